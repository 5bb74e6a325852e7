//! The data of a scene, and the file that it comes from.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::report::{Loaded, Report};
use crate::num;
use crate::scene::{Data, KernelSize, Points};

/// The data of a scene, and the file it comes from.
pub(crate) struct SceneData {
    pub(crate) data: Data,
    pub(crate) file: PathBuf,
    pub(crate) report: Report,
}

impl SceneData {
    /// Wraps data that has been read; points without size get an estimated radius.
    pub(crate) fn new(file: &Path, loaded: Loaded) -> Self {
        let Loaded { data, report } = loaded;
        match data {
            Data::Points(points) => Self::of_points(file, points, report),
            data => Self { data, file: file.to_path_buf(), report },
        }
    }

    /// Wraps points; those without size get an estimated radius.
    pub(crate) fn of_points(file: &Path, mut points: Points, mut report: Report) -> Self {
        if *points.size() == KernelSize::Unknown {
            points = points.with_estimated_radius();
            if let KernelSize::Radius(radius) = points.size() {
                report.notes.push(format!("radius {}: from the spacing of points", short(*radius)));
            }
        }
        Self { data: points.into(), file: file.to_path_buf(), report }
    }

    /// Wraps data that must be a grid.
    pub(crate) fn grid(file: &Path, loaded: Loaded) -> Result<Self> {
        match loaded.data {
            Data::Grid(_) => Ok(Self::new(file, loaded)),
            Data::Mesh(_) => Err(Error::file(file, "content", "holds a mesh: a scene names it in `mesh`")),
            Data::Points(_) => Err(Error::file(file, "content", HOLDS_POINTS)),
        }
    }
}

/// The rule for a file of points under another key.
pub(crate) const HOLDS_POINTS: &str = "holds points: a scene names them in `points`";

/// Formats a positive number with three digits.
fn short(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        let digits = num::usize_of((2.0 - value.log10().floor()).max(0.0));
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    }
}

/// Resolves a path relative to the scene file.
pub(crate) fn beside(scene: &Path, file: &str) -> PathBuf {
    scene.parent().unwrap_or(Path::new("")).join(file)
}
