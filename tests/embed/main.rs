//! The library in another program: instance, device, queue and the ends of frames are that program's.

#![allow(unreachable_pub, missing_debug_implementations, reason = "a test of several files")]
#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]
#![allow(clippy::unwrap_used, clippy::panic, clippy::too_many_lines, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, reason = "few queue families")]

#[expect(
    clippy::undocumented_unsafe_blocks,
    reason = "the comments are in the macro, where the lint does not see them"
)]
mod calls;
#[path = "../common/mod.rs"]
mod common;
mod contract;
mod engine;
mod host;
mod lifetimes;
mod triangles;

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use common::caller::{Caller, Depth, Signal};
use common::*;
use engine::{Engine, adopt, turn};
use volraster::ash::vk;
use volraster::gpu::{DepthProjection, Enabled, Gpu, GpuOptions, OptionalFeature, PipelineCache, Validation};
use volraster::scene::Field;
use volraster::technique::Renderer;
use volraster::{GpuScene, Plan, TargetDesc, TargetMode};

const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// A frame by a plan, waited for by its fence.
fn draw(gpu: &Gpu, plan: &mut Plan, frame: &Caller) -> Vec<u8> {
    frame.begin([0.0; 4]);
    let recorded = plan.record(&mut frame.command_buffer(gpu), Some(&frame.target(gpu)), None).unwrap();
    let bytes = frame.end(gpu);
    assert!(recorded.completed().unwrap().complete);
    bytes
}

/// The caller's device draws what the crate's own does; it is there when the crate is gone, and nothing is left on it.
#[test]
fn the_caller_s_device_is_as_good_as_one_s_own() {
    let _turn = turn();
    let view = view(perspective(), 1.0, 40, 30);
    let want: Vec<_> = {
        let gpu = fresh_gpu();
        let scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, "u8", &FOG));
        ["slices-3d:route=raster", "slabs:route=compute"].map(|spec| draw_on(&scene, &view, spec)).into()
    };
    let engine = Engine::full();
    let gpu = engine.gpu();
    assert_eq!(gpu.report().reason, "the caller's");
    assert_eq!(gpu.device_reports().len(), 1);
    assert!(gpu.report().chosen);
    assert_eq!(gpu.validation_layer(), None);
    assert!(gpu.has(OptionalFeature::DebugNames));
    assert_eq!(gpu.has(OptionalFeature::FragmentStores), engine.enabled.fragment_stores_and_atomics);
    assert_eq!(gpu.has(OptionalFeature::FragmentInterlock), engine.enabled.fragment_shader_pixel_interlock);
    let own = fresh_gpu();
    for feature in OptionalFeature::ALL {
        assert_eq!(gpu.has(feature), own.has(feature), "{}", feature.name());
    }
    drop(own);
    assert_eq!(gpu.handles().device.handle(), engine.device.handle());
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, "u8", &FOG));
    let got = ["slices-3d:route=raster", "slabs:route=compute"].map(|spec| draw_on(&scene, &view, spec));
    assert!(got == want[..]);
    let log = gpu.validation_log();
    drop((scene, gpu));
    // Alive, and nothing of the crate's on it: the layer tells of what is left when a device goes.
    // SAFETY: nothing is pending.
    unsafe { engine.device.device_wait_idle() }.unwrap();
    engine.end_silently();
    assert!(log.messages().is_empty());
}

/// With nothing enabled but what is required, everything that is optional is missing, and everything is drawn without it.
#[test]
fn the_least_device_draws_everything() {
    let _turn = turn();
    let engine = Engine::least();
    let mut parts = engine.parts();
    parts.instance_extensions.clear();
    let gpu = adopt(parts).unwrap();
    for feature in [
        OptionalFeature::FragmentStores,
        OptionalFeature::FragmentInterlock,
        OptionalFeature::OrderedStores,
        OptionalFeature::BufferAddresses,
        OptionalFeature::MemoryBudget,
        OptionalFeature::DebugNames,
    ] {
        assert!(!gpu.has(feature), "{}", feature.name());
    }
    let view = view(perspective(), 1.0, 40, 30);
    for (scene, specs) in every_kind(&gpu) {
        assert!(!specs.is_empty());
        for spec in specs {
            let image = draw_on(&scene, &view, &spec);
            let [_, _, _, alpha] = image.pixel(20, 15);
            assert!(alpha > 0.1, "{spec}: {alpha}");
        }
    }
    drop(gpu);
    engine.end_silently();
}

