//! A loaded scene: data, transfer function, camera and everything else that an image needs.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::read_data;
use crate::io::report::{Loaded, Report};
use crate::io::scene_file::data::SceneData;
use crate::io::scene_file::technique::TechniqueChoice;
use crate::scene::{Camera, Clip, Kernels, Scene, Surface, TransferFunction, View, auto};

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
    pub const DEFAULT_SIDE: u32 = 512;

    /// The default background: opaque black.
    pub const DEFAULT_BACKGROUND: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

    /// Loads a data file, and chooses a camera, a transfer function and, for points of unknown size, a radius.
    ///
    /// # Errors
    ///
    /// As [`io::read`](crate::io::read) and [`Self::from_loaded`].
    pub fn from_data(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        Self::from_loaded(path, read_data::read(path, options)?)
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
            auto::camera(&self.scene.data, width, height)?
        } else {
            self.camera
        };
        Ok(View::new(camera, width, height)?.with_clip(self.clip))
    }

    /// Assembles the scene, with defaults for missing parts.
    pub(crate) fn assemble(path: &Path, source: SceneData, rest: Rest) -> Result<Self> {
        let SceneData { data, file, report } = source;
        let [width, height] = rest.extent.unwrap_or([Self::DEFAULT_SIDE; 2]);
        let located = |error: Error| error.in_file(path);
        let transfer = match rest.transfer {
            Some(transfer) => transfer,
            None => auto::transfer_of(&data, rest.kernels.as_ref()).map_err(located)?,
        };
        let camera_is_automatic = rest.camera.is_none();
        let camera = match rest.camera {
            Some(camera) => camera,
            None => auto::camera(&data, width, height).map_err(located)?,
        };
        View::new(camera, width, height).map_err(located)?;
        let mut scene = Scene::new(data, transfer);
        if let Some(kernels) = rest.kernels {
            scene = scene.with_kernels(kernels).map_err(located)?;
        }
        Ok(Self {
            scene: scene.with_surfaces(rest.surfaces),
            clip: rest.clip,
            camera,
            camera_is_automatic,
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
pub(crate) struct Rest {
    pub(crate) kernels: Option<Kernels>,
    pub(crate) transfer: Option<TransferFunction>,
    pub(crate) camera: Option<Camera>,
    pub(crate) extent: Option<[u32; 2]>,
    pub(crate) background: Option<[f64; 4]>,
    pub(crate) technique: Option<TechniqueChoice>,
    pub(crate) surfaces: Vec<Surface>,
    pub(crate) clip: Clip,
}
