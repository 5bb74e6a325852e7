//! The validation gate itself: provoked errors must be heard, and a missing layer must fail.

#![allow(unsafe_code, reason = "provokes Vulkan errors on purpose, through raw calls")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers of test images")]

use crate::common::TestGpu;
use volraster::GpuScene;
use volraster::ash::vk;
use volraster::gpu::{Gpu, GpuOptions, Handles, PipelineCache, Validation};
use volraster::scene::{Field, KernelSize, Points, Scene, TetScalars, Tets, TransferFunction};
use volraster::technique::{Method, Renderer};

/// A validated device whose messages are expected.
fn validated() -> TestGpu {
    crate::common::provoked_gpu()
}

fn heard(messages: &[String], part: &str) -> bool {
    messages.iter().any(|message| message.contains(part))
}

#[test]
fn a_core_error_is_heard() {
    let gpu = validated();
    println!("validation layer {}", gpu.validation_layer().unwrap());
    assert!(gpu.validation_log().messages().is_empty());
    let info = vk::BufferCreateInfo::default().size(0).usage(vk::BufferUsageFlags::TRANSFER_SRC);
    // SAFETY: none: a buffer of 0 bytes is the error that must be heard. Software drivers survive it.
    let buffer = unsafe { gpu.handles().device.create_buffer(&info, None) };
    if let Ok(buffer) = buffer {
        // SAFETY: just made, unused.
        unsafe { gpu.handles().device.destroy_buffer(buffer, None) };
    }
    let messages = gpu.validation_log().take();
    assert!(heard(&messages, "VUID-VkBufferCreateInfo-size-00912"), "{messages:#?}");
}

/// The message of a leak, by older layers and by newer ones.
const LEAK: [&str; 2] = ["VUID-vkDestroyDevice-device-00378", "VUID-vkDestroyDevice-device-05137"];

#[test]
fn a_leak_is_heard_after_the_device_is_gone() {
    let gpu = validated();
    let log = gpu.validation_log();
    let info = vk::BufferCreateInfo::default().size(64).usage(vk::BufferUsageFlags::TRANSFER_SRC);
    // SAFETY: valid; the leak is the error that must be heard.
    let _leaked = unsafe { gpu.handles().device.create_buffer(&info, None) }.unwrap();
    assert!(log.messages().is_empty());
    drop(gpu);
    let messages = log.messages();
    assert!(LEAK.iter().any(|id| heard(&messages, id)), "{messages:#?}");
}

/// A buffer of 256 bytes, its memory, and command buffers of a pool to fill it with.
fn to_fill(
    handles: &Handles,
    count: u32,
) -> (vk::Buffer, vk::DeviceMemory, vk::CommandPool, Vec<vk::CommandBuffer>) {
    let device = &handles.device;
    let info = vk::BufferCreateInfo::default().size(256).usage(vk::BufferUsageFlags::TRANSFER_DST);
    // SAFETY: valid; destroyed by the caller.
    let buffer = unsafe { device.create_buffer(&info, None) }.unwrap();
    // SAFETY: `buffer` is alive.
    let requirements = unsafe { device.get_buffer_memory_requirements(buffer) };
    let info = vk::MemoryAllocateInfo::default()
        .allocation_size(requirements.size)
        .memory_type_index(requirements.memory_type_bits.trailing_zeros());
    // SAFETY: the type is one that the buffer allows.
    let memory = unsafe { device.allocate_memory(&info, None) }.unwrap();
    // SAFETY: fresh buffer and memory of its size.
    unsafe { device.bind_buffer_memory(buffer, memory, 0) }.unwrap();
    let info = vk::CommandPoolCreateInfo::default().queue_family_index(handles.queue_family);
    // SAFETY: valid; destroyed by the caller.
    let pool = unsafe { device.create_command_pool(&info, None) }.unwrap();
    let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(count);
    // SAFETY: `pool` is alive.
    (buffer, memory, pool, unsafe { device.allocate_command_buffers(&info) }.unwrap())
}

/// Two fills of one buffer without a barrier between them: a hazard that only synchronization validation
/// sees.
#[test]
fn a_missing_barrier_is_heard() {
    let gpu = validated();
    let handles = gpu.handles();
    let device = &handles.device;
    let (buffer, memory, pool, commands) = to_fill(&handles, 1);
    let commands = commands[0];
    // SAFETY: in the initial state.
    unsafe { device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()) }.unwrap();
    assert!(gpu.validation_log().messages().is_empty());
    for value in [1, 2] {
        // SAFETY: valid but for the missing barrier, which must be heard; never submitted.
        unsafe { device.cmd_fill_buffer(commands, buffer, 0, 256, value) };
    }
    // SAFETY: recording.
    unsafe { device.end_command_buffer(commands) }.unwrap();
    // SAFETY: never submitted.
    unsafe { device.destroy_command_pool(pool, None) };
    // SAFETY: unused.
    unsafe { device.destroy_buffer(buffer, None) };
    // SAFETY: its buffer is gone.
    unsafe { device.free_memory(memory, None) };
    let messages = gpu.validation_log().take();
    assert!(heard(&messages, "SYNC-HAZARD-WRITE"), "{messages:#?}");
}

