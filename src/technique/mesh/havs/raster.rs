//! The raster routes of `havs`: each face is drawn once, by rank, and a k-buffer in storage images sorts its fragments
//! (`havs-raster.glsl`).
//!
//! Fragments of one pixel must read and write its k-buffer one after the other, in the order of ranks:
//!
//! - `interlock`: `VK_EXT_fragment_shader_interlock` guarantees it, with the mode `pixel_interlock_ordered`.
//! - `implementation-ordered` relies on a driver whose rasteriser is known to work so: Mesa's llvmpipe gives a tile of
//!   the image to one thread, which takes its triangles in order. Vulkan does not promise it, so this route is never
//!   chosen automatically.
//!
//! One dispatch at the end empties the k-buffers. Unsorted pixels are flagged; with `repair=exact` only they get lists,
//! and are drawn as by the route `compute`. So are pixels in which cells overlap.

use std::sync::Arc;

use ash::vk;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::{Hits, Measured, Ranking, measure};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::shader::{
    FLAG_UNSORTED, HAVS_RASTER_EMPTY, HAVS_RASTER_IMPLEMENTATION, HAVS_RASTER_INTERLOCK, HAVS_RASTER_VERTEX,
    HavsRasterEmpty, HavsRasterInterlock, HavsRasterVertex, STATUS_NAN_KEYS, STATUS_OVERFLOW_PIXELS,
    STATUS_WORDS, TILE, TILE_PIXELS,
};
use crate::gpu::{
    Blend, Bound, Buffer, Descriptors, Gpu, GraphicsState, Image, OptionalFeature, Pipeline, Recorder,
    TargetImage,
};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, words};
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::scene::View;
use crate::technique::declare::Value as _;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::flagged::FlaggedFrame;
use crate::technique::mesh::havs::options::KBufferRoute;
use crate::technique::mesh::list_inputs::{FORMAT, ListInputs, ListShader, Shading, kbuffer_images};
use crate::technique::mesh::outcome::MeshOutcome;
use crate::technique::mesh::overlaps::Overlaps;
use crate::technique::mesh::repairs::Repairs;
use crate::technique::mesh::shading::shading_push;

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct RasterFrame {
    space: LocalSpace,
    /// The box around the mesh.
    bounds: [DVec3; 2],
    push: MeshPush,
    extent: [u32; 2],
    tiles: u32,
    /// 2 where faces behind the eye are drawn too, else 1.
    lobes: u32,
    route: KBufferRoute,
    ranking: Ranking,
    draw: (Arc<Pipeline>, Arc<Descriptors>),
    empty: Dispatch,
    repair: Option<Repairs>,
    overlaps: Option<Overlaps>,
    image: Arc<Image>,
    flags: Arc<Buffer>,
    outcome: Arc<RasterOutcome>,
}

/// The status of a frame, and the outcome of its repairs.
#[derive(Debug)]
struct RasterOutcome {
    status: Arc<Buffer>,
    primitives: u32,
    repair: Option<MeshOutcome>,
}

impl Outcome for RasterOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        if let Some(repair) = &self.repair {
            return repair.read();
        }
        let status = words(&self.status.host_copy()?);
        let at = |word: u32| u64::from(status.get(num::index(word)).copied().unwrap_or(0));
        let counters = vec![
            ("primitives", u64::from(self.primitives)),
            ("kbuffer_overflow_pixels", at(STATUS_OVERFLOW_PIXELS)),
            ("nan_keys", at(STATUS_NAN_KEYS)),
        ];
        Ok((true, counters))
    }
}

/// Refuses a raster route that the device does not offer.
///
/// # Errors
///
/// [`Error::Unsupported`] with the missing feature.
fn check_route(gpu: &Gpu, route: KBufferRoute, name: &str) -> Result<()> {
    let (feature, missing) = match route {
        KBufferRoute::Interlock => {
            (OptionalFeature::FragmentInterlock, "fragmentShaderPixelInterlock; route=compute works")
        }
        _ => (
            OptionalFeature::OrderedStores,
            "a driver that is known to keep fragments' stores in order; route=compute works",
        ),
    };
    let what = || format!("{name} route={}", route.word());
    if !gpu.has(OptionalFeature::FragmentStores) {
        return Err(Error::unsupported(what(), "fragmentStoresAndAtomics; route=compute works"));
    }
    if gpu.has(feature) { Ok(()) } else { Err(Error::unsupported(what(), missing)) }
}

