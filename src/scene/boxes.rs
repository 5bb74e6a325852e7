//! Boxes of a k-d tree, which fill space and can be put into visibility order.

use glam::DVec3;

use crate::num;
use crate::scene::View;

/// Places along an axis at which a box may be cut.
const PLACES: usize = 1024;

/// A place and the work that it is.
pub(crate) type Item = (DVec3, f64);

/// Boxes of about the same work that fill space, the leaves of a k-d tree.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Boxes {
    root: Node,
    boxes: Vec<[DVec3; 2]>,
}

#[derive(Clone, Debug, PartialEq)]
enum Node {
    Box(u32),
    /// A plane across an axis, with what lies below and above.
    Plane(usize, f64, Box<[Node; 2]>),
}

impl Boxes {
    /// Cuts space into `count` boxes with about the same work in each. Changes the order of the items; equal items give equal boxes.
    pub(crate) fn new(items: &mut [Item], count: u32) -> Self {
        let mut boxes = Vec::new();
        let root = cut(items, count.max(1), [DVec3::NEG_INFINITY, DVec3::INFINITY], &mut boxes);
        Self { root, boxes }
    }

    /// Returns the least and the greatest corner of each box; the outer sides are infinite.
    pub(crate) fn boxes(&self) -> &[[DVec3; 2]] {
        &self.boxes
    }

    /// Returns the numbers of the boxes in visibility order: along any ray of a view it meets the boxes in this order.
    pub(crate) fn order(&self, view: &View) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.boxes.len());
        self.root.walk(view, &mut order);
        order
    }

    /// Returns the number of the box that a place lies in; its sides belong to the box above them.
    pub(crate) fn holding(&self, place: DVec3) -> u32 {
        let mut node = &self.root;
        loop {
            match node {
                Node::Box(number) => return *number,
                Node::Plane(axis, at, sides) => node = &sides[usize::from(place[*axis] >= *at)],
            }
        }
    }
}

impl Node {
    fn walk(&self, view: &View, order: &mut Vec<u32>) {
        match self {
            Self::Box(number) => order.push(*number),
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

/// Cuts a box, which these items lie in, into so many boxes.
fn cut(items: &mut [Item], count: u32, [low, high]: [DVec3; 2], boxes: &mut Vec<[DVec3; 2]>) -> Node {
    if count == 1 {
        boxes.push([low, high]);
        return Node::Box(num::count(boxes.len()) - 1);
    }
    let below = count / 2;
    let (axis, at) = plane(items, f64::from(below) / f64::from(count), [low, high]);
    let middle = partition(items, |(place, _)| place[axis] < at);
    let (left, right) = items.split_at_mut(middle);
    let (mut end, mut begin) = (high, low);
    (end[axis], begin[axis]) = (at, at);
    let left = cut(left, below, [low, end], boxes);
    let right = cut(right, count - below, [begin, high], boxes);
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
