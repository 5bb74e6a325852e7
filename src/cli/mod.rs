//! Arguments, dispatch, and how a run ends.
//!
//! | file | what |
//! |---|---|
//! | `render`, `reference`, `compare`, `bench`, `calibrate`, `devices`, `techniques`, `info`, `convert` | one command each |
//! | `suite`, `case`, `required_k` | of `bench`: scenes and sweeps, one case, pairs that a k-buffer needs |
//! | `record`, `results`, `tables`, `fronts`, `charts` | of `bench`: a line of its results, its folder, table.md, time at equal error, what plots show |
//! | `selftest` | everything on this device, under validation |
//! | `ratios` | `bench --compare` |
//! | `plot`, `picture` | charts; their lines and letters as SVG |
//! | `report` | of `compare`: report.html |
//! | `cache`, `interrupt` | reference images that were drawn before; Ctrl-C |
//! | `draws` | of `calibrate`: random scenes on which choices are checked |
//! | `input` | what several commands take: scene, size, technique, device |
//! | `output` | stdout, files written beside and renamed, progress |
//! | `table`, `timing`, `histogram` | aligned text, quantiles of frame times, how often values occur |
//! | `random` | random numbers that are the same in every run |

mod bench;
mod cache;
mod calibrate;
mod case;
mod charts;
mod compare;
mod convert;
mod devices;
mod draws;
mod fronts;
mod histogram;
mod info;
mod input;
mod interrupt;
mod output;
mod picture;
mod plot;
mod random;
mod ratios;
mod record;
mod reference;
mod render;
mod report;
mod required_k;
mod results;
mod selftest;
mod suite;
mod table;
mod tables;
mod techniques;
mod timing;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};
use volraster::Error;

/// Direct volume rendering in object order on explicit Vulkan.
#[derive(Debug, Parser)]
#[command(name = "volraster", version, arg_required_else_help = true)]
struct Cli {
    /// Print no summary and no warnings. Errors, and what `devices`, `techniques` and `info` are asked for,
    /// are printed still.
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

/// What the program can do.
#[derive(Debug, Subcommand)]
enum Command {
    /// Draw a scene file, or a data file with a camera and a transfer function chosen for it.
    Render(render::Args),
    /// Draw the float64 reference on the CPU.
    Reference(reference::Args),
    /// Draw with several techniques and measure each one's error.
    Compare(compare::Args),
    /// Measure time and error of every technique on standard scenes.
    Bench(bench::Args),
    /// Measure what techniques cost on this device, for `render --max-error` and `--budget`.
    Calibrate(calibrate::Args),
    /// List the Vulkan devices and what the chosen one offers.
    Devices(devices::Args),
    /// List the techniques with their options.
    Techniques(techniques::Args),
    /// Describe a data file, a folder of slices or a scene file.
    Info(info::Args),
    /// Check every technique, route and resource path on this device, under every kind of validation.
    Selftest(selftest::Args),
    /// Write a data file as NRRD (grids) or VTU (meshes and points).
    Convert(convert::Args),
}

/// Why a run does not end with exit code 0.
#[derive(Debug)]
enum Failure {
    /// Something could not be done.
    Error(Error),
    /// Everything was done, and what came out is wrong.
    Finding(String),
    /// The user has stopped it.
    Interrupted(String),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl Failure {
    /// The line for stderr.
    fn line(&self) -> String {
        match self {
            Self::Error(error) => error.to_string(),
            Self::Finding(text) | Self::Interrupted(text) => text.clone(),
        }
    }

    /// 0 done, 2 wrong input or usage, 3 the device cannot do it, 130 stopped, 1 anything else.
    fn exit_code(&self) -> u8 {
        match self {
            Self::Error(error) => error.exit_code(),
            Self::Finding(_) => 1,
            Self::Interrupted(_) => interrupt::EXIT_CODE,
        }
    }
}

/// How a command ends.
type Outcome = Result<(), Failure>;

/// The exit code of wrong usage.
const USAGE: u8 = 2;

/// Runs the program.
pub(crate) fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    let quiet = cli.quiet;
    let outcome = match &cli.command {
        Command::Render(args) => args.run(quiet),
        Command::Reference(args) => args.run(quiet),
        Command::Compare(args) => args.run(quiet),
        Command::Bench(args) => args.run(quiet),
        Command::Calibrate(args) => args.run(quiet),
        Command::Devices(args) => args.run(),
        Command::Techniques(args) => args.run(),
        Command::Info(args) => args.run(),
        Command::Selftest(args) => args.run(quiet),
        Command::Convert(args) => args.run(quiet),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::complain(&failure.line());
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Help and version as clap prints them, wrong usage as one line.
fn usage(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            // A reader that has gone away needs no help.
            let _ = error.print();
            ExitCode::SUCCESS
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            ExitCode::from(USAGE)
        }
        _ => {
            output::complain(&one_line(&error.to_string()));
            ExitCode::from(USAGE)
        }
    }
}

/// The message of clap's report, without the usage and the hint that follow it.
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
