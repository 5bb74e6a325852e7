//! `volraster convert`: writes data of any supported format as NRRD or VTU.

use std::path::PathBuf;

use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{Data, Report, write_nrrd, write_vtu};
use volraster::{Result, io};

use crate::cli::input::ArraysArgs;
use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `convert`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A data file, a folder of slices, or a scene file (.json), whose data is converted.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// Output file: .nrrd for a grid, .vtu for a mesh or points.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        let refuse = |rule: &str| output::refuse(&self.output, "file name", rule);
        let ending = self.output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if !["nrrd", "vtu"].contains(&ending.as_str()) {
            return Err(refuse("must end in .nrrd (grids) or .vtu (meshes and points)").into());
        }
        volraster::io::check_writable(&self.output)?;
        output::check_apart("output", &self.output, &[(&self.input, "the input")])?;
        let (data, report) = self.load()?;
        let written = match (&data, ending.as_str()) {
            (Data::Grid(grid), "nrrd") => write_nrrd(&self.output, grid)?,
            (Data::Mesh(_) | Data::Points(_), "vtu") => {
                write_vtu(&self.output, &data, name_of(&report))?;
                None
            }
            (data, _) => {
                let (what, ending) = match data {
                    Data::Grid(_) => ("a grid", "nrrd"),
                    Data::Mesh(_) => ("a mesh", "vtu"),
                    _ => ("points", "vtu"),
                };
                let input = self.input.display();
                let rule = format!("must end in .{ending}: {input} holds {what}");
                return Err(refuse(&rule).into());
            }
        };
        if quiet {
            return Ok(());
        }
        output::warn(&self.input, &report.warnings);
        let written = written.map_or_else(String::new, |note| format!(", {note}"));
        let bytes = std::fs::metadata(&self.output).map_or(0, |metadata| metadata.len());
        let (format, summary, output) = (report.format, summary(&data, &report), self.output.display());
        let line = format!("{format}: {summary}{written}: {output}, {bytes} bytes");
        Ok(output::print(&output::plain(&line))?)
    }

    fn load(&self) -> Result<(Data, Report)> {
        let options = output::with_progress(&self.input, self.arrays.options());
        if SceneFile::is_at(&self.input, &options) {
            let LoadedScene { scene, file, report, .. } = LoadedScene::load_any(&self.input, &options)?;
            output::check_apart("output", &self.output, &[(&file, "the input")])?;
            return Ok((scene.data, report));
        }
        let loaded = io::read(&self.input, &options)?;
        Ok((loaded.data, loaded.report))
    }
}

/// Returns a name for the scalars: that of the shown array, without the prefix `point:` or `cell:`.
fn name_of(report: &Report) -> &str {
    let shown = report.shown.as_deref().unwrap_or_default();
    shown.strip_prefix("point:").or_else(|| shown.strip_prefix("cell:")).unwrap_or(shown)
}

fn summary(data: &Data, report: &Report) -> String {
    let shown = report.shown.as_ref().map_or_else(String::new, |name| format!(", {name}"));
    match data {
        Data::Grid(grid) => {
            let [nx, ny, nz] = grid.dims();
            format!("grid of {nx} x {ny} x {nz} {}{shown}", grid.samples().type_name())
        }
        Data::Mesh(mesh) => {
            format!("mesh of {} points and {} tetrahedra{shown}", mesh.points().len(), mesh.cells().len())
        }
        Data::Points(points) => format!("{} points{shown}", points.centres().len()),
        other => other.kind().to_string(),
    }
}