/// What is required and missing is named, and nothing is taken that cannot be.
#[test]
fn what_is_missing_is_named() {
    let _turn = turn();
    for (sync, dynamic, what) in [
        (false, true, "synchronization2"),
        (true, false, "dynamicRendering"),
        (false, false, "synchronization2"),
    ] {
        let engine = Engine::new(|_| Enabled {
            synchronization2: sync,
            dynamic_rendering: dynamic,
            ..Enabled::default()
        });
        let error = adopt(engine.parts()).unwrap_err();
        assert!(matches!(error, volraster::Error::Unsupported { .. }), "{error:?}");
        assert!(error.to_string().contains(&format!("{what} is not enabled")), "{error}");
    }
    let engine = Engine::least();
    let refused = |change: &dyn Fn(&mut volraster::gpu::GpuParts)| {
        let mut parts = engine.parts();
        change(&mut parts);
        adopt(parts).unwrap_err()
    };
    for version in [0, vk::API_VERSION_1_0, vk::API_VERSION_1_2] {
        let error = refused(&|parts| parts.api_version = version);
        assert!(matches!(error, volraster::Error::Unsupported { .. }), "{error:?}");
        assert!(error.to_string().contains("older than the required 1.3"), "{error}");
    }
    let error = refused(&|parts| parts.queue_family = 77);
    assert!(matches!(error, volraster::Error::Unsupported { .. }), "{error:?}");
    assert!(error.to_string().contains("graphics and compute"), "{error}");
    let other = Engine::least();
    let invalid = |change: &dyn Fn(&mut volraster::gpu::GpuParts), what: &str| {
        let error = refused(change);
        assert!(matches!(error, volraster::Error::Invalid { .. }), "{error:?}");
        assert!(error.to_string().contains(what), "{error}");
    };
    invalid(&|parts| parts.physical_device = other.physical, "not of this instance");
    invalid(&|parts| parts.physical_device = vk::PhysicalDevice::null(), "physical device is null");
    invalid(&|parts| parts.queue = vk::Queue::null(), "queue is null");
    // SAFETY: refused before it is used.
    let options = |options: &GpuOptions| unsafe { Gpu::from_raw(engine.parts(), options) }.unwrap_err();
    for set in [
        GpuOptions { device: Some("llvmpipe".to_string()), ..GpuOptions::default() },
        GpuOptions { validation: Validation::On, ..GpuOptions::default() },
    ] {
        let error = options(&set);
        assert!(error.to_string().contains("leave them unset"), "{error}");
    }
    // Whatever is said, a device of an instance for less does not have the functions.
    let old = Engine::for_version(vk::API_VERSION_1_1, |none| none);
    let mut parts = old.parts();
    parts.enabled = engine.enabled.clone();
    let error = adopt(parts).unwrap_err();
    assert!(error.to_string().contains("not made for Vulkan 1.3"), "{error}");
    drop(old);
    // Refusals leave the device as it was.
    assert!(engine.gpu().loop_limit().unwrap() > 0);
    for engine in [engine, other] {
        engine.end_silently();
    }
}

/// The other options do what they do on a device of the crate's own.
#[test]
fn budget_and_pipeline_cache_work_on_the_caller_s_device() {
    let _turn = turn();
    let engine = Engine::full();
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("embedded-pipeline-cache");
    let _ = std::fs::remove_dir_all(&folder);
    let options = GpuOptions {
        memory_budget: Some(1000),
        pipeline_cache: PipelineCache::Folder(folder.clone()),
        storage_range: Some(4096),
        ..GpuOptions::default()
    };
    // SAFETY: the engine outlives it.
    let gpu = unsafe { Gpu::from_raw(engine.parts(), &options) }.unwrap();
    assert_eq!(gpu.memory_budget(), 1000);
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, "u8", &FOG));
    let error = Renderer::new(&scene, technique("raycast")).render(&view(perspective(), 1.0, 20, 20));
    let error = error.unwrap_err();
    assert!(matches!(error, volraster::Error::Memory { budget: 1000, .. }), "{error:?}");
    drop((scene, gpu));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    engine.end_silently();
}