/// The guard of every other test fails when a message came.
#[test]
fn the_guard_fails_on_a_message() {
    let outcome = std::panic::catch_unwind(|| {
        let gpu = crate::common::gpu();
        let info = vk::BufferCreateInfo::default().size(0).usage(vk::BufferUsageFlags::TRANSFER_SRC);
        // SAFETY: as in `a_core_error_is_heard`.
        if let Ok(buffer) = unsafe { gpu.handles().device.create_buffer(&info, None) } {
            // SAFETY: just made, unused.
            unsafe { gpu.handles().device.destroy_buffer(buffer, None) };
        }
    });
    let message = *outcome.expect_err("the guard let a message pass").downcast::<String>().unwrap();
    assert!(message.contains("validation messages"), "{message}");
}

#[test]
#[ignore = "run by the test below, alone: the last test with a shared device ends it"]
fn child_leaks_on_a_shared_device() {
    let gpu = crate::common::gpu();
    let info = vk::BufferCreateInfo::default().size(64).usage(vk::BufferUsageFlags::TRANSFER_SRC);
    // SAFETY: valid; the leak is the error that must be heard.
    let _leaked = unsafe { gpu.handles().device.create_buffer(&info, None) }.unwrap();
}

#[test]
#[ignore = "run by the test below, alone"]
fn child_keeps_memory_of_a_shared_device() {
    let gpu = crate::common::gpu();
    let scene = GpuScene::new(&gpu, crate::common::scene(Field::Blobs, 4, "f32", &crate::common::FOG));
    crate::common::draw_on(
        &scene,
        &crate::common::view(crate::common::perspective(), 1.0, 4, 4),
        "slices-3d",
    );
    std::mem::forget(scene);
}

/// The guard fails on what is left on a device that tests share, be it memory or an object.
#[test]
fn the_guard_fails_on_leaks_of_shared_devices() {
    let (success, text) = child("child_leaks_on_a_shared_device", &[]);
    assert!(!success && text.contains("at the end of shared devices"), "{text}");
    assert!(LEAK.iter().any(|id| text.contains(id)), "{text}");
    let (success, text) = child("child_keeps_memory_of_a_shared_device", &[]);
    assert!(!success && text.contains("still held when the test ends"), "{text}");
}

/// GPU-assisted validation can be switched on as well.
#[test]
fn gpu_assisted_validation_starts() {
    let options = GpuOptions {
        validation: Validation::GpuAssisted,
        pipeline_cache: PipelineCache::Off,
        ..GpuOptions::default()
    };
    crate::common::undisturbed(|| {
        let gpu = Gpu::new(&options).unwrap();
        let limit = gpu.loop_limit().unwrap();
        assert!(limit > 1000, "{limit}");
        let log = gpu.validation_log();
        drop(gpu);
        let messages = log.messages();
        assert!(messages.is_empty(), "{messages:#?}");
    });
}

/// Runs this test program again with one ignored test and another environment.
fn child(test: &str, variables: &[(&str, &str)]) -> (bool, String) {
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", &format!("validation::{test}"), "--ignored", "--nocapture"])
        .envs(variables.iter().copied())
        .output()
        .unwrap();
    let [stdout, stderr] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    // The status names the signal that ended the process, if one did.
    (output.status.success(), format!("{stdout}{stderr}{test}: {}", output.status))
}

/// What makes the layer look at hazards between command buffers.
const SUBMISSIONS: (&str, &str) =
    ("VK_LAYER_ENABLES", "VALIDATION_CHECK_ENABLE_SYNCHRONIZATION_VALIDATION_QUEUE_SUBMIT");

