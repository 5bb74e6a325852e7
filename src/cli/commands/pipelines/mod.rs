//! `volraster pipelines`: `variants` prepares frames of every technique, `command` prints the pipelines that they use.

mod command;
mod variants;

pub(crate) use command::Args;
