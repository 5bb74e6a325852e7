//! Tetrahedral meshes.

use std::cmp::Ordering;
use std::sync::Arc;

use glam::DVec3;

use super::predicates;
use crate::error::{Error, Result};
use crate::num;

/// The scalars of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum TetScalars {
    /// One per point, linear inside each tetrahedron.
    Point(Vec<f32>),
    /// One per tetrahedron, constant inside it.
    Cell(Vec<f32>),
}

impl TetScalars {
    /// Returns the values.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        match self {
            Self::Point(values) | Self::Cell(values) => values,
        }
    }

    /// Checks that there is one per point or one per tetrahedron.
    fn check(&self, points: usize, cells: usize) -> Result<()> {
        let (given, wanted) = match self {
            Self::Point(values) => (values.len(), points),
            Self::Cell(values) => (values.len(), cells),
        };
        if given == wanted {
            return Ok(());
        }
        Err(Error::invalid("mesh scalars", format!("{given} are given, {wanted} are needed")))
    }
}

/// Counts the repairs made to a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mended {
    /// Tetrahedra of negative orientation; two of their corners were exchanged.
    pub reoriented: usize,
    /// Tetrahedra without volume, which were dropped.
    pub flat: usize,
    /// Tetrahedra with a corner that is not finite, which were dropped.
    pub nowhere: usize,
}

/// A mesh of tetrahedra with a scalar at each point or in each cell; vacuum outside.
///
/// Valid by construction: indices are in range and corners finite. Every tetrahedron has a volume that
/// float64 can distinguish from zero and is positively oriented: seen from corner 3, the corners 0, 1 and 2
/// run counter-clockwise.
///
/// Points may coincide, and a point need not belong to any tetrahedron. Cells may overlap or leave gaps;
/// nothing checks that they partition space. A tetrahedron with a NaN scalar is vacuum.
#[derive(Clone, Debug)]
pub struct Tets {
    /// Shared, so that a mesh is cheap to clone, also with other scalars.
    points: Arc<Vec<DVec3>>,
    cells: Arc<Vec<[u32; 4]>>,
    scalars: Arc<TetScalars>,
    bounds: [DVec3; 2],
    range: [f64; 2],
    blank: usize,
}

impl Tets {
    /// Makes a mesh of points in world units and tetrahedra, and repairs it.
    ///
    /// Tetrahedra without volume are dropped together with their cell scalars. A volume counts as zero where
    /// rounding in float64 may have decided the sign of its determinant (Shewchuk 1997, bound A of
    /// `orient3d`).
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if an index is out of range, the number of scalars is wrong, no tetrahedron is
    /// left, or no scalar is finite.
    pub fn new(
        points: Vec<DVec3>,
        mut cells: Vec<[u32; 4]>,
        mut scalars: TetScalars,
    ) -> Result<(Self, Mended)> {
        scalars.check(points.len(), cells.len())?;
        if let Some((i, cell)) =
            cells.iter().enumerate().find(|(_, cell)| cell.iter().any(|&i| num::index(i) >= points.len()))
        {
            let why = format!("tetrahedron {i} has the corners {cell:?}: there are {} points", points.len());
            return Err(Error::invalid("mesh cells", why));
        }
        let mut mended = Mended::default();
        let mut kept = 0;
        for i in 0..cells.len() {
            let mut cell = cells[i];
            match Orientation::of(cell.map(|i| points[num::index(i)])) {
                Orientation::Positive => {}
                Orientation::Negative => {
                    cell.swap(2, 3);
                    mended.reoriented += 1;
                }
                Orientation::Flat => {
                    mended.flat += 1;
                    continue;
                }
                Orientation::Nowhere => {
                    mended.nowhere += 1;
                    continue;
                }
            }
            cells[kept] = cell;
            if let TetScalars::Cell(values) = &mut scalars {
                values[kept] = values[i];
            }
            kept += 1;
        }
        if kept == 0 {
            let why = format!("no tetrahedron has a volume: {} were given", cells.len());
            return Err(Error::invalid("mesh cells", why));
        }
        cells.truncate(kept);
        if let TetScalars::Cell(values) = &mut scalars {
            values.truncate(kept);
        }
        let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for point in cells.iter().flatten().map(|&i| points[num::index(i)]) {
            bounds = [bounds[0].min(point), bounds[1].max(point)];
        }
        let mesh = Self {
            points: Arc::new(points),
            cells: Arc::new(cells),
            scalars: Arc::new(TetScalars::Point(Vec::new())),
            bounds,
            range: [0.0; 2],
            blank: 0,
        };
        mesh.with_scalars(scalars).map(|mesh| (mesh, mended))
    }

