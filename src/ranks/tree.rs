//! The k-d tree that cuts space into a box per rank.

use std::borrow::Cow;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::gpu::shader::BRICK;
use crate::num;
use crate::resident::visible_scalars::nonzero_ranges;
use crate::scene::{Data, Grid, Scene, TransferFunction, View};

/// Places along an axis at which a box may be cut.
const PLACES: usize = 1024;

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
pub struct KdTree {
    root: Node,
    boxes: Vec<[DVec3; 2]>,
}

#[derive(Clone, Debug, PartialEq)]
enum Node {
    Rank(u32),
    /// A plane across an axis, with what lies below and above.
    Plane(usize, f64, Box<[Node; 2]>),
}

/// A place and the work that it is.
type Item = (DVec3, f64);

impl KdTree {
    /// Cuts space for so many ranks: by samples of a grid, or of its overview where they are read on demand, that the transfer function
    /// shows, or by cells of a mesh. A view magnifies what is near, and its rays are the denser there; other views may share the tree.
    /// Equal arguments give equal trees.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for no ranks, and for points.
    pub fn new(scene: &Scene, view: &View, ranks: u32) -> Result<Self> {
        check_count(ranks)?;
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
        let found: Vec<(DVec3, Option<f64>)> = match &scene.data {
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
            _ => return Err(Error::invalid("ranks", "kernels overlap, so that no boxes own them")),
        };
        let most = found.iter().filter_map(|(_, work)| *work).fold(0.0, f64::max);
        let hidden = HIDDEN * if most > 0.0 { most } else { 1.0 };
        let mut items: Vec<Item> =
            found.into_iter().map(|(place, work)| (place, work.unwrap_or(hidden))).collect();
        let mut boxes = Vec::new();
        let all = [DVec3::NEG_INFINITY, DVec3::INFINITY];
        let root = cut(&mut items, ranks, all, &mut boxes);
        Ok(Self { root, boxes })
    }

    /// Returns the least and the greatest corner of the box of each rank; the outer sides are infinite.
    #[must_use]
    pub fn boxes(&self) -> &[[DVec3; 2]] {
        &self.boxes
    }

    /// Returns the ranks in visibility order: along any ray of a view it meets their boxes in this order.
    #[must_use]
    pub fn order(&self, view: &View) -> Vec<u32> {
        let mut order = Vec::new();
        self.root.walk(view, &mut order);
        order
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

impl Node {
    fn walk(&self, view: &View, order: &mut Vec<u32>) {
        match self {
            Self::Rank(rank) => order.push(*rank),
            Self::Plane(axis, at, sides) => {
                // Rays run from the side of the eye, or all one way.
                let upwards = if view.is_perspective() {
                    view.camera().eye[*axis] < *at
                } else {
                    view.forward()[*axis] > 0.0
                };
                let [near, far] = if upwards { [0, 1] } else { [1, 0] };
                sides[near].walk(view, order);
                sides[far].walk(view, order);
            }
        }
    }
}

/// Cuts a box, which these items lie in, for so many ranks.
fn cut(items: &mut [Item], ranks: u32, [low, high]: [DVec3; 2], boxes: &mut Vec<[DVec3; 2]>) -> Node {
    if ranks == 1 {
        boxes.push([low, high]);
        return Node::Rank(num::count(boxes.len()) - 1);
    }
    let below = ranks / 2;
    let (axis, at) = plane(items, f64::from(below) / f64::from(ranks), [low, high]);
    let middle = partition(items, |(place, _)| place[axis] < at);
    let (left, right) = items.split_at_mut(middle);
    let (mut end, mut begin) = (high, low);
    (end[axis], begin[axis]) = (at, at);
    let left = cut(left, below, [low, end], boxes);
    let right = cut(right, ranks - below, [begin, high], boxes);
    Node::Plane(axis, at, Box::new([left, right]))
}

/// Returns the plane across the longest axis of the items that leaves a share of their work below it.
fn plane(items: &[Item], share: f64, [low, high]: [DVec3; 2]) -> (usize, f64) {
    let first = items.iter().fold(DVec3::INFINITY, |least, (place, _)| least.min(*place));
    let last = items.iter().fold(DVec3::NEG_INFINITY, |most, (place, _)| most.max(*place));
    let extent = last - first;
    let axis = extent.max_position();
    if items.is_empty() || extent[axis] <= 0.0 {
        // No work, or all at one place: any plane that cuts the box.
        let at = [low[axis], high[axis]].into_iter().filter(|side| side.is_finite()).sum::<f64>();
        let both = low[axis].is_finite() && high[axis].is_finite();
        return (
            axis,
            if both {
                0.5 * at
            } else if low[axis].is_finite() {
                at + 1.0
            } else {
                at - 1.0
            },
        );
    }
    let mut work = vec![0.0; PLACES];
    for (place, weight) in items {
        let bin = (place[axis] - first[axis]) / extent[axis] * num::f64_of(PLACES);
        work[num::index(num::u32_of(bin)).min(PLACES - 1)] += weight;
    }
    let wanted = share * work.iter().sum::<f64>();
    let mut sum = 0.0;
    let mut best = (f64::INFINITY, 1);
    for (i, weight) in work.iter().enumerate().take(PLACES - 1) {
        sum += weight;
        best = if (sum - wanted).abs() < best.0 { ((sum - wanted).abs(), i + 1) } else { best };
    }
    (axis, first[axis] + extent[axis] * num::f64_of(best.1) / num::f64_of(PLACES))
}

/// Moves the items that a test accepts to the front; returns their number.
fn partition(items: &mut [Item], accepts: impl Fn(&Item) -> bool) -> usize {
    let mut next = 0;
    for i in 0..items.len() {
        if accepts(&items[i]) {
            items.swap(i, next);
            next += 1;
        }
    }
    next
}
