//! A loaded scene: data, transfer function, camera and everything else that an image needs, from a scene file or from
//! a data file on its own.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::file::json::{parse, parse_file};
use crate::io::file::source::Source;
use crate::io::formats::gaussian::sog;
use crate::io::formats::raw::layout::is_sidecar;
use crate::io::options::ReadOptions;
use crate::io::read_data;
use crate::io::report::{Loaded, Report};
use crate::io::scene_file::data::SceneData;
use crate::io::scene_file::document::{DataSpec, Document, ImageSpec};
use crate::io::scene_file::technique::TechniqueChoice;
use crate::io::scene_file::transfer::Recipe;
use crate::io::scene_file::{mode, surfaces};
use crate::scene::{Camera, Clip, Kernels, Mode, Scene, Surface, TransferFunction, View, auto};

/// Everything that an image needs, read and checked.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// Data, transfer function and surfaces.
    pub scene: Scene,
    /// The clip planes and the crop box.
    pub clip: Clip,
    /// The camera.
    pub camera: Camera,
    /// Whether the camera was chosen automatically; for another image size it should be chosen again with
    /// [`auto::camera`].
    pub camera_is_automatic: bool,
    /// Whether the transfer function was chosen automatically; for another mode it should be chosen again with
    /// [`auto::transfer`] or [`auto::maximum`].
    pub transfer_is_automatic: bool,
    /// Width of the image, in pixels.
    pub width: u32,
    /// Height of the image, in pixels.
    pub height: u32,
    /// The background of PNG output: straight linear RGBA.
    pub background: [f64; 4],
    /// The technique that the file asks for.
    pub technique: Option<TechniqueChoice>,
    /// The file that the data comes from; for an analytic field the scene file.
    pub file: PathBuf,
    /// How the data was read.
    pub report: Report,
}

impl LoadedScene {
    /// The default image width and height, in pixels.
    pub const DEFAULT_SIDE: u32 = ImageSpec::SIDE;

    /// The default background: opaque black.
    pub const DEFAULT_BACKGROUND: [f64; 4] = Document::BACKGROUND;

    /// Loads a scene file or a data file: a `.json` file is a scene file, unless it describes raw samples.
    ///
    /// # Errors
    ///
    /// As [`SceneFile::load`] and [`LoadedScene::from_data`].
    pub fn load_any(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        if SceneFile::is_at(path, options) {
            SceneFile::load(path, options)
        } else {
            Self::from_data(path, options)
        }
    }

    /// Loads a data file, and chooses a camera, a transfer function and, for points of unknown size, a radius.
    ///
    /// # Errors
    ///
    /// As [`io::read`](crate::io::read) and [`Self::from_loaded`].
    pub fn from_data(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        Self::from_loaded(path, read_data::read(path, options)?)
    }

    /// Reads only the data of a scene file or a data file: of another step of a series, for example, to draw it like
    /// the first.
    ///
    /// # Errors
    ///
    /// As [`SceneFile::load`] and [`io::read`](crate::io::read).
    pub fn read_data(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Loaded> {
        let path = path.as_ref();
        let SceneData { data, report, .. } = if SceneFile::is_at(path, options) {
            let mut document: Document = parse_file(path, options)?;
            document.data(path)?.load(path, options)?
        } else {
            SceneData::new(path, read_data::read(path, options)?)
        };
        Ok(Loaded { data, report })
    }

    /// Completes data that has been read, as [`Self::from_data`] does. `path` is for messages.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if no camera or no transfer function can be chosen for it.
    pub fn from_loaded(path: impl AsRef<Path>, loaded: Loaded) -> Result<Self> {
        let path = path.as_ref();
        Self::assemble(path, SceneData::new(path, loaded), Rest::default())
    }

    /// Returns the view for an image size, with the scene's clip region. An automatic camera is chosen again if the
    /// size is not the scene's own.
    ///
    /// # Errors
    ///
    /// As [`View::new`] and [`auto::camera`].
    pub fn view(&self, width: u32, height: u32) -> Result<View> {
        let camera = if self.camera_is_automatic && [width, height] != [self.width, self.height] {
            auto::camera(&self.scene, width, height)?
        } else {
            self.camera
        };
        Ok(View::new(camera, width, height)?.with_clip(self.clip))
    }

    /// Assembles the scene, with defaults for missing parts.
    fn assemble(path: &Path, source: SceneData, rest: Rest) -> Result<Self> {
        let SceneData { data, file, report, rule } = source;
        let [width, height] = rest.extent.unwrap_or([Self::DEFAULT_SIDE; 2]);
        let located = |error: Error| error.in_file(path);
        let transfer_is_automatic = rest.transfer.is_none();
        let transfer = match rest.transfer {
            Some(transfer) => transfer,
            None => auto::transfer_in(&data, rest.kernels.as_ref(), rest.mode).map_err(located)?,
        };
        let mut scene = Scene::new(data, transfer);
        scene.rule = rule;
        if let Some(kernels) = rest.kernels {
            scene = scene.with_kernels(kernels).map_err(located)?;
        }
        let scene = scene.with_mode(rest.mode).map_err(|error| error.at_place(path, "mode"))?;
        let scene = scene.with_surfaces(rest.surfaces);
        let camera_is_automatic = rest.camera.is_none();
        let camera = match rest.camera {
            Some(camera) => camera,
            None => auto::camera(&scene, width, height).map_err(located)?,
        };
        View::new(camera, width, height).map_err(located)?;
        Ok(Self {
            scene,
            clip: rest.clip,
            camera,
            camera_is_automatic,
            transfer_is_automatic,
            width,
            height,
            background: rest.background.unwrap_or(Self::DEFAULT_BACKGROUND),
            technique: rest.technique,
            file,
            report,
        })
    }
}

/// The optional parts of a scene.
#[derive(Default)]
struct Rest {
    kernels: Option<Kernels>,
    transfer: Option<TransferFunction>,
    mode: Mode,
    camera: Option<Camera>,
    extent: Option<[u32; 2]>,
    background: Option<[f64; 4]>,
    technique: Option<TechniqueChoice>,
    surfaces: Vec<Surface>,
    clip: Clip,
}

/// Reader of scene files.
#[derive(Clone, Copy, Debug)]
pub struct SceneFile;

impl SceneFile {
    /// Whether a file is a scene file: its extension is `.json`, and it describes neither raw samples nor Gaussian splats.
    #[must_use]
    pub fn is_at(path: &Path, options: &ReadOptions) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"))
            && !Source::open(path, options).is_ok_and(|source| is_sidecar(&source) || sog::is_meta(&source))
    }

