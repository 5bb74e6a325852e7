//! `volraster bench`: measures time and error of every technique, all on one device in one run.
//!
//! `scenes` and `sweeps` list what is measured; `session`, `workload`, `turns`, `case` and `required_k` measure it, and `sizes` sees to
//! it that a suite ends in time.
//! `bounds` says how much of the device's peaks they reach. Each case becomes a `record`, a line of bench.jsonl. `results`,
//! `tables`, `fronts`, `charts` and `ratios` are made from records alone.

mod bounds;
mod case;
mod charts;
mod command;
mod fronts;
mod ratios;
mod record;
mod required_k;
mod results;
mod scenes;
mod series;
mod session;
mod sizes;
mod sweeps;
mod tables;
mod turns;
mod workload;

pub(crate) use command::Args;
