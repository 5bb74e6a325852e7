//! A mesh on the device: points and topology, scalars, and the faces or cells that are drawn.

use std::sync::{Arc, Mutex};

use glam::DVec3;
use rayon::prelude::*;

use crate::error::Result;
use crate::gpu::shader::{CELL_WORDS, FACE_AHEAD, FACE_BEHIND};
use crate::gpu::{Buffer, Gpu};
use crate::num::{self, f32_of};
use crate::resident::cache::Cache;
use crate::resident::local_space::LocalSpace;
use crate::resident::visible_scalars::nonzero_ranges;
use crate::scene::topology::{NONE, Topology};
use crate::scene::{TetScalars, Tets, TransferFunction};

// Shaders rely on these.
const _: () = assert!(CELL_WORDS == 4 && FACE_AHEAD == 1 << 31 && FACE_BEHIND == 1 << 30);

/// The primitives that a technique takes in each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Primitives {
    Faces,
    Cells,
}

impl Primitives {
    /// Returns the words of one, where scalars belong to cells or to points (`glsl/mesh/cell-scalars.glsl`).
    pub(crate) const fn words(self, cell_scalars: bool) -> usize {
        match (self, cell_scalars) {
            (Self::Cells, _) => 4,
            (Self::Faces, true) => 5,
            (Self::Faces, false) => 3,
        }
    }
}

/// Data that does not depend on the transfer function.
#[derive(Debug, Default)]
pub(crate) struct MeshData {
    points: Cache<(), Arc<Buffer>>,
    topology: Cache<(), Arc<Topology>>,
    scalars: Cache<(), Arc<Buffer>>,
    /// Capacities that frames have needed so far, of faces and of cells.
    needs: [Arc<Mutex<Needs>>; 2],
}

/// Capacities that frames have needed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Needs {
    /// Entries of the bins of a band.
    pub(crate) bins: u32,
    /// Entries of the lists of a band.
    pub(crate) lists: u32,
    /// Entries of lists for an entry of the bins, where only flagged pixels have lists.
    pub(crate) listed_per_pair: u32,
    /// Entries of the bin of one tile.
    pub(crate) longest_bin: u32,
    /// Repair passes.
    pub(crate) rounds: u32,
    /// Whether so many pixels were unsorted that a larger k-buffer pays.
    pub(crate) deep: bool,
    /// Whether a frame has met overlapping cells.
    pub(crate) overlaps: bool,
}

impl MeshData {
    /// Returns the capacities that frames of faces, or of cells, have needed so far.
    pub(crate) fn needs(&self, kind: Primitives) -> &Arc<Mutex<Needs>> {
        let [faces, cells] = &self.needs;
        if kind == Primitives::Faces { faces } else { cells }
    }

    /// Returns the data of the same points and cells with other scalars.
    pub(crate) fn with_other_scalars(&self) -> Self {
        Self { points: self.points.clone(), topology: self.topology.clone(), ..Self::default() }
    }

    /// Returns the points relative to the centre, in radii: four floats each.
    pub(crate) fn points(&self, gpu: &Gpu, mesh: &Tets) -> Result<Arc<Buffer>> {
        self.points.get((), || {
            let space = LocalSpace::of(mesh);
            let points: Vec<[f32; 4]> =
                mesh.points().iter().map(|&point| local_point(&space, point)).collect();
            Buffer::with_data(gpu, "mesh.points", bytemuck::cast_slice(&points))
        })
    }

    /// Returns the faces with the cells on both sides.
    pub(crate) fn topology(&self, mesh: &Tets) -> Result<Arc<Topology>> {
        self.topology.get((), || Ok(Arc::new(Topology::new(mesh)?)))
    }

    /// Returns the scalars of points or cells as [`stored`] converts them.
    pub(crate) fn scalars(&self, gpu: &Gpu, mesh: &Tets, ends: [f64; 2]) -> Result<Arc<Buffer>> {
        self.scalars.get((), || {
            let scalars: Vec<f32> = mesh.scalars().values().iter().map(|&s| stored(s, ends)).collect();
            Buffer::with_data(gpu, "mesh.scalars", bytemuck::cast_slice(&scalars))
        })
    }
}

/// Returns a point as the device stores it.
pub(super) fn local_point(space: &LocalSpace, point: DVec3) -> [f32; 4] {
    // Points that no cell uses may be infinite.
    let [x, y, z] = space.place(point).map(|x| if x.is_finite() { x } else { 0.0 });
    [x, y, z, 0.0]
}

/// Returns for each cell whether it is drawn.
///
/// A cell that touches a NaN is vacuum. With `margin`, cells without extinction are skipped; it is the distance, in
/// scalars, by which an integrator smears extinction.
pub(super) fn drawn_cells(mesh: &Tets, transfer: &TransferFunction, margin: Option<f32>) -> Vec<bool> {
    let (ends, ranges) = (transfer.domain(), nonzero_ranges(transfer));
    let shows = |cell: usize| {
        let corners: [f32; 4] = match mesh.scalars() {
            TetScalars::Point(values) => mesh.cells()[cell].map(|i| values[num::index(i)]),
            TetScalars::Cell(values) => [values[cell]; 4],
        };
        if corners.iter().any(|s| s.is_nan()) {
            return false;
        }
        let Some(margin) = margin else { return true };
        let corners = corners.map(|s| stored(s, ends));
        let low = corners.into_iter().fold(f32::MAX, f32::min) - margin;
        let high = corners.into_iter().fold(f32::MIN, f32::max) + margin;
        ranges.iter().any(|range| low <= range[1] && high >= range[0])
    };
    (0..mesh.cells().len()).into_par_iter().map(shows).collect()
}

