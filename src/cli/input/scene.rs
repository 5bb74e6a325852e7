//! The scene to draw, its settings, and the technique that draws it.

use std::path::{Path, PathBuf};
use std::time::Instant;

use volraster::io::scene_file::{LoadedScene, TechniqueChoice};
use volraster::io::{ReadOptions, Report};
use volraster::scene::{Mode, Scene, Surface, View};
use volraster::technique::Method;
use volraster::{Error, Result, Technique};

use super::args::{ArraysArgs, Size};
use super::technique::Request;
use crate::cli::output;
use crate::cli::timing::milliseconds_since;

/// A scene with its settings. They are separate because the scene moves to the device.
#[derive(Debug)]
pub(crate) struct Input {
    /// Data, transfer function, kernels and surfaces.
    pub(crate) scene: Scene,
    /// All other settings.
    pub(crate) settings: Settings,
}

/// The settings of a scene file, or their defaults for a data file.
#[derive(Debug)]
pub(crate) struct Settings {
    /// The scene file or data file.
    path: PathBuf,
    /// The file of the data itself.
    pub(crate) data: PathBuf,
    /// Notes and warnings of the reader.
    pub(crate) report: Report,
    /// Camera and image size.
    pub(crate) view: View,
    /// Whether the camera was chosen automatically.
    pub(crate) camera_is_automatic: bool,
    /// Whether the transfer function was chosen automatically.
    pub(crate) transfer_is_automatic: bool,
    /// Background colour of PNG output.
    pub(crate) background: [f64; 4],
    /// The technique that the scene file names.
    pub(crate) choice: Option<TechniqueChoice>,
    /// Time for reading, in milliseconds.
    pub(crate) load_ms: f64,
}

impl Input {
    /// Reads a scene file or a data file with a progress bar, and prints its warnings. `size` replaces the image
    /// size; an automatic camera adapts to it.
    pub(crate) fn load(path: &Path, size: Option<Size>, arrays: &ArraysArgs, quiet: bool) -> Result<Self> {
        let input = Self::load_step(path, size, arrays, quiet)?;
        let count = input.settings.report.steps.len();
        if !quiet && count > 1 && arrays.options().step.is_none() {
            let text = format!("shows the first of {count} time steps; --step N shows another");
            output::complain(&format!("{}: {text}", path.display()));
        }
        Ok(input)
    }

    /// Reads like [`Input::load`], for a command that draws all steps of a series.
    pub(crate) fn load_step(
        path: &Path,
        size: Option<Size>,
        arrays: &ArraysArgs,
        quiet: bool,
    ) -> Result<Self> {
        let input = Self::load_within(path, size, &output::with_progress(path, arrays.options()))?;
        if !quiet {
            output::warn(&input.settings.data, &input.settings.report.warnings);
        }
        Ok(input)
    }

    /// Reads like [`Input::load`], but prints nothing.
    pub(crate) fn load_within(path: &Path, size: Option<Size>, options: &ReadOptions) -> Result<Self> {
        let start = Instant::now();
        let loaded = LoadedScene::load_any(path, options)?;
        let Size { width, height } = size.unwrap_or(Size { width: loaded.width, height: loaded.height });
        let view = loaded.view(width, height).map_err(|error| error.in_file(path))?;
        let LoadedScene { scene, camera_is_automatic, transfer_is_automatic, .. } = loaded;
        let LoadedScene { background, technique, file, report, .. } = loaded;
        let settings = Settings {
            path: path.to_path_buf(),
            data: file,
            report,
            view,
            camera_is_automatic,
            transfer_is_automatic,
            background,
            choice: technique,
            load_ms: milliseconds_since(start),
        };
        Ok(Self { scene, settings })
    }
}

impl Settings {
    /// Returns the technique that the scene file names, if any. An error names the scene file.
    pub(crate) fn technique(&self) -> Result<Option<Technique>> {
        let Some(choice) = &self.choice else { return Ok(None) };
        let technique = Method::from_name(&choice.name).and_then(|m| Technique::new(m, &choice.options));
        technique.map(Some).map_err(|error| error.in_file(&self.path))
    }

    /// Chooses the technique: the requested one, else that of the scene file, else the default for the scene. The
    /// technique of the scene file, requested without options, keeps the options of the file.
    /// A technique that cannot draw the scene is an error.
    pub(crate) fn choose(&self, request: Option<Request>, scene: &Scene) -> Result<Technique> {
        let own = || self.technique().transpose();
        let technique = match request {
            None => own().unwrap_or_else(|| default_technique(scene))?,
            Some(Request { technique, bare }) => {
                let name = technique.method().name();
                let same = bare && self.choice.as_ref().is_some_and(|choice| choice.name == name);
                own().filter(|_| same).unwrap_or(Ok(technique))?
            }
        };
        let method = technique.method();
        if method.draws_scene(scene) {
            return Ok(technique);
        }
        drawn(scene)?;
        let others: Vec<&str> =
            Method::ALL.into_iter().filter(|m| m.draws_scene(scene)).map(Method::name).collect();
        let why =
            format!("\"{}\": draws no {}; {} would", method.name(), described(scene), others.join(", "));
        Err(Error::Invalid { what: "technique".to_string(), why })
    }
}

