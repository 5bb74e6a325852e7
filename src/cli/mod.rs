//! The command-line program: arguments, commands, and everything that only the program needs.
//!
//! The program uses the library through its public interface alone; nothing uses the program. Imports point downwards:
//! `dispatch`, then `commands` (a file or folder each, independent of one another), then `annotate`, `plot` and `input`, then the files
//! below, which know no command.

mod annotate;
mod cache;
mod commands;
mod dispatch;
mod histogram;
mod in_flight;
mod input;
mod interrupt;
mod load;
mod markup;
mod memory;
mod nothing;
mod numbers;
mod outcome;
mod output;
mod plot;
mod random;
mod report;
mod sensors;
mod table;
mod timing;

pub(crate) use dispatch::main;
