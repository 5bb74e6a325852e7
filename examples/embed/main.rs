//! Uses the library in a program with a Vulkan device of its own: an opaque pass into colour and depth, the volume composited into
//! it, two frames in flight, a timeline semaphore that signals their ends.
//!
//!     cargo run --release --example embed -- out 8 --technique slices-3d:step=0.5 --size 640x480
//!     cargo run --release --example embed -- out 8 --splats playbot.sog
//!
//! There is no window: the program writes the last two frames to `out`. `--technique none` draws no volume. The exit code is 1
//! after messages of the validation layer.

#![allow(unsafe_code, reason = "owns Vulkan objects")]
#![allow(clippy::cast_precision_loss, reason = "sides of images")]

mod boxes;
mod vulkan;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use boxes::Boxes;
use volraster::ash::vk;
use volraster::glam::dcamera::rh::{proj, view};
use volraster::glam::{DMat4, DVec3};
use volraster::gpu::{CommandBuffer, DepthImage, DepthProjection, GpuOptions, TargetImage};
use volraster::io::ReadOptions;
use volraster::scene::{Axes, Camera, Field, Projection, Scene, TransferFunction, View};
use volraster::{Colours, Gpu, GpuScene, Plan, Recorded, Renderer, TargetDesc, TargetMode, Technique, io};
use vulkan::{Image, ReadBack, Result, Vulkan};

const COLOUR: vk::Format = vk::Format::R8G8B8A8_SRGB;
/// The same image as it is displayed: trained splats are blended in such colours.
const DISPLAYED: vk::Format = vk::Format::R8G8B8A8_UNORM;
const DEPTH: vk::Format = vk::Format::D32_SFLOAT;
const BACKGROUND: [f32; 4] = [0.02, 0.025, 0.04, 1.0];
const FOV_Y_DEG: f64 = 40.0;
const NEAR: f64 = 0.1;
const IN_FLIGHT: u64 = 2;

struct Arguments {
    folder: PathBuf,
    frames: u64,
    technique: Option<Technique>,
    splats: Option<PathBuf>,
    size: [u32; 2],
}

fn arguments() -> Result<Arguments> {
    const USAGE: &str =
        "usage: embed FOLDER [FRAMES] [--technique NAME[:KEY=VALUE,...]|none] [--splats FILE] [--size WxH]";
    let mut given = std::env::args().skip(1);
    let folder = PathBuf::from(given.next().ok_or(USAGE)?);
    let technique = Some(Technique::parse("slices-3d")?);
    let mut arguments = Arguments { folder, frames: 8, technique, splats: None, size: [640, 480] };
    while let Some(argument) = given.next() {
        match argument.as_str() {
            "--technique" => {
                let name = given.next().ok_or(USAGE)?;
                arguments.technique = if name == "none" { None } else { Some(Technique::parse(&name)?) };
            }
            "--splats" => {
                // By a rule that has a depth on each ray, so that the boxes hide what is behind them.
                arguments.technique = Some(Technique::parse("gaussians:rule=ray")?);
                arguments.splats = Some(given.next().ok_or(USAGE)?.into());
            }
            "--size" => {
                let size = given.next().ok_or(USAGE)?;
                let (width, height) = size.split_once('x').ok_or(USAGE)?;
                arguments.size = [width.parse()?, height.parse()?];
            }
            number => arguments.frames = number.parse().map_err(|_| USAGE)?,
        }
    }
    Ok(arguments)
}

