//! The list of all cases.

use volraster::Result;

use super::cases::{self, Case};
use super::{controls, sweeps};

/// The name of the case that destroys the shared device.
pub(super) const END: &str = "device/end";

/// Returns every case but the checks of validation itself and the end of the device.
pub(super) fn all() -> Result<Vec<Case>> {
    Ok(cases::all()?.into_iter().chain(sweeps::all()?).collect())
}

/// Returns the names of all cases in the order in which they run.
pub(super) fn names() -> Result<Vec<String>> {
    let cases = all()?.into_iter().map(|case| case.name);
    Ok(controls::names().chain(cases).chain([END.to_string()]).collect())
}
