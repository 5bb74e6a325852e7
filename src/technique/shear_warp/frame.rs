//! A frame of `shear-warp`: stacks, the intermediate image, what is composited on each base plane, and the warp.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::prepared::Prepared;
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BRICKS, BINDING_EDGES, BINDING_INTERMEDIATE, BINDING_KNOTS,
    BINDING_KNOTS_UNIFORM, BINDING_TABLE, BINDING_TABLE_HEAD, BINDING_TEXEL_BOUNDS, BINDING_VOLUME,
    SHEAR_WARP_COMPUTE, SHEAR_WARP_FRAGMENT, SHEAR_WARP_VERTEX, SPEC_BETWEEN, SPEC_EMPTY_SPACE, SPEC_EVERY,
    SPEC_FILTER_EXACT, SPEC_HAS_NAN, SPEC_INTEGRATOR, SPEC_KNOT_WALK, SPEC_RESUME, SPEC_TABLE_FILTER,
    SPEC_WARP, WARP_BICUBIC, WARP_BILINEAR, WARP_BOUNDED, WARP_COMPUTE, WARP_FRAGMENT, WARP_HALVE, WARP_MIP,
    WARP_VERTEX,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Attachment, Blend, Buffer, ComputeDesc, Descriptors, GraphicsDesc, Image, ImageDesc, Pipeline, Recorder,
    Resource, SpecConstant, TargetImage,
};
use crate::interface::{BasePlanePush, ShearBoundsPush, WarpPush};
use crate::num::{self, f32_of};
use crate::primitives::dispatch::{buffer, tiles_of};
use crate::resident::GpuScene;
use crate::resident::tables::{Integrator, Knots, TABLE_FORMAT};
use crate::resident::volume::{Layout, Volume};
use crate::scene::View;
use crate::technique::grid::frame::{check_loops, slabs_per_dispatch};
use crate::technique::grid::options::Filter;
use crate::technique::grid::slices_2d::Stacks;
use crate::technique::options::{Choice, EmptySpace, Order, Route};
use crate::technique::shear_warp::bounds::ShearBounds;
use crate::technique::shear_warp::march::{EdgeMarch, March};
use crate::technique::shear_warp::options::{NAME, Options, Warp};
use crate::technique::shear_warp::planes::{FILL, Face, Faces, TEXEL, plan};

/// Format of the intermediate image.
const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// A bit of `BasePlanePush::order`.
const BACK_TO_FRONT: u32 = crate::gpu::shader::PLANE_BACK_TO_FRONT;

