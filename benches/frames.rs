//! `cargo bench`: runs the program's `bench smoke`, so that there is only one way to measure.
//!
//! Results go to `bench` in cargo's target folder. `cargo test --benches` and `--list` run nothing.

use std::path::Path;
use std::process::{Command, ExitCode};

fn main() -> ExitCode {
    // `cargo bench` passes --bench; a test run omits it or passes --test.
    let given = |name: &str| std::env::args().any(|argument| argument == name);
    if !given("--bench") || given("--test") || given("--list") {
        return ExitCode::SUCCESS;
    }
    // The folder for the files of integration tests is inside the target folder, wherever that is.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("bench");
    let status = Command::new(env!("CARGO_BIN_EXE_volraster"))
        .arg("bench")
        .arg("smoke")
        .arg("-o")
        .arg(&folder)
        .status();
    match status {
        Ok(status) if status.success() => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("bench: cannot run the program: {error}");
            ExitCode::FAILURE
        }
    }
}
