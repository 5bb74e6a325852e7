//! What the guide promises of a recording (docs/EMBEDDING.md, "The contract of a recording"): an engine's passes before and after it in
//! one command buffer, with no more barriers than it says, draw what they draw without it.

use std::collections::BTreeSet;

use volraster::ash::vk;
use volraster::gpu::{CommandBuffer, DepthProjection, Gpu, OptionalFeature};
use volraster::technique::Renderer;
use volraster::{Plan, TargetDesc, TargetMode};

use super::calls;
use super::common::caller::{Caller, Depth};
use super::common::*;
use super::engine::{Engine, adopt, turn};
use super::triangles::Triangles;

type Stage = vk::PipelineStageFlags2;
type Access = vk::AccessFlags2;
type Layout = vk::ImageLayout;

const COLOUR: vk::Format = vk::Format::R8G8B8A8_UNORM;
const DEPTH: vk::Format = vk::Format::D32_SFLOAT;
const SIZE: [u32; 2] = [40, 30];
const BACKGROUND: [f32; 4] = [0.1, 0.2, 0.3, 1.0];

/// One image's part of a barrier: stages and accesses before and after, and the layouts.
struct Barrier(vk::Image, vk::ImageAspectFlags, [(Stage, Access, Layout); 2]);

/// The engine's frame: two passes with the same attachments.
struct Frame<'a> {
    engine: &'a Engine,
    gpu: &'a Gpu,
    caller: Caller,
    depth: Depth,
    triangles: Triangles<'a>,
}

impl<'a> Frame<'a> {
    fn new(engine: &'a Engine, gpu: &'a Gpu) -> Self {
        let caller = Caller::new(gpu, COLOUR, SIZE, 4);
        let depth = Depth::new(gpu, DEPTH, SIZE, &[0.0; 40 * 30]).unwrap();
        Self { engine, gpu, caller, depth, triangles: Triangles::new(engine, gpu, COLOUR, DEPTH) }
    }

    fn barrier(&self, barriers: &[Barrier]) {
        let barriers: Vec<_> = barriers
            .iter()
            .map(|Barrier(image, aspect, [before, after])| {
                let range =
                    vk::ImageSubresourceRange::default().aspect_mask(*aspect).level_count(1).layer_count(1);
                vk::ImageMemoryBarrier2::default()
                    .src_stage_mask(before.0)
                    .src_access_mask(before.1)
                    .dst_stage_mask(after.0)
                    .dst_access_mask(after.1)
                    .old_layout(before.2)
                    .new_layout(after.2)
                    .image(*image)
                    .subresource_range(range)
            })
            .collect();
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: recording, outside of rendering.
        unsafe { self.engine.device.cmd_pipeline_barrier2(self.caller.commands, &info) };
    }

    /// A pass into both images, which clears them or goes on with them.
    fn pass(&self, clear: bool, draw: impl FnOnce()) {
        let load = if clear { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD };
        let attachment = |view, layout, clear_value| {
            vk::RenderingAttachmentInfo::default()
                .image_view(view)
                .image_layout(layout)
                .load_op(load)
                .store_op(vk::AttachmentStoreOp::STORE)
                .clear_value(clear_value)
        };
        let colour = vk::ClearValue { color: vk::ClearColorValue { float32: BACKGROUND } };
        let colours = [attachment(self.caller.view, Layout::COLOR_ATTACHMENT_OPTIMAL, colour)];
        let depth = attachment(self.depth.view, Layout::DEPTH_ATTACHMENT_OPTIMAL, vk::ClearValue::default());
        let [width, height] = SIZE;
        let info = vk::RenderingInfo::default()
            .render_area(vk::Extent2D { width, height }.into())
            .layer_count(1)
            .color_attachments(&colours)
            .depth_attachment(&depth);
        // SAFETY: recording; both images are in these layouts.
        unsafe { self.engine.device.cmd_begin_rendering(self.caller.commands, &info) };
        draw();
        // SAFETY: begun above.
        unsafe { self.engine.device.cmd_end_rendering(self.caller.commands) };
    }

