//! Surfaces in the volume (`glsl/frame/surfaces.glsl`): lists the triangles that each pixel's ray meets, as lists of a mesh's faces are made,
//! and sorts them by depth.
//!
//! The nearest opaque triangle bounds the ray of every technique, and shows through the part of the volume in front of it. Translucent
//! triangles in front of it become lists of depths and colours, for techniques that can split rays at them. Clipping does not apply to
//! surfaces.
//!
//! An edge belongs to one of the triangles that share it, in every view, as in meshes. Points at the same position are one.

use std::sync::{Arc, PoisonError};

use ash::vk;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::frame::depth_measure::{DepthMeasure, PixelRays};
use crate::frame::lists::{Band, Geometry, Hits, Lists, Measured, Ranking, measure, measure_lists};
use crate::frame::prepared::Outcome;
use crate::frame::target::{Layers, TargetDesc, usage_after};
use crate::gpu::shader::{
    MOST_LAYERS, STATUS_CUT, STATUS_LOST, STATUS_WORDS, SURFACES_BEHIND, SURFACES_RESOLVE, SurfacesBehind,
    SurfacesResolve, TILE, TILE_PIXELS,
};
use crate::gpu::{Buffer, Gpu, Image, ImageDesc, Recorder};
use crate::interface::{MeshPush, SurfacePush};
use crate::num::{self, f32_of};
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, tiles_of, total, words};
use crate::resident::mesh::{Needs, Primitives};
use crate::resident::surfaces::SurfaceData;
use crate::scene::View;

const NAME: &str = "surfaces";

// havs.glsl counts the surfaces already composited in 10 bits.
const _: () = assert!(MOST_LAYERS < 1 << 10);

/// Most difference between the depth in a list and that of the triangle's plane, which grows when the plane is seen edge-on, in radii of
/// the data.
const SLACK: f64 = 1e-3;

/// The lists of triangles of each pixel, and the buffers that the sorted surfaces are written to.
#[derive(Debug)]
pub(crate) struct SurfaceLists {
    data: Arc<SurfaceData>,
    stage: Ranking,
    band: Band,
    hits: Arc<Hits>,
    lists: Lists,
    needs: Needs,
    push: MeshPush,
    tiles: u32,
    layers: Layers,
    background: Arc<Buffer>,
}

/// The passes of a frame's surfaces.
#[derive(Debug)]
pub(crate) struct SurfaceFrame {
    lists: SurfaceLists,
    resolve: Dispatch,
    push: SurfacePush,
    measure: DepthMeasure,
    outcome: Arc<SurfaceOutcome>,
    behind: Dispatch,
    /// The image of volume and surfaces.
    pub(crate) image: Arc<Image>,
}

/// The status of the surfaces of a frame that has ended.
#[derive(Debug)]
struct SurfaceOutcome {
    data: Arc<SurfaceData>,
    status: Arc<Buffer>,
    bins: Arc<Buffer>,
    lists: Arc<Buffer>,
    capacities: Needs,
}

impl Outcome for SurfaceOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let status = words(&self.status.host_copy()?);
        let at = |word: u32| status.get(num::index(word)).copied().unwrap_or(0);
        if at(STATUS_CUT) > 0 {
            return Err(Error::unsupported(
                "surfaces of this view",
                format!(
                    "more than {MOST_LAYERS} translucent surfaces, or more triangles than loops have turns for, in {} pixels",
                    at(STATUS_CUT)
                ),
            ));
        }
        let (bins, lists) = (total(&self.bins)?, total(&self.lists)?);
        let fits = bins <= u64::from(self.capacities.bins)
            && lists <= u64::from(self.capacities.lists)
            && at(STATUS_LOST) == 0;
        let mut needs = self.data.needs.lock().unwrap_or_else(PoisonError::into_inner);
        needs.bins = needs.bins.max(u32::try_from(bins).unwrap_or(u32::MAX));
        needs.lists = needs.lists.max(u32::try_from(lists).unwrap_or(u32::MAX));
        Ok((fits, vec![("surface_fragments", lists)]))
    }
}

