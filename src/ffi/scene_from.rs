//! Scenes made from another one, with which they share unchanged data, and from files.

use std::ffi::{c_char, c_void};

use super::argument::{Caller, Structure, User, given};
use super::data::{self, vr_kernels_info, vr_knot, vr_lighting, vr_surface_info};
use super::gpu::vr_gpu;
use super::result::{c_text, make, vr_result};
use super::scene::{SceneView, default_technique, vr_scene};
use crate::error::{Error, Result};
use crate::io::scene_file::LoadedScene;
use crate::io::{Progress, ReadOptions};
use crate::resident::GpuScene;
use crate::scene::{Data, Surface};
use crate::technique::{Method, Technique};

/// Makes a scene of the same data with another transfer function. The scenes share the data on the device; `source` is
/// unchanged.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_transfer(
    source: *const vr_scene,
    knots: *const vr_knot,
    knot_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (scene, "scene"), |caller| {
        let source = caller.reference(source, "source")?;
        let transfer = data::transfer(caller, knots, knot_count)?;
        let transfer = transfer.ok_or_else(|| Error::invalid("knot_count", "0: there must be at least 1"))?;
        Ok(source.with(source.scene.with_transfer(transfer)))
    })
}

/// Makes a scene of other samples in the same grid, with the same placement, transfer function, surfaces and view. The samples are
/// copied, and may be of another type; see vr_grid_info. `source` is unchanged.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, `samples` has `sample_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_samples(
    source: *const vr_scene,
    sample_type: u32,
    samples: *const c_void,
    sample_bytes: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (scene, "scene"), |caller| {
        let source = caller.reference(source, "source")?;
        let old = source.scene.scene();
        let Some(grid) = old.grid() else {
            return Err(Error::invalid("source", format!("holds a {}, not a grid", old.data.kind())));
        };
        let samples = data::samples(caller, grid.dims(), sample_type, (samples, sample_bytes))?;
        Ok(source.with(source.scene.with_samples(samples)?))
    })
}

/// Makes a scene of the same mesh with other scalars, as in vr_mesh_info, and with another transfer function if there are knots. The
/// scenes share points and tetrahedra on the device. Scalars per tetrahedron are given for the tetrahedra that were kept. `source`
/// is unchanged.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_scalars(
    source: *const vr_scene,
    scalars_per: u32,
    scalars: *const f32,
    scalar_count: usize,
    knots: *const vr_knot,
    knot_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (scene, "scene"), |caller| {
        let source = caller.reference(source, "source")?;
        let scalars = data::scalars(caller, scalars, scalar_count, scalars_per)?;
        let transfer = data::transfer(caller, knots, knot_count)?;
        let transfer = transfer.unwrap_or_else(|| source.scene.scene().transfer.clone());
        Ok(source.with(source.scene.with_scalars(scalars, transfer)?))
    })
}

/// Makes a scene of the same data with other surfaces, or with none. The scenes share the data on the device. Every technique draws
/// opaque surfaces, some draw translucent ones, and none does so with a resolution below full: vr_plan_create() refuses the others.
///
/// `surfaces` are `surface_count` pointers. Everything is copied, and `source` is unchanged. Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_surfaces(
    source: *const vr_scene,
    surfaces: *const *const vr_surface_info,
    surface_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (scene, "scene"), |caller| {
        let source = caller.reference(source, "source")?;
        let given = caller.array(surfaces, surface_count, "surfaces")?;
        let surface = |(i, &info)| -> Result<Surface> {
            let info = caller.structure(info, &format!("surfaces[{i}]"))?;
            data::surface(caller, &info).map_err(|error| match error {
                Error::Invalid { what, why } => {
                    Error::Invalid { what: format!("surfaces[{i}]: {what}"), why }
                }
                other => other,
            })
        };
        let surfaces = given.iter().enumerate().map(surface).collect::<Result<Vec<_>>>()?;
        Ok(source.with_other_default(source.scene.with_surfaces(surfaces)))
    })
}

/// Makes a scene of the same data in another mode, a vr_mode. The scenes share the data on the device; `source` is unchanged. Techniques
/// that do not draw a mode are refused by vr_plan_create().
///
/// `lighting` is for VR_MODE_LIT; NULL stands for a light at the eye. Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_mode(
    source: *const vr_scene,
    mode: u32,
    lighting: *const vr_lighting,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (scene, "scene"), |caller| {
        let source = caller.reference(source, "source")?;
        let mode = data::mode(caller, mode, lighting)?;
        Ok(source.with_other_default(source.scene.with_mode(mode)?))
    })
}

/// Makes a scene whose field other kernels reconstruct. The scenes share the data on the device; `source` is unchanged. Splatting techniques
/// draw it; for grids and meshes all others refuse it.
///
/// Fails with VR_ERROR_INVALID, also for trained Gaussian splats, which are kernels of their own.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_kernels(
    source: *const vr_scene,
    info: *const vr_kernels_info,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (scene, "scene"), |caller| {
        let source = caller.reference(source, "source")?;
        let info = caller.structure(info, "vr_kernels_info")?;
        let of_points = matches!(source.scene.scene().data, Data::Points(_));
        let kernels = data::kernels(&info, of_points)?;
        Ok(source.with_other_default(source.scene.with_kernels(kernels)?))
    })
}

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
unsafe impl Structure for vr_read_info {}

fn read_options(caller: &Caller, info: &vr_read_info) -> Result<ReadOptions> {
    let name =
        |pointer, what| -> Result<Option<String>> { Ok(caller.text(pointer, what)?.map(str::to_string)) };
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
    let user = User(info.user);
    options.progress = info.progress.map(|progress| {
        // SAFETY: the caller's function with its own pointer.
        Progress::new(move |done, all| unsafe { progress(done, all, user.pointer()) })
    });
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
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (scene, "scene"), |caller| {
        let gpu = caller.reference(gpu, "gpu")?;
        let path = given(caller.path(path, "path")?, "path")?;
        let info = caller.structure_or_zeros(info, "vr_read_info")?;
        let loaded = LoadedScene::load_any(path, &read_options(caller, &info)?)?;
        let technique = match &loaded.technique {
            Some(choice) => {
                // Errors are reported here, not at the first use.
                Technique::new(Method::from_name(&choice.name)?, &choice.options)?;
                let pairs: Vec<String> = choice.options.iter().map(|(k, v)| format!("{k}={v}")).collect();
                c_text(&format!("{}:{}", choice.name, pairs.join(",")))
            }
            None => default_technique(&loaded.scene),
        };
        let view = SceneView {
            camera: (!loaded.camera_is_automatic).then_some(loaded.camera),
            clip: loaded.clip,
            extent: [loaded.width, loaded.height],
        };
        let warnings = c_text(&loaded.report.warnings.join("\n"));
        Ok(vr_scene { scene: GpuScene::new(&gpu.gpu, loaded.scene), technique, view, warnings })
    })
}
