//! Meshed polyhedra visibility ordering (MPVO): a topological sort of cells.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use crate::error::Result;
use crate::num;
use crate::scene::topology::{Face, NONE, Topology};
use crate::scene::{Tets, View};
use crate::technique::mesh::order::eye::Eye;
use crate::technique::mesh::order::keys::{self, CHUNK};
use crate::technique::mesh::order::{boundary, cycles};

/// How cells with a gap between them are ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Boundary {
    /// By the ray of each pixel, which leaves the mesh and enters it again: right at every pixel centre.
    Pixels,
    /// By the distance of centroids: wrong where rays cross gaps or hollows of the mesh.
    Centroid,
}

/// The cells of a mesh in visibility order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct VisibilityOrder {
    /// Every cell once, nearest first.
    pub front_to_back: Vec<u32>,
    /// Groups of cells that occlude each other in a cycle, so that no order is right for all.
    pub cycles: u32,
    /// Cells in such groups.
    pub cells_in_cycles: u32,
    /// Relations that the order violates because of cycles.
    pub dropped_relations: u64,
    /// Whether cells with a gap between them were ordered by centroids.
    pub approximate: bool,
}

/// Sorts the cells of a mesh front to back.
///
/// Of two cells at a face, the one on the eye's side comes first. With [`Boundary::Pixels`], the cell that the ray of a
/// pixel leaves before a gap comes before the cell that it enters behind the gap. A cell is free once all cells before
/// it are sorted (Kahn 1962); of the free cells the one with the nearest centroid is next. So the order depends only on
/// mesh and view, and is that of centroids wherever no relation forbids it. [`cycles::order`] breaks cycles.
///
/// Takes O(n log n) time, and 32 bytes a cell beside the result.
///
/// # Errors
///
/// [`crate::Error::Invalid`] when the topology is that of another mesh.
pub(crate) fn mpvo(
    mesh: &Tets,
    topology: &Topology,
    view: &View,
    boundary: Boundary,
) -> Result<VisibilityOrder> {
    topology.check(mesh)?;
    let eye = Eye::of(view);
    let points = mesh.points();
    let across = |[one, other]: [u32; 2]| {
        let [face, behind] = [one, other].map(|i| topology.faces()[num::index(i)]);
        let closed = if face.front == NONE {
            Face { front: behind.only(), ..face }
        } else {
            Face { back: behind.only(), ..face }
        };
        eye.crossed(&closed, points)
    };
    let mut extra: Vec<[u32; 2]> = topology.seams().iter().copied().filter_map(across).collect();
    if boundary == Boundary::Pixels {
        extra.append(&mut boundary::relations(mesh, topology, view));
    }
    extra.sort_unstable();
    extra.dedup();
    let approximate = boundary == Boundary::Centroid && !topology.is_convex();
    let order = sort(&links(topology, points, eye), &extra, &keys::centroid(mesh, view));
    Ok(VisibilityOrder { approximate, ..order })
}

/// Returns the neighbour at each face of each cell: twice its number, plus 1 where rays go from this cell to it.
///
/// [`NONE`] stands for no neighbour, or a face that no ray crosses.
fn links(topology: &Topology, points: &[glam::DVec3], eye: Eye) -> Vec<[u32; 4]> {
    let faces = topology.faces();
    let first: Vec<u32> = faces
        .par_iter()
        .with_min_len(CHUNK)
        .map(|face| eye.crossed(face, points).map_or(NONE, |cells| cells[0]))
        .collect();
    (0..num::count(topology.cell_faces().len()))
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|cell| {
            topology.cell_faces()[num::index(cell)].map(|number| {
                let (face, first) = (faces[num::index(number)], first[num::index(number)]);
                if first == NONE {
                    return NONE;
                }
                let other = if face.front == cell { face.back } else { face.front };
                other << 1 | u32::from(first == cell)
            })
        })
        .collect()
}

/// Returns a key that sorts as the number does.
fn ascending_bits(value: f64) -> u32 {
    let bits = num::f32_of(value).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// Sorts cells by all links and by the `extra` relations, which are sorted; breaks cycles.
fn sort(links: &[[u32; 4]], extra: &[[u32; 2]], distance: &[f64]) -> VisibilityOrder {
    let key = |cell: u32| u64::from(ascending_bits(distance[num::index(cell)])) << 32 | u64::from(cell);
    let mut held: Vec<u32> = links
        .par_iter()
        .with_min_len(CHUNK)
        .map(|links| links.iter().map(|&link| u32::from(link != NONE && link & 1 == 0)).sum())
        .collect();
    // The extra relations of a cell begin at its start.
    let mut starts = vec![0_u32; if extra.is_empty() { 0 } else { links.len() + 1 }];
    for [from, to] in extra {
        held[num::index(*to)] += 1;
        starts[num::index(*from) + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let extra_of = |cell: usize| match starts.get(cell..cell + 2) {
        Some(&[begin, end]) => &extra[num::index(begin)..num::index(end)],
        _ => &[],
    };
    let free: Vec<Reverse<u64>> = (0..num::count(links.len()))
        .filter(|&cell| held[num::index(cell)] == 0)
        .map(|cell| Reverse(key(cell)))
        .collect();
    let mut free = BinaryHeap::from(free);
    let mut order = Vec::with_capacity(links.len());
    while let Some(Reverse(taken)) = free.pop() {
        let cell = u32::try_from(taken & u64::from(NONE)).unwrap_or(NONE);
        order.push(cell);
        let behind = links[num::index(cell)].into_iter().filter(|&link| link != NONE && link & 1 == 1);
        let beyond = extra_of(num::index(cell)).iter().map(|relation| relation[1]);
        for next in behind.map(|link| link >> 1).chain(beyond) {
            let held = &mut held[num::index(next)];
            *held -= 1;
            if *held == 0 {
                free.push(Reverse(key(next)));
            }
        }
    }
    let mut result = VisibilityOrder {
        front_to_back: order,
        cycles: 0,
        cells_in_cycles: 0,
        dropped_relations: 0,
        approximate: false,
    };
    if result.front_to_back.len() < links.len() {
        // The remaining cells are in cycles or behind them.
        let left: Vec<u32> =
            (0..num::count(links.len())).filter(|&cell| held[num::index(cell)] > 0).collect();
        let number = |cell: u32| left.binary_search(&cell).ok().map(num::count);
        let mut edges = Vec::new();
        for (from, &cell) in (0..).zip(&left) {
            let behind = links[num::index(cell)].into_iter().filter(|&link| link != NONE && link & 1 == 1);
            let beyond = extra_of(num::index(cell)).iter().map(|relation| relation[1]);
            edges.extend(behind.map(|link| link >> 1).chain(beyond).filter_map(number).map(|to| [from, to]));
        }
        let keys: Vec<u64> = left.iter().map(|&cell| key(cell)).collect();
        let broken = cycles::order(&keys, edges);
        result.front_to_back.extend(broken.order.iter().map(|&i| left[num::index(i)]));
        result.cycles = broken.components;
        result.cells_in_cycles = broken.nodes;
        result.dropped_relations = broken.dropped;
    }
    result
}
