//! `volraster selftest`: checks every technique, route and resource path under every kind of validation.
//!
//! `cases` lists the checks of `pictures`, `resources`, `targets`, `limits` and `session`, which run on a `workbench`.
//! `controls` provoke a fault for each kind of validation; `allow` knows the messages that are no fault.

mod allow;
mod cases;
mod command;
mod controls;
mod limits;
mod pictures;
mod resources;
mod session;
mod subject;
mod targets;
mod workbench;

pub(crate) use command::Args;
