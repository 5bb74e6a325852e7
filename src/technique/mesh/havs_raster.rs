//! The raster routes of `havs`: each face drawn once, by rank, through a k-buffer in four storage images
//! (`glsl/havs-raster.glsl`).
//!
//! Fragments of one pixel must read and write its k-buffer one after the other, in the order of ranks:
//!
//! - `interlock` has it by `VK_EXT_fragment_shader_interlock`, ordered by pixel.
//! - `implementation-ordered` relies on a driver whose rasteriser is known to work so: Mesa's llvmpipe gives a tile of the
//!   image to one thread, which works through its triangles in their order. Vulkan does not promise it, so nobody gets this
//!   route without asking.
//!
//! What remains in the k-buffer is taken out by one dispatch at the end. Pixels that were not sorted are flagged, and with
//! `repair=exact` lists are made of them alone and drawn as by the route `compute`; so are pixels in which cells overlap.

use std::sync::Arc;

use ash::vk;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::{Lists, Stage, measure};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BOXES, BINDING_CURSORS, BINDING_FLAGS, BINDING_KBUFFER_0,
    BINDING_KBUFFER_1, BINDING_KBUFFER_2, BINDING_KBUFFER_3, BINDING_LISTS, BINDING_MESH_SCALARS,
    BINDING_ORDER, BINDING_PRIMITIVES, BINDING_STATUS, BINDING_VIEW_POINTS, HAVS_RASTER_EMPTY,
    HAVS_RASTER_IMPLEMENTATION, HAVS_RASTER_INTERLOCK, HAVS_RASTER_VERTEX, SPEC_INTEGRATOR, SPEC_K,
    SPEC_KNOT_WALK, SPEC_LAST_CHUNK, SPEC_REPAIR, SPEC_RESUME, STATUS_NAN_KEYS, STATUS_OVERFLOW_PIXELS,
    STATUS_WORDS, TILE, TILE_PIXELS,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Blend, Buffer, Descriptors, Gpu, GraphicsDesc, Image, ImageDesc, OptionalFeature, Pipeline, Recorder,
    Resource, SpecConstant, TargetImage,
};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, words};
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::resident::mesh::{MeshData, Needs};
use crate::resident::tables::{Knots, Table};
use crate::scene::View;
use crate::technique::mesh::frame::MeshOutcome;
use crate::technique::mesh::overlaps::Overlaps;
use crate::technique::mesh::shading::{
    MeshDesc, REPAIR_K, constants, only_flagged, shading, shading_push, stage,
};
use crate::technique::options::Choice;

/// How faces come to pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KBufferRoute {
    /// By compute.
    Auto,
    /// Lists of each pixel's faces, and the k-buffer in registers.
    Compute,
    /// Rasterised, the k-buffer in storage images, fragments ordered by `VK_EXT_fragment_shader_interlock`.
    Interlock,
    /// The same without the extension, on drivers that are known to order fragments' stores. Vulkan does not promise it.
    ImplementationOrdered,
}

impl Choice for KBufferRoute {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("auto", Self::Auto),
        ("compute", Self::Compute),
        ("interlock", Self::Interlock),
        ("implementation-ordered", Self::ImplementationOrdered),
    ];
}

/// Most pairs of the k-buffer: with the one that left last they fill four images.
pub(crate) const MOST_K: u32 = 7;

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct RasterFrame {
    frame: LocalSpace,
    /// The box around the mesh.
    bounds: [DVec3; 2],
    push: MeshPush,
    extent: [u32; 2],
    tiles: u32,
    /// 2 where what is behind the eye is drawn too, else 1.
    lobes: u32,
    route: KBufferRoute,
    stage: Stage,
    draw: (Arc<Pipeline>, Arc<Descriptors>),
    empty: Dispatch,
    repair: Option<Repairs>,
    overlaps: Option<Overlaps>,
    image: Arc<Image>,
    flags: Arc<Buffer>,
    outcome: Arc<RasterOutcome>,
    _knots: Arc<Knots>,
    table: Option<Arc<Table>>,
}

/// Lists of flagged pixels, and what draws them.
#[derive(Debug)]
struct Repairs {
    lists: Lists,
    pass: Dispatch,
    rounds: u32,
}

/// What a frame tells of itself when it has ended.
#[derive(Debug)]
struct RasterOutcome {
    status: Arc<Buffer>,
    primitives: u32,
    repair: Option<MeshOutcome>,
}

