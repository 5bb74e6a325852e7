//! Devices and the lives of handles; what the library tells of itself.

use std::cell::Cell;
use std::ffi::c_void;
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicU32, Ordering};

use volraster::ash::vk;
use volraster::ash::vk::Handle as _;
use volraster::ffi::*;
use volraster::gpu::Enabled;
use volraster::scene::Field;
use volraster::technique::Method;

use crate::common::caller::Caller;
use crate::common::{FOG, perspective, view};
use crate::engine::Engine;
use crate::support::*;

/// What was made from a handle lives on without it. Locks are held in pairs, and the end is told once, after everything.
#[test]
fn handles_go_in_any_order() {
    #[derive(Default)]
    struct Calls {
        held: Cell<bool>,
        /// Locked when it was, or unlocked when it was not.
        wrong: Cell<bool>,
        locks: Cell<u32>,
        released: Cell<u32>,
    }
    // Calls of this test's thread alone.
    unsafe extern "C" fn lock(user: *mut c_void) {
        // SAFETY: the test's, which waits.
        let calls = unsafe { &*user.cast::<Calls>() };
        calls.locks.set(calls.locks.get() + 1);
        calls.wrong.set(calls.wrong.get() | calls.held.replace(true));
    }
    unsafe extern "C" fn unlock(user: *mut c_void) {
        // SAFETY: the test's, which waits.
        let calls = unsafe { &*user.cast::<Calls>() };
        calls.wrong.set(calls.wrong.get() | !calls.held.replace(false));
    }
    unsafe extern "C" fn released(user: *mut c_void) {
        // SAFETY: the test's, which waits.
        let calls = unsafe { &*user.cast::<Calls>() };
        calls.released.set(calls.released.get() + 1);
    }
    unsafe extern "C" fn with_queue(queue: VkQueue, user: *mut c_void) {
        // SAFETY: the test's, which waits.
        unsafe { *user.cast::<u64>() = queue.as_raw() };
    }
    let _turn = turn();
    let engine = Engine::full();
    let own = engine.gpu();
    let frame = Caller::new(&own, FORMAT, [40, 30], 16);
    let calls = Calls::default();
    let view = c_view(&view(perspective(), 1.0, 40, 30));
    let info = sized!(vr_plan_info { format: FORMAT, mode: vr_target_mode::VR_TARGET_CLEAR as u32 });
    let mut expected = 0;
    for order in 0..3 {
        let (mut gpu, mut plan, mut recording) = (null_mut(), null_mut(), null_mut());
        with_device(&engine, |mut info| {
            info.lock_queue = Some(lock);
            info.unlock_queue = Some(unlock);
            info.released = Some(released);
            info.user = (&raw const calls).cast_mut().cast();
            done!(vr_gpu_adopt(&info, &mut gpu));
            // What fails has released, too.
            info.unlock_queue = None;
            let mut none = null_mut();
            refused!(vr_gpu_adopt(&info, &mut none), vr_result::VR_ERROR_INVALID, "one of them");
            expected += 1;
            assert_eq!(calls.released.get(), expected);
        });
        let before = calls.locks.get();
        let mut queue = 0_u64;
        done!(vr_gpu_with_queue(gpu, Some(with_queue), (&raw mut queue).cast()));
        assert_eq!((queue, calls.locks.get()), (engine.queue.as_raw(), before + 1));
        let scene = c_scene(gpu, &Field::Blobs.sample([12; 3], "u8").unwrap(), &FOG);
        done!(vr_plan_create(scene, &info, &view, &mut plan));
        assert!(calls.locks.get() > before + 1 && !calls.held.get());
        end_gpu(gpu);
        if order > 0 {
            end_scene(scene);
        }
        let at_record = calls.locks.get();
        frame.begin([0.0; 4]);
        done!(vr_plan_record(plan, &record_info(&frame), &mut recording));
        assert_eq!(calls.locks.get(), at_record);
        if order > 1 {
            end_plan(plan);
        }
        let bytes = frame.end(&own);
        assert!(bytes.iter().any(|&byte| byte != 0));
        let mut status = sized!(vr_status {});
        done!(vr_recording_completed(recording, &mut status));
        assert_eq!((status.complete, calls.released.get()), (1, expected + u32::from(order > 1)));
        end_recording(recording);
        if order < 2 {
            end_plan(plan);
        }
        if order < 1 {
            end_scene(scene);
        }
        expected += 1;
        assert_eq!(calls.released.get(), expected);
    }
    assert!(!calls.wrong.get() && calls.locks.get() > 3);
    drop((frame, own));
    engine.end_silently();
}

