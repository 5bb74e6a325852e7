//! Loading of scene files, and of data files on their own.

use std::path::Path;

use crate::error::{Error, Result};
use crate::io::file::json::parse_file;
use crate::io::formats::raw::sidecar;
use crate::io::options::ReadOptions;
use crate::io::scene_file::document::{DataSpec, Document};
use crate::io::scene_file::loaded::{LoadedScene, Rest};
use crate::io::scene_file::surfaces;
use crate::io::scene_file::transfer::Recipe;
use crate::scene::View;

impl LoadedScene {
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
}

/// Reader of scene files.
#[derive(Clone, Copy, Debug)]
pub struct SceneFile;

impl SceneFile {
    /// Whether a file is a scene file: its extension is `.json`, and it does not describe raw samples.
    #[must_use]
    pub fn is_at(path: &Path, options: &ReadOptions) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"))
            && !sidecar::describes_raw(path, options)
    }

    /// Reads a scene file and the data that it names. Arrays selected in `options` override those in the file.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a file cannot be read; [`Error::File`] with file, place and rule if the scene file or a file
    /// that it names breaks a rule.
    pub fn load(path: impl AsRef<Path>, options: &ReadOptions) -> Result<LoadedScene> {
        let path = path.as_ref();
        let document: Document = parse_file(path, options)?;
        let refuse = |place: &str, rule: &str| Err(Error::file(path, place, rule));
        let source = match (document.volume, document.mesh, document.points) {
            (Some(volume), None, None) => DataSpec::Volume(Box::new(volume)),
            (None, Some(mesh), None) => DataSpec::Mesh(mesh),
            (None, None, Some(points)) => DataSpec::Points(points),
            (None, None, None) => {
                return refuse("volume", "missing: a scene needs data, in `volume`, `mesh` or `points`");
            }
            (_, _, points) => {
                let second = if points.is_some() { "points" } else { "mesh" };
                return refuse(second, "a scene has one of `volume`, `mesh` and `points`");
            }
        };
        if let Some(background) = document.background {
            let valid = background.iter().all(|v| *v >= 0.0 && v.is_finite()) && background[3] <= 1.0;
            if !valid {
                return refuse("background", "must be four numbers that are not negative, alpha at most 1");
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
        let clip = document.clip.map(|clip| clip.check(path)).transpose()?.unwrap_or_default();
        let surfaces = surfaces::load(&document.opaque.unwrap_or_default(), path, options)?;
        let source = match source {
            DataSpec::Volume(volume) => volume.load(path, options)?,
            DataSpec::Mesh(mesh) => mesh.load(path, options)?,
            DataSpec::Points(points) => points.load(path, options)?,
        };
        let transfer = recipe.map(|recipe| recipe.build(source.data.range())).transpose()?;
        let Document { background, technique, .. } = document;
        let rest = Rest { kernels, transfer, camera, extent, background, technique, surfaces, clip };
        LoadedScene::assemble(path, source, rest)
    }
}