    /// Draws the frame with what `between` records between the passes. Barriers are those of the contract.
    fn draw(&self, between: impl FnOnce(vk::CommandBuffer)) -> Vec<u8> {
        let commands = self.caller.commands;
        let (colour, depth) = (vk::ImageAspectFlags::COLOR, vk::ImageAspectFlags::DEPTH);
        let written = (
            Stage::COLOR_ATTACHMENT_OUTPUT,
            Access::COLOR_ATTACHMENT_WRITE,
            Layout::COLOR_ATTACHMENT_OPTIMAL,
        );
        let blended = Access::COLOR_ATTACHMENT_READ | Access::COLOR_ATTACHMENT_WRITE;
        let for_colour = (Stage::COLOR_ATTACHMENT_OUTPUT, blended, Layout::COLOR_ATTACHMENT_OPTIMAL);
        let tests = Stage::EARLY_FRAGMENT_TESTS | Stage::LATE_FRAGMENT_TESTS;
        let tested = Access::DEPTH_STENCIL_ATTACHMENT_READ | Access::DEPTH_STENCIL_ATTACHMENT_WRITE;
        let for_depth = (tests, tested, Layout::DEPTH_ATTACHMENT_OPTIMAL);
        let sampled = (Stage::COMPUTE_SHADER, Access::SHADER_SAMPLED_READ, Layout::DEPTH_READ_ONLY_OPTIMAL);
        let read = (Stage::COMPUTE_SHADER, Access::NONE, Layout::DEPTH_READ_ONLY_OPTIMAL);
        let fresh = (tests, Access::NONE, Layout::UNDEFINED);

        self.caller.begin([0.0; 4]);
        self.triangles.bind_corners(commands);
        self.barrier(&[Barrier(self.depth.image, depth, [fresh, for_depth])]);
        self.pass(true, || {
            self.triangles.draw(commands, SIZE, [0.8, 0.4, 0.1, 1.0], [-0.2, 0.1, 0.6, 0.03]);
        });
        self.barrier(&[
            Barrier(self.caller.image, colour, [written, for_colour]),
            Barrier(self.depth.image, depth, [for_depth, sampled]),
        ]);
        between(commands);
        self.barrier(&[
            Barrier(self.caller.image, colour, [written, for_colour]),
            Barrier(self.depth.image, depth, [read, for_depth]),
        ]);
        // In front of the first one and behind it: the depths of the first pass are as they were.
        self.pass(false, || {
            self.triangles.draw(commands, SIZE, [0.1, 0.9, 0.3, 1.0], [0.4, -0.2, 0.4, 0.05]);
            self.triangles.draw(commands, SIZE, [0.2, 0.1, 0.9, 1.0], [-0.6, 0.5, 0.4, 0.01]);
        });
        self.caller.end(self.gpu)
    }
}

/// Every technique between an engine's passes, in the command buffer of these or in a secondary one: opaque pixels of the second pass and those
/// that the volume leaves are to the bit what they are without it, and both ways draw the same.
#[test]
fn the_engine_s_passes_draw_what_they_draw_without_the_library() {
    let _turn = turn();
    let engine = Engine::full();
    let gpu = engine.gpu();
    let frame = Frame::new(&engine, &gpu);
    let view = view(perspective(), 1.0, SIZE[0], SIZE[1]);
    let projection = DepthProjection::perspective(f64::INFINITY, 0.1).unwrap();
    let without = frame.draw(|_| {});
    let mut drawn = 0;
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs {
            let renderer = Renderer::new(&scene, technique(&spec));
            let target = TargetDesc::caller(COLOUR, TargetMode::Over);
            let (mut plan, depth) = match renderer.prepare(&view, &target.with_depth()) {
                Err(volraster::Error::Unsupported { .. }) => {
                    (renderer.prepare(&view, &target).unwrap(), None)
                }
                plan => (plan.unwrap(), Some(frame.depth.image(&gpu, projection))),
            };
            let image = renderer.render(&view).unwrap();
            let record = |plan: &mut Plan, commands| {
                // SAFETY: recording, on this thread, outside of rendering.
                let mut commands = unsafe { CommandBuffer::from_raw(&gpu, commands) };
                plan.record(&mut commands, Some(&frame.caller.target(&gpu)), depth.as_ref()).unwrap()
            };
            let mut recorded = None;
            let primary = frame.draw(|commands| recorded = Some(record(&mut plan, commands)));
            assert!(recorded.take().unwrap().completed().unwrap().complete, "{spec}");
            let secondary = frame.draw(|commands| {
                let info = vk::CommandBufferAllocateInfo::default()
                    .command_pool(frame.caller.pool)
                    .level(vk::CommandBufferLevel::SECONDARY)
                    .command_buffer_count(1);
                // SAFETY: the pool is alive, and frees it.
                let own = unsafe { engine.device.allocate_command_buffers(&info) }.unwrap()[0];
                let inherited = vk::CommandBufferInheritanceInfo::default();
                let info = vk::CommandBufferBeginInfo::default()
                    .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT)
                    .inheritance_info(&inherited);
                // SAFETY: fresh.
                unsafe { engine.device.begin_command_buffer(own, &info) }.unwrap();
                recorded = Some(record(&mut plan, own));
                // SAFETY: recording.
                unsafe { engine.device.end_command_buffer(own) }.unwrap();
                // SAFETY: recording, outside of rendering; complete.
                unsafe { engine.device.cmd_execute_commands(commands, &[own]) };
                // A secondary command buffer leaves all state of its primary undefined.
                frame.triangles.bind_corners(commands);
            });
            assert!(recorded.take().unwrap().completed().unwrap().complete, "{spec}");
            assert!(primary == secondary, "{spec}: a secondary command buffer draws something else");
            let green = |texel: &[u8]| texel == [26, 230, 77, 255] || texel == [25, 229, 76, 255];
            for (i, (got, plain)) in primary.chunks_exact(4).zip(without.chunks_exact(4)).enumerate() {
                if green(plain) || image.pixels()[i][3] == 0.0 {
                    assert_eq!(got, plain, "{spec}: pixel {i}");
                } else {
                    drawn += u32::from(got != plain);
                }
            }
        }
    }
    assert!(drawn > 1000, "{drawn} pixels of volumes");
    drop(frame);
    drop(gpu);
    engine.end_silently();
}