/// A stack on the device with the descriptors that name it.
#[derive(Debug)]
struct Stack {
    axis: usize,
    volume: Arc<Volume>,
    descriptors: Arc<Descriptors>,
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct ShearFrame {
    scene: Arc<GpuScene>,
    measure: DepthMeasure,
    options: Options,
    knots: Arc<Knots>,
    /// The transfer function's table, or what stands for one.
    table: Arc<Image>,
    stacks: Vec<Stack>,
    path: Path,
    /// Where lines are bounded.
    bounded: Option<(ShearBounds, EdgeMarch)>,
    /// Texels of the intermediate image, the levels of each base plane one after the other.
    intermediate: Arc<Buffer>,
    image: Option<Arc<Image>>,
    halve: Option<(Arc<Pipeline>, Arc<Descriptors>)>,
    warp: Arc<Pipeline>,
    warp_descriptors: Arc<Descriptors>,
    faces: Faces,
    /// Passes that there is room for.
    passes: u32,
}

#[derive(Debug)]
enum Path {
    Compute(March),
    Raster {
        pipeline: Arc<Pipeline>,
        /// All base planes, one below the other.
        atlas: Arc<Image>,
    },
}

impl Path {
    /// Dispatches or draws for slabs.
    fn parts(&self, slabs: u32) -> u32 {
        match self {
            Self::Compute(march) => march.parts(slabs),
            Self::Raster { .. } => 1,
        }
    }
}

impl ShearFrame {
    pub(crate) fn new(scene: &Arc<GpuScene>, view: &View, target: &Canvas, options: Options) -> Result<Self> {
        options.check()?;
        let gpu = scene.gpu();
        let grid = scene.grid()?;
        let route = options.grid.route_on(gpu, NAME)?;
        let raster = route == Route::Raster;
        let has_nan = grid.nan_count() > 0;
        if has_nan && options.every > 1 {
            return Err(Error::unsupported(
                format!("{NAME} every={}", options.every),
                "a grid without NaN: slices that are not looked up may hold it",
            ));
        }
        let planned = plan(gpu, grid, &options, view, None, raster)?;
        let axes = match (options.stacks, planned.axes.as_slice()) {
            (Stacks::All, _) => vec![0, 1, 2],
            // Something must be bound.
            (Stacks::Used, []) => vec![2],
            (Stacks::Used, axes) => axes.to_vec(),
        };

        let mut volumes = Vec::new();
        for &axis in &axes {
            volumes.push(scene.volume(
                Layout::Stack(axis),
                options.grid.filter == Filter::Hardware,
                false,
            )?);
        }
        let Some(volume) = volumes.first() else { return Err(Error::invalid(NAME, "no volume")) };
        let exact = options.grid.filter == Filter::Exact || !volume.filterable || has_nan;

        let knots = scene.knots()?;
        let segments = Some(options.segments).filter(|s| s.integrator != Integrator::Midpoint);
        let table = match &segments {
            Some(segments) => scene.table(segments)?,
            None => None,
        };
        let table_texels = match &table {
            Some(table) => Arc::clone(&table.image),
            None => scene.no_table()?,
        };
        let filters_table = options.segments.integrator == Integrator::Full
            && options.grid.filter == Filter::Hardware
            && gpu.image_features(TABLE_FORMAT).contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR);
        let constants: Vec<SpecConstant> = vec![
            (SPEC_FILTER_EXACT, u32::from(exact)),
            (SPEC_HAS_NAN, u32::from(has_nan)),
            (SPEC_KNOT_WALK, knots.walk),
            (SPEC_INTEGRATOR, options.segments.integrator.code()),
            (SPEC_TABLE_FILTER, u32::from(filters_table)),
            (SPEC_BETWEEN, u32::from(options.between)),
            (SPEC_EVERY, u32::from(options.every > 1)),
            target.bounded(),
        ];
        let knots_buffer = || Resource::Buffer(Arc::clone(&knots.buffer));
        let table_head =
            table.as_ref().map_or_else(knots_buffer, |table| Resource::Buffer(Arc::clone(&table.buffer)));
        let table_filter = if filters_table { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
        let mut resources = vec![
            (BINDING_KNOTS_UNIFORM, knots_buffer()),
            (BINDING_KNOTS, knots_buffer()),
            (BINDING_TABLE_HEAD, table_head),
            (BINDING_TABLE, Resource::Sampled(Arc::clone(&table_texels), table_filter)),
        ];

        // Room for views that need more.
        let faces = Faces::of(scene, &options, &planned, &axes, volume, &knots, view, raster)?;
        let most = gpu.most_buffer_bytes() / TEXEL;
        let [columns, rows] = faces.atlas.map(|side| {
            let with_room = num::u32_of(f64::from(side.max(1)) * 1.3);
            with_room.min(gpu.max_image_2d()).max(side)
        });
        let atlas_texels = if raster { u64::from(columns) * u64::from(rows) } else { 0 };
        let needed = atlas_texels + u64::from(faces.texels);
        let with_room = num::u64_of(f64::from(faces.texels.max(64)) / FILL);
        let room = (atlas_texels + with_room).min(most).max(needed);
        let intermediate = buffer(gpu, &format!("{NAME}.intermediate"), room.saturating_mul(TEXEL / 4))?;
        resources.push((BINDING_INTERMEDIATE, Resource::Buffer(Arc::clone(&intermediate))));
        let code = match options.warp {
            Warp::Bilinear => WARP_BILINEAR,
            Warp::Mip => WARP_MIP,
            Warp::Bicubic => WARP_BICUBIC,
        };
        let bounds = match &target.bounds {
            Some(bounds) => Some(ShearBounds::new(gpu, bounds, view, room, (SPEC_WARP, code))?),
            None => None,
        };
        let texel_bounds = bounds.as_ref().map_or(&knots.buffer, |bounds| &bounds.texel_bounds);
        resources.push((BINDING_TEXEL_BOUNDS, Resource::ReadOnly(Arc::clone(texel_bounds))));

        let most_slabs = faces.faces.iter().map(|face| face.slabs).max().unwrap_or(1);
        let (path, pipeline) = if raster {
            check_loops(gpu, NAME, &knots, segments.as_ref())?;
            let pipeline = gpu.graphics_pipeline(
                &format!("{NAME}.draw"),
                &GraphicsDesc {
                    vertex: &SHEAR_WARP_VERTEX,
                    fragment: &SHEAR_WARP_FRAGMENT,
                    topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                    blend: if options.grid.order() == Order::BackToFront {
                        Blend::Over
                    } else {
                        Blend::Under
                    },
                    format: Some(FORMAT),
                    constants: &constants,
                },
            )?;
            gpu.check_drawing(&format!("{NAME}.base-planes"), [columns, rows])?;
            let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
            let desc = ImageDesc::flat(FORMAT, [columns, rows], usage);
            let atlas = Arc::new(Image::new(gpu, &format!("{NAME}.base-planes"), &desc)?);
            (Path::Raster { pipeline: Arc::clone(&pipeline), atlas }, pipeline)
        } else {
            let skips = options.grid.empty_space == EmptySpace::Skip;
            let bricks = if skips {
                Resource::ReadOnly(scene.bricks(scene.margin(segments.as_ref()))?)
            } else {
                knots_buffer()
            };
            resources.push((BINDING_BRICKS, bricks));
            // Of the largest base plane that there is room for.
            let rays = room;
            let slabs_per_dispatch =
                slabs_per_dispatch(gpu, NAME, most_slabs, &knots, segments.as_ref(), grid, rays)?;
            let pipeline = |resume: bool| {
                let mut constants = constants.clone();
                constants.push((SPEC_RESUME, u32::from(resume)));
                constants.push((SPEC_EMPTY_SPACE, u32::from(skips)));
                let name = if resume { format!("{NAME}.march.resume") } else { format!("{NAME}.march") };
                gpu.compute_pipeline(
                    &name,
                    &ComputeDesc { shader: &SHEAR_WARP_COMPUTE, constants: &constants },
                )
            };
            let first = pipeline(false)?;
            let resume = if most_slabs > slabs_per_dispatch { Some(pipeline(true)?) } else { None };
            (Path::Compute(March { first: Arc::clone(&first), resume, slabs_per_dispatch }), first)
        };
        let filter = if exact { vk::Filter::NEAREST } else { vk::Filter::LINEAR };
        let mut stacks = Vec::new();
        let mut stack_resources = Vec::new();
        for (axis, volume) in axes.into_iter().zip(volumes) {
            let mut resources = resources.clone();
            resources.push((BINDING_VOLUME, Resource::Sampled(Arc::clone(&volume.image), filter)));
            stack_resources.push(resources.clone());
            let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &resources)?);
            stacks.push(Stack { axis, volume, descriptors });
        }

