//! The visibility order of a frame's primitives: points as the view sees them, boxes, keys and the sort (`glsl/mesh/mesh-rank.glsl`).

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::shader::{
    Coverage, MESH_RANK_BOXES, MESH_RANK_POINTS, MeshRankBoxes, MeshRankPoints, STATUS_WORDS,
};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, BufferUse, Gpu, Recorder};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::{Bins, Ranked};
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};
use crate::primitives::radix_sort::RadixSort;
use crate::resident::mesh::Primitives;

/// Faces or cells on the device.
#[derive(Debug)]
pub(crate) struct Geometry {
    pub(crate) kind: Primitives,
    /// Points relative to the centre of the data, in radii.
    pub(crate) points: Arc<Buffer>,
    pub(crate) point_count: u32,
    pub(crate) scalars: Arc<Buffer>,
    /// Whether scalars belong to cells; else they belong to points.
    pub(crate) cell_scalars: bool,
    pub(crate) primitives: Arc<Buffer>,
    pub(crate) count: u32,
}

/// Projects points, finds the pixels that each primitive may cover, and sorts primitives by rank.
///
/// None of its buffers depends on the capacities that a view needs.
#[derive(Debug)]
pub(crate) struct Ranking {
    pub(crate) name: &'static str,
    pub(crate) kind: Primitives,
    /// Whether scalars belong to cells; else they belong to points.
    pub(crate) cell_scalars: bool,
    pub(crate) back_to_front: bool,
    /// Sort key of each primitive.
    pub(crate) keys: Arc<Buffer>,
    points: Dispatch,
    boxes: Dispatch,
    sort: RadixSort,
    /// View coordinates of each point.
    pub(crate) view_points: Arc<Buffer>,
    pub(crate) primitives: Arc<Buffer>,
    pub(crate) scalars: Arc<Buffer>,
    /// Primitives by rank.
    pub(crate) order: Arc<Buffer>,
    /// Pixels that each primitive may cover.
    pub(crate) boxed: Arc<Buffer>,
    /// Planes of faces, with `by_planes`.
    pub(crate) planes: Arc<Buffer>,
    /// Whether lines meet faces by their planes.
    pub(crate) by_planes: bool,
    /// Counters of the frame: see the `STATUS_` constants.
    pub(crate) status: Arc<Buffer>,
    pub(crate) count: u32,
    point_count: u32,
    /// Primitives by rank from the host; without it the device sorts.
    given: Option<Arc<Buffer>>,
}

/// Stores ranks from the host; each frame copies them.
fn given_order(gpu: &Gpu, order: &[u32]) -> Result<Arc<Buffer>> {
    let bytes: &[u8] = bytemuck::cast_slice(order);
    let mut buffer = Buffer::new(gpu, "order.given", num::wide(bytes.len()).max(4), BufferUse::Upload)?;
    if let Some(place) = buffer.bytes_mut().and_then(|place| place.get_mut(..bytes.len())) {
        place.copy_from_slice(bytes);
    }
    Ok(Arc::new(buffer))
}

impl Ranking {
    /// Ranks the primitives of `geometry` by `order_given`, or on the device by the distance of their centroids.
    pub(crate) fn new(
        gpu: &Gpu,
        name: &'static str,
        geometry: Geometry,
        back_to_front: bool,
        order_given: Option<&[u32]>,
    ) -> Result<Self> {
        let Geometry { kind, points, point_count, scalars, cell_scalars, primitives, count } = geometry;
        let view_points = buffer(gpu, "view.points", 4 * u64::from(point_count))?;
        let keys = buffer(gpu, "order.keys", count.into())?;
        let order = buffer(gpu, "order", count.into())?;
        let boxed = buffer(gpu, "boxes", 2 * u64::from(count))?;
        // Scalars of cells are met at corners. So are faces so many that planes take much memory: each covers few pixels.
        let words = 8 * u64::from(count);
        let fit = 4 * words <= gpu.most_bound_bytes();
        let by_planes = kind == Primitives::Faces && !cell_scalars && fit;
        let planes = buffer(gpu, "planes", if by_planes { words } else { 0 })?;
        let status = buffer(gpu, "status", STATUS_WORDS.into())?;
        let points = MESH_RANK_POINTS.with(&MeshRankPoints {
            mesh_points: points.read(),
            mesh_scalars: scalars.read(),
            view_points: view_points.write(),
            cell_scalars,
        });
        let boxes = MESH_RANK_BOXES.with(&MeshRankBoxes {
            primitives: primitives.read(),
            view_points: view_points.read(),
            rank_keys: keys.write(),
            order: order.write(),
            boxes: boxed.write(),
            status: status.write(),
            planes: planes.write(),
            by_planes,
            cell_scalars,
            cells: kind == Primitives::Cells,
            back_to_front,
        });
        Ok(Self {
            name,
            kind,
            cell_scalars,
            back_to_front,
            points: pass(gpu, &format!("{name}.points"), &points)?,
            boxes: pass(gpu, &format!("{name}.boxes"), &boxes)?,
            sort: RadixSort::new(gpu, &format!("{name}.sort"), [&keys, &order], count)?,
            view_points,
            primitives,
            scalars,
            keys,
            order,
            boxed,
            planes,
            by_planes,
            status,
            count,
            point_count,
            given: order_given.map(|order| given_order(gpu, order)).transpose()?,
        })
    }