impl Outcome for RasterOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        if let Some(repair) = &self.repair {
            let (complete, mut counters) = repair.read()?;
            for (name, _) in &mut counters {
                // There are lists of flagged pixels only.
                *name = match *name {
                    "fragments" => "repaired_fragments",
                    other => other,
                };
            }
            return Ok((complete, counters));
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

/// Whether a device offers a raster route.
fn offers(gpu: &Gpu, route: KBufferRoute, name: &str) -> Result<()> {
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

impl RasterFrame {
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        desc: MeshDesc,
        route: KBufferRoute,
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let name = desc.name;
        offers(gpu, route, name)?;
        target.refuse_layers(&format!("{name} route={}", route.word()), "route=compute")?;
        gpu.check_drawing(name, view.extent())?;
        let mesh = scene.mesh()?;
        let data = scene.mesh_data();
        let frame = LocalSpace::of(mesh);
        let knots = scene.knots()?;
        let table = scene.table(&desc.segments)?;
        let push = frame.push(view, &shading_push(scene, &desc, &knots)?)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);
        let stage = stage(scene, &data, &desc, None)?;
        // Shaders count vertices in signed numbers.
        if u64::from(stage.count) * 3 > u64::from(u32::MAX / 2) {
            return Err(Error::unsupported(
                format!("{name} route={}", route.word()),
                format!("{} faces in one draw; route=compute works", stage.count),
            ));
        }

        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = own_image(gpu, name, format, vk::ImageUsageFlags::STORAGE, view, target)?;
        let flags = buffer(gpu, "flags", u64::from(tiles) * u64::from(TILE_PIXELS))?;
        let kbuffer_desc = ImageDesc::flat(format, view.extent(), vk::ImageUsageFlags::STORAGE);
        // As many as K pairs and the last one fill.
        let kbuffer: Vec<_> = (0..=desc.k / 2)
            .map(|i| Image::new(gpu, &format!("kbuffer.{i}"), &kbuffer_desc).map(Arc::new))
            .collect::<Result<_>>()?;
        let storage = |i: usize| Resource::Storage(Arc::clone(kbuffer.get(i).unwrap_or(&image)));

        let mut resources = shading(scene, &knots, table.as_ref())?;
        resources.extend([
            (BINDING_ORDER, Resource::ReadOnly(Arc::clone(&stage.order))),
            (BINDING_BOXES, Resource::ReadOnly(Arc::clone(&stage.boxed))),
            (BINDING_PRIMITIVES, Resource::Buffer(Arc::clone(&stage.primitives))),
            (BINDING_VIEW_POINTS, Resource::ReadOnly(Arc::clone(&stage.view_points))),
            (BINDING_MESH_SCALARS, Resource::Buffer(Arc::clone(&stage.scalars))),
            (BINDING_STATUS, Resource::Buffer(Arc::clone(&stage.status))),
            (BINDING_FLAGS, Resource::Buffer(Arc::clone(&flags))),
            (BINDING_ACCUMULATION, Resource::Storage(Arc::clone(&image))),
            (BINDING_KBUFFER_0, storage(0)),
            (BINDING_KBUFFER_1, storage(1)),
            (BINDING_KBUFFER_2, storage(2)),
            (BINDING_KBUFFER_3, storage(3)),
        ]);
        resources.extend(target.bounds(&knots.buffer));
        resources.extend(target.layers(&knots.buffer));
        let mut shared = constants(scene, &desc)?;
        let shading = [
            (SPEC_KNOT_WALK, knots.walk),
            (SPEC_INTEGRATOR, desc.segments.integrator.code()),
            target.bounded(),
        ];
        shared.extend(shading);
        let own: Vec<SpecConstant> = shared.iter().copied().chain([(SPEC_K, desc.k)]).collect();
        let pipeline = gpu.graphics_pipeline(
            &format!("{name}.draw"),
            &GraphicsDesc {
                vertex: &HAVS_RASTER_VERTEX,
                fragment: match route {
                    KBufferRoute::Interlock => &HAVS_RASTER_INTERLOCK,
                    _ => &HAVS_RASTER_IMPLEMENTATION,
                },
                topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                blend: Blend::Copy,
                format: None,
                constants: &own,
            },
        )?;
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &resources)?);
        let empty = pass(gpu, &format!("{name}.empty"), &HAVS_RASTER_EMPTY, &own, &resources)?;

        let status = download(gpu, "status", 4 * u64::from(STATUS_WORDS))?;
        let mut repair = None;
        let mut outcome = None;
        let mut overlaps = None;
        if desc.repair.is_some() {
            let (runs, needs, bands) = measure(gpu, &stage, &data.needs, &push, tiles, across)?;
            let mut lists = Lists::new(gpu, &stage, tiles, runs, bands, needs)?;
            only_flagged(&mut lists, scene, &desc, &flags)?;
            if let Some(entries) = lists.list_fill.descriptors.resource(BINDING_LISTS) {
                resources.push((BINDING_LISTS, entries));
            }
            resources.push((BINDING_CURSORS, Resource::ReadOnly(Arc::clone(&lists.cursors))));
            shared.extend([(SPEC_K, REPAIR_K), (SPEC_RESUME, 0), (SPEC_LAST_CHUNK, 1), (SPEC_REPAIR, 1)]);
            outcome = Some(outcome_of(gpu, &data, &status, &lists, needs, stage.count)?);
            repair = Some(Repairs {
                lists,
                pass: pass(gpu, &format!("{name}.repair"), desc.resolve, &shared, &resources)?,
                rounds: needs.rounds,
            });
            if needs.overlaps {
                let found =
                    Overlaps::new(scene, &desc, &data, &push, [tiles, across], &flags, resources, &shading)?;
                if let Some(outcome) = &mut outcome {
                    outcome.overlaps = Some(found.status());
                }
                overlaps = Some(found);
            }
        }
        let mut frame = Self {
            frame,
            bounds: mesh.bounds(),
            push,
            extent: view.extent(),
            tiles,
            lobes: 1,
            route,
            outcome: Arc::new(RasterOutcome { status, primitives: stage.count, repair: outcome }),
            stage,
            draw: (pipeline, descriptors),
            empty,
            repair,
            overlaps,
            image,
            flags,
            _knots: knots,
            table,
        };
        frame.lobes = frame.lobes_of(view);
        Ok(frame)
    }

    /// What is behind the eye matters to a line that begins inside the mesh.
    fn lobes_of(&self, view: &View) -> u32 {
        let eye = view.camera().eye;
        // More than float32 moves points by.
        let margin = DVec3::splat(1e-5 * self.frame.radius);
        let inside = eye.cmpge(self.bounds[0] - margin).all() && eye.cmple(self.bounds[1] + margin).all();
        if view.is_perspective() && inside { 2 } else { 1 }
    }
}