/// Every pipeline is created with the caller's cache, and nothing but the caller destroys it. Without one nothing is kept on disk.
#[test]
fn every_pipeline_is_created_with_the_caller_s_cache() {
    let _turn = turn();
    let engine = Engine::full();
    // SAFETY: no data.
    let cache = unsafe { engine.device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None) }
        .unwrap();
    let view = view(perspective(), 1.0, 40, 30);
    let adopted = |pipeline_cache: PipelineCache| {
        let mut parts = engine.parts();
        parts.device = calls::noting(&engine.instance, engine.device.handle());
        // SAFETY: engine and cache outlive it.
        unsafe { Gpu::from_raw(parts, &GpuOptions { pipeline_cache, ..GpuOptions::default() }) }.unwrap()
    };
    let (pipelines, caches) = calls::caches(|| {
        let gpu = adopted(PipelineCache::Caller(cache));
        let mut pipelines = 0;
        for (scene, specs) in every_kind(&gpu) {
            for spec in specs {
                let (_, calls) = calls::during(|| draw_on(&scene, &view, &spec));
                pipelines += calls.iter().filter(|call| call.ends_with("Pipelines")).count();
                assert!(!calls.contains(&"vkCreatePipelineCache"), "{spec}");
            }
        }
        pipelines
    });
    assert!(pipelines > 20 && caches.len() >= pipelines, "{pipelines} of {}", caches.len());
    assert!(caches.iter().all(|&given| given == cache), "{caches:?}");
    let gpu = adopted(PipelineCache::Auto);
    let ((), calls) = calls::during(|| {
        gpu.save_pipeline_cache();
        drop(gpu);
    });
    assert!(!calls.contains(&"vkGetPipelineCacheData"), "{calls:?}");
    let error =
        Gpu::new(&GpuOptions { pipeline_cache: PipelineCache::Caller(cache), ..GpuOptions::default() });
    assert!(error.unwrap_err().to_string().contains("pipeline_cache"));
    // SAFETY: the last pipeline was created.
    unsafe { engine.device.destroy_pipeline_cache(cache, None) };
    engine.end_silently();
}

/// What the caller gives to be kept goes after everything that was made from the device, and may take the device along.
#[test]
fn the_caller_s_device_may_go_with_the_last_of_the_crate() {
    struct Ended(Option<Engine>, Arc<AtomicBool>);
    impl Drop for Ended {
        fn drop(&mut self) {
            drop(self.0.take());
            self.1.store(true, Ordering::Relaxed);
        }
    }
    let _turn = turn();
    let engine = Engine::full();
    let (log, ended) = (Arc::clone(&engine.log), Arc::new(AtomicBool::new(false)));
    let mut parts = engine.parts();
    parts.keep = Some(Arc::new(Mutex::new(Ended(Some(engine), Arc::clone(&ended)))));
    let gpu = adopt(parts).unwrap();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 8, "u8", &FOG));
    let image = draw_on(&scene, &view(perspective(), 1.0, 20, 20), "slices-3d");
    assert!(image.pixel(10, 10)[3] > 0.1);
    drop(gpu);
    assert!(!ended.load(Ordering::Relaxed));
    drop(scene);
    assert!(ended.load(Ordering::Relaxed));
    assert_eq!(log.messages(), [""; 0]);
}

