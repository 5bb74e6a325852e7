//! `volraster schema`: prints the JSON Schema of scene files.

use volraster::technique::scene_schema;

use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Runs the command, which has no arguments.
pub(crate) fn run() -> Outcome {
    output::print(&scene_schema())?;
    Ok(())
}
