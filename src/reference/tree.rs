//! A tree of boxes around the triangles of surfaces, or around kernels.

use glam::DVec3;

/// A box around items.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    /// First item of a leaf, else first of two child nodes.
    pub(super) first: usize,
    /// Number of items of a leaf; 0 for inner nodes.
    pub(super) count: usize,
}

/// Sorts items into a tree with at most `largest` of them in a leaf; the first node is the root.
///
/// Each node is split at the median of its items' centres, along the longest side of the box around those
/// centres.
pub(super) fn tree<T>(
    items: &mut [T],
    largest: usize,
    bounds: impl Fn(&T) -> [DVec3; 2],
    centre: impl Fn(&T) -> DVec3,
) -> Vec<Node> {
    let leaf = |first: usize, count: usize| Node { low: DVec3::ZERO, high: DVec3::ZERO, first, count };
    let mut nodes = Vec::new();
    if !items.is_empty() {
        nodes.push(leaf(0, items.len()));
    }
    let mut next = 0;
    while next < nodes.len() {
        let Node { first, count, .. } = nodes[next];
        let some = &mut items[first..first + count];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut least, mut most) = (low, high);
        for item in some.iter() {
            let ([from, to], middle) = (bounds(item), centre(item));
            (low, high) = (low.min(from), high.max(to));
            (least, most) = (least.min(middle), most.max(middle));
        }
        (nodes[next].low, nodes[next].high) = (low, high);
        if count > largest {
            let axis = (most - least).max_position();
            some.select_nth_unstable_by(count / 2, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
            (nodes[next].first, nodes[next].count) = (nodes.len(), 0);
            nodes.push(leaf(first, count / 2));
            nodes.push(leaf(first + count / 2, count - count / 2));
        }
        next += 1;
    }
    nodes
}
