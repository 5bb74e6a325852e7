//! A mesh in parts, for devices without room for the whole: the primitives whose centroids lie in each box of a k-d tree, each part a small
//! mesh with points of its own.

use std::sync::{Arc, Mutex};

use glam::DVec3;
use rayon::prelude::*;

use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::interface::MeshPush;
use crate::num;
use crate::resident::local_space::LocalSpace;
use crate::resident::mesh::{MeshData, Needs, Primitives, drawn_cells, face_words, local_point, stored};
use crate::resident::part_buffers::PartBuffers;
use crate::scene::boxes::Boxes;
use crate::scene::topology::{Face, NONE};
use crate::scene::{TetScalars, Tets, TransferFunction, View};

/// About the most primitives that decide where space is cut.
const MOST_SAMPLES: usize = 1 << 20;

/// The primitives of a mesh that are drawn, in parts.
#[derive(Debug)]
pub(crate) struct MeshParts {
    boxes: Boxes,
    parts: Vec<Part>,
    space: LocalSpace,
    /// Finite ends of the transfer function, which infinite scalars become.
    ends: [f64; 2],
    /// The room that the largest part takes.
    most: Extent,
    /// The number of the primitives of all parts.
    pub(crate) primitives: u32,
    /// Capacities that frames of parts have needed so far.
    pub(crate) needs: Arc<Mutex<Needs>>,
}

/// The numbers of points, of scalars, and of words of primitives.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    points: usize,
    scalars: usize,
    words: usize,
}

/// A part of a mesh.
#[derive(Debug, Default)]
struct Part {
    /// Numbers in the mesh of its points, ascending: primitives keep the order of their corners.
    points: Vec<u32>,
    /// Numbers of the cells whose scalars it has, where scalars belong to cells.
    cells: Vec<u32>,
    /// Primitives as [`crate::resident::mesh::DrawnPrimitives`] has them, by their own points and cells.
    words: Vec<u32>,
    /// The box around its points, relative to the mesh's centre, in radii.
    bounds: [DVec3; 2],
}

/// The points of a part among those of the mesh, as bits, with the number of those before each word.
struct Chosen {
    bits: Vec<u64>,
    before: Vec<u32>,
}

impl Chosen {
    fn new(numbers: impl Iterator<Item = u32>, of: usize) -> Self {
        let mut bits = vec![0_u64; of.div_ceil(64)];
        for number in numbers {
            bits[num::index(number / 64)] |= 1 << (number % 64);
        }
        let before = bits.iter().scan(0, |sum, word| {
            let before = *sum;
            *sum += word.count_ones();
            Some(before)
        });
        Self { before: before.collect(), bits }
    }

    /// Returns the place of a chosen number among all of them.
    fn place(&self, number: u32) -> u32 {
        let word = num::index(number / 64);
        self.before[word] + (self.bits[word] & ((1 << (number % 64)) - 1)).count_ones()
    }

    /// Returns what was chosen, ascending.
    fn numbers(&self) -> Vec<u32> {
        let of_word = |(i, word): (u32, &u64)| {
            let word = *word;
            (0..64).filter(move |bit| word >> bit & 1 != 0).map(move |bit| 64 * i + bit)
        };
        (0..).zip(&self.bits).flat_map(of_word).collect()
    }
}

impl MeshParts {
    /// Cuts the faces or cells of a mesh that are drawn into `count` parts of about the same number; with `margin` only those of visible
    /// cells. Beside the topology they take 12 bytes of the host's memory for each face, 20 where scalars belong to cells, and 4 for each point and
    /// cell of a part.
    ///
    /// # Errors
    ///
    /// As [`MeshData::topology`].
    pub(crate) fn new(
        mesh: &Tets,
        data: &MeshData,
        transfer: &TransferFunction,
        kind: Primitives,
        margin: Option<f32>,
        count: u32,
    ) -> Result<Self> {
        let drawn = drawn_cells(mesh, transfer, margin);
        let is_drawn = |cell: u32| cell != NONE && drawn[num::index(cell)];
        let space = LocalSpace::of(mesh);
        let (boxes, parts, primitives) = match kind {
            Primitives::Faces => {
                let topology = data.topology(mesh)?;
                let faces = topology.faces().par_iter();
                let shown: Vec<&Face> =
                    faces.filter(|face| is_drawn(face.front) || is_drawn(face.back)).collect();
                let sides = |face: &Face| [is_drawn(face.front), is_drawn(face.back)];
                cut(
                    mesh,
                    &shown,
                    count,
                    |face| face.corners,
                    |faces| Part::of_faces(mesh, &space, faces, sides),
                )
            }
            Primitives::Cells => {
                let cells = (0..num::count(mesh.cells().len())).into_par_iter();
                let shown: Vec<u32> = cells.filter(|&cell| is_drawn(cell)).collect();
                let corners = |cell: &u32| mesh.cells()[num::index(*cell)];
                cut(mesh, &shown, count, corners, |cells| Part::of_cells(mesh, &space, cells))
            }
        };
        let most = parts.iter().fold(Extent::default(), |most, part| Extent {
            points: most.points.max(part.points.len()),
            scalars: most.scalars.max(part.cells.len()),
            words: most.words.max(part.words.len()),
        });
        let of_cells = matches!(mesh.scalars(), TetScalars::Cell(_));
        let most = Extent { scalars: if of_cells { most.scalars } else { most.points }, ..most };
        Ok(Self { boxes, parts, space, ends: transfer.domain(), most, primitives, needs: Arc::default() })
    }

