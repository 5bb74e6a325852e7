//! The data of a scene: where it comes from, and what all kinds of data have in common.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::read_data;
use crate::io::report::{Loaded, Report};
use crate::num;
use crate::scene::{Data, KernelSize, SplatRule};

/// The data of a scene, and the file it comes from.
pub(crate) struct SceneData {
    pub(crate) data: Data,
    pub(crate) file: PathBuf,
    pub(crate) report: Report,
    /// The rule that trained splats are drawn by.
    pub(crate) rule: Option<SplatRule>,
}

impl SceneData {
    /// Wraps data that has been read; points without size get an estimated radius.
    pub(crate) fn new(file: &Path, loaded: Loaded) -> Self {
        let Loaded { data, mut report } = loaded;
        let data = match data {
            Data::Points(points) if *points.size() == KernelSize::Unknown => {
                let points = points.with_estimated_radius();
                if let KernelSize::Radius(radius) = points.size() {
                    report.notes.push(format!("radius {}: from the spacing of points", short(*radius)));
                }
                points.into()
            }
            data => data,
        };
        Self { data, file: file.to_path_buf(), report, rule: None }
    }

    /// Wraps an analytic field.
    pub(crate) fn analytic(scene: &Path, data: impl Into<Data>) -> Self {
        Self::new(scene, Loaded::new("analytic field", data))
    }
}

/// Formats a positive number with three digits.
fn short(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        let digits = num::usize_of((2.0 - value.log10().floor()).max(0.0));
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    }
}

/// Reads a data file, which must hold the data that belongs under the key.
pub(crate) fn read(key: &str, file: &Path, options: &ReadOptions) -> Result<Loaded> {
    let loaded = read_data::read(file, options)?;
    let (own, rule) = match loaded.data {
        Data::Grid(_) => ("volume", "holds a grid: a scene names it in `volume`"),
        Data::Mesh(_) => ("mesh", "holds a mesh: a scene names it in `mesh`"),
        Data::Points(_) => ("points", "holds points: a scene names them in `points`"),
        Data::Gaussians(_) => ("gaussians", "holds gaussians: a scene names them in `gaussians`"),
    };
    if own == key { Ok(loaded) } else { Err(Error::file(file, "content", rule)) }
}

/// The place that data comes from: a file, or the name of an analytic field.
pub(crate) enum Given<'a> {
    File(PathBuf),
    Field(&'a str),
}

impl<'a> Given<'a> {
    /// Returns what is given under a key, which must be one of both.
    pub(crate) fn of(
        scene: &Path,
        key: &str,
        file: &Option<String>,
        field: &'a Option<String>,
    ) -> Result<Self> {
        let rule = match (file, field) {
            (Some(file), None) => return Ok(Self::File(beside(scene, file))),
            (None, Some(field)) => return Ok(Self::Field(field)),
            (Some(_), Some(_)) => "must have either `file` or `field`, not both",
            (None, None) => "must have `file` or `field`",
        };
        Err(Error::file(scene, key, rule))
    }
}

/// Refuses arrays that keys of the scene or options select, for data that has none.
pub(crate) fn refuse_arrays(scene: &Path, what: &str, wanted: &[(&str, &Option<String>)]) -> Result<()> {
    match wanted.iter().find_map(|&(key, array)| Some((key, array.as_ref()?))) {
        Some((key, array)) => {
            Err(Error::file(scene, key, format!("\"{array}\": {what} have no arrays with names")))
        }
        None => Ok(()),
    }
}

/// Checks the memory of an analytic field, whose extent a key gives, before it is allocated.
pub(crate) fn check_memory(
    scene: &Path,
    key: &str,
    extent: u32,
    bytes: u64,
    options: &ReadOptions,
) -> Result<()> {
    if bytes <= options.max_bytes {
        return Ok(());
    }
    let rule = format!("{extent}: takes {bytes} bytes, the limit is {} bytes", options.max_bytes);
    Err(Error::file(scene, key, rule))
}

/// Resolves a path relative to the scene file.
pub(crate) fn beside(scene: &Path, file: &str) -> PathBuf {
    scene.parent().unwrap_or(Path::new("")).join(file)
}
