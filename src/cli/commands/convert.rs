//! `volraster convert`: writes the arrays of a data file in another format.

use std::path::PathBuf;

use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{Data, DataFile, GaussiansOutput, Loaded, OutputFormat, ReadOptions, Report};
use volraster::{Result, io};

use crate::cli::input::AxesArgs;
use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `convert`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A data file, a folder of slices, or a scene file (.json), whose data is converted as it is rendered.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// Output file. With all arrays: .vti (grids), .vtr (grids with uneven coordinates), .vtu (meshes, points). With one
    /// array of a grid: .nrrd, .nii, .nii.gz. Gaussian splats: .ply, .compressed.ply, .spz.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Write only this array, or a part of it: a component (0, 1, ..., or a letter of xyzw or rgba) or `magnitude`.
    #[arg(long, value_name = "[point:|cell:]NAME[:PART]")]
    only: Option<String>,
    /// Time step to convert of a series, from 0 [default: 0].
    #[arg(long, value_name = "N")]
    step: Option<u32>,
    #[command(flatten)]
    axes: AxesArgs,
    /// Version of an .spz file: 3 (gzip) or 4 (zstd).
    #[arg(long, value_name = "3|4", default_value_t = 4, value_parser = clap::value_parser!(u32).range(3..=4))]
    spz_version: u32,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        let format = OutputFormat::of(&self.output)?;
        io::check_writable(&self.output)?;
        output::check_apart("output", &self.output, &[(&self.input, "the input")])?;
        if format.holds_gaussians() {
            return self.gaussians(quiet);
        }
        let Loaded { data, report } = self.load(format)?;
        let summary = format!("{}: {}", report.format, data.summary());
        let notes = io::write_arrays(&self.output, data)?;
        self.report(quiet, &summary, &report, &notes)
    }

    /// Converts Gaussian splats.
    fn gaussians(&self, quiet: bool) -> Outcome {
        let options = self.options();
        let LoadedScene { scene, file, report, .. } = LoadedScene::load_any(&self.input, &options)?;
        output::check_apart("output", &self.output, &[(&file, "the input")])?;
        let Data::Gaussians(splats) = &scene.data else {
            let rule = format!("must hold gaussians for such an output, holds a {}", scene.data.kind());
            return Err(output::refuse(&self.input, "content", &rule).into());
        };
        let texts = report.gaussians.as_ref().map_or_else(Vec::new, |about| about.texts.clone());
        let output = GaussiansOutput { spz_version: self.spz_version, texts };
        let notes = io::write_gaussians(&self.output, splats, &output)?;
        let axes = splats.axes().name();
        let summary =
            format!("{}: {} splats of degree {}, {axes}", report.format, splats.len(), splats.degree());
        self.report(quiet, &summary, &report, &notes)
    }

    /// Prints warnings, and one line about the file that was written.
    fn report(&self, quiet: bool, summary: &str, report: &Report, notes: &[String]) -> Outcome {
        if quiet {
            return Ok(());
        }
        output::warn(&self.input, &report.warnings);
        let notes: String = notes.iter().map(|note| format!("; {note}")).collect();
        let bytes = std::fs::metadata(&self.output).map_or(0, |metadata| metadata.len());
        let line = format!("{summary}{notes}: {}, {bytes} bytes", self.output.display());
        Ok(output::print(&output::plain(&line))?)
    }

    fn options(&self) -> ReadOptions {
        let options = ReadOptions { array: self.only.clone(), step: self.step, ..ReadOptions::default() };
        output::with_progress(&self.input, self.axes.over(options))
    }

    fn load(&self, format: OutputFormat) -> Result<Loaded<DataFile>> {
        let options = self.options();
        if SceneFile::is_at(&self.input, &options) {
            let LoadedScene { scene, file, report, .. } = LoadedScene::load_any(&self.input, &options)?;
            output::check_apart("output", &self.output, &[(&file, "the input")])?;
            return Ok(rendered(&scene.data, report));
        }
        let loaded = io::read_arrays(&self.input, &options, format.holds_one_array())?;
        if !loaded.data.is_uneven() || matches!(format, OutputFormat::Vtr | OutputFormat::Vtu) {
            return Ok(loaded);
        }
        if loaded.data.arrays().len() != 1 {
            let rule = "must end in .vtr, for all arrays on uneven coordinates; or choose one by --only NAME, which is resampled";
            return Err(output::refuse(&self.output, "file name", rule));
        }
        let Loaded { data, report } = io::read(&self.input, &options)?;
        let mut resampled = rendered(&data, report);
        resampled.report.warnings.extend(resampled.report.notes.iter().cloned());
        Ok(resampled)
    }
}

/// Returns data as it is rendered.
fn rendered(data: &io::Data, report: Report) -> Loaded<DataFile> {
    Loaded { data: DataFile::of(data, report.shown_name()), report }
}