/// Recording uses no commands but those of the guide's table, and all of these: who hooks them knows what comes.
#[test]
fn a_recording_has_the_commands_of_the_guide() {
    let guide = include_str!("../../docs/EMBEDDING.md");
    let row = guide.lines().find(|line| line.starts_with("| commands |")).unwrap();
    let listed: BTreeSet<&str> = row.split('`').filter(|name| name.starts_with("vkCmd")).collect();
    let _turn = turn();
    let engine = Engine::full();
    let mut parts = engine.parts();
    parts.device = calls::noting(&engine.instance, engine.device.handle());
    let gpu = adopt(parts).unwrap();
    let frame = Caller::new(&gpu, vk::Format::R32G32B32A32_SFLOAT, SIZE, 16);
    let depth = Depth::new(&gpu, DEPTH, SIZE, &[0.01; 40 * 30]).unwrap();
    let projection = DepthProjection::perspective(f64::INFINITY, 0.1).unwrap();
    let view = view(perspective(), 1.0, SIZE[0], SIZE[1]);
    let mut seen = BTreeSet::new();
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs {
            for (mode, with_depth) in [(TargetMode::Clear, false), (TargetMode::Over, true)] {
                let target = TargetDesc::caller(frame.format, mode);
                let target = if with_depth { target.with_depth() } else { target };
                let plan = Renderer::new(&scene, technique(&spec)).prepare(&view, &target);
                let mut plan = match plan {
                    Err(volraster::Error::Unsupported { .. }) if with_depth => continue,
                    plan => plan.unwrap(),
                };
                frame.begin([0.0; 4]);
                depth.fill(frame.commands);
                let (mut commands, image) = (frame.command_buffer(&gpu), frame.target(&gpu));
                let depth = with_depth.then(|| depth.image(&gpu, projection));
                let (recorded, calls) =
                    calls::during(|| plan.record(&mut commands, Some(&image), depth.as_ref()).unwrap());
                seen.extend(calls.into_iter().filter(|call| call.starts_with("vkCmd")));
                frame.end(&gpu);
                let _ = recorded.completed().unwrap();
            }
        }
    }
    // Functions of extensions are found by the instance, and not noted; a device may have no timestamps.
    let mut unseen = BTreeSet::from(["vkCmdBeginDebugUtilsLabelEXT", "vkCmdEndDebugUtilsLabelEXT"]);
    if !gpu.has(OptionalFeature::Timestamps) {
        unseen.extend(["vkCmdResetQueryPool", "vkCmdWriteTimestamp2"]);
    }
    assert_eq!(seen, &listed - &unseen);
    assert!(unseen.is_subset(&listed));
    drop((frame, depth, gpu));
    engine.end_silently();
}