/// A device of the library's own, and what is no device.
#[test]
fn a_device_of_its_own() {
    use vr_result::VR_ERROR_INVALID as INVALID;
    let _turn = turn();
    let mut gpu = null_mut();
    let info = sized!(vr_gpu_info {
        no_pipeline_cache: 1,
        memory_budget: 123 << 20,
        validation: vr_validation::VR_VALIDATION_ON as u32
    });
    // SAFETY: all are valid.
    let create = |info: &vr_gpu_info, gpu: &mut *mut vr_gpu| unsafe { vr_gpu_create(info, gpu) };
    done(create(&info, &mut gpu));
    // SAFETY: a device.
    assert_ne!(text(unsafe { vr_gpu_name(gpu) }), "");
    let (mut budget, mut objects) = (0, sized!(vr_gpu_objects {}));
    done!(vr_gpu_memory(gpu, null_mut(), &mut budget));
    assert_eq!(budget, 123 << 20);
    done!(vr_gpu_handles(gpu, &mut objects));
    assert!(
        !objects.instance.is_null()
            && !objects.physical_device.is_null()
            && !objects.device.is_null()
            && !objects.queue.is_null()
    );
    let scene = c_scene(gpu, &Field::Blobs.sample([8; 3], "u8").unwrap(), &FOG);
    let view = view(perspective(), 1.0, 16, 12);
    assert!(c_render(scene, Some(c"slabs"), &view).iter().any(|p| p[3] > 0.1));
    end_gpu(gpu);
    end_scene(scene);
    gpu = std::ptr::dangling_mut();
    let none = vr_gpu_info { device: c"none".as_ptr(), ..info };
    refused(create(&none, &mut gpu), vr_result::VR_ERROR_NO_DEVICE, "none");
    assert!(gpu.is_null());
    refused(create(&vr_gpu_info { validation: 3, ..info }, &mut gpu), INVALID, "validation: 3");
    refused!(vr_gpu_create(&info, null_mut()), INVALID, "gpu: is NULL");

    let engine = Engine::new(|_| Enabled { dynamic_rendering: true, ..Enabled::default() });
    with_device(&engine, |info| {
        // SAFETY: what is wrong is refused before it is used.
        let adopt = |info: vr_device_info, gpu: &mut *mut vr_gpu| unsafe { vr_gpu_adopt(&info, gpu) };
        let unsupported = vr_result::VR_ERROR_UNSUPPORTED;
        refused(adopt(info, &mut gpu), unsupported, "synchronization2 is not enabled");
        refused(adopt(vr_device_info { api_version: 0, ..info }, &mut gpu), unsupported, "1.3");
        refused(
            adopt(vr_device_info { instance: vk::Instance::null(), ..info }, &mut gpu),
            INVALID,
            "instance",
        );
        refused(adopt(vr_device_info { device: vk::Device::null(), ..info }, &mut gpu), INVALID, "device");
        refused(adopt(vr_device_info { queue: vk::Queue::null(), ..info }, &mut gpu), INVALID, "queue");
        refused(
            adopt(vr_device_info { physical_device: vk::PhysicalDevice::null(), ..info }, &mut gpu),
            INVALID,
            "physical_device",
        );
        refused(
            adopt(vr_device_info { device_create_info: null(), ..info }, &mut gpu),
            INVALID,
            "device_create_info",
        );
        let two = vr_device_info {
            // Refused before it is used.
            pipeline_cache: vk::Handle::from_raw(1),
            pipeline_cache_folder: c"out".as_ptr(),
            ..info
        };
        refused(adopt(two, &mut gpu), INVALID, "both are given");
        // Of the system's loader, which the engine has, too.
        refused(
            adopt(vr_device_info { get_instance_proc_addr: None, ..info }, &mut gpu),
            unsupported,
            "synchronization2",
        );
    });
    engine.end_silently();
}

#[test]
fn techniques_are_described() {
    assert_eq!(text(vr_version()), env!("CARGO_PKG_VERSION"));
    assert_eq!(vr_technique_count() as usize, Method::ALL.len());
    for (i, method) in Method::ALL.into_iter().enumerate() {
        let mut info = sized!(vr_technique_info {});
        done!(vr_technique_query(i as u32, &mut info));
        let summary = format!("{} ({})", method.summary(), method.source());
        assert_eq!((text(info.name), text(info.summary)), (method.name().into(), summary));
        // SAFETY: lives for ever.
        let options = unsafe { std::slice::from_raw_parts(info.options, info.option_count) };
        assert_eq!(options.len(), method.options().len());
        for (got, want) in options.iter().zip(method.options()) {
            let got = [got.key, got.values, got.default_value, got.effect].map(text);
            assert_eq!(got, [want.key, &want.values, &want.default, want.effect]);
        }
        done!(vr_technique_parse(info.name));
    }
    let mut info = sized!(vr_technique_info {});
    refused!(vr_technique_query(99, &mut info), vr_result::VR_ERROR_INVALID, "index: 99");
    refused!(vr_technique_parse(null()), vr_result::VR_ERROR_INVALID, "NULL");
}