/// Recording calls nothing but `vkCmd...`: it submits nothing, waits for nothing, makes, maps, frees and destroys nothing.
/// Neither does turning to another view. A depth image is written into a descriptor set, and that is all.
#[test]
fn recording_only_records() {
    let _turn = turn();
    let engine = Engine::full();
    let mut parts = engine.parts();
    parts.device = calls::noting(&engine.instance, engine.device.handle());
    let gpu = adopt(parts).unwrap();
    let size = [40, 30];
    let frame = Caller::new(&gpu, FORMAT, size, 16);
    let depth = Depth::new(&gpu, vk::Format::D32_SFLOAT, size, &[0.2; 40 * 30]).unwrap();
    let projection = DepthProjection::perspective(f64::INFINITY, 1.0).unwrap();
    let depth_image = depth.image(&gpu, projection);
    let [first, second] = [1.0, 1.1].map(|distance| view(perspective(), distance, size[0], size[1]));
    let (mut seen, mut cut) = (Vec::new(), 0);
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs {
            for (mode, with_depth) in
                [(TargetMode::Clear, false), (TargetMode::Over, false), (TargetMode::Over, true)]
            {
                let target = TargetDesc::caller(FORMAT, mode);
                let target = if with_depth { target.with_depth() } else { target };
                let renderer = Renderer::new(&scene, technique(&spec));
                let (plan, prepared) = calls::during(|| renderer.prepare(&first, &target));
                seen.extend(prepared);
                let mut plan = match plan {
                    Err(error @ volraster::Error::Unsupported { .. }) if with_depth => {
                        println!("skipped: {error}");
                        continue;
                    }
                    plan => plan.unwrap(),
                };
                cut += u32::from(with_depth);
                for turn in 0..3 {
                    let to = if turn % 2 == 0 { &first } else { &second };
                    let (turned, calls) = calls::during(|| plan.set_view(to).unwrap());
                    assert_eq!(calls, [""; 0], "{spec}: set_view");
                    assert!(turned, "{spec}");
                    frame.begin([0.0; 4]);
                    depth.fill(frame.commands);
                    let (mut commands, image) = (frame.command_buffer(&gpu), frame.target(&gpu));
                    let depth = with_depth.then_some(&depth_image);
                    let held = gpu.memory_report();
                    let (recorded, mut calls) =
                        calls::during(|| plan.record(&mut commands, Some(&image), depth).unwrap());
                    calls.retain(|call| !call.starts_with("vkCmd"));
                    // The depth image is named in a set that the plan has to itself.
                    let want: &[&str] = if with_depth { &["vkUpdateDescriptorSets"] } else { &[] };
                    assert_eq!(calls, want, "{spec}: record");
                    assert_eq!(gpu.memory_report(), held, "{spec}");
                    frame.end(&gpu);
                    // Where the room was too small for the second view, the frame says so.
                    let _ = recorded.completed().unwrap();
                }
            }
        }
    }
    assert!(cut > 5, "{cut} with depth");
    // The notes are taken: preparing does all of this.
    for call in ["vkAllocateMemory", "vkCreateBuffer", "vkCreateImage", "vkQueueSubmit2", "vkWaitForFences"] {
        assert!(calls::NOTED.contains(&call) && seen.contains(&call), "{call}");
    }
    drop((frame, depth, gpu));
    engine.end_silently();
}