impl SurfaceLists {
    /// Builds the lists for the image of a view.
    pub(crate) fn new(gpu: &Gpu, data: &Arc<SurfaceData>, view: &View) -> Result<Self> {
        let geometry = Geometry {
            kind: Primitives::Faces,
            points: Arc::clone(&data.points),
            point_count: data.point_count,
            scalars: Arc::clone(&data.numbers),
            cell_scalars: true,
            primitives: Arc::clone(&data.primitives),
            count: num::count(data.triangles.len()),
        };
        // Triangles are listed by rank, so that the list of a pixel is nearly sorted.
        let stage = Ranking::new(gpu, NAME, geometry, false, None)?;
        let push = data.space.push(view, &MeshPush::default())?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);
        let known = data.needs.lock().unwrap_or_else(PoisonError::into_inner).lists;
        let Measured { mut needs, bins, bands } =
            measure(gpu, &stage, &data.needs, &push, [tiles, across], false)?;
        let &[band] = &bands[..] else {
            return Err(Error::unsupported(
                "surfaces of this view",
                format!("the pairs of a tile and a triangle exceed one buffer: they fill {}", bands.len()),
            ));
        };
        let hits = Hits::new(gpu, &stage, bins, None)?;
        needs.lists = measure_lists(gpu, &stage, &hits, &push, band, known)?;
        let lists = Lists::new(gpu, &stage, &hits, bands, needs.lists, None)?;
        // Opaque triangles need no entry.
        let layers = if data.translucent { u64::from(lists.capacity) } else { 1 };
        let layers = Layers {
            cursors: Arc::clone(&lists.cursors),
            ends: buffer(gpu, "surfaces.ends", u64::from(tiles) * u64::from(TILE_PIXELS))?,
            colours: buffer(gpu, "surfaces.layers", 4 * layers)?,
            depths: Arc::clone(&lists.entries),
        };
        let background = buffer(gpu, "surfaces.background", 4 * u64::from(width) * u64::from(height))?;
        Ok(Self { data: Arc::clone(data), stage, band, hits, lists, needs, push, tiles, layers, background })
    }

    /// The translucent surfaces as techniques read them, if there are any.
    pub(crate) fn layers(&self) -> Option<Layers> {
        self.data.translucent.then(|| self.layers.clone())
    }
}

