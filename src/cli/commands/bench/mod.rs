//! `volraster bench`: measures time and error of every technique, all on one device in one run.
//!
//! `scenes` and `sweeps` list what is measured; `command`, `workload`, `case` and `required_k` measure it.
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
mod sweeps;
mod tables;
mod workload;

pub(crate) use command::Args;