    /// Reads a scene file and the data that it names. Arrays selected in `options` override those in the file.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a file cannot be read; [`Error::File`] with file, place and rule if the scene file or a file
    /// that it names breaks a rule.
    pub fn load(path: impl AsRef<Path>, options: &ReadOptions) -> Result<LoadedScene> {
        let path = path.as_ref();
        let mut document: Document = parse_file(path, options)?;
        let source = document.data(path)?;
        Self::build(path, document, source, options)
    }

    /// Makes a scene of data that is given, and of the text of a scene file without data. Paths of surfaces are relative to the
    /// current folder.
    ///
    /// # Errors
    ///
    /// As [`Self::load`]; messages call the text `scene`.
    pub fn with_data(text: &str, loaded: Loaded, options: &ReadOptions) -> Result<LoadedScene> {
        let path = Path::new("scene");
        let mut document: Document = parse(path, text.as_bytes())?;
        let source = document.given(path, loaded)?;
        Self::build(path, document, source, options)
    }

    fn build(
        path: &Path,
        document: Document,
        source: DataSpec,
        options: &ReadOptions,
    ) -> Result<LoadedScene> {
        if let Some(background) = document.background {
            let valid = background.iter().all(|v| *v >= 0.0 && v.is_finite()) && background[3] <= 1.0;
            if !valid {
                let rule = "must be four numbers that are not negative, alpha at most 1";
                return Err(Error::file(path, "background", rule));
            }
        }
        if source.is_gaussians() {
            let given =
                [("transfer", document.transfer.is_some()), ("lighting", document.lighting.is_some())];
            if let Some((key, _)) = given.into_iter().find(|(_, given)| *given) {
                return Err(Error::file(path, key, "gaussians have colours of their own"));
            }
        }
        // The cheap parts are checked before the data is read.
        let camera = document.camera.map(|camera| camera.check(path)).transpose()?;
        let extent = document
            .image
            .map(|image| [image.width, image.height].map(|side| side.unwrap_or(LoadedScene::DEFAULT_SIDE)));
        if let (Some(camera), [width, height]) = (camera, extent.unwrap_or([LoadedScene::DEFAULT_SIDE; 2])) {
            View::new(camera, width, height).map_err(|error| error.in_file(path))?;
        }
        let recipe = document.transfer.map(|spec| Recipe::new(path, spec, options)).transpose()?;
        let kernels = source.kernels(path, document.kernels)?;
        let mode = mode::mode(path, document.mode.as_deref(), document.lighting.as_ref())?;
        let clip = document.clip.map(|clip| clip.check(path)).transpose()?.unwrap_or_default();
        let surfaces = surfaces::load(&document.opaque.unwrap_or_default(), path, options)?;
        let source = source.load(path, options)?;
        let own = recipe.as_ref().map(|recipe| recipe.mode(&source.data, kernels.as_ref()));
        let mode = mode.or(own).unwrap_or(Mode::Emission);
        let transfer = recipe.map(|recipe| recipe.build(&source.data, kernels.as_ref())).transpose()?;
        let Document { background, technique, .. } = document;
        let rest = Rest { kernels, transfer, mode, camera, extent, background, technique, surfaces, clip };
        LoadedScene::assemble(path, source, rest)
    }
}