    /// Returns the same mesh with other scalars; cell scalars are those of [`Self::cells`].
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if their number is wrong, or no tetrahedron has finite ones.
    pub fn with_scalars(mut self, scalars: TetScalars) -> Result<Self> {
        scalars.check(self.points.len(), self.cells.len())?;
        let (mut range, mut blank) = ([f64::INFINITY, f64::NEG_INFINITY], 0);
        for (i, cell) in self.cells.iter().enumerate() {
            let values: [f32; 4] = match &scalars {
                TetScalars::Point(values) => cell.map(|i| values[num::index(i)]),
                TetScalars::Cell(values) => [values[i]; 4],
            };
            if values.iter().any(|value| value.is_nan()) {
                blank += 1;
                continue;
            }
            for value in values.into_iter().filter(|value| value.is_finite()).map(f64::from) {
                range = [range[0].min(value), range[1].max(value)];
            }
        }
        if range[0] > range[1] {
            return Err(Error::invalid("mesh scalars", "no tetrahedron has finite scalars"));
        }
        self.scalars = Arc::new(scalars);
        self.range = range;
        self.blank = blank;
        Ok(self)
    }

    /// Returns the cells that may meet a box, with the points that they use; the whole mesh where there are none of use.
    pub(crate) fn near_box(&self, [low, high]: [DVec3; 2]) -> Self {
        let points = &*self.points;
        let reach = |cell: &[u32; 4]| {
            let corners = cell.map(|i| points[num::index(i)]);
            let ends = |pick: fn(DVec3, DVec3) -> DVec3| corners.into_iter().reduce(pick).unwrap_or_default();
            [ends(DVec3::min), ends(DVec3::max)]
        };
        let meets = |cell: &[u32; 4]| {
            let [from, to] = reach(cell);
            (from.cmple(high) & to.cmpge(low)).all()
        };
        let kept: Vec<usize> = (0..self.cells.len()).filter(|&i| meets(&self.cells[i])).collect();
        let mut places = vec![None; points.len()];
        let mut used = Vec::new();
        let mut place = |point: u32| {
            *places[num::index(point)].get_or_insert_with(|| {
                used.push(num::index(point));
                num::count(used.len()) - 1
            })
        };
        let cells = kept.iter().map(|&i| self.cells[i].map(&mut place)).collect();
        let scalars = match &*self.scalars {
            TetScalars::Point(values) => TetScalars::Point(used.iter().map(|&i| values[i]).collect()),
            TetScalars::Cell(values) => TetScalars::Cell(kept.iter().map(|&i| values[i]).collect()),
        };
        let points = used.iter().map(|&i| points[i]).collect();
        match Self::new(points, cells, scalars) {
            // Positions are rounded as those of the whole, from whose middle the device counts them.
            Ok((mesh, _)) => Self { bounds: self.bounds, ..mesh },
            Err(_) => self.clone(),
        }
    }

    /// Returns the points, in world units.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Returns the corners of the tetrahedra as indices of points.
    #[must_use]
    pub fn cells(&self) -> &[[u32; 4]] {
        &self.cells
    }

    /// Returns the scalars.
    #[must_use]
    pub fn scalars(&self) -> &TetScalars {
        &self.scalars
    }

    /// Returns the least and the greatest coordinates of the points that tetrahedra use.
    #[must_use]
    pub fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    /// Returns the smallest and the largest finite scalar of the tetrahedra that are not vacuum.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// Returns the number of tetrahedra that are vacuum because of a NaN scalar.
    #[must_use]
    pub fn blank_count(&self) -> usize {
        self.blank
    }
}

