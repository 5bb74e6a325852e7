//! Device memory, host memory and threads for compilation that the caller provides.

use std::alloc::Layout;
use std::collections::HashMap;
use std::ffi::c_void;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use volraster::ash::vk;
use volraster::gpu::{
    AllocationCallbacks, Compilation, Gpu, GpuOptions, MemoryAccess, MemoryPart, MemoryRequest, MemorySource,
    PipelineCache,
};

use super::common::*;
use super::engine::{Engine, turn};
use super::{calls, every_kind};

/// A source that gives each resource an allocation of its own, behind a part that it skips.
#[derive(Debug)]
struct Dedicated {
    functions: NotShown<volraster::ash::Device>,
    types: vk::PhysicalDeviceMemoryProperties,
    live: Mutex<HashMap<u64, u64>>,
    given: AtomicUsize,
    /// The number of the request that fails.
    fails: usize,
    wrong: Option<Wrong>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrong {
    Unmapped,
    Misaligned,
}

struct NotShown<T>(T);

impl<T> std::fmt::Debug for NotShown<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("...")
    }
}

impl Dedicated {
    fn new(engine: &Engine, fails: usize, wrong: Option<Wrong>) -> Arc<Self> {
        Arc::new(Self {
            functions: NotShown(engine.device.clone()),
            // SAFETY: the physical device belongs to the instance.
            types: unsafe { engine.instance.get_physical_device_memory_properties(engine.physical) },
            live: Mutex::default(),
            given: AtomicUsize::new(0),
            fails,
            wrong,
        })
    }
}

// SAFETY: each part is an allocation of its own of the requested type, mapped where the host has access, until it is freed.
unsafe impl MemorySource for Dedicated {
    fn allocate(&self, request: &MemoryRequest<'_>) -> Result<MemoryPart, vk::Result> {
        use vk::MemoryPropertyFlags as P;
        if self.given.fetch_add(1, Ordering::Relaxed) == self.fails {
            return Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
        }
        let host = request.access != MemoryAccess::Device;
        let wanted = if host { P::HOST_VISIBLE | P::HOST_COHERENT } else { P::DEVICE_LOCAL };
        let MemoryRequest { requirements, addressed, .. } = *request;
        let allowed = |i: &u32| {
            requirements.memory_type_bits & (1 << i) != 0
                && self.types.memory_types[*i as usize].property_flags.contains(wanted)
        };
        let kind = (0..self.types.memory_type_count).find(allowed).unwrap();
        let skipped = requirements.alignment;
        let flags = if addressed { vk::MemoryAllocateFlags::DEVICE_ADDRESS } else { Default::default() };
        let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(flags);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(requirements.size + skipped)
            .memory_type_index(kind)
            .push_next(&mut flags);
        let device = &self.functions.0;
        // SAFETY: a type of this device.
        let memory = unsafe { device.allocate_memory(&info, None) }?;
        self.live.lock().unwrap().insert(vk::Handle::as_raw(memory), requirements.size);
        let start = host.then(|| {
            // SAFETY: the host sees it, and it is not mapped.
            unsafe { device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()) }.unwrap()
        });
        // SAFETY: the allocation is larger.
        let mapped = start.map(|start| unsafe { start.cast::<u8>().add(skipped as usize) });
        let mapped = mapped.and_then(NonNull::new).filter(|_| self.wrong != Some(Wrong::Unmapped));
        let offset = if self.wrong == Some(Wrong::Misaligned) && skipped > 1 { 1 } else { skipped };
        Ok(MemoryPart { memory, offset, mapped, tag: 7 })
    }

    fn free(&self, part: MemoryPart) {
        assert_eq!(part.tag, 7);
        assert!(self.live.lock().unwrap().remove(&vk::Handle::as_raw(part.memory)).is_some(), "freed twice");
        // SAFETY: it was allocated here, and nothing uses it.
        unsafe { self.functions.0.free_memory(part.memory, None) };
    }
}