/// Memory and threads of a C program are used, and all of the memory is given back.
#[test]
fn memory_and_threads_are_the_caller_s() {
    #[derive(Default)]
    struct Given {
        device: Option<volraster::ash::Device>,
        types: vk::PhysicalDeviceMemoryProperties,
        live: AtomicU32,
        parts: AtomicU32,
        pipelines: AtomicU32,
    }
    fn given<'a>(user: *mut c_void) -> &'a Given {
        // SAFETY: the test's, which outlives the handles.
        unsafe { &*user.cast::<Given>() }
    }
    unsafe extern "C" fn allocate(
        request: *const vr_memory_request,
        part: *mut vr_memory_part,
        user: *mut c_void,
    ) -> VkResult {
        use vk::MemoryPropertyFlags as P;
        // SAFETY: valid during the call.
        let (request, given) = (unsafe { &*request }, given(user));
        // SAFETY: ends with NUL.
        assert!(!unsafe { std::ffi::CStr::from_ptr(request.name) }.is_empty());
        assert_eq!(request.struct_size, size_of::<vr_memory_request>());
        let host = request.access != vr_memory_access::VR_MEMORY_DEVICE as u32;
        let wanted = if host { P::HOST_VISIBLE | P::HOST_COHERENT } else { P::DEVICE_LOCAL };
        let kind = (0..given.types.memory_type_count).find(|&i| {
            request.memory_type_bits & (1 << i) != 0
                && given.types.memory_types[i as usize].property_flags.contains(wanted)
        });
        let info =
            vk::MemoryAllocateInfo::default().allocation_size(request.size).memory_type_index(kind.unwrap());
        let device = given.device.as_ref().unwrap();
        // SAFETY: a type of this device.
        let memory = unsafe { device.allocate_memory(&info, None) }.unwrap();
        let mapped = if host {
            // SAFETY: the host sees it, and it is not mapped.
            unsafe { device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()) }.unwrap()
        } else {
            null_mut()
        };
        given.live.fetch_add(1, Ordering::Relaxed);
        given.parts.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the library's.
        unsafe { *part = vr_memory_part { memory, offset: 0, mapped, tag: 5 } };
        VkResult::SUCCESS
    }
    unsafe extern "C" fn free(part: *const vr_memory_part, user: *mut c_void) {
        // SAFETY: valid during the call.
        let (part, given) = (unsafe { *part }, given(user));
        assert_eq!(part.tag, 5);
        given.live.fetch_sub(1, Ordering::Relaxed);
        // SAFETY: allocated above, and nothing uses it.
        unsafe { given.device.as_ref().unwrap().free_memory(part.memory, None) };
    }
    unsafe extern "C" fn compile(count: u32, build: vr_compile_task, task: *mut c_void, user: *mut c_void) {
        struct Shared(*mut c_void);
        // SAFETY: the library's task may be called by any thread.
        unsafe impl Sync for Shared {}
        given(user).pipelines.fetch_add(count, Ordering::Relaxed);
        let task = &Shared(task);
        std::thread::scope(|scope| {
            for number in 0..count {
                // SAFETY: as the library asks.
                scope.spawn(move || unsafe { build.unwrap()(number, { task }.0) });
            }
        });
    }
    let _turn = turn();
    let engine = Engine::least();
    let given = Given {
        device: Some(engine.device.clone()),
        // SAFETY: the physical device belongs to the instance.
        types: unsafe { engine.instance.get_physical_device_memory_properties(engine.physical) },
        ..Given::default()
    };
    let mut gpu = null_mut();
    with_device(&engine, |mut info| {
        info.user = (&raw const given).cast_mut().cast();
        info.allocate_memory = Some(allocate);
        let mut none = null_mut();
        refused!(
            vr_gpu_adopt(&info, &mut none),
            vr_result::VR_ERROR_INVALID,
            "free_memory: one of them is NULL"
        );
        info.free_memory = Some(free);
        info.compile = Some(compile);
        done!(vr_gpu_adopt(&info, &mut gpu));
    });
    let grid = Field::Blobs.sample([12; 3], "u8").unwrap();
    let scene = c_scene(gpu, &grid, &FOG);
    let view = view(perspective(), 1.0, 40, 30);
    let (mut used, mut budget) = (0, 0);
    let got = c_render(scene, None, &view);
    done!(vr_gpu_memory(gpu, &mut used, &mut budget));
    assert!(used > 0 && given.live.load(Ordering::Relaxed) > 0);
    end_scene(scene);
    end_gpu(gpu);
    let [live, parts, pipelines] =
        [&given.live, &given.parts, &given.pipelines].map(|count| count.load(Ordering::Relaxed));
    assert!(live == 0 && parts > 5 && pipelines > 0, "{live} of {parts} parts, {pipelines} pipelines");
    let plain = adopt(&engine);
    let scene = c_scene(plain, &grid, &FOG);
    assert!(got == c_render(scene, None, &view));
    end_scene(scene);
    end_gpu(plain);
    engine.end_silently();
}
