//! Scenes from files.

use std::ffi::{c_char, c_void};

use super::argument::{self, Structure};
use super::gpu::vr_gpu;
use super::result::{c_text, call, vr_result};
use super::scene::{FileView, default_technique, give, vr_scene};
use crate::error::{Error, Result};
use crate::io::scene_file::LoadedScene;
use crate::io::{Progress, ReadOptions};
use crate::resident::GpuScene;
use crate::technique::{Method, Technique};

/// Receives the number of bytes read so far and of all bytes, now and then, on any thread; `all` is 0 if it is unknown.
pub type vr_progress_callback = Option<unsafe extern "C" fn(done: u64, all: u64, user: *mut c_void)>;

/// How a file is read, and which of its arrays. Zeros are the defaults. Arrays are named NAME, NAME:PART, point:NAME or
/// cell:NAME:PART; PART is a component (0, x, r, ...) or "magnitude".
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_read_info {
    /// sizeof(vr_read_info).
    pub struct_size: usize,
    /// Limit of the memory for the data, in bytes. 0: 16 GiB.
    pub max_bytes: u64,
    /// The array to show. NULL: the file's active one, else the first with one component.
    pub array: *const c_char,
    /// The array of support radii of points.
    pub radius: *const c_char,
    /// The array of covariances of points.
    pub covariance: *const c_char,
    /// The array of weights of points.
    pub weight: *const c_char,
    /// Receives the progress. May be NULL.
    pub progress: vr_progress_callback,
    /// Passed to progress.
    pub user: *mut c_void,
}

// SAFETY: repr(C), numbers and pointers, which may be null, the first its size.
unsafe impl Structure for vr_read_info {
    const FIRST: usize = size_of::<Self>();
}

/// The caller's function for progress, with its pointer.
struct Listener(unsafe extern "C" fn(u64, u64, *mut c_void), *mut c_void);

// SAFETY: the pointer is passed back and never followed; any thread may call the caller's function.
unsafe impl Send for Listener {}
// SAFETY: the same.
unsafe impl Sync for Listener {}

impl Listener {
    fn tell(&self, done: u64, all: u64) {
        // SAFETY: the caller's function with its own pointer.
        unsafe { (self.0)(done, all, self.1) };
    }
}

/// # Safety
///
/// The strings of `info` are null or end with NUL.
unsafe fn read_options(info: &vr_read_info) -> Result<ReadOptions> {
    let name = |pointer, what| -> Result<Option<String>> {
        // SAFETY: the caller's promise.
        Ok(unsafe { argument::text(pointer, what) }?.map(str::to_string))
    };
    let mut options = ReadOptions {
        array: name(info.array, "array")?,
        radius: name(info.radius, "radius")?,
        covariance: name(info.covariance, "covariance")?,
        weight: name(info.weight, "weight")?,
        ..ReadOptions::default()
    };
    if info.max_bytes > 0 {
        options.max_bytes = info.max_bytes;
    }
    if let Some(progress) = info.progress {
        let listener = Listener(progress, info.user);
        options.progress = Some(Progress::new(move |done, all| listener.tell(done, all)));
    }
    Ok(options)
}

/// Makes a scene from a scene file (.json), a data file of any supported format, or a folder of slices. For a data file the
/// library chooses a camera and a transfer function. `info` may be NULL.
///
/// `path` is UTF-8; on Unix it may have any bytes. Fails with VR_ERROR_IO, with VR_ERROR_FILE whose message names file, place and
/// rule, and with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, strings end with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_load(
    gpu: *const vr_gpu,
    path: *const c_char,
    info: *const vr_read_info,
    scene: *mut *mut vr_scene,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(scene, "scene") }?;
        // SAFETY: the caller's promise.
        let gpu = unsafe { argument::reference(gpu, "gpu") }?;
        // SAFETY: the caller's promise.
        let path = unsafe { argument::path(path, "path") }?;
        let path = path.ok_or_else(|| Error::invalid("path", "is NULL"))?;
        let options = if info.is_null() {
            ReadOptions::default()
        } else {
            // SAFETY: the caller's promise.
            let info = unsafe { argument::structure(info, "vr_read_info") }?;
            // SAFETY: the caller's promise.
            unsafe { read_options(&info) }?
        };
        let loaded = LoadedScene::load_any(path, &options)?;
        let technique = match &loaded.technique {
            Some(choice) => {
                // Errors are reported here, not at the first use.
                Technique::new(Method::from_name(&choice.name)?, &choice.options)?;
                let pairs: Vec<String> = choice.options.iter().map(|(k, v)| format!("{k}={v}")).collect();
                c_text(&format!("{}:{}", choice.name, pairs.join(",")))
            }
            None => default_technique(&loaded.scene),
        };
        let file = FileView {
            camera: (!loaded.camera_is_automatic).then_some(loaded.camera),
            clip: loaded.clip,
            extent: [loaded.width, loaded.height],
        };
        let warnings = c_text(&loaded.report.warnings.join("\n"));
        let scene = GpuScene::new(&gpu.gpu, loaded.scene);
        Ok(give(vr_scene { scene, technique, file: Some(file), warnings }, out))
    })
}
