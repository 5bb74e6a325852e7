//! Scenes to measure: those of suites, given files, and files found in folders.

use std::path::{Path, PathBuf};

use volraster::io::ReadOptions;
use volraster::io::scene_file::SceneFile;
use volraster::scene::{Scene, View};
use volraster::{Error, Result};

use super::scenes::{self, StandardScene, Suite};
use super::sizes::Sizes;
use super::sweeps::{self, Given, Sweep};
use crate::cli::input::{self, Input};

/// Memory limit for reading a file found in a folder, in bytes.
const MAX_BYTES: u64 = 512 << 20;

/// A scene to measure.
pub(super) enum Workload {
    /// A scene of a suite, not yet in memory.
    Standard(&'static Suite, &'static StandardScene),
    /// The file that the command line names, with its name in results.
    File(String, Box<Input>),
    /// A file found in a folder, not yet opened, with its path relative to the folder and its sweeps.
    Found(PathBuf, String, &'static [Sweep]),
}

/// A view with the sweeps that are measured in it.
pub(super) struct ViewCases {
    pub(super) projection: &'static str,
    pub(super) view: View,
    pub(super) sweeps: &'static [Sweep],
}

/// A scene in memory, with its views.
pub(super) struct Opened {
    pub(super) name: String,
    pub(super) family: Option<String>,
    pub(super) scene: Scene,
    pub(super) views: Vec<ViewCases>,
}

impl Workload {
    /// Lists files found in a folder.
    pub(super) fn of_files(
        files: Vec<PathBuf>,
        folder: &Path,
        sweeps: &'static [Sweep],
    ) -> impl Iterator<Item = Self> {
        files.into_iter().map(move |path| {
            let name = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().replace('\\', "/");
            Self::Found(path, name, sweeps)
        })
    }

    /// Returns the name in results.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Standard(_, scene) => scene.name,
            Self::File(name, _) | Self::Found(_, name, _) => name,
        }
    }

    /// Returns the suite that the scene is of.
    pub(super) fn suite(&self) -> Option<&'static Suite> {
        if let Self::Standard(suite, _) = self { Some(suite) } else { None }
    }

    /// Returns the scene of a suite.
    pub(super) fn standard(&self) -> Option<&'static StandardScene> {
        if let Self::Standard(_, scene) = self { Some(scene) } else { None }
    }

    /// Returns an upper bound of the number of cases.
    pub(super) fn case_count(&self, sizes: Sizes, given: &Given) -> Result<usize> {
        let count = |sweeps| Ok(given.or(sweeps)?.len());
        match self {
            Self::Standard(suite, scene) => {
                let further = sizes.further(scene.sides).len();
                Ok(scene.views * count(suite.sweeps)? + further * count(sweeps::SIZES)?)
            }
            Self::File(..) => count(sweeps::STANDARD),
            Self::Found(_, _, sweeps) => count(sweeps),
        }
    }

    /// Reads or makes the scene, and lists its views.
    pub(super) fn open(self, sizes: Sizes) -> Result<Opened> {
        let of_file = |name: String, input: Input, sweeps: &'static [Sweep]| {
            let view = input.settings.view;
            let projection = if view.is_perspective() { "perspective" } else { "orthographic" };
            let views = vec![ViewCases { projection, view, sweeps }];
            Opened { name, family: None, scene: input.scene, views }
        };
        match self {
            Self::File(name, input) => Ok(of_file(name, *input, sweeps::STANDARD)),
            Self::Found(path, name, sweeps) => {
                // A scene file states its image size; data files are all drawn at the standard one.
                let is_scene = SceneFile::is_at(&path, &ReadOptions::default());
                let size = match sizes {
                    Sizes::All(size) => Some(size),
                    Sizes::Eighths(_) => (!is_scene).then_some(scenes::SIZE),
                };
                let input = Input::load_within(&path, size, &ReadOptions::within(MAX_BYTES))?;
                input::drawn(&input.scene).map_err(|error| error.in_file(&path))?;
                Ok(of_file(name, input, sweeps))
            }
            Self::Standard(suite, scene) => {
                let cases = |sweeps| move |(projection, view)| ViewCases { projection, view, sweeps };
                let views = scene.views(sizes.of(suite.size))?;
                let mut views: Vec<ViewCases> = views.into_iter().map(cases(suite.sweeps)).collect();
                for size in sizes.further(scene.sides) {
                    views.extend(scene.views(size)?.into_iter().take(1).map(cases(sweeps::SIZES)));
                }
                let family = Some(scene.family.to_string());
                Ok(Opened { name: scene.name.to_string(), family, scene: scene.load()?, views })
            }
        }
    }
}

/// Lists the files in a folder, sorted; if `deep`, also those in its subfolders. Follows links to files, not links to
/// folders.
///
/// # Errors
///
/// [`Error::Io`] when a folder cannot be listed.
pub(super) fn files_in(folder: &Path, deep: bool) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let failed = |source| Error::Io { path: folder.clone(), action: "cannot list", source };
        for entry in std::fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let path = entry.path();
            if !entry.file_type().map_err(failed)?.is_dir() {
                files.extend(path.is_file().then_some(path));
            } else if deep {
                folders.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}
