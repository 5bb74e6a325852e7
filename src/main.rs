//! The command-line program `volraster`. Everything it draws with is in the library.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
