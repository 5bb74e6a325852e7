//! Validated devices. Making one is slow, and its pipelines stay with it: tests of a process share a few, of which each test
//! has one to itself.

use std::cell::RefCell;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

use volraster::gpu::{Gpu, GpuOptions, PipelineCache, Validation, ValidationLog};

/// A device under core and synchronization validation. Dropping it fails the test when any message came or anything is left
/// on it. A device of the test's own is destroyed, and the messages of that count. One that is shared is destroyed when no
/// test has any (the last one, if none before), and what comes then fails that test. No device is a failure.
pub struct TestGpu {
    gpu: Option<Gpu>,
    log: Arc<ValidationLog>,
    shared: bool,
    /// Whether messages are what the test wants.
    provoked: bool,
}

/// The shared devices.
struct Shared {
    /// Those that no test has.
    free: Vec<Gpu>,
    /// All that there are, or are being made.
    made: usize,
}

static SHARED: Mutex<Shared> = Mutex::new(Shared { free: Vec::new(), made: 0 });
static RETURNED: Condvar = Condvar::new();

/// The layer keeps its devices in a table without a lock: whoever adds one or takes one out writes, everybody else with a
/// device reads. Reading lasts as long as the test has devices.
static TABLE: RwLock<()> = RwLock::new(());

#[derive(Default)]
struct Held {
    devices: usize,
    /// Whether one of them is shared.
    shared: bool,
    reading: Option<RwLockReadGuard<'static, ()>>,
}

thread_local! {
    static HELD: RefCell<Held> = RefCell::default();
}

/// Runs what may wait for other tests. None waits for this one meanwhile, which uses no device before it is through.
fn aside<T>(wait: impl FnOnce() -> T) -> T {
    struct Return;
    impl Drop for Return {
        fn drop(&mut self) {
            if HELD.with_borrow(|held| held.devices > 0) {
                let reading = TABLE.read().unwrap_or_else(PoisonError::into_inner);
                HELD.with_borrow_mut(|held| held.reading = Some(reading));
            }
        }
    }
    HELD.with_borrow_mut(|held| held.reading = None);
    let _return = Return;
    wait()
}

/// Makes or destroys devices. Only from [`aside`].
fn alone<T>(change: impl FnOnce() -> T) -> T {
    let _writing = TABLE.write().unwrap_or_else(PoisonError::into_inner);
    change()
}

/// Runs `work`, which makes and destroys devices of its own, while no other test has one.
pub fn undisturbed<T>(work: impl FnOnce() -> T) -> T {
    aside(|| alone(work))
}

fn hold(shared: bool) {
    HELD.with_borrow_mut(|held| {
        held.devices += 1;
        held.shared |= shared;
    });
}

fn let_go(shared: bool) {
    HELD.with_borrow_mut(|held| {
        held.devices -= 1;
        held.shared &= !shared;
    });
}

/// Whether `VOLRASTER_EMULATE` names a property that the tests' devices have then.
pub fn emulates(property: &str) -> bool {
    std::env::var("VOLRASTER_EMULATE").is_ok_and(|list| list.split(',').any(|word| word == property))
}

fn open(options: GpuOptions) -> Gpu {
    let options = GpuOptions {
        validation: Validation::On,
        pipeline_cache: PipelineCache::Off,
        poison: true,
        ..options
    };
    let options = options.emulating(&std::env::var("VOLRASTER_EMULATE").unwrap_or_default()).unwrap();
    match Gpu::new(&options) {
        Ok(gpu) => gpu,
        Err(error) => panic!("a validated device is required (run `make test`, which installs one): {error}"),
    }
}

fn lock() -> MutexGuard<'static, Shared> {
    SHARED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A shared device: there are as many as tests run at once, up to four.