        let warp_constants = [(SPEC_WARP, code)];
        let mut warp_resources = vec![(BINDING_INTERMEDIATE, Resource::ReadOnly(Arc::clone(&intermediate)))];
        if let Some(bounds) = &bounds {
            warp_resources.push((BINDING_EDGES, Resource::Buffer(Arc::clone(&bounds.edge_pixels))));
        }
        // Pixels that are marched by themselves are stored by a shader.
        let (warp, image) = if raster && bounds.is_none() {
            let directly = target.format().filter(|&format| draws_directly(target, format, true));
            let warp = gpu.graphics_pipeline(
                &format!("{NAME}.warp"),
                &GraphicsDesc {
                    vertex: &WARP_VERTEX,
                    fragment: &WARP_FRAGMENT,
                    topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                    blend: Blend::Over,
                    format: Some(directly.unwrap_or(FORMAT)),
                    constants: &warp_constants,
                },
            )?;
            let image = match directly {
                Some(_) => None,
                None => {
                    gpu.check_drawing(&format!("{NAME}.accumulation"), view.extent())?;
                    Some(own_image(gpu, NAME, FORMAT, vk::ImageUsageFlags::COLOR_ATTACHMENT, view, target)?)
                }
            };
            (warp, image)
        } else {
            let image = own_image(gpu, NAME, FORMAT, vk::ImageUsageFlags::STORAGE, view, target)?;
            warp_resources.push((BINDING_ACCUMULATION, Resource::Storage(Arc::clone(&image))));
            let shader = if bounds.is_some() { &WARP_BOUNDED } else { &WARP_COMPUTE };
            let desc = ComputeDesc { shader, constants: &warp_constants };
            (gpu.compute_pipeline(&format!("{NAME}.warp"), &desc)?, Some(image))
        };
        let warp_descriptors = Arc::new(Descriptors::new(gpu, &warp, &warp_resources)?);
        let bounded = match (bounds, &image) {
            (Some(bounds), Some(image)) => {
                let rays = view.extent().map(u64::from).iter().product();
                let per_dispatch =
                    slabs_per_dispatch(gpu, NAME, most_slabs, &knots, segments.as_ref(), grid, rays)?;
                let march =
                    EdgeMarch::new(gpu, &bounds, image, &knots, &constants, stack_resources, per_dispatch)?;
                Some((bounds, march))
            }
            _ => None,
        };
        let halve = if options.warp == Warp::Mip {
            let desc = ComputeDesc { shader: &WARP_HALVE, constants: &[] };
            let pipeline = gpu.compute_pipeline(&format!("{NAME}.halve"), &desc)?;
            let resources = [(BINDING_INTERMEDIATE, Resource::Buffer(Arc::clone(&intermediate)))];
            let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &resources)?);
            Some((pipeline, descriptors))
        } else {
            None
        };
        let mut frame = Self {
            scene: Arc::clone(scene),
            measure: DepthMeasure::of_grid(grid),
            options,
            knots,
            table: table_texels,
            stacks,
            path,
            bounded,
            intermediate,
            image,
            halve,
            warp,
            warp_descriptors,
            faces,
            passes: 0,
        };
        // As many as a turn of the view may need: six base planes, and half as many slabs again.
        let parts = frame.path.parts(most_slabs.saturating_add(most_slabs / 2));
        let halves = if options.warp == Warp::Mip { 16 } else { 0 };
        let planes = if view.is_perspective() { 6 } else { 1 };
        let beside =
            frame.bounded.as_ref().map_or(0, |(_, edge)| 2 + edge.march.parts(most_slabs + most_slabs / 2));
        frame.passes = frame.needed_passes(&frame.faces).max(planes * (parts + halves + 1 + beside) + 1);
        Ok(frame)
    }

    /// Dispatches and draws, those of the warp among them.
    fn draws(&self, faces: &Faces) -> u32 {
        let beside = |face: &Face| match &self.bounded {
            Some((_, edge)) => 2 + edge.march.parts(face.slabs),
            None => 0,
        };
        let of_face =
            |face: &Face| self.path.parts(face.slabs) + num::count(face.halves.len()) + 1 + beside(face);
        faces.faces.iter().map(of_face).sum()
    }

    fn needed_passes(&self, faces: &Faces) -> u32 {
        // Raster copies its image.
        self.draws(faces) + 2
    }
}