    /// Makes bins of the ranked primitives for an image of `tiles` tiles. With `flagged` they hold only primitives whose box
    /// contains a marked pixel.
    pub(crate) fn bins(&self, gpu: &Gpu, tiles: u32, capacity: u32, flagged: bool) -> Result<Arc<Bins>> {
        Bins::new(gpu, self.name, &self.ranked(), tiles, capacity, flagged).map(Arc::new)
    }

    /// Returns the inputs of shaders that find the pixels of primitives.
    pub(crate) fn coverage(&self) -> Coverage {
        Coverage {
            mesh_scalars: self.scalars.read(),
            primitives: self.primitives.read(),
            view_points: self.view_points.read(),
            planes: self.planes.read(),
            cells: self.kind == Primitives::Cells,
        }
    }

    /// Returns the ranked primitives, for bins.
    pub(crate) fn ranked(&self) -> Ranked {
        Ranked {
            order: Arc::clone(&self.order),
            boxes: Arc::clone(&self.boxed),
            status: Arc::clone(&self.status),
            keys: Arc::clone(&self.keys),
            scratch: Arc::clone(&self.sort.scratch),
            count: self.count,
        }
    }

    /// Records every step: points, boxes and keys, order.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.clear_status(recorder);
        self.record_ranks(recorder, push);
    }

    /// Records the same for a further part of a mesh, whose status adds to that of the parts before.
    pub(crate) fn record_ranks(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        self.record_points(recorder, push);
        self.record_boxes(recorder, push);
        self.record_order(recorder);
    }

    pub(crate) fn clear_status(&self, recorder: &mut Recorder<'_>) {
        recorder.clear_buffer("status.clear", &self.status);
    }

    /// Projects points to view coordinates.
    pub(crate) fn record_points(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        let push = MeshPush { count: self.point_count, ..*push };
        self.points.record(recorder, &push, groups_of(self.point_count, 64));
    }

    /// Finds the pixels that each primitive may cover, and its sort key.
    pub(crate) fn record_boxes(&self, recorder: &mut Recorder<'_>, push: &MeshPush) {
        let push = MeshPush { count: self.count, ..*push };
        self.boxes.record(recorder, &push, groups_of(self.count, 64));
    }

    /// Sorts primitives by their keys, or copies the order from the host.
    pub(crate) fn record_order(&self, recorder: &mut Recorder<'_>) {
        match &self.given {
            Some(order) => recorder.copy_buffer("order", order, &self.order, self.order.size()),
            None => self.sort.record(recorder),
        }
    }

    /// Declares that an earlier submission has ranked the primitives.
    pub(crate) fn assume_order(&self, recorder: &mut Recorder<'_>) {
        let last = if self.given.is_some() { Use::TransferWrite } else { Use::ComputeReadWrite };
        recorder.assume_buffer_after(&self.order, last);
    }

    /// Replaces the ranks from the host. Returns `false`, and changes nothing, while a recording reads the old ones.
    pub(crate) fn give_order(&mut self, order: &[u32]) -> bool {
        let bytes: &[u8] = bytemuck::cast_slice(order);
        let place = self.given.as_mut().and_then(Arc::get_mut).and_then(Buffer::bytes_mut);
        let place = place.and_then(|place| place.get_mut(..bytes.len()));
        let Some(place) = place else { return false };
        place.copy_from_slice(bytes);
        true
    }
}
