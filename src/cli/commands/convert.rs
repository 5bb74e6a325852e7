//! `volraster convert`: writes data of any supported format as NRRD or VTU.

use std::path::{Path, PathBuf};

use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{Data, Report, write_nrrd, write_vtu};
use volraster::{Error, Result, io};

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

/// An output format, chosen by the ending of the file name.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Nrrd,
    Vtu,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An error in the arguments, the input or the output.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        let format = self.format()?;
        output::check_file(&self.output)?;
        self.check_place(&self.input)?;
        let (data, report) = self.load()?;
        let written = match (&data, format) {
            (Data::Grid(grid), Format::Nrrd) => write_nrrd(&self.output, grid)?,
            (Data::Mesh(_) | Data::Points(_), Format::Vtu) => {
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
                return Err(refuse(&self.output, &rule).into());
            }
        };
        if quiet {
            return Ok(());
        }
        output::warn(&self.input, &report.warnings);
        let written = written.map_or_else(String::new, |note| format!(", {note}"));
        let bytes = std::fs::metadata(&self.output).map_or(0, |metadata| metadata.len());
        let line = format!(
            "{}: {}{written}: {}, {bytes} bytes",
            report.format,
            summary(&data, &report),
            self.output.display()
        );
        output::print(&output::plain(&line))?;
        Ok(())
    }

    fn format(&self) -> Result<Format> {
        match self.output.extension().map(|ending| ending.to_string_lossy().to_lowercase()).as_deref() {
            Some("nrrd") => Ok(Format::Nrrd),
            Some("vtu") => Ok(Format::Vtu),
            _ => Err(refuse(&self.output, "must end in .nrrd (grids) or .vtu (meshes and points)")),
        }
    }

    /// Refuses to overwrite the input.
    fn check_place(&self, input: &Path) -> Result<()> {
        if output::same_place(&self.output, input) {
            let why = format!("{}: is also the input", self.output.display());
            return Err(Error::Invalid { what: "output".to_string(), why });
        }
        Ok(())
    }

    fn load(&self) -> Result<(Data, Report)> {
        let reading = output::Reading::new(&self.input);
        let options = reading.with_progress(self.arrays.options());
        if SceneFile::is_at(&self.input, &options) {
            let LoadedScene { scene, file, report, .. } = LoadedScene::load_any(&self.input, &options)?;
            self.check_place(&file)?;
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

fn refuse(path: &Path, rule: &str) -> Error {
    Error::File { path: path.to_path_buf(), place: "file name".to_string(), rule: rule.to_string() }
}
