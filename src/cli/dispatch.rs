//! The program's arguments, dispatch to a command, and the exit code.

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

#[cfg(feature = "window")]
use crate::cli::commands::view;
use crate::cli::commands::{
    bench, calibrate, compare, convert, devices, info, pipelines, provoke, reference, render, schema,
    selftest, techniques,
};
use crate::cli::{interrupt, output};

/// Direct volume rendering on Vulkan, checked against a float64 reference.
#[derive(Debug, Parser)]
#[command(name = "volraster", version, arg_required_else_help = true)]
struct Cli {
    /// Print no summary and no warnings. Errors, and the output of `devices`, `techniques`, `schema` and `info`, are
    /// still printed.
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
enum Command {
    /// Draw a scene file or a data file. For a data file, camera and transfer function are chosen automatically.
    Render(render::Args),
    /// Open a window to turn the data in and to edit its transfer function.
    #[cfg(feature = "window")]
    View(view::Args),
    /// Draw the float64 reference image on the CPU.
    Reference(reference::Args),
    /// Draw a scene with several techniques and measure the error of each.
    Compare(compare::Args),
    /// Measure time and error of every technique on standard scenes.
    Bench(bench::Args),
    /// Measure the cost of techniques on this device, for `render --max-error` and `render --budget`.
    Calibrate(calibrate::Args),
    /// List the Vulkan devices and the features of the selected one.
    Devices(devices::Args),
    /// List the techniques with their options.
    Techniques(techniques::Args),
    /// Describe a data file, a folder of slices or a scene file.
    Info(info::Args),
    /// Print the JSON Schema of scene files, for editors.
    Schema,
    /// Check every technique, route and resource path on this device under full validation.
    Selftest(selftest::Args),
    /// Commit faults that volume renderers make, and tell which the validation layer hears.
    Provoke(provoke::Args),
    /// Build the pipelines of every technique without drawing; print their constants, build times and the driver's statistics.
    Pipelines(pipelines::Args),
    /// Write a data file as NRRD (grids) or VTU (meshes and points).
    Convert(convert::Args),
}

/// Exit code of wrong usage.
const USAGE: u8 = 2;

/// Parses the arguments, runs the command and reports its failure.
pub(crate) fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    interrupt::outlive_size_limits();
    let quiet = cli.quiet;
    let outcome = match &cli.command {
        Command::Render(args) => args.run(quiet),
        #[cfg(feature = "window")]
        Command::View(args) => args.run(quiet),
        Command::Reference(args) => args.run(quiet),
        Command::Compare(args) => args.run(quiet),
        Command::Bench(args) => args.run(quiet),
        Command::Calibrate(args) => args.run(quiet),
        Command::Devices(args) => args.run(),
        Command::Techniques(args) => args.run(),
        Command::Info(args) => args.run(),
        Command::Schema => schema::run(),
        Command::Selftest(args) => args.run(quiet),
        Command::Provoke(args) => args.run(quiet),
        Command::Pipelines(args) => args.run(),
        Command::Convert(args) => args.run(quiet),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::complain(&failure.to_string());
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Prints help and version as clap formats them, and a usage error as one line.
fn usage(error: &clap::Error) -> ExitCode {
    use ErrorKind::{DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion};
    if matches!(error.kind(), DisplayHelp | DisplayVersion | DisplayHelpOnMissingArgumentOrSubcommand) {
        // A closed pipe is no error here.
        let _ = error.print();
    } else {
        output::complain(&one_line(&error.to_string()));
    }
    if error.use_stderr() { ExitCode::from(USAGE) } else { ExitCode::SUCCESS }
}

/// Extracts the message of clap's report, without the usage and the hint that follow it.
fn one_line(report: &str) -> String {
    let ends = |line: &&str| line.starts_with("Usage:") || line.starts_with("For more information");
    let lines: Vec<&str> = report.lines().take_while(|line| !ends(line)).map(str::trim).collect();
    let text = lines.into_iter().filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
    text.strip_prefix("error: ").unwrap_or(&text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn usage_errors_are_one_line() {
        let line = |args: &[&str]| one_line(&Cli::try_parse_from(args).unwrap_err().to_string());
        let missing = line(&["volraster", "render", "scene.json"]);
        assert_eq!(missing, "the following required arguments were not provided: --output <FILE>");
        let unknown = line(&["volraster", "info", "x", "--jason"]);
        assert!(unknown.starts_with("unexpected argument '--jason' found"), "{unknown}");
        assert!(!unknown.contains("Usage") && !unknown.contains('\n'), "{unknown}");
    }
}