impl Prepared for ShearFrame {
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool> {
        let gpu = self.scene.gpu().clone();
        let grid = self.scene.grid()?;
        let raster = matches!(self.path, Path::Raster { .. });
        let planned = plan(&gpu, grid, &self.options, view, self.faces.axis, raster)?;
        let axes: Vec<usize> = self.stacks.iter().map(|stack| stack.axis).collect();
        if !planned.axes.iter().all(|axis| axes.contains(axis)) {
            return Ok(false);
        }
        let Some(Stack { volume, .. }) = self.stacks.first() else { return Ok(false) };
        let faces =
            Faces::of(&self.scene, &self.options, &planned, &axes, volume, &self.knots, view, raster)?;
        let passes = self.needed_passes(&faces);
        let parts = faces.faces.iter().map(|face| self.path.parts(face.slabs)).max().unwrap_or(1);
        let splits = parts == 1 || !matches!(self.path, Path::Compute(March { resume: None, .. }));
        let room = match &self.path {
            Path::Compute(_) => u64::from(faces.texels) * TEXEL <= self.intermediate.size(),
            Path::Raster { atlas, .. } => {
                let [columns, rows, _] = atlas.desc().extent;
                let texels = u64::from(columns) * u64::from(rows) + u64::from(faces.texels);
                faces.atlas[0] <= columns
                    && faces.atlas[1] <= rows
                    && texels * TEXEL <= self.intermediate.size()
            }
        };
        let fits = passes <= most_passes && splits && room;
        if fits {
            self.faces = faces;
        }
        Ok(fits)
    }