fn borrowed() -> Gpu {
    let mut shared = lock();
    loop {
        if let Some(gpu) = shared.free.pop() {
            return gpu;
        }
        if shared.made == 0 {
            let threads = std::env::var("RUST_TEST_THREADS").ok().and_then(|text| text.parse().ok());
            let threads = threads.or_else(|| std::thread::available_parallelism().ok().map(usize::from));
            shared.made = threads.unwrap_or(1).min(4);
            let count = shared.made;
            drop(shared);
            // Anyone else finds them made, and waits.
            let made = std::panic::catch_unwind(|| {
                alone(|| (0..count).map(|_| open(GpuOptions::default())).collect())
            });
            shared = lock();
            match made {
                Ok(devices) => shared.free = devices,
                Err(panic) => {
                    shared.made = 0;
                    drop(shared);
                    RETURNED.notify_all();
                    std::panic::resume_unwind(panic);
                }
            }
            RETURNED.notify_all();
        } else {
            shared = RETURNED.wait(shared).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// Gives a shared device back, or ends it. What the layer said at the end of the last ones.
fn give_back(gpu: Gpu, sound: bool) -> Vec<String> {
    let mut shared = lock();
    let mut ending = Vec::new();
    if sound {
        shared.free.push(gpu);
    } else {
        shared.made -= 1;
        ending.push(gpu);
    }
    end(shared, ending)
}

/// Destroys devices, and the shared ones if nobody has any. What the layer said of that.
fn end(mut shared: MutexGuard<'static, Shared>, mut ending: Vec<Gpu>) -> Vec<String> {
    if shared.free.len() == shared.made {
        shared.made = 0;
        ending.append(&mut shared.free);
    }
    drop(shared);
    RETURNED.notify_all();
    let logs: Vec<_> = ending.iter().map(Gpu::validation_log).collect();
    if !ending.is_empty() {
        alone(|| drop(ending));
    }
    logs.iter().flat_map(|log| log.take()).collect()
}

/// A device of the run, validated, without a pipeline cache on disk. Another test may have used it: it may have pipelines.
pub fn gpu() -> TestGpu {
    // Two threads that wait for each other's second device would wait for ever.
    if HELD.with_borrow(|held| held.shared) {
        return fresh_gpu();
    }
    let gpu = aside(|| {
        let gpu = borrowed();
        hold(true);
        gpu
    });
    TestGpu { log: gpu.validation_log(), gpu: Some(gpu), shared: true, provoked: false }
}

/// A device that no other test has used or will use.
pub fn fresh_gpu() -> TestGpu {
    gpu_with(GpuOptions::default())
}

/// The same with options.
pub fn gpu_with(options: GpuOptions) -> TestGpu {
    let gpu = aside(|| {
        let gpu = alone(|| open(options));
        hold(false);
        gpu
    });
    TestGpu { log: gpu.validation_log(), gpu: Some(gpu), shared: false, provoked: false }
}

/// A device for messages that the test wants to hear.
pub fn provoked_gpu() -> TestGpu {
    let mut gpu = fresh_gpu();
    gpu.provoked = true;
    gpu
}

impl std::ops::Deref for TestGpu {
    type Target = Gpu;
    fn deref(&self) -> &Gpu {
        self.gpu.as_ref().unwrap()
    }
}

impl Drop for TestGpu {
    fn drop(&mut self) {
        let Some(gpu) = self.gpu.take() else { return };
        let panicking = std::thread::panicking();
        let held = gpu.memory_report();
        let mut messages = if self.provoked { Vec::new() } else { self.log.messages() };
        let sound = !panicking && held.is_empty() && messages.is_empty();
        let_go(self.shared);
        let shared = self.shared;
        let last = aside(move || {
            if shared {
                return give_back(gpu, sound);
            }
            alone(|| drop(gpu));
            Vec::new()
        });
        if !shared && !self.provoked {
            messages = self.log.messages();
        }
        if !panicking {
            // Something that lives on keeps the device, and then nothing is heard of its end.
            assert!(held.is_empty(), "still held when the test ends: {held:?}");
            assert!(messages.is_empty(), "validation messages: {messages:#?}");
            assert!(last.is_empty(), "validation messages at the end of shared devices: {last:#?}");
        }
    }
}
