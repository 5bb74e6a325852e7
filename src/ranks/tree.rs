//! The k-d tree that cuts space into a box per rank.

use std::borrow::Cow;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::gpu::shader::BRICK;
use crate::num;
use crate::resident::visible_scalars::nonzero_ranges;
use crate::scene::boxes::{Boxes, Item};
use crate::scene::{Data, Grid, Scene, TransferFunction, View};

/// Most samples along an axis that tell the work.
const MOST_SAMPLES: u32 = 128;

/// About the most cells of a mesh that do.
const MOST_CELLS: usize = 1 << 21;

/// The work of what shows nothing, of that of what does: a look at it.
const HIDDEN: f64 = 0.02;

/// The distance up to which a view magnifies more and more, by the diagonal of the data.
const NEAREST: f64 = 0.02;

/// Boxes of about the same visible work, one per rank, that fill space.
#[derive(Clone, Debug, PartialEq)]
pub struct KdTree(Boxes);

impl KdTree {
    /// Cuts space for so many ranks: by samples of a grid, or of its overview where they are read on demand, that the transfer function
    /// shows, or by cells of a mesh. A view magnifies what is near, and its rays are the denser there; other views may share the tree.
    /// Equal arguments give equal trees.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for no ranks, for points, and for trained splats.
    pub fn new(scene: &Scene, view: &View, ranks: u32) -> Result<Self> {
        check_count(ranks)?;
        if scene.grid().is_none() && scene.mesh().is_none() {
            return Err(Error::invalid("ranks", "kernels overlap, so that no boxes own them"));
        }
        let found = work_of(scene, view);
        let most = found.iter().filter_map(|(_, work)| *work).fold(0.0, f64::max);
        let hidden = HIDDEN * if most > 0.0 { most } else { 1.0 };
        let mut items: Vec<Item> =
            found.into_iter().map(|(place, work)| (place, work.unwrap_or(hidden))).collect();
        Ok(Self(Boxes::new(&mut items, ranks)))
    }

    /// Returns the least and the greatest corner of the box of each rank; the outer sides are infinite.
    #[must_use]
    pub fn boxes(&self) -> &[[DVec3; 2]] {
        self.0.boxes()
    }

    /// Returns the ranks in visibility order: along any ray of a view it meets their boxes in this order.
    #[must_use]
    pub fn order(&self, view: &View) -> Vec<u32> {
        self.0.order(view)
    }
}

/// Returns places of a grid or a mesh, and the work of each in a view; `None` where nothing is seen. Places are samples of a grid that the transfer
/// function shows, those of its overview where it is read on demand, and cells of a mesh.
pub(super) fn work_of(scene: &Scene, view: &View) -> Vec<(DVec3, Option<f64>)> {
    let [first, .., last] = scene.data.corners();
    let nearest = NEAREST * first.distance(last);
    let work = |place: DVec3, shows: bool| {
        let [width, height] = view.extent().map(f64::from);
        let seen = view
            .project(place)
            .filter(|(at, _)| shows && (0.0..=width).contains(&at.x) && (0.0..=height).contains(&at.y));
        let rays = |(_, depth): (_, f64)| {
            if view.is_perspective() { depth.max(nearest).powi(-2) } else { 1.0 }
        };
        (place, seen.map(rays))
    };
    match &scene.data {
        Data::Grid(grid) => {
            let coarse = Coarse::of(grid);
            let shown = Bricks::of(&coarse, &scene.transfer);
            let item = |index: [u32; 3]| work(coarse.place(index), shown.holds(index));
            indices(coarse.dims).map(item).collect()
        }
        Data::Mesh(mesh) => {
            let points = mesh.points();
            let middle = |cell: &[u32; 4]| {
                work(cell.map(|i| points[num::index(i)]).into_iter().sum::<DVec3>() / 4.0, true)
            };
            let every = mesh.cells().len().div_ceil(MOST_CELLS);
            mesh.cells().iter().step_by(every).map(middle).collect()
        }
        _ => Vec::new(),
    }
}

/// Refuses shares for no ranks.
pub(super) fn check_count(ranks: u32) -> Result<()> {
    if ranks == 0 { Err(Error::invalid("ranks", "0: at least 1")) } else { Ok(()) }
}

fn indices([width, height, depth]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..depth).flat_map(move |z| (0..height).flat_map(move |y| (0..width).map(move |x| [x, y, z])))
}

/// Samples of a grid, or of its overview, at most [`MOST_SAMPLES`] along each axis.
struct Coarse<'a> {
    grid: Cow<'a, Grid>,
    /// The extent of the whole grid.
    whole: [u32; 3],
    /// From one to the next.
    step: [u32; 3],
    dims: [u32; 3],
}

impl<'a> Coarse<'a> {
    fn of(grid: &'a Grid) -> Self {
        let overview = grid.overview();
        let step = overview.dims().map(|side| side.div_ceil(MOST_SAMPLES));
        let dims = [0, 1, 2].map(|axis| overview.dims()[axis].div_ceil(step[axis]));
        Self { grid: overview, whole: grid.dims(), step, dims }
    }

    fn index(&self, index: [u32; 3]) -> [u32; 3] {
        [0, 1, 2].map(|axis| index[axis] * self.step[axis])
    }

    fn place(&self, index: [u32; 3]) -> DVec3 {
        self.grid.world_of_index(DVec3::from_array(self.index(index).map(f64::from)))
    }

    fn value(&self, index: [u32; 3]) -> f64 {
        let [x, y, z] = self.index(index);
        self.grid.value(x, y, z)
    }
}

/// The bricks of a grid that show anything, which rays do not skip.
struct Bricks {
    /// Coarse samples along each side of a brick.
    side: [u32; 3],
    count: [u32; 3],
    shown: Vec<bool>,
}

impl Bricks {
    fn of(coarse: &Coarse<'_>, transfer: &TransferFunction) -> Self {
        let dims = coarse.dims;
        let side = [0, 1, 2].map(|axis| (BRICK * dims[axis]).div_ceil(coarse.whole[axis]));
        let count = [0, 1, 2].map(|axis| dims[axis].div_ceil(side[axis]));
        // The scalars of a brick, with those of the samples beyond, between which it ends.
        let range = |brick: [u32; 3]| {
            let corner = [0, 1, 2].map(|axis| brick[axis] * side[axis]);
            let extent = [0, 1, 2].map(|axis| (side[axis] + 1).min(dims[axis] - corner[axis]));
            indices(extent).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], index| {
                let value = coarse.value([0, 1, 2].map(|axis| corner[axis] + index[axis]));
                [low.min(value), high.max(value)]
            })
        };
        let scalars: Vec<[f64; 2]> =
            nonzero_ranges(transfer).into_iter().map(|range| range.map(f64::from)).collect();
        let shows = |[low, high]: [f64; 2]| {
            low <= high && scalars.iter().any(|[from, to]| *from <= high && *to >= low)
        };
        Self { side, count, shown: indices(count).map(|brick| shows(range(brick))).collect() }
    }

    /// Returns whether a brick that shows anything holds a coarse sample.
    fn holds(&self, index: [u32; 3]) -> bool {
        let [x, y, z] = [0, 1, 2].map(|axis| index[axis] / self.side[axis]);
        let [width, height, _] = self.count;
        self.shown[num::index((z * height + y) * width + x)]
    }
}