/// Each submission of the crate is made under the caller's lock, and nothing else is. The end waits for nothing.
#[test]
fn the_caller_s_lock_is_held_around_each_submission() {
    let _turn = turn();
    let engine = Engine::full();
    let (held, times) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
    let mut parts = engine.parts();
    parts.device = calls::noting(&engine.instance, engine.device.handle());
    let (is_held, count) = (Arc::clone(&held), Arc::clone(&times));
    parts.queue_lock = Some(Arc::new(move |work: &mut dyn FnMut()| {
        assert!(!is_held.swap(true, Ordering::Relaxed));
        count.fetch_add(1, Ordering::Relaxed);
        work();
        is_held.store(false, Ordering::Relaxed);
    }));
    let gpu = adopt(parts).unwrap();
    // A panic would not get through the driver: what is wrong is told afterwards.
    let (submissions, wrong) = (Arc::new(AtomicU32::new(0)), Arc::new(Mutex::new(Vec::new())));
    let (is_held, count, told) = (Arc::clone(&held), Arc::clone(&submissions), Arc::clone(&wrong));
    let watch = move |call: &'static str| {
        let queue = call.starts_with("vkQueue");
        if is_held.load(Ordering::Relaxed) != queue {
            told.lock().unwrap().push(call);
        }
        count.fetch_add(u32::from(queue), Ordering::Relaxed);
    };
    let image = calls::watched(watch, || {
        let scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, "u8", &FOG));
        draw_on(&scene, &view(perspective(), 1.0, 40, 30), "raycast")
    });
    assert_eq!(*wrong.lock().unwrap(), [""; 0]);
    assert!(image.pixel(20, 15)[3] > 0.1);
    let count = submissions.load(Ordering::Relaxed);
    assert!(count >= 3, "{count} submissions");
    assert_eq!(times.load(Ordering::Relaxed), count);
    assert_eq!(gpu.with_queue(|queue| (queue, held.load(Ordering::Relaxed))), (engine.queue, true));
    let ((), end) = calls::during(|| drop(gpu));
    assert!(end.contains(&"vkFreeMemory"), "{end:?}");
    let waits = |call: &&str| call.contains("Wait") || *call == "vkDestroyDevice";
    assert!(!end.iter().any(waits), "{end:?}");
    engine.end_silently();
}

/// A timeline semaphore tells of the ends of frames as well as a fence does: two frames in flight, each completed when the
/// counter has come to its value.
#[test]
fn a_timeline_semaphore_tells_of_the_end() {
    let _turn = turn();
    let engine = Engine::full();
    let gpu = engine.gpu();
    let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
    let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
    // SAFETY: the feature is enabled.
    let semaphore = unsafe { engine.device.create_semaphore(&info, None) }.unwrap();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, "u8", &FOG));
    let renderer = Renderer::new(&scene, technique("slices-3d:route=raster"));
    let views: Vec<_> = (0..6).map(|i| view(perspective(), 1.0 + 0.05 * f64::from(i), 40, 30)).collect();
    let target = TargetDesc::caller(FORMAT, TargetMode::Clear);
    let mut slots: Vec<_> = (0..2)
        .map(|_| {
            (renderer.prepare(&views[0], &target).unwrap(), Caller::new(&gpu, FORMAT, [40, 30], 16), None)
        })
        .collect();
    let mut images = Vec::new();
    let wait = |value: u64| {
        let (semaphores, values) = ([semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the value was submitted.
        unsafe { engine.device.wait_semaphores(&info, 60_000_000_000) }.unwrap();
    };
    for (i, view) in views.iter().enumerate() {
        let value = i as u64 + 1;
        let (plan, frame, recorded) = &mut slots[i % 2];
        if let Some((before, recorded)) = recorded.take() {
            wait(before);
            let recorded: volraster::Recorded = recorded;
            assert!(recorded.completed().unwrap().complete);
            images.push(frame.read());
        }
        assert!(plan.set_view(view).unwrap());
        frame.begin([0.0; 4]);
        let new = plan.record(&mut frame.command_buffer(&gpu), Some(&frame.target(&gpu)), None).unwrap();
        frame.submit(&gpu, Signal::Timeline(semaphore, value));
        *recorded = Some((value, new));
    }
    for i in [views.len(), views.len() + 1] {
        let (_, frame, recorded) = &mut slots[i % 2];
        let (value, recorded) = recorded.take().unwrap();
        wait(value);
        assert!(recorded.completed().unwrap().complete);
        images.push(frame.read());
    }
    let mut plan = renderer.prepare(&views[0], &target).unwrap();
    for (view, image) in views.iter().zip(&images) {
        assert!(plan.set_view(view).unwrap());
        assert!(draw(&gpu, &mut plan, &slots[0].1) == *image);
    }
    assert!(images[0] != images[5]);
    // SAFETY: every value was waited for.
    unsafe { engine.device.destroy_semaphore(semaphore, None) };
    drop((slots, plan, renderer, scene, gpu));
    engine.end_silently();
}