/// Adopts a device whose functions note their calls.
fn adopted(engine: &Engine, options: GpuOptions) -> Gpu {
    let mut parts = engine.parts();
    parts.device = calls::noting(&engine.instance, engine.device.handle());
    // SAFETY: the engine outlives it.
    unsafe { Gpu::from_raw(parts, &GpuOptions { pipeline_cache: PipelineCache::Off, ..options }) }.unwrap()
}

/// Pictures of every kind of scene.
fn pictures(gpu: &Gpu) -> Vec<volraster::Image> {
    let view = view(perspective(), 1.0, 40, 30);
    let scenes = every_kind(gpu);
    let draw = |(scene, specs): &(Arc<volraster::GpuScene>, Vec<String>)| {
        specs.iter().map(|spec| draw_on(scene, &view, spec)).collect::<Vec<_>>()
    };
    scenes.iter().flat_map(draw).collect()
}

/// All memory comes from the caller's source and goes back to it, images are the same, and the library allocates none.
#[test]
fn all_device_memory_is_the_caller_s() {
    let _turn = turn();
    let engine = Engine::full();
    let want = pictures(&engine.gpu());
    let source = Dedicated::new(&engine, usize::MAX, None);
    let (got, calls) = calls::during(|| {
        let gpu =
            adopted(&engine, GpuOptions { memory: Some(Arc::clone(&source) as _), ..GpuOptions::default() });
        let got = pictures(&gpu);
        let reported: u64 = gpu.memory_report().iter().map(|(_, bytes)| bytes).sum();
        assert_eq!(source.live.lock().unwrap().values().sum::<u64>(), reported);
        got
    });
    assert!(got == want);
    assert!(!calls.contains(&"vkAllocateMemory") && calls.contains(&"vkCreateBuffer"));
    assert!(source.given.load(Ordering::Relaxed) > 100, "{:?}", source.given);
    assert_eq!(*source.live.lock().unwrap(), HashMap::new());
    engine.end_silently();
}

/// A request that the source refuses is an error that names it; a part against its promises is refused and given back.
#[test]
fn memory_that_is_refused_or_wrong_is_an_error() {
    let _turn = turn();
    let engine = Engine::full();
    for (fails, wrong, words) in [
        (3, None, "device memory allocation has failed"),
        (usize::MAX, Some(Wrong::Unmapped), "is not mapped"),
        (usize::MAX, Some(Wrong::Misaligned), "not aligned"),
    ] {
        let source = Dedicated::new(&engine, fails, wrong);
        let gpu =
            adopted(&engine, GpuOptions { memory: Some(Arc::clone(&source) as _), ..GpuOptions::default() });
        let scene = volraster::GpuScene::new(&gpu, scene(volraster::scene::Field::Blobs, 8, "u8", &FOG));
        let renderer = volraster::Renderer::new(&scene, technique("slices-3d"));
        let text = renderer.render(&view(perspective(), 1.0, 20, 20)).unwrap_err().to_string();
        assert!(text.contains(words) && !text.contains('\n'), "{text}");
        drop((renderer, scene, gpu));
        assert_eq!(*source.live.lock().unwrap(), HashMap::new(), "{words}");
    }
    engine.end_silently();
}

/// Bytes of host memory that are in use, and calls.
#[derive(Default)]
struct Host {
    live: Mutex<HashMap<usize, Layout>>,
    calls: AtomicUsize,
}

impl Host {
    fn of<'a>(user: *mut c_void) -> &'a Self {
        // SAFETY: the test's, which outlives the device's objects.
        unsafe { &*user.cast::<Self>() }
    }

    fn allocate(&self, size: usize, alignment: usize) -> *mut c_void {
        self.calls.fetch_add(1, Ordering::Relaxed);
        let Ok(layout) = Layout::from_size_align(size.max(1), alignment.max(1)) else {
            return std::ptr::null_mut();
        };
        // SAFETY: not of size 0.
        let pointer = unsafe { std::alloc::alloc(layout) };
        self.live.lock().unwrap().insert(pointer.addr(), layout);
        pointer.cast()
    }

    fn free(&self, memory: *mut c_void) {
        if memory.is_null() {
            return;
        }
        let layout = self.live.lock().unwrap().remove(&memory.addr()).unwrap();
        // SAFETY: allocated with this layout.
        unsafe { std::alloc::dealloc(memory.cast(), layout) };
    }
}