    /// Returns the number of parts.
    pub(crate) fn count(&self) -> usize {
        self.parts.len()
    }

    /// Returns the numbers of the parts in the order of compositing. Those that no pixel's line of a view can meet, behind the eye or before it,
    /// are left out, unless nothing would be left.
    pub(crate) fn order(&self, view: &View, push: &MeshPush, back_to_front: bool) -> Vec<u32> {
        let mut order = self.boxes.order(view);
        if back_to_front {
            order.reverse();
        }
        let may_meet = |&part: &u32| meets(push, self.parts[num::index(part)].bounds);
        let seen: Vec<u32> = order.iter().copied().filter(may_meet).collect();
        if seen.is_empty() { order[..1].to_vec() } else { seen }
    }

    /// Writes a part into staging buffers.
    fn write(&self, mesh: &Tets, part: u32, bytes: Vec<&mut [u8]>) {
        let Ok([points, scalars, words]) = <[&mut [u8]; 3]>::try_from(bytes) else { return };
        let part = &self.parts[num::index(part)];
        let place = |(bytes, &i): (&mut [u8], &u32)| {
            let point = local_point(&self.space, mesh.points()[num::index(i)]);
            bytes.copy_from_slice(bytemuck::bytes_of(&point));
        };
        points.par_chunks_exact_mut(16).zip(&part.points).for_each(place);
        let values = mesh.scalars().values();
        let of = if matches!(mesh.scalars(), TetScalars::Cell(_)) { &part.cells } else { &part.points };
        let scalar = |(bytes, &i): (&mut [u8], &u32)| {
            bytes.copy_from_slice(&stored(values[num::index(i)], self.ends).to_ne_bytes());
        };
        scalars.par_chunks_exact_mut(4).zip(of).for_each(scalar);
        let (used, rest) = words.split_at_mut((4 * part.words.len()).min(words.len()));
        used.copy_from_slice(bytemuck::cast_slice(&part.words));
        // Faces without a cell beside them are not drawn.
        rest.fill(0);
    }
}

impl Part {
    fn of_faces(
        mesh: &Tets,
        space: &LocalSpace,
        faces: &[&Face],
        sides: impl Fn(&Face) -> [bool; 2],
    ) -> Self {
        let points = Chosen::new(faces.iter().flat_map(|face| face.corners), mesh.points().len());
        let of_cells = matches!(mesh.scalars(), TetScalars::Cell(_));
        let both = |face: &&Face| [face.front, face.back].into_iter().filter(|&cell| cell != NONE);
        let beside = of_cells.then(|| Chosen::new(faces.iter().flat_map(both), mesh.cells().len()));
        let mut words = Vec::with_capacity(faces.len() * Primitives::Faces.words(of_cells));
        for face in faces {
            let corners = face.corners.map(|point| points.place(point));
            let own =
                |cell| beside.as_ref().filter(|_| cell != NONE).map_or(NONE, |beside| beside.place(cell));
            let face = face_words(corners, [own(face.front), own(face.back)], sides(face));
            words.extend_from_slice(if of_cells { &face } else { &face[..Primitives::Faces.words(false)] });
        }
        Self::new(mesh, space, &points, beside.map(|beside| beside.numbers()).unwrap_or_default(), words)
    }

    fn of_cells(mesh: &Tets, space: &LocalSpace, cells: &[u32]) -> Self {
        let corners = |cell: &u32| mesh.cells()[num::index(*cell)];
        let points = Chosen::new(cells.iter().flat_map(corners), mesh.points().len());
        let words = cells.iter().flat_map(|cell| {
            let mut corners = corners(cell).map(|point| points.place(point));
            corners.sort_unstable();
            corners
        });
        let of_cells = matches!(mesh.scalars(), TetScalars::Cell(_));
        let numbers = if of_cells { cells.to_vec() } else { Vec::new() };
        Self::new(mesh, space, &points, numbers, words.collect())
    }