impl SurfaceFrame {
    /// Builds the passes for a technique's measure of depth. They narrow `bounds`, which a depth image has filled where the target
    /// has one, and composite the technique's image, `drawn`, in front of the opaque surfaces, into an image of its own.
    pub(crate) fn new(
        gpu: &Gpu,
        lists: SurfaceLists,
        view: &View,
        target: &TargetDesc,
        bounds: &Arc<Buffer>,
        drawn: &Arc<Image>,
        measured: &DepthMeasure,
    ) -> Result<Self> {
        let planes = lists.data.planes(measured.centre, measured.unit);
        let planes = Buffer::with_data(gpu, "surfaces.planes", bytemuck::cast_slice(&planes))?;
        let resolve = SURFACES_RESOLVE.with(&SurfacesResolve {
            cursors: lists.lists.cursors.read(),
            lists: lists.layers.depths.write(),
            status: lists.stage.status.write(),
            triangles: planes.read(),
            line_bounds: bounds.write(),
            layers: lists.layers.colours.write(),
            layer_ends: lists.layers.ends.write(),
            background: lists.background.write(),
            bounded: target.depth,
        });
        let resolve = pass(gpu, "surfaces.resolve", &resolve)?;
        let outcome = SurfaceOutcome {
            data: Arc::clone(&lists.data),
            status: download(gpu, "surfaces.status", 4 * u64::from(STATUS_WORDS))?,
            bins: download(gpu, "surfaces.bins.total", 8)?,
            lists: download(gpu, "surfaces.lists.total", 8)?,
            capacities: lists.needs,
        };
        let usage = vk::ImageUsageFlags::STORAGE | usage_after(gpu, target, false);
        let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, view.extent(), usage);
        let image = Arc::new(Image::new(gpu, "surfaces.image", &desc)?);
        let behind = SURFACES_BEHIND.with(&SurfacesBehind {
            source: drawn.sampled(vk::Filter::NEAREST),
            accumulation: image.stored(),
            background: lists.background.read(),
        });
        let mut frame = Self {
            lists,
            resolve,
            push: SurfacePush::default(),
            measure: *measured,
            outcome: Arc::new(outcome),
            behind: pass(gpu, "surfaces.behind", &behind)?,
            image,
        };
        frame.push = frame.push_of(view)?;
        Ok(frame)
    }

    /// Returns the push constants that change with the view, for another view of the same extent.
    pub(crate) fn pushes(&self, view: &View) -> Result<(MeshPush, SurfacePush)> {
        Ok((self.lists.data.space.push(view, &self.lists.push)?, self.push_of(view)?))
    }

    /// Changes to that view.
    pub(crate) fn set_view(&mut self, pushes: (MeshPush, SurfacePush)) {
        (self.lists.push, self.push) = pushes;
    }

    fn push_of(&self, view: &View) -> Result<SurfacePush> {
        let DepthMeasure { centre, unit } = self.measure;
        let space = &self.lists.data.space;
        let PixelRays { foot, kq, scale, centre_depth } = self.measure.rays(view);
        let perspective = view.is_perspective();
        let pack = |v: DVec3, w: f64| num::vec3_of(v).extend(f32_of(w)).to_array();
        let push = SurfacePush {
            q0_kq: pack(foot / unit, kq),
            right_kd: pack(view.across() * scale, if perspective { 1.0 } else { 0.0 }),
            up_near: pack(view.up() * scale, if perspective { -centre_depth / unit } else { -3e38 }),
            forward_ratio: pack(view.ahead(), space.radius / unit),
            half_extent: view.half_extent(),
            offset: f32_of((space.centre - centre).dot(view.forward()) / unit),
            capacity: self.lists.lists.capacity,
            across: view.extent()[0].div_ceil(TILE),
            tiles: self.lists.tiles,
            slack: f32_of(SLACK * space.radius / unit),
            pad0: 0,
        };
        let numbers = [push.q0_kq, push.right_kd, push.up_near, push.forward_ratio];
        if numbers.iter().flatten().chain([&push.offset]).all(|number| number.is_finite()) {
            return Ok(push);
        }
        let why = "surfaces or the camera are so far from the data that float32 cannot hold their distance";
        Err(Error::invalid("view", why))
    }

    /// Records the passes that find the surfaces of each ray, after the bounds by the depth image.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>) {
        let SurfaceLists { stage, band, hits, lists, push, tiles, .. } = &self.lists;
        stage.record(recorder, push);
        hits.record(recorder, push, *band, Some(&self.outcome.bins));
        lists.record_count(recorder, push, *band, false);
        lists.record_places(recorder, 0, Some(&self.outcome.lists));
        lists.record_fill(recorder, push, *band);
        self.resolve.record(recorder, &self.push, groups_of(*tiles, 1));
        let bytes = self.outcome.status.size();
        recorder.copy_buffer("surfaces.status", &stage.status, &self.outcome.status, bytes);
        recorder.release_to_host(&self.outcome.status);
    }

    /// Records the pass after the technique that composites its image in front of the opaque surfaces.
    pub(crate) fn record_behind(&self, recorder: &mut Recorder<'_>) {
        let [width, height, _] = self.image.desc().extent;
        self.behind.record(recorder, &[0_u8; 0], tiles_of([width, height]));
    }

    /// The status of a frame, to be read when it has ended.
    pub(crate) fn outcome(&self) -> Arc<dyn Outcome> {
        Arc::clone(&self.outcome) as _
    }
}