unsafe extern "system" fn allocate(
    user: *mut c_void,
    size: usize,
    alignment: usize,
    _: vk::SystemAllocationScope,
) -> *mut c_void {
    Host::of(user).allocate(size, alignment)
}

unsafe extern "system" fn reallocate(
    user: *mut c_void,
    old: *mut c_void,
    size: usize,
    alignment: usize,
    _: vk::SystemAllocationScope,
) -> *mut c_void {
    let host = Host::of(user);
    let new = if size == 0 { std::ptr::null_mut() } else { host.allocate(size, alignment) };
    let before = host.live.lock().unwrap().get(&old.addr()).map_or(0, Layout::size);
    if !new.is_null() && !old.is_null() {
        // SAFETY: both are as large, and apart.
        unsafe { std::ptr::copy_nonoverlapping(old.cast::<u8>(), new.cast::<u8>(), before.min(size)) };
    }
    host.free(old);
    new
}

unsafe extern "system" fn free(user: *mut c_void, memory: *mut c_void) {
    Host::of(user).free(memory);
}

/// Every object is created and destroyed with the caller's callbacks, and nothing of theirs is left.
#[test]
fn every_object_gets_the_caller_s_callbacks() {
    let _turn = turn();
    let engine = Engine::full();
    let host = Host::default();
    let callbacks = vk::AllocationCallbacks::default()
        .user_data((&raw const host).cast_mut().cast())
        .pfn_allocation(Some(allocate))
        .pfn_reallocation(Some(reallocate))
        .pfn_free(Some(free));
    // SAFETY: valid, of no thread in particular, and `host` outlives the device's objects.
    let allocation_callbacks = Some(unsafe { AllocationCallbacks::new(callbacks) });
    let source = Dedicated::new(&engine, usize::MAX, None);
    let ((), [with, without]) = calls::hosts(|| {
        let memory = Some(Arc::clone(&source) as _);
        let gpu = adopted(&engine, GpuOptions { allocation_callbacks, memory, ..GpuOptions::default() });
        assert!(!pictures(&gpu).is_empty());
    });
    assert!(with > 500 && without == 0, "{with} with, {without} without");
    assert!(host.calls.load(Ordering::Relaxed) > 100, "{:?}", host.calls);
    assert_eq!(*host.live.lock().unwrap(), HashMap::new());
    engine.end_silently();
}

/// Pipelines are built by the caller's threads, one call for each, and what these leave out all the same.
#[test]
fn pipelines_are_compiled_on_the_caller_s_threads() {
    let _turn = turn();
    let engine = Engine::full();
    let want = pictures(&engine.gpu());
    let (announced, built) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    let elsewhere = Arc::new(AtomicUsize::new(0));
    for lazy in [false, true] {
        let counts = [&announced, &built, &elsewhere].map(Arc::clone);
        let compilation = Compilation::new(move |count, task| {
            counts[0].fetch_add(count, Ordering::Relaxed);
            let waits = std::thread::current().id();
            std::thread::scope(|scope| {
                for i in (0..count).filter(|i| !lazy || i % 2 == 0) {
                    let (built, elsewhere) = (&counts[1], &counts[2]);
                    scope.spawn(move || {
                        task(i);
                        built.fetch_add(1, Ordering::Relaxed);
                        elsewhere
                            .fetch_add(usize::from(std::thread::current().id() != waits), Ordering::Relaxed);
                    });
                }
            });
        });
        let (got, calls) = calls::during(|| {
            let gpu =
                adopted(&engine, GpuOptions { compilation: Some(compilation), ..GpuOptions::default() });
            pictures(&gpu)
        });
        assert!(got == want);
        let created = calls.iter().filter(|call| call.ends_with("Pipelines")).count();
        let [announced, built, elsewhere] =
            [&announced, &built, &elsewhere].map(|count| count.swap(0, Ordering::Relaxed));
        assert!(created > 20 && announced >= created, "{created} of {announced}");
        assert_eq!(built, elsewhere);
        assert!(if lazy { built < announced } else { built == announced }, "{built} of {announced}");
    }
    engine.end_silently();
}