/// The primitives of a mesh that are drawn, on the device.
#[derive(Clone, Debug)]
pub(crate) struct DrawnPrimitives {
    pub(crate) buffer: Arc<Buffer>,
    pub(crate) count: u32,
    /// Numbers of the cells in the mesh; empty for faces.
    pub(crate) cells: Arc<Vec<u32>>,
    /// Scalars of the cells, where scalars belong to cells.
    pub(crate) scalars: Option<Arc<Buffer>>,
}

impl DrawnPrimitives {
    /// Uploads the faces or cells of a mesh that are drawn; with `margin` only those of visible cells.
    pub(crate) fn new(
        gpu: &Gpu,
        mesh: &Tets,
        data: &MeshData,
        transfer: &TransferFunction,
        kind: Primitives,
        margin: Option<f32>,
    ) -> Result<Self> {
        let drawn = drawn_cells(mesh, transfer, margin);
        match kind {
            Primitives::Faces => {
                let of_cells = matches!(mesh.scalars(), TetScalars::Cell(_));
                Self::faces(gpu, &*data.topology(mesh)?, &drawn, of_cells)
            }
            Primitives::Cells => Self::cells(gpu, mesh, transfer.domain(), &drawn),
        }
    }

    /// Uploads cells: the numbers of their corners, ascending.
    fn cells(gpu: &Gpu, mesh: &Tets, ends: [f64; 2], drawn: &[bool]) -> Result<Self> {
        let cells: Vec<u32> = (0..).zip(drawn).filter(|(_, drawn)| **drawn).map(|(i, _)| i).collect();
        let corners: Vec<[u32; 4]> = cells
            .iter()
            .map(|&i| {
                let mut corners = mesh.cells()[num::index(i)];
                corners.sort_unstable();
                corners
            })
            .collect();
        let scalars = match mesh.scalars() {
            TetScalars::Point(_) => None,
            TetScalars::Cell(values) => {
                let scalars: Vec<f32> = cells.iter().map(|&i| stored(values[num::index(i)], ends)).collect();
                Some(upload(gpu, "mesh.cell-scalars", &scalars)?)
            }
        };
        let count = num::count(cells.len());
        let buffer = upload(gpu, "mesh.cells", &corners)?;
        Ok(Self { buffer, count, cells: Arc::new(cells), scalars })
    }

    /// Uploads the faces of cells: the numbers of their corners, ascending; with `of_cells` also of the cells in front and behind.
    fn faces(gpu: &Gpu, topology: &Topology, drawn: &[bool], of_cells: bool) -> Result<Self> {
        let is_drawn = |cell: u32| cell != NONE && drawn[num::index(cell)];
        let shown = topology.faces().iter().filter(|face| is_drawn(face.front) || is_drawn(face.back));
        let words: Vec<[u32; 5]> = shown
            .map(|face| {
                face_words(face.corners, [face.front, face.back], [is_drawn(face.front), is_drawn(face.back)])
            })
            .collect();
        let count = num::count(words.len());
        let buffer = if of_cells {
            upload(gpu, "mesh.faces", &words)?
        } else {
            let corners: Vec<[u32; 3]> = words.iter().map(|&[a, b, c, ..]| [a, b, c]).collect();
            upload(gpu, "mesh.faces", &corners)?
        };
        Ok(Self { buffer, count, cells: Arc::default(), scalars: None })
    }
}

/// Returns the words of a face as shaders read them (`glsl/mesh/cell-scalars.glsl`): corners, with bits that tell on which sides there is a
/// cell, and the cells in front and behind.
pub(super) fn face_words(
    [a, b, c]: [u32; 3],
    [front, back]: [u32; 2],
    [ahead, behind]: [bool; 2],
) -> [u32; 5] {
    let sides = if ahead { FACE_AHEAD } else { 0 } | if behind { FACE_BEHIND } else { 0 };
    [a | sides, b, c, front, back]
}

/// Uploads data, or one zero where it is empty: a buffer must have a size.
fn upload<T: bytemuck::Pod>(gpu: &Gpu, name: &str, data: &[T]) -> Result<Arc<Buffer>> {
    let nothing = [T::zeroed()];
    Buffer::with_data(gpu, name, bytemuck::cast_slice(if data.is_empty() { &nothing } else { data }))
}

/// Returns a scalar as the device stores it: infinities become the ends of the transfer function, and NaN, which no
/// drawn cell has, 0.
pub(super) fn stored(s: f32, ends: [f64; 2]) -> f32 {
    match s {
        f32::INFINITY => f32_of(ends[1]),
        f32::NEG_INFINITY => f32_of(ends[0]),
        s if s.is_nan() => 0.0,
        s => s,
    }
}