    fn measure(&self) -> DepthMeasure {
        self.measure
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.image.as_ref()
    }

    fn last_use(&self) -> Use {
        match self.path {
            Path::Raster { .. } if self.bounded.is_none() => Use::ColorAttachment,
            _ => Use::ComputeReadWrite,
        }
    }

    fn route(&self) -> &'static str {
        match self.path {
            Path::Raster { .. } => Route::Raster.word(),
            Path::Compute(_) => Route::Compute.word(),
        }
    }

    fn passes(&self) -> u32 {
        self.passes
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let faces = &self.faces;
        let texels = |face: &Face| u64::from(face.push.size[0]) * u64::from(face.push.size[1]);
        let mut counters = vec![
            ("slices", faces.faces.iter().map(|face| u64::from(face.slabs)).sum()),
            ("base_planes", num::wide(faces.faces.len())),
            ("intermediate_texels", faces.faces.iter().map(texels).sum()),
            // The warp of nothing clears.
            ("dispatches_or_draws", self.draws(faces).max(1).into()),
        ];
        counters.extend(faces.axis.map(|axis| ("stack_axis", u64::from(num::count(axis)))));
        counters
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        for stack in &self.stacks {
            recorder.assume_ready(&stack.volume.image);
        }
        recorder.assume_ready(&self.table);
        if let Some((bounds, _)) = &self.bounded {
            for face in &self.faces.faces {
                bounds.record_texels(recorder, &self.placed_bounds(face));
            }
        }
        match &self.path {
            Path::Compute(march) => {
                for face in &self.faces.faces {
                    let descriptors = &self.stacks[face.stack].descriptors;
                    let groups = tiles_of(face.push.size);
                    march.record(recorder, &format!("{NAME}.march"), face, descriptors, groups);
                }
            }
            Path::Raster { pipeline, atlas } => {
                let [columns, rows, _] = atlas.desc().extent;
                let back_to_front = self.options.grid.order() == Order::BackToFront;
                for (i, face) in self.faces.faces.iter().enumerate() {
                    let order = face.push.order | if back_to_front { BACK_TO_FRONT } else { 0 };
                    let push = BasePlanePush { order, atlas: [columns, rows], ..face.push };
                    recorder.draw(
                        &format!("{NAME}.draw"),
                        pipeline,
                        &self.stacks[face.stack].descriptors,
                        bytemuck::bytes_of(&push),
                        &Attachment::Own(Arc::clone(atlas)),
                        i == 0,
                        4,
                        face.slabs,
                    );
                }
                if !self.faces.faces.is_empty() {
                    recorder.copy_image_to_buffer(&format!("{NAME}.copy"), atlas, &self.intermediate);
                }
            }
        }
        self.record_warp(recorder, target, clear);
    }
}