fn main() -> ExitCode {
    match run() {
        Ok(0) => ExitCode::SUCCESS,
        Ok(messages) => {
            eprintln!("{messages} messages of the validation layer");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Draws, and returns the number of messages of the validation layer.
fn run() -> Result<usize> {
    let arguments = arguments()?;
    let vulkan = Arc::new(Vulkan::new()?);
    let log = vulkan.log.clone();
    draw(&vulkan, &arguments)?;
    // The messages of destruction count, too: they report objects that were not destroyed.
    drop(vulkan);
    Ok(log.count())
}

fn draw(vulkan: &Arc<Vulkan>, arguments: &Arguments) -> Result<()> {
    // SAFETY: the parts belong to one device, which their owner `keep` destroys last; the queue is used only through
    // `with_queue`.
    let gpu = unsafe { Gpu::from_raw(vulkan.parts(), &GpuOptions::default()) }?;
    println!("device: {}", gpu.report().name);
    let scene = scene(arguments.splats.as_deref())?;
    let colours = scene.colours();
    let renderer = arguments.technique.map(|technique| Renderer::new(&GpuScene::new(&gpu, scene), technique));
    let boxes = Boxes::new(vulkan, COLOUR, DEPTH)?;
    let counter = Counter::new(vulkan)?;
    let mut slots = Vec::new();
    for _ in 0..IN_FLIGHT {
        slots.push(Slot::new(vulkan, arguments.size)?);
    }
    let engine = Engine { vulkan, gpu: &gpu, renderer, colours, boxes, counter, arguments };
    // After an error frames may be in flight: their resources are dropped only after they have ended.
    let drawn = engine.frames(&mut slots);
    let ended = slots.iter_mut().try_for_each(|slot| engine.finish(slot));
    drawn.and(ended)
}

/// Returns trained splats of a file with y up, or a field in a grid.
fn scene(splats: Option<&Path>) -> Result<Scene> {
    let rows = [
        [0.0, 0.1, 0.4, 0.8, 0.0],
        [0.2, 0.1, 0.4, 0.8, 0.0],
        [0.32, 0.15, 0.6, 0.75, 1.5],
        [0.45, 0.4, 0.8, 0.4, 0.0],
        [0.95, 1.0, 0.6, 0.2, 0.1],
        [1.0, 1.0, 0.75, 0.3, 0.5],
    ];
    let data = match splats {
        Some(path) => {
            io::read(path, &ReadOptions { turn_to: Some(Axes::Rub), ..ReadOptions::default() })?.data
        }
        None => Field::Blobs.sample([64, 64, 64], "u8")?.into(),
    };
    Ok(Scene::new(data, TransferFunction::from_rows(&rows)?))
}

struct Engine<'a> {
    vulkan: &'a Vulkan,
    gpu: &'a Gpu,
    renderer: Option<Renderer>,
    /// What the numbers of the scene's colours are.
    colours: Colours,
    boxes: Boxes<'a>,
    counter: Counter<'a>,
    arguments: &'a Arguments,
}

impl Engine<'_> {
    fn frames(&self, slots: &mut [Slot<'_>]) -> Result<()> {
        for frame in 0..self.arguments.frames {
            let slot = &mut slots[usize::try_from(frame % IN_FLIGHT)?];
            self.finish(slot)?;
            self.record(slot, frame)?;
            self.submit(slot)?;
        }
        Ok(())
    }

    fn camera(frame: u64) -> volraster::Result<Camera> {
        let camera = Camera {
            eye: DVec3::new(2.6, 1.4, 4.0),
            target: DVec3::new(0.0, -0.1, 0.0),
            up: DVec3::Y,
            projection: Projection::Perspective { fov_y_deg: FOV_Y_DEG },
        };
        camera.orbit(frame as f64)
    }

    /// Waits for the frame that a slot has in flight, frees its resources, and writes it if it is one of the last.
    fn finish(&self, slot: &mut Slot<'_>) -> Result<()> {
        let Some(pending) = slot.pending.take() else { return Ok(()) };
        self.counter.wait(pending.value)?;
        if let Some(recorded) = pending.recorded {
            let status = recorded.completed()?;
            // Empty on a device without timestamps.
            let passes = status.passes.iter().map(|pass| format!(" {} {:.2} ms", pass.name, pass.ms));
            println!("frame {}:{}", pending.frame, passes.collect::<String>());
            if !status.complete {
                // The next recording has the pages, or the next plan the capacity, that this one lacked. A program with a window would show
                // the frame and go on.
                if !slot.plan.as_mut().map_or(Ok(false), Plan::load)? {
                    slot.plan = None;
                }
                self.record(slot, pending.frame)?;
                self.submit(slot)?;
                return self.finish(slot);
            }
        }
        if pending.frame + IN_FLIGHT >= self.arguments.frames {
            self.write(slot, pending.frame)?;
        }
        Ok(())
    }

    fn write(&self, slot: &Slot<'_>, frame: u64) -> Result<()> {
        let [width, height] = self.arguments.size;
        let linear = |code: u8| {
            let coded = f32::from(code) / 255.0;
            if coded <= 0.04045 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
        };
        let bytes = slot.read_back.read()?;
        let pixels = bytes
            .chunks_exact(4)
            .map(|p| [linear(p[0]), linear(p[1]), linear(p[2]), f32::from(p[3]) / 255.0]);
        let image = volraster::Image::new(width, height, pixels.collect())?;
        std::fs::create_dir_all(&self.arguments.folder)?;
        let path = self.arguments.folder.join(format!("frame-{frame:04}.png"));
        io::write_image(&path, &image, [0.0, 0.0, 0.0, 1.0])?;
        println!("{}", path.display());
        Ok(())
    }

    /// Records a frame: opaque pass, volume, copy to the host.
    fn record(&self, slot: &mut Slot<'_>, frame: u64) -> Result<()> {
        let device = &self.vulkan.device;
        let [width, height] = self.arguments.size;
        let camera = Self::camera(frame)?;
        let aspect = f64::from(width) / f64::from(height);
        // Reversed depth without a far end: 1 at the near plane, 0 at infinity.
        let projection = proj::vulkan::perspective_infinite_reverse(FOV_Y_DEG.to_radians(), aspect, NEAR);
        let to_clip = projection * view::look_at_mat4(camera.eye, camera.target, camera.up);

        // SAFETY: no command buffer of this pool is pending.
        unsafe { device.reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty()) }?;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: in the initial state.
        unsafe { device.begin_command_buffer(slot.commands, &info) }?;
        self.opaque_pass(slot, to_clip);
        let recorded = match &self.renderer {
            Some(renderer) => Some(self.volume(slot, renderer, &camera, &projection)?),
            None => None,
        };
        self.copy_out(slot);
        // SAFETY: recording was begun, and every rendering ended.
        unsafe { device.end_command_buffer(slot.commands) }?;
        slot.pending = Some(Pending { frame, value: 0, recorded });
        Ok(())
    }

    fn opaque_pass(&self, slot: &Slot<'_>, to_clip: DMat4) {
        use vk::{AccessFlags2 as Access, ImageLayout as Layout, PipelineStageFlags2 as Stage};
        let device = &self.vulkan.device;
        let [width, height] = self.arguments.size;
        let extent = vk::Extent2D { width, height };
        let depth_stages = Stage::EARLY_FRAGMENT_TESTS | Stage::LATE_FRAGMENT_TESTS;
        let depth_access = Access::DEPTH_STENCIL_ATTACHMENT_READ | Access::DEPTH_STENCIL_ATTACHMENT_WRITE;
        let colour_stage = Stage::COLOR_ATTACHMENT_OUTPUT;
        let colour_access = Access::COLOR_ATTACHMENT_READ | Access::COLOR_ATTACHMENT_WRITE;
        // The earlier frame in this slot has ended; the contents of its images are discarded.
        self.barriers(
            slot.commands,
            &[
                to_layout(&slot.colour, [Layout::UNDEFINED, Layout::COLOR_ATTACHMENT_OPTIMAL])
                    .dst_stage_mask(colour_stage)
                    .dst_access_mask(colour_access),
                to_layout(&slot.depth, [Layout::UNDEFINED, Layout::DEPTH_ATTACHMENT_OPTIMAL])
                    .dst_stage_mask(depth_stages)
                    .dst_access_mask(depth_access),
            ],
        );
        let attachment = |image: &Image<'_>, layout, clear_value| {
            vk::RenderingAttachmentInfo::default()
                .image_view(image.view)
                .image_layout(layout)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::STORE)
                .clear_value(clear_value)
        };
        let background = vk::ClearValue { color: vk::ClearColorValue { float32: BACKGROUND } };
        let far = vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 } };
        let colours = [attachment(&slot.colour, Layout::COLOR_ATTACHMENT_OPTIMAL, background)];
        let depth = attachment(&slot.depth, Layout::DEPTH_ATTACHMENT_OPTIMAL, far);
        let info = vk::RenderingInfo::default()
            .render_area(extent.into())
            .layer_count(1)
            .color_attachments(&colours)
            .depth_attachment(&depth);
        // SAFETY: recording; both images are in these layouts.
        unsafe { device.cmd_begin_rendering(slot.commands, &info) };
        self.boxes.record(slot.commands, extent, to_clip);
        // SAFETY: begun above.
        unsafe { device.cmd_end_rendering(slot.commands) };
        // The library needs colour as an attachment, and depth for reads by compute shaders.
        self.barriers(
            slot.commands,
            &[
                to_layout(&slot.colour, [Layout::COLOR_ATTACHMENT_OPTIMAL; 2])
                    .src_stage_mask(colour_stage)
                    .src_access_mask(Access::COLOR_ATTACHMENT_WRITE)
                    .dst_stage_mask(colour_stage)
                    .dst_access_mask(colour_access),
                to_layout(&slot.depth, [Layout::DEPTH_ATTACHMENT_OPTIMAL, Layout::DEPTH_READ_ONLY_OPTIMAL])
                    .src_stage_mask(depth_stages)
                    .src_access_mask(Access::DEPTH_STENCIL_ATTACHMENT_WRITE)
                    .dst_stage_mask(Stage::COMPUTE_SHADER)
                    .dst_access_mask(Access::SHADER_SAMPLED_READ),
            ],
        );
    }

    /// Records the volume: composited over the boxes, and hidden where they are nearer.
    fn volume(
        &self,
        slot: &mut Slot<'_>,
        renderer: &Renderer,
        camera: &Camera,
        projection: &DMat4,
    ) -> Result<Recorded> {
        let [width, height] = self.arguments.size;
        let view = View::new(*camera, width, height)?;
        // Colours that are displayed are blended as they are, linear ones in the format that encodes them.
        let (format, colour) = match self.colours {
            Colours::Displayed => (DISPLAYED, slot.colour.other),
            Colours::Linear => (COLOUR, slot.colour.view),
        };
        let target = TargetDesc::caller(format, TargetMode::Over).with_depth();
        // Each frame in flight has a plan, which is set to the view of each frame, and made anew where its capacity is too small.
        let fits = match &mut slot.plan {
            Some(plan) => plan.set_view(&view)?,
            None => false,
        };
        if !fits {
            slot.plan = None;
        }
        let plan = match &mut slot.plan {
            Some(plan) => plan,
            none => none.insert(renderer.prepare(&view, &target)?),
        };
        // SAFETY: recording on this thread, outside of rendering, to be submitted to this device's queue family, once.
        let mut commands = unsafe { CommandBuffer::from_raw(self.gpu, slot.commands) };
        let size = self.arguments.size;
        // SAFETY: the image is in the layout COLOR_ATTACHMENT_OPTIMAL by the barrier above and outlives the frame.
        let target = unsafe { TargetImage::from_raw(self.gpu, slot.colour.raw, colour, format, size) };
        let stored = DepthProjection::from_matrix(projection)?;
        // SAFETY: the image is in the layout DEPTH_READ_ONLY_OPTIMAL by the barrier above and outlives the frame.
        let depth = unsafe { DepthImage::from_raw(self.gpu, slot.depth.view, DEPTH, size, stored) };
        Ok(plan.record(&mut commands, Some(&target), Some(&depth))?)
    }

    fn copy_out(&self, slot: &Slot<'_>) {
        use vk::{AccessFlags2 as Access, ImageLayout as Layout, PipelineStageFlags2 as Stage};
        let device = &self.vulkan.device;
        let [width, height] = self.arguments.size;
        let source = Layout::TRANSFER_SRC_OPTIMAL;
        self.barriers(
            slot.commands,
            &[to_layout(&slot.colour, [Layout::COLOR_ATTACHMENT_OPTIMAL, source])
                .src_stage_mask(Stage::COLOR_ATTACHMENT_OUTPUT)
                .src_access_mask(Access::COLOR_ATTACHMENT_WRITE)
                .dst_stage_mask(Stage::COPY)
                .dst_access_mask(Access::TRANSFER_READ)],
        );
        let layers =
            vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        });
        let (image, buffer) = (slot.colour.raw, slot.read_back.raw);
        // SAFETY: recording; the buffer holds the image.
        unsafe { device.cmd_copy_image_to_buffer(slot.commands, image, source, buffer, &[region]) };
        let barriers = [vk::BufferMemoryBarrier2::default()
            .src_stage_mask(Stage::COPY)
            .src_access_mask(Access::TRANSFER_WRITE)
            .dst_stage_mask(Stage::HOST)
            .dst_access_mask(Access::HOST_READ)
            .buffer(buffer)
            .size(vk::WHOLE_SIZE)];
        let info = vk::DependencyInfo::default().buffer_memory_barriers(&barriers);
        // SAFETY: recording.
        unsafe { device.cmd_pipeline_barrier2(slot.commands, &info) };
    }

    fn barriers(&self, commands: vk::CommandBuffer, barriers: &[vk::ImageMemoryBarrier2<'_>]) {
        let info = vk::DependencyInfo::default().image_memory_barriers(barriers);
        // SAFETY: recording, outside of rendering.
        unsafe { self.vulkan.device.cmd_pipeline_barrier2(commands, &info) };
    }

    /// Submits the recording; the counter signals its end.
    fn submit(&self, slot: &mut Slot<'_>) -> Result<()> {
        let Some(pending) = &mut slot.pending else { return Ok(()) };
        pending.value = self.counter.next();
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(slot.commands)];
        let signals = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.counter.semaphore)
            .value(pending.value)
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let submits =
            [vk::SubmitInfo2::default().command_buffer_infos(&buffers).signal_semaphore_infos(&signals)];
        let submitted = self.gpu.with_queue(|queue| {
            // SAFETY: no other thread uses the queue during the call; the command buffer is complete and not pending.
            unsafe { self.vulkan.device.queue_submit2(queue, &submits, vk::Fence::null()) }
        });
        Ok(submitted?)
    }
}