/// Refuses more faces than one draw has vertices for.
fn check_faces(name: &str, route: KBufferRoute, faces: u32) -> Result<()> {
    // Shaders count vertices in signed numbers.
    if u64::from(faces) * 3 <= u64::from(u32::MAX / 2) {
        return Ok(());
    }
    Err(Error::unsupported(
        format!("{name} route={}", route.word()),
        format!("{faces} faces in one draw; route=compute works"),
    ))
}

/// Binds the shaders that draw faces.
fn draw_shaders(route: KBufferRoute, ranking: &Ranking, list: &ListInputs<'_>) -> Bound {
    let fragment = match route {
        KBufferRoute::Interlock => HAVS_RASTER_INTERLOCK,
        _ => HAVS_RASTER_IMPLEMENTATION,
    };
    let vertex = HAVS_RASTER_VERTEX.with(&HavsRasterVertex {
        boxes: ranking.boxed.read(),
        mesh_scalars: ranking.scalars.read(),
        order: ranking.order.read(),
        planes: ranking.planes.read(),
        primitives: ranking.primitives.read(),
        view_points: ranking.view_points.read(),
        by_planes: list.by_planes,
        cell_scalars: list.cell_scalars,
    });
    vertex.and(fragment.with(&HavsRasterInterlock {
        flags: list.flags.write(),
        k: list.k,
        by_planes: list.by_planes,
        cell_scalars: list.cell_scalars,
        bounded: list.shading.bounded.clone(),
        havs_sweep: list.sweep(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
        sweep_images: list.images(),
    }))
}

/// Binds the shader that empties the k-buffers.
fn empty_shader(list: &ListInputs<'_>) -> Bound {
    HAVS_RASTER_EMPTY.with(&HavsRasterEmpty {
        flags: list.flags.write(),
        status: list.status.write(),
        k: list.k,
        cell_scalars: list.cell_scalars,
        bounded: list.shading.bounded.clone(),
        havs_sweep: list.sweep(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
        sweep_images: list.images(),
    })
}

impl RasterFrame {
    /// Prepares frames of one view size.
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        desc: MeshDesc,
        route: KBufferRoute,
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let name = desc.name;
        check_route(gpu, route, name)?;
        target.refuse_layers(&format!("{name} route={}", route.word()), "route=compute")?;
        gpu.check_drawing(name, view.extent())?;
        let mesh = scene.mesh()?;
        let data = scene.mesh_data();
        let space = LocalSpace::of(mesh);
        let knots = scene.knots()?;
        let push = space.push(view, &shading_push(scene, &desc, &knots)?)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);
        let ranking = desc.rank_primitives(scene, &data, None)?;
        check_faces(name, route, ranking.count)?;

        let image = own_image(gpu, name, FORMAT, vk::ImageUsageFlags::STORAGE, view, target)?;
        let flags = buffer(gpu, "flags", u64::from(tiles) * u64::from(TILE_PIXELS))?;
        let kbuffer = kbuffer_images(gpu, desc.k, view.extent())?;

        let shading = Shading::new(scene, &desc.options.segments, target)?;
        let list = ListInputs {
            shading: &shading,
            // Only repairs have lists, of their own.
            cursors: &flags,
            lists: &flags,
            status: &ranking.status,
            flags: &flags,
            image: &image,
            kbuffer: &kbuffer,
            cell_scalars: ranking.cell_scalars,
            by_planes: ranking.by_planes,
            back_to_front: desc.options.back_to_front(),
            eye_inside: true,
            k: desc.k,
            listed: FLAG_UNSORTED,
        };
        let bound = draw_shaders(route, &ranking, &list);
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            blend: Blend::Copy,
            format: None,
        };
        let pipeline = gpu.graphics_pipeline(&format!("{name}.draw"), &bound, state)?;
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &bound)?);
        let empty = pass(gpu, &format!("{name}.empty"), &empty_shader(&list))?;

        let status = download(gpu, "status", 4 * u64::from(STATUS_WORDS))?;
        let mut outcome = RasterOutcome { status, primitives: ranking.count, repair: None };
        let mut repair = None;
        let mut overlaps = None;
        if let Some(shader) = desc.repair {
            let frame =
                FlaggedFrame { scene, data: &data, desc: &desc, push: &push, tiles, across, drawn: &list };
            (repair, overlaps) = outcome.add_repairs(&frame, shader, &ranking)?;
        }
        let mut frame = Self {
            space,
            bounds: mesh.bounds(),
            push,
            extent: view.extent(),
            tiles,
            lobes: 1,
            route,
            outcome: Arc::new(outcome),
            ranking,
            draw: (pipeline, descriptors),
            empty,
            repair,
            overlaps,
            image,
            flags,
        };
        frame.lobes = frame.lobes_of(view);
        Ok(frame)
    }

    /// Returns the number of lobes of the projection that a view needs.
    ///
    /// A ray that begins inside the mesh starts in a cell that only the faces behind the eye can name.
    fn lobes_of(&self, view: &View) -> u32 {
        let eye = view.camera().eye;
        // Float32 moves points by less.
        let margin = DVec3::splat(1e-5 * self.space.radius);
        let inside = eye.cmpge(self.bounds[0] - margin).all() && eye.cmple(self.bounds[1] + margin).all();
        if view.is_perspective() && inside { 2 } else { 1 }
    }
}