/// Describes what decides which techniques draw a scene: kind of data, kernels, mode, translucent surfaces.
fn described(scene: &Scene) -> String {
    let kind = scene.data.kind();
    let translucent = scene.surfaces.iter().any(Surface::is_translucent);
    let surfaces = if translucent { " with translucent surfaces" } else { "" };
    let of = scene.kernels.map_or_else(String::new, |of| format!(" of {} kernels", of.kernel.name()));
    let mode =
        if scene.mode == Mode::Emission { String::new() } else { format!(" of mode {}", scene.mode.name()) };
    format!("{kind}{of}{mode}{surfaces}")
}

/// Returns the default technique for a scene. An error says that no technique draws it.
fn default_technique(scene: &Scene) -> Result<Technique> {
    let Some(method) = Method::default_for(scene) else {
        let why = format!("no technique draws data of this kind: {}; `reference` does", described(scene));
        return Err(Error::Invalid { what: "technique".to_string(), why });
    };
    Technique::new(method, &[])
}

/// Checks that some technique draws a scene.
pub(crate) fn drawn(scene: &Scene) -> Result<()> {
    default_technique(scene).map(drop)
}

#[cfg(test)]
mod tests {
    use super::super::technique::options_text;
    use super::*;

    #[test]
    fn techniques_that_cannot_draw_the_scene_are_refused() {
        let read = |name: &str, json: &str| {
            let path =
                std::env::temp_dir().join(format!("volraster-input-{}-{name}.json", std::process::id()));
            std::fs::write(&path, json).unwrap();
            let input = Input::load_within(&path, None, &ReadOptions::default());
            std::fs::remove_file(&path).unwrap();
            input.unwrap()
        };
        let grid = read(
            "grid",
            r#"{"volume": {"field": "ramp", "dims": [2,2,2]}, "technique": {"name": "slabs", "step": 2}}"#,
        );
        let mesh = read("mesh", r#"{"mesh": {"field": "ramp", "cubes": 1}}"#);
        let choose = |input: &Input, text: Option<&str>| {
            input.settings.choose(text.map(|text| Request::parse(text).unwrap()), &input.scene)
        };
        let text = |technique: Technique| (technique.method().name(), options_text(&technique));
        assert_eq!(text(choose(&grid, None).unwrap()), ("slabs", "step=2".into()));
        assert_eq!(text(choose(&grid, Some("slabs")).unwrap()), ("slabs", "step=2".into()));
        assert_eq!(
            text(choose(&grid, Some("slabs:filter=exact")).unwrap()),
            ("slabs", "filter=exact".into())
        );
        assert_eq!(text(choose(&grid, Some("raycast")).unwrap()), ("raycast", String::new()));
        assert_eq!(default_technique(&grid.scene).unwrap(), Technique::default());
        let why = choose(&mesh, Some("slabs")).unwrap_err().to_string();
        assert!(why.contains("mesh"), "{why}");
        assert!(choose(&mesh, None).unwrap().method().draws(&mesh.scene.data));
        let points = read("points", r#"{"points": {"field": "ramp", "count": 10}}"#);
        assert_eq!(choose(&points, None).unwrap().method().name(), "splat-ewa");
        // Techniques without kernels are neither chosen for kernels nor accepted.
        let kernels = |data: &str, kernel: &str| {
            read(kernel, &format!(r#"{{{data}, "kernels": {{"kernel": "{kernel}"}}}}"#))
        };
        let (of_mesh, of_grid) =
            (r#""mesh": {"field": "ramp", "cubes": 1}"#, r#""volume": {"field": "ramp", "dims": [2,2,2]}"#);
        let gaussian = kernels(of_mesh, "gaussian");
        assert_eq!(choose(&gaussian, None).unwrap().method().name(), "splat-ewa");
        let bspline = kernels(of_grid, "bspline");
        assert_eq!(choose(&bspline, None).unwrap().method().name(), "splat-sheets");
        for name in ["slices-3d", "raycast", "splat-ewa"] {
            let why = choose(&bspline, Some(name)).unwrap_err().to_string();
            assert!(why.contains("no grid of bspline kernels; splat-sheets would"), "{why}");
        }
        let why = choose(&kernels(of_mesh, "bspline"), None).unwrap_err().to_string();
        assert!(why.contains("no technique draws data of this kind: mesh of bspline kernels"), "{why}");
    }
}