fn to_layout<'a>(image: &Image<'_>, [old, new]: [vk::ImageLayout; 2]) -> vk::ImageMemoryBarrier2<'a> {
    vk::ImageMemoryBarrier2::default()
        .old_layout(old)
        .new_layout(new)
        .image(image.raw)
        .subresource_range(image.range)
}

/// The resources of a frame in flight.
struct Slot<'a> {
    vulkan: &'a Vulkan,
    colour: Image<'a>,
    depth: Image<'a>,
    read_back: ReadBack<'a>,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    plan: Option<Plan>,
    pending: Option<Pending>,
}

/// A frame that was recorded or submitted and is not known to have ended.
struct Pending {
    frame: u64,
    /// Value of the counter at its end.
    value: u64,
    /// Resources that the library keeps for it.
    recorded: Option<Recorded>,
}

impl<'a> Slot<'a> {
    fn new(vulkan: &'a Vulkan, size: [u32; 2]) -> Result<Self> {
        use vk::{ImageAspectFlags as Aspect, ImageUsageFlags as Usage};
        let bytes = 4 * usize::try_from(size[0])? * usize::try_from(size[1])?;
        let colours = Usage::COLOR_ATTACHMENT | Usage::TRANSFER_SRC;
        let depths = Usage::DEPTH_STENCIL_ATTACHMENT | Usage::SAMPLED;
        let mut slot = Self {
            vulkan,
            colour: Image::new(vulkan, COLOUR, Some(DISPLAYED), Aspect::COLOR, colours, size)?,
            depth: Image::new(vulkan, DEPTH, None, Aspect::DEPTH, depths, size)?,
            read_back: ReadBack::new(vulkan, bytes)?,
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            plan: None,
            pending: None,
        };
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(vulkan.family);
        // SAFETY: the device has this family.
        slot.pool = unsafe { vulkan.device.create_command_pool(&info, None) }?;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(slot.pool).command_buffer_count(1);
        // SAFETY: the pool is alive.
        slot.commands = unsafe { vulkan.device.allocate_command_buffers(&info) }?[0];
        Ok(slot)
    }
}

