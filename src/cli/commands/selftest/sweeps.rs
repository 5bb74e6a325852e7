//! The cases that sweep failures over sessions. Each runs in a process of its own: a validation layer keeps memory about every device
//! and command pool of its process, and a crash costs one case.

use std::process::Command;

use volraster::gpu::Validation;
use volraster::{Error, Result};

use super::cases::Case;
use super::session::{self, Place, Session};
use super::workbench::{Stop, Verdict, Workbench, fail};
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;

type Sweep = fn(&Place, &Session, usize) -> std::result::Result<session::Swept, String>;

/// Sweeps of failures, with the number of calls of each function that fail.
const SWEEPS: [(&str, Sweep, usize); 4] = [
    ("frames", session::fail_frames, 8),
    ("failures", session::fail_each, 2),
    ("opening", session::fail_opening, 1),
    ("lost", session::lose, 2),
];

/// Returns the cases in the order in which they run.
pub(super) fn all() -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for (kind, ..) in SWEEPS {
        // Opening a device does not depend on the session.
        let serves = |session: &Session| kind != "opening" || session.name == "grid-raster";
        for session in session::sessions()?.into_iter().filter(serves) {
            let name = format!("{kind}/{}", session.name);
            let run = Box::new({
                let name = name.clone();
                move |workbench: &Workbench| start(workbench, &name)
            });
            cases.push(Case { name, method: Some(session.technique.method()), run });
        }
    }
    Ok(cases)
}

/// Runs a case in a process of the same arguments.
fn start(workbench: &Workbench, name: &str) -> Verdict {
    let failed = |error: std::io::Error| Stop::Fail(format!("no process: {error}"));
    let mut process = Command::new(std::env::current_exe().map_err(failed)?);
    process.args(std::env::args_os().skip(1)).args(["--sweep", name]);
    let quietly = "--without-validation";
    if workbench.plain() == Validation::Off && std::env::args_os().all(|argument| argument != quietly) {
        process.arg(quietly);
    }
    let output = process.output().map_err(failed)?;
    let line = |text: &[u8]| String::from_utf8_lossy(text).lines().last().unwrap_or_default().to_string();
    match output.status.code() {
        Some(0) => Ok(line(&output.stdout)),
        Some(_) => fail(line(&output.stderr).trim_start_matches("volraster: ")),
        None => fail(output.status.to_string()),
    }
}

/// Runs a case in this process and prints its summary. With `every_call`, each Vulkan call of the session fails in turn, instead of a few
/// calls of each function.
pub(super) fn run(name: &str, place: &Place, every_call: bool) -> Outcome {
    let found = name.split_once('/').and_then(|(kind, session)| {
        let sweep = SWEEPS.into_iter().find(|sweep| sweep.0 == kind)?;
        Some((sweep, session))
    });
    let sessions = session::sessions()?;
    let named = |(sweep, name)| Some((sweep, sessions.iter().find(|session| session.name == name)?));
    let Some(((_, sweep, some), session)) = found.and_then(named) else {
        return Err(Error::Invalid { what: "sweep".to_string(), why: format!("there is no {name}") }.into());
    };
    let swept =
        sweep(place, session, if every_call { usize::MAX } else { some }).map_err(Failure::Finding)?;
    let failed: u32 = swept.failed.values().sum();
    output::print(&format!("{failed} of {} calls, {} kinds", swept.calls, swept.failed.len()))?;
    Ok(())
}