impl ShearFrame {
    /// Raster's base planes lie in the buffer as they do in its image, so many rows down; smaller levels come after it.
    fn placed(&self, push: &WarpPush, first: bool) -> WarpPush {
        let Path::Raster { atlas, .. } = &self.path else { return *push };
        let [columns, rows, _] = atlas.desc().extent;
        let mut placed = *push;
        placed.to_w[3] = f32::from_bits(push.to_w[3].to_bits() + columns * rows);
        if first {
            (placed.offset, placed.stride) = (push.offset * columns, columns);
        } else {
            placed.offset += columns * rows;
        }
        placed
    }

    /// Bounds of texels lie as the texels themselves.
    fn placed_bounds(&self, face: &Face) -> ShearBoundsPush {
        let Path::Raster { atlas, .. } = &self.path else { return face.bounds };
        let [columns, ..] = atlas.desc().extent;
        ShearBoundsPush { offset: face.bounds.offset * columns, stride: columns, ..face.bounds }
    }

    /// After the warp of a base plane: its pixels that are marched by themselves.
    fn record_edges(&self, recorder: &mut Recorder<'_>, face: &Face, extent: [u32; 2]) {
        let Some((bounds, edge)) = &self.bounded else { return };
        bounds.record_edges(recorder, &self.placed_bounds(face), extent);
        // Where there are no slabs, nothing is marched, and what the warp has left stays.
        if let Some(descriptors) = edge.descriptors.get(face.stack).filter(|_| face.slabs > 0) {
            edge.march.record(recorder, &format!("{NAME}.edge"), face, descriptors, tiles_of(extent));
        }
    }

    fn record_warp(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        if let Some((pipeline, descriptors)) = &self.halve {
            for face in &self.faces.faces {
                for (level, half) in face.halves.iter().enumerate() {
                    let [w, h] = half.size;
                    let push = self.placed(half, level == 0);
                    recorder.dispatch(
                        &format!("{NAME}.halve"),
                        pipeline,
                        descriptors,
                        bytemuck::bytes_of(&push),
                        tiles_of([w.div_ceil(2), h.div_ceil(2)]),
                    );
                }
            }
        }
        // Without a base plane nothing is seen: a warp that shows nothing clears the image.
        let [width, height] = match (&self.image, target) {
            (Some(image), _) => [image.desc().extent[0], image.desc().extent[1]],
            (None, Some(target)) => target.extent,
            (None, None) => return,
        };
        let mut pushes: Vec<WarpPush> =
            self.faces.faces.iter().map(|face| self.placed(&face.warp, true)).collect();
        if pushes.is_empty() {
            let half_extent = [width, height].map(|side| f32_of(f64::from(side) * 0.5));
            pushes.push(WarpPush { half_extent, levels: 1, ..WarpPush::default() });
        }
        for (i, push) in pushes.iter().enumerate() {
            let name = format!("{NAME}.warp");
            let bytes = bytemuck::bytes_of(push);
            if self.bounded.is_some() || matches!(self.path, Path::Compute(_)) {
                let groups = tiles_of([width, height]);
                recorder.dispatch(&name, &self.warp, &self.warp_descriptors, bytes, groups);
                if let Some(face) = self.faces.faces.get(i) {
                    self.record_edges(recorder, face, [width, height]);
                }
                continue;
            }
            let attachment = match (&self.image, target) {
                (Some(image), _) => Attachment::Own(Arc::clone(image)),
                (None, Some(target)) => Attachment::Caller(*target),
                (None, None) => return,
            };
            let clear = i == 0 && (clear || self.image.is_some());
            recorder.draw(&name, &self.warp, &self.warp_descriptors, bytes, &attachment, clear, 4, 1);
        }
    }
}

#[cfg(test)]
mod tests;