fn outcome_of(
    gpu: &Gpu,
    data: &Arc<MeshData>,
    status: &Arc<Buffer>,
    lists: &Lists,
    capacities: Needs,
    primitives: u32,
) -> Result<MeshOutcome> {
    Ok(MeshOutcome {
        data: Arc::clone(data),
        status: Arc::clone(status),
        bins: download(gpu, "bins.total", 8)?,
        lists: lists.bands.iter().map(|_| download(gpu, "lists.total", 8)).collect::<Result<_>>()?,
        capacities,
        primitives,
        repairs_overlaps: true,
        unsorted: "kbuffer_overflow_pixels",
        overlaps: None,
    })
}

impl Repairs {
    fn record(&self, recorder: &mut Recorder<'_>, push: &MeshPush, count: u32, outcome: &MeshOutcome) {
        let lists = &self.lists;
        lists.bin(recorder, push, count);
        recorder.copy_buffer("bins.total", lists.bins.total(), &outcome.bins, 8);
        recorder.release_to_host(&outcome.bins);
        for (i, band) in lists.bands.iter().enumerate() {
            recorder.clear_buffer("lists.clear", &lists.cursors);
            lists.list(recorder, push, i, false);
            if let (Some(scan), Some(host)) = (lists.list_scans.get(i), outcome.lists.get(i)) {
                scan.record(recorder);
                recorder.copy_buffer("lists.total", scan.total(), host, 8);
                recorder.release_to_host(host);
            }
            lists.list(recorder, push, i, true);
            for round in 1..=self.rounds {
                let push = MeshPush {
                    count: band.tiles,
                    band: band.first,
                    capacity: lists.list_capacity,
                    number: u32::MAX / 2,
                    bins: u32::from(round == self.rounds),
                    ..*push
                };
                self.pass.record(recorder, &push, groups_of(band.tiles, 1));
            }
        }
    }
}

impl Prepared for RasterFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        self.push = self.frame.push(view, &self.push)?;
        self.lobes = self.lobes_of(view);
        Ok(true)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure::of_frame(&self.frame)
    }

    fn image(&self) -> Option<&Arc<Image>> {
        Some(&self.image)
    }

    fn last_use(&self) -> Use {
        Use::ComputeReadWrite
    }

    fn route(&self) -> &'static str {
        self.route.word()
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        vec![("tiles", self.tiles.into())]
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        if let Some(table) = &self.table {
            recorder.assume_ready(&table.image);
        }
        self.stage.record(recorder, &self.push);
        // Says of all images that they hold nothing.
        recorder.clear_buffer("flags.clear", &self.flags);
        let push = MeshPush { number: self.lobes, ..self.push };
        let (pipeline, descriptors) = &self.draw;
        recorder.draw_each(
            pipeline.name(),
            pipeline,
            descriptors,
            std::iter::once(bytemuck::bytes_of(&push)),
            self.extent,
            3 * self.stage.count,
        );
        let push = MeshPush { count: self.tiles, ..self.push };
        self.empty.record(recorder, &push, groups_of(self.tiles, 1));
        if let (Some(repair), Some(outcome)) = (&self.repair, &self.outcome.repair) {
            repair.record(recorder, &self.push, self.stage.count, outcome);
        }
        if let Some(overlaps) = &self.overlaps {
            overlaps.record(recorder, &self.push);
        }
        let status = &self.outcome.status;
        recorder.copy_buffer("status", &self.stage.status, status, status.size());
        recorder.release_to_host(status);
    }
}