impl Drop for Slot<'_> {
    fn drop(&mut self) {
        // SAFETY: its command buffer is not pending; null is allowed.
        unsafe { self.vulkan.device.destroy_command_pool(self.pool, None) };
    }
}

/// A timeline semaphore.
struct Counter<'a> {
    vulkan: &'a Vulkan,
    semaphore: vk::Semaphore,
    last: std::cell::Cell<u64>,
}

impl<'a> Counter<'a> {
    fn new(vulkan: &'a Vulkan) -> Result<Self> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the feature is enabled.
        let semaphore = unsafe { vulkan.device.create_semaphore(&info, None) }?;
        Ok(Self { vulkan, semaphore, last: std::cell::Cell::new(0) })
    }

    /// Returns the value of the next submission.
    fn next(&self) -> u64 {
        self.last.set(self.last.get() + 1);
        self.last.get()
    }

    fn wait(&self, value: u64) -> Result<()> {
        let (semaphores, values) = ([self.semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is a timeline.
        Ok(unsafe { self.vulkan.device.wait_semaphores(&info, u64::MAX) }?)
    }
}

impl Drop for Counter<'_> {
    fn drop(&mut self) {
        // SAFETY: every submission that signals it has ended.
        unsafe { self.vulkan.device.destroy_semaphore(self.semaphore, None) };
    }
}
