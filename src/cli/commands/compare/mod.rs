//! `volraster compare`: draws a scene with several techniques and reports their errors and times.
//!
//! `command` runs it, `entry` draws one technique, `page` writes report.html with the sections `error_table` and `pass_bars`.

mod command;
mod entry;
mod error_table;
mod page;
mod pass_bars;
mod row;

pub(crate) use command::Args;
