//! A scene.

use std::path::{Path, PathBuf};
use std::time::Instant;

use volraster::io::scene_file::{LoadedScene, TechniqueChoice};
use volraster::io::{ReadOptions, Report};
use volraster::scene::{Scene, Surface, View};
use volraster::technique::Method;
use volraster::{Error, Result, Technique};

use super::args::{ArraysArgs, Size};
use super::technique::Request;
use crate::cli::output;
use crate::cli::timing::milliseconds_since;

/// A scene, and how to draw it. Two parts, since the scene goes to the device and is large.
#[derive(Debug)]
pub(crate) struct Input {
    /// Data and transfer function.
    pub(crate) scene: Scene,
    /// Everything else.
    pub(crate) settings: Settings,
}

/// How a scene is to be drawn.
#[derive(Debug)]
pub(crate) struct Settings {
    /// The file.
    path: PathBuf,
    /// The file that the data comes from.
    pub(crate) data: PathBuf,
    /// How it was read.
    pub(crate) report: Report,
    /// The camera with the image size in force.
    pub(crate) view: View,
    /// Whether the camera was chosen for the data.
    pub(crate) camera_is_automatic: bool,
    /// What PNG output is composited over.
    pub(crate) background: [f64; 4],
    /// The technique that the file asks for.
    pub(crate) choice: Option<TechniqueChoice>,
    /// Time that reading took, in milliseconds.
    pub(crate) load_ms: f64,
}

impl Input {
    /// Reads a scene file or a data file, with a bar, and says what may not be as it seems. For another image
    /// size an automatic camera is chosen again.
    ///
    /// # Errors
    ///
    /// As [`LoadedScene::load_any`] and [`View::new`].
    pub(crate) fn load(path: &Path, size: Option<Size>, arrays: &ArraysArgs, quiet: bool) -> Result<Self> {
        let reading = output::Reading::new(path);
        let input = Self::load_within(path, size, &reading.tell(arrays.options()))?;
        drop(reading);
        if !quiet {
            output::warn(&input.settings.data, &input.settings.report.warnings);
        }
        Ok(input)
    }

    /// The same without a word.
    ///
    /// # Errors
    ///
    /// As [`Input::load`].
    pub(crate) fn load_within(path: &Path, size: Option<Size>, options: &ReadOptions) -> Result<Self> {
        let start = Instant::now();
        let loaded = LoadedScene::load_any(path, options)?;
        Self::new(path, loaded, size, start)
    }

    /// What was read, with the image size in force.
    ///
    /// # Errors
    ///
    /// As [`View::new`].
    pub(crate) fn new(path: &Path, loaded: LoadedScene, size: Option<Size>, start: Instant) -> Result<Self> {
        let Size { width, height } = size.unwrap_or(Size { width: loaded.width, height: loaded.height });
        let view = loaded.view(width, height).map_err(|error| error.in_file(path))?;
        let LoadedScene { scene, camera_is_automatic, background, technique, file, report, .. } = loaded;
        let settings = Settings {
            path: path.to_path_buf(),
            data: file,
            report,
            view,
            camera_is_automatic,
            background,
            choice: technique,
            load_ms: milliseconds_since(start),
        };
        Ok(Self { scene, settings })
    }
}

impl Settings {
    /// The technique that the file asks for, if it does.
    ///
    /// # Errors
    ///
    /// [`Error::File`] naming the scene file and what is wrong.
    pub(crate) fn technique(&self) -> Result<Option<Technique>> {
        let Some(choice) = &self.choice else { return Ok(None) };
        let technique = Method::from_name(&choice.name).and_then(|m| Technique::new(m, &choice.options));
        technique.map(Some).map_err(|error| error.in_file(&self.path))
    }

    /// The technique to draw with: the one asked for, else the file's, else the default for the scene. Asked for
    /// by its bare name, the file's technique keeps the file's options.
    ///
    /// # Errors
    ///
    /// As [`Settings::technique`] and [`drawn`]; [`Error::Invalid`] if it does not draw the scene's data or kernels.
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

/// The kind of data, of its kernels where it has some of its own, and surfaces that not all techniques draw.
fn described(scene: &Scene) -> String {
    let kind = scene.data.kind();
    let surfaces = match scene.surfaces.iter().any(Surface::is_translucent) {
        true => " with translucent surfaces",
        false => "",
    };
    scene.kernels.map_or_else(
        || format!("{kind}{surfaces}"),
        |kernels| format!("{kind} of {} kernels{surfaces}", kernels.kernel.name()),
    )
}

/// The technique that draws a scene where none is asked for.
///
/// # Errors
///
/// As [`drawn`].
fn default_technique(scene: &Scene) -> Result<Technique> {
    drawn(scene)?;
    Method::default_for(scene).map_or_else(|| Ok(Technique::default()), |method| Technique::new(method, &[]))
}

/// Nothing, if a technique draws a scene.
///
/// # Errors
///
/// [`Error::Invalid`] if none does.
pub(crate) fn drawn(scene: &Scene) -> Result<()> {
    if Method::default_for(scene).is_some() {
        return Ok(());
    }
    let why = format!("no technique draws data of this kind: {}; `reference` does", described(scene));
    Err(Error::Invalid { what: "technique".to_string(), why })
}

#[cfg(test)]
mod tests {
    use super::super::technique::options_text;
    use super::*;

    #[test]
    fn a_technique_draws_the_data_or_is_refused() {
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
        // What knows no kernels is not chosen for them, and refused.
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
