//! `volraster selftest`: checks every technique, route and resource path under every kind of validation.
//!
//! `cases` lists the checks of `pictures`, `resources`, `targets` and `limits`, which run on a `workbench`, `sweeps` those of a `session`,
//! which run in processes of their own. `controls` provoke a fault for each kind of validation; `allow` knows the messages that are no fault,
//! `googletest` the protocol of runners of tests. `catalogue` lists all cases; a `listener` is told of them as they run.

mod allow;
mod cases;
mod catalogue;
mod command;
mod controls;
mod googletest;
mod limits;
mod listener;
mod pictures;
mod resources;
mod session;
mod subject;
mod sweeps;
mod targets;
mod workbench;

pub(crate) use command::Args;