#[test]
#[ignore = "run by the test below, with submissions looked at"]
fn child_misses_a_barrier_between_command_buffers() {
    let gpu = validated();
    let handles = gpu.handles();
    let device = &handles.device;
    let (buffer, memory, pool, commands) = to_fill(&handles, 2);
    for &commands in &commands {
        // SAFETY: in the initial state.
        unsafe { device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()) }.unwrap();
        // SAFETY: recording.
        unsafe { device.cmd_fill_buffer(commands, buffer, 0, 256, 1) };
        // SAFETY: recording.
        unsafe { device.end_command_buffer(commands) }.unwrap();
    }
    let infos: Vec<_> =
        commands.iter().map(|&raw| vk::CommandBufferSubmitInfo::default().command_buffer(raw)).collect();
    let submits = [vk::SubmitInfo2::default().command_buffer_infos(&infos)];
    // SAFETY: complete but for the missing barrier, which must be heard.
    let _ = gpu.with_queue(|queue| unsafe { device.queue_submit2(queue, &submits, vk::Fence::null()) });
    // SAFETY: alive.
    unsafe { device.device_wait_idle() }.unwrap();
    // SAFETY: nothing is pending.
    unsafe { device.destroy_command_pool(pool, None) };
    // SAFETY: unused.
    unsafe { device.destroy_buffer(buffer, None) };
    // SAFETY: its buffer is gone.
    unsafe { device.free_memory(memory, None) };
    println!("heard: {:?}", gpu.validation_log().take());
}

/// Frames, pass by pass in command buffers of their own: silent, and the images are those of one command buffer.
#[test]
#[ignore = "run by the test below, with submissions looked at"]
fn child_draws_pass_by_pass() {
    let grid = crate::common::scene(Field::Blobs, 12, "f32", &crate::common::FOG);
    let transfer = TransferFunction::from_rows(&crate::common::FOG).unwrap();
    // Cells that overlap: what `havs` draws again from lists of cells.
    let one = Field::Blobs.tets(4).unwrap();
    let count = one.points().len() as u32;
    let points = one.points().iter().copied().chain(one.points().iter().map(|point| *point * 0.7)).collect();
    let cells = one.cells().iter().copied().chain(one.cells().iter().map(|cell| cell.map(|i| i + count)));
    let TetScalars::Point(scalars) = one.scalars() else { panic!("scalars at points") };
    let scalars = scalars.iter().copied().chain(scalars.iter().map(|s| 1.0 - s)).collect();
    let mesh = Tets::new(points, cells.collect(), TetScalars::Point(scalars)).unwrap().0;
    let points = Points::of_vertices(&mesh).unwrap();
    let ellipsoid = [0.05, 0.01, 0.0, 0.04, -0.01, 0.06];
    let covariances = KernelSize::Covariances(vec![ellipsoid; points.centres().len()]);
    let points = Scene::new(points.with_size(covariances).unwrap(), transfer.clone());
    let mesh = Scene::new(mesh, transfer);
    let view = crate::common::view(crate::common::perspective(), 1.0, 50, 30);
    let parallel = crate::common::view(crate::common::orthographic(), 1.0, 50, 30);
    let draw = |options: GpuOptions| {
        let gpu = crate::common::gpu_with(options.clone());
        let (grid, mesh) = (GpuScene::new(&gpu, grid.clone()), GpuScene::new(&gpu, mesh.clone()));
        let points = GpuScene::new(&gpu, points.clone());
        let mut images = Vec::new();
        for spec in crate::common::specs(&gpu).into_iter().filter(|spec| !spec.starts_with("splat-")) {
            images.push(crate::common::draw_on(&grid, &view, &spec));
        }
        // From inside, by base planes on all sides; smaller levels of each.
        let inside = crate::common::view(crate::common::perspective(), 0.1, 50, 30);
        for route in crate::common::routes_of(&gpu, Method::ShearWarp) {
            for spec in ["intermediate=0.5", "intermediate=3,warp=mip", "integrator=exact,stacks=all"] {
                let spec = format!("shear-warp:route={route},{spec}");
                let mut frames =
                    Renderer::new(&grid, crate::common::technique(&spec)).frames(&inside).unwrap();
                for _ in 0..2 {
                    frames.draw(&inside).unwrap();
                }
                let planes = frames
                    .plan()
                    .counters()
                    .iter()
                    .any(|counter| counter.0 == "base_planes" && counter.1 > 2);
                assert!(planes, "{spec}");
                images.push(frames.read_back().unwrap());
            }
        }
        // Marches that go on where another stopped.
        let short = crate::common::gpu_with(GpuOptions { loop_limit: Some(1500), ..options });
        let resumed = GpuScene::new(&short, grid.scene().clone());
        let mut frames =
            Renderer::new(&resumed, crate::common::technique("shear-warp:step=0.02")).frames(&view).unwrap();
        for _ in 0..2 {
            frames.draw(&view).unwrap();
        }
        let dispatches = frames.plan().counters().iter().find(|c| c.0 == "dispatches_or_draws").map(|c| c.1);
        assert!(dispatches > Some(2), "{dispatches:?}");
        images.push(frames.read_back().unwrap());
        drop((frames, resumed, short));
        // Splats by each order, in bands, and frame after frame.
        for (scene, specs) in [
            (
                &points,
                [
                    "splat-ewa:order=center",
                    "splat-ewa:order=center,pairs=500",
                    "splat-ewa:order=pixel",
                    "splat-ewa:order=slabs",
                    "splat-ewa:footprint=ewa",
                    "splat-sheets:sheets=image",
                    "splat-sheets:sheets=axis",
                ]
                .as_slice(),
            ),
            (
                &grid,
                &[
                    "splat-ewa:",
                    "splat-ewa:model=density",
                    "splat-sheets:sheets=image,pairs=1500",
                    "splat-sheets:sheets=axis",
                    "splat-sheets:sheets=axis,kernel=bspline,template=32",
                ],
            ),
            (&mesh, &["splat-ewa:"]),
        ] {
            for spec in specs {
                let view = if spec.contains("template") { &parallel } else { &view };
                let mut frames = Renderer::new(scene, crate::common::technique(spec)).frames(view).unwrap();
                for _ in 0..2 {
                    frames.draw(view).unwrap();
                }
                let bands =
                    frames.plan().counters().iter().any(|counter| counter.0 == "bands" && counter.1 > 1);
                assert_eq!(bands, spec.contains("pairs"), "{spec}");
                images.push(frames.read_back().unwrap());
            }
        }
        let mut meshes: Vec<String> = Vec::new();
        for method in [Method::Havs, Method::ProjectedTets] {
            let routes = crate::common::routes_of(&gpu, method).into_iter();
            meshes.extend(routes.map(|route| format!("{}:route={route}", method.name())));
        }
        meshes.extend(
            [
                "havs:k=1",
                "havs:k=8,chunk=11",
                "havs:order=back-to-front",
                "abuffer",
                "projected-tets:rank=centroid",
                "projected-tets:rank=power,repair=none",
            ]
            .map(String::from),
        );
        if meshes.contains(&"projected-tets:route=raster".to_string()) {
            meshes.extend(["plane=space", "shade=vertex"].map(|option| format!("projected-tets:{option}")));
        }
        for spec in &meshes {
            let mut frames = Renderer::new(&mesh, crate::common::technique(spec)).frames(&view).unwrap();
            for _ in 0..2 {
                frames.draw(&view).unwrap();
            }
            let _ = frames.overflow_map().unwrap();
            images.push(frames.read_back().unwrap());
        }
        images
    };
    let by_pass = draw(GpuOptions { command_buffer_by_pass: true, ..GpuOptions::default() });
    assert!(by_pass == draw(GpuOptions::default()), "the images differ");
    println!("drawn: {}", by_pass.len());
}

