//! `volraster convert`: writes the arrays of a data file in another format.

use std::path::PathBuf;

use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{DataFile, Loaded, OutputFormat, ReadOptions, Report};
use volraster::{Result, io};

use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `convert`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A data file, a folder of slices, or a scene file (.json), whose data is converted as it is rendered.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// Output file. With all arrays: .vti (grids), .vtr (grids with uneven coordinates), .vtu (meshes, points). With one
    /// array of a grid: .nrrd, .nii, .nii.gz.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Write only this array, or a part of it: a component (0, 1, ..., or a letter of xyzw or rgba) or `magnitude`.
    #[arg(long, value_name = "[point:|cell:]NAME[:PART]")]
    only: Option<String>,
    /// Time step to convert of a series, from 0 [default: 0].
    #[arg(long, value_name = "N")]
    step: Option<u32>,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        let format = OutputFormat::of(&self.output)?;
        io::check_writable(&self.output)?;
        output::check_apart("output", &self.output, &[(&self.input, "the input")])?;
        let Loaded { data, report } = self.load(format)?;
        let summary = format!("{}: {}", report.format, data.summary());
        let notes = io::write_arrays(&self.output, data)?;
        if quiet {
            return Ok(());
        }
        output::warn(&self.input, &report.warnings);
        let notes: String = notes.iter().map(|note| format!("; {note}")).collect();
        let bytes = std::fs::metadata(&self.output).map_or(0, |metadata| metadata.len());
        let line = format!("{summary}{notes}: {}, {bytes} bytes", self.output.display());
        Ok(output::print(&output::plain(&line))?)
    }

    fn load(&self, format: OutputFormat) -> Result<Loaded<DataFile>> {
        let options = ReadOptions { array: self.only.clone(), step: self.step, ..ReadOptions::default() };
        let options = output::with_progress(&self.input, options);
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