    fn new(mesh: &Tets, space: &LocalSpace, points: &Chosen, cells: Vec<u32>, words: Vec<u32>) -> Self {
        let points = points.numbers();
        let place = |&point: &u32| {
            let [x, y, z, _] = local_point(space, mesh.points()[num::index(point)]);
            DVec3::new(x.into(), y.into(), z.into())
        };
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let bounds = points.iter().map(place).fold(none, |[low, high], p| [low.min(p), high.max(p)]);
        Self { points, cells, words, bounds }
    }
}

/// Cuts primitives into parts by their centroids.
fn cut<T: Copy + Send + Sync, const N: usize>(
    mesh: &Tets,
    primitives: &[T],
    count: u32,
    corners: impl Fn(&T) -> [u32; N] + Sync,
    part_of: impl Fn(&[T]) -> Part + Sync,
) -> (Boxes, Vec<Part>, u32) {
    let middle = |primitive: &T| {
        let places = corners(primitive).map(|i| mesh.points()[num::index(i)]);
        places.into_iter().sum::<DVec3>() / num::f64_of(N)
    };
    let every = primitives.len().div_ceil(MOST_SAMPLES).max(1);
    let mut sampled: Vec<_> = primitives.iter().step_by(every).map(|one| (middle(one), 1.0)).collect();
    let boxes = Boxes::new(&mut sampled, count);
    drop(sampled);
    let numbers: Vec<u32> = primitives.par_iter().map(|one| boxes.holding(middle(one))).collect();
    let mut members = vec![Vec::new(); boxes.boxes().len()];
    for (number, one) in numbers.iter().zip(primitives) {
        members[num::index(*number)].push(*one);
    }
    drop(numbers);
    let parts = members.into_par_iter().map(|members| part_of(&members)).collect();
    (boxes, parts, num::count(primitives.len()))
}

/// Returns whether a pixel's line of a view may meet a box, in coordinates relative to the mesh: no side of the image has all of it beyond.
fn meets(push: &MeshPush, [low, high]: [DVec3; 2]) -> bool {
    let row = |row: [f32; 4], p: DVec3| {
        let [x, y, z, w] = row.map(f64::from);
        p.dot(DVec3::new(x, y, z)) + w
    };
    let corners: [DVec3; 8] = std::array::from_fn(|i| {
        DVec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] }))
    });
    let beyond = |offset: [f32; 4], half: f32, sign: f64| {
        corners.iter().all(|&p| {
            let w = f64::from(push.w0)
                + f64::from(push.w1) * row([push.forward[0], push.forward[1], push.forward[2], 0.0], p);
            let at = sign * row(offset, p);
            // A pixel's thousandth and what places may be rounded by.
            at > f64::from(half + 1e-3) * f64::from(push.pixel) * w.abs() + 1e-5 * (1.0 + at.abs())
        })
    };
    let [width, height] = push.half_extent;
    let sides = [(push.right, width), (push.up, height)];
    low.cmple(high).all()
        && !sides.iter().any(|&(row, half)| beyond(row, half, 1.0) || beyond(row, half, -1.0))
}

/// The buffers of one part on the device: points, scalars and primitives.
#[derive(Debug)]
pub(crate) struct PartSlot {
    parts: Arc<MeshParts>,
    held: PartBuffers,
}

impl PartSlot {
    pub(crate) fn new(gpu: &Gpu, parts: &Arc<MeshParts>) -> Result<Self> {
        let Extent { points, scalars, words } = parts.most;
        let of = [("mesh.points", 4 * points), ("mesh.scalars", scalars), ("mesh.primitives", words)];
        let held = PartBuffers::new(gpu, &of.map(|(name, words)| (name, 4 * num::wide(words))))?;
        Ok(Self { parts: Arc::clone(parts), held })
    }

    /// Returns the numbers of points and primitives that the buffers have room for, where a primitive takes so many words.
    pub(crate) fn room(&self, primitive: usize) -> [u32; 2] {
        let Extent { points, words, .. } = self.parts.most;
        [num::count(points), num::count(words / primitive)]
    }

    /// Returns the buffers of points, scalars and primitives.
    pub(crate) fn buffers(&self) -> [&Arc<Buffer>; 3] {
        [0, 1, 2].map(|i| &self.held.buffers[i])
    }

    /// Writes a part where the host does ([`PartBuffers::stage`]).
    pub(crate) fn stage(&mut self, mesh: &Tets, part: u32, begins: bool) -> bool {
        let parts = &self.parts;
        self.held.stage(part, begins, |bytes| parts.write(mesh, part, bytes))
    }

    /// Records the upload of the staged part.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, begins: bool) {
        self.held.record(recorder, begins);
    }
}