/// The layer overlooks hazards between what shaders write in one command buffer. Between command buffers it sees them.
#[test]
fn passes_wait_for_each_other() {
    let hears = |text: &str| text.contains("heard: [") && text.contains("SYNC-HAZARD-WRITE");
    let misses = |variables: &[_]| child("child_misses_a_barrier_between_command_buffers", variables).1;
    // Newer layers do so unasked, and stop where they are asked in the way of older ones.
    let variables = if hears(&misses(&[])) { [].as_slice() } else { &[SUBMISSIONS] };
    let text = misses(variables);
    assert!(hears(&text), "{text}");
    let (success, text) = child("child_draws_pass_by_pass", variables);
    assert!(success && text.contains("drawn: "), "{text}");
}

#[test]
#[ignore = "run by the test below, without a layer"]
fn child_opens_a_validated_device() {
    let error = Gpu::new(&GpuOptions { validation: Validation::On, ..GpuOptions::default() }).unwrap_err();
    println!("refused: {error} (exit code {})", error.exit_code());
    // And the tests' own way to a device fails.
    let _ = crate::common::gpu();
}

#[test]
fn a_missing_layer_is_a_failure() {
    let empty = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("no-layers");
    std::fs::create_dir_all(&empty).unwrap();
    let empty = empty.to_str().unwrap();
    let (success, text) =
        child("child_opens_a_validated_device", &[("VK_LAYER_PATH", empty), ("VK_ADD_LAYER_PATH", empty)]);
    assert!(text.contains("refused: validation: not supported") && text.contains("exit code 3"), "{text}");
    assert!(!success && text.contains("a validated device is required"), "{text}");
}

#[test]
#[ignore = "run by the test below, without a device"]
fn child_opens_any_device() {
    let error = Gpu::headless().unwrap_err();
    println!("refused: {error} (exit code {})", error.exit_code());
}

#[test]
fn a_refused_device_says_why() {
    let (_, text) = child("child_opens_any_device", &[("VOLRASTER_DEVICE", "none")]);
    assert!(text.contains("its name does not contain \"none\"") && text.contains("exit code 3"), "{text}");
    let (_, text) = child(
        "child_opens_any_device",
        &[("VK_DRIVER_FILES", "/nonexistent/icd.json"), ("VK_ICD_FILENAMES", "/nonexistent/icd.json")],
    );
    assert!(text.contains("refused: ") && text.contains("exit code"), "{text}");
}