/// The orientation of a tetrahedron.
pub(crate) enum Orientation {
    Positive,
    Negative,
    /// Without a volume that float64 can distinguish from zero.
    Flat,
    /// With a corner that is not finite.
    Nowhere,
}

impl Orientation {
    /// Returns the sign of six times the volume, where float64 is certain of it.
    pub(crate) fn of([a, b, c, d]: [DVec3; 4]) -> Self {
        if !(a.is_finite() && b.is_finite() && c.is_finite() && d.is_finite()) {
            return Self::Nowhere;
        }
        match predicates::certain([b - a, c - a, d - a]) {
            Some(Ordering::Greater) => Self::Positive,
            Some(Ordering::Less) => Self::Negative,
            _ => Self::Flat,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners() -> Vec<DVec3> {
        vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.5, 0.5, 0.0), DVec3::NAN, DVec3::ONE]
    }

    fn scalars() -> TetScalars {
        TetScalars::Point(vec![0.0, 1.0, 2.0, 3.0, 4.0, 9.0, 5.0])
    }

    #[test]
    fn cells_are_mended_and_counted() {
        let cells = vec![[0, 1, 2, 3], [0, 2, 1, 3], [0, 1, 2, 4], [0, 1, 2, 5], [1, 1, 2, 3]];
        let data = TetScalars::Cell(vec![1.0, 2.0, 3.0, 4.0, 5.0]);
        let (mesh, mended) = Tets::new(corners(), cells, data).unwrap();
        assert_eq!(mended, Mended { reoriented: 1, flat: 2, nowhere: 1 });
        assert_eq!(mesh.cells(), [[0, 1, 2, 3], [0, 2, 3, 1]]);
        assert_eq!(mesh.scalars(), &TetScalars::Cell(vec![1.0, 2.0]));
        assert_eq!(mesh.bounds(), [DVec3::ZERO, DVec3::ONE]);
        assert_eq!(mesh.range(), [1.0, 2.0]);
        for [a, b, c, d] in mesh.cells().iter().map(|cell| cell.map(|i| mesh.points()[num::index(i)])) {
            assert!((b - a).cross(c - a).dot(d - a) > 0.0);
        }
    }

    #[test]
    fn nan_blanks_cells() {
        let (mesh, _) = Tets::new(corners(), vec![[0, 1, 2, 3], [6, 1, 2, 3]], scalars()).unwrap();
        assert_eq!((mesh.range(), mesh.blank_count()), ([0.0, 5.0], 0));
        let nan = TetScalars::Point(vec![f32::NAN, 1.0, 2.0, f32::INFINITY, 7.0, f32::NAN, 1.5]);
        let mesh = mesh.with_scalars(nan).unwrap();
        assert_eq!((mesh.range(), mesh.blank_count()), ([1.0, 2.0], 1));
    }

    #[test]
    fn refuses_what_is_no_mesh() {
        let why =
            |cells: Vec<[u32; 4]>, scalars| Tets::new(corners(), cells, scalars).unwrap_err().to_string();
        assert!(why(vec![[0, 1, 2, 7]], scalars()).contains("tetrahedron 0"));
        assert!(why(vec![[0, 1, 2, 3]], TetScalars::Cell(vec![])).contains("0 are given, 1"));
        assert!(why(vec![[0, 1, 2, 4]], scalars()).contains("no tetrahedron has a volume"));
        assert!(why(vec![[0, 1, 2, 3]], TetScalars::Cell(vec![f32::NAN])).contains("finite"));
    }

    #[test]
    fn slivers_are_told_from_flat_cells() {
        let thin = |height: f64| {
            let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.3, 0.3, height)];
            Tets::new(points, vec![[0, 1, 2, 3]], TetScalars::Cell(vec![1.0])).is_ok()
        };
        assert!(thin(1e-12) && thin(-1e-300) && !thin(0.0));
        // Far from the origin the same height is lost to the rounding of the coordinates.
        let far = DVec3::splat(1e6);
        let points: Vec<DVec3> =
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.3, 0.3, 1e-12)].map(|p| p + far).to_vec();
        assert!(Tets::new(points, vec![[0, 1, 2, 3]], TetScalars::Cell(vec![1.0])).is_err());
    }
}