impl RasterOutcome {
    /// Builds the passes that draw unsorted pixels again, and, once a frame has met overlaps, those that draw these.
    fn add_repairs(
        &mut self,
        frame: &FlaggedFrame<'_>,
        shader: ListShader,
        ranking: &Ranking,
    ) -> Result<(Option<Repairs>, Option<Overlaps>)> {
        let FlaggedFrame { scene, data, desc, push, tiles, across, drawn } = *frame;
        let gpu = scene.gpu();
        let known = data.needs(desc.primitives);
        let Measured { needs, bins, bands } = measure(gpu, ranking, known, push, [tiles, across], true)?;
        let hits = Hits::new(gpu, ranking, bins, Some((drawn.flags, drawn.listed)))?;
        let status = Arc::clone(&self.status);
        let mut outcome = MeshOutcome::new(gpu, known, desc, status, [bands.len(); 2], needs, ranking.count)?;
        let repairs = Repairs::new(frame, shader, ranking, hits, bands, needs)?;
        let mut overlaps = None;
        if needs.overlaps {
            let found = Overlaps::new(frame)?;
            outcome.overlaps = Some(found.outcome());
            overlaps = Some(found);
        }
        self.repair = Some(outcome);
        Ok((Some(repairs), overlaps))
    }
}

impl Prepared for RasterFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        self.push = self.space.push(view, &self.push)?;
        self.lobes = self.lobes_of(view);
        Ok(true)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure::of_frame(&self.space)
    }

    fn image(&self) -> Option<&Arc<Image>> {
        Some(&self.image)
    }

    fn route(&self) -> &'static str {
        self.route.word()
    }

    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        Err("route=compute tells them")
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        vec![("tiles", self.tiles.into())]
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        self.ranking.record(recorder, &self.push);
        // A flag of 0 says that the images hold nothing of the pixel, so they need no clear.
        recorder.clear_buffer("flags.clear", &self.flags);
        let push = MeshPush { number: self.lobes, ..self.push };
        let (pipeline, descriptors) = &self.draw;
        recorder.draw_each(
            pipeline.name(),
            pipeline,
            descriptors,
            vec![bytemuck::bytes_of(&push).to_vec()],
            self.extent,
            3 * self.ranking.count,
        );
        let push = MeshPush { count: self.tiles, ..self.push };
        self.empty.record(recorder, &push, groups_of(self.tiles, 1));
        if let (Some(repair), Some(outcome)) = (&self.repair, &self.outcome.repair) {
            repair.record_all(recorder, &self.push, outcome);
        }
        if let Some(overlaps) = &self.overlaps {
            overlaps.record(recorder, &self.push);
        }
        let status = &self.outcome.status;
        recorder.copy_buffer("status", &self.ranking.status, status, status.size());
        recorder.release_to_host(status);
    }
}
