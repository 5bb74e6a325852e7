//! Scenes: data and transfer function on a device.

use std::ffi::{CString, c_char};
use std::sync::Arc;

use super::argument::{Caller, Structure, check_pointer};
use super::data::{self, vr_gaussians_info, vr_grid_info, vr_knot, vr_mesh_info, vr_points_info};
use super::gpu::vr_gpu;
use super::result::{c_text, call, destroy, make, vr_result};
use super::view::vr_view;
use super::vulkan::VkBool32;
use crate::error::Result;
use crate::io::scene_file::LoadedScene;
use crate::resident::GpuScene;
use crate::scene::{Camera, Clip, Data, Scene, View, auto};
use crate::technique::{Method, Technique};

/// Data with a transfer function on a device. Creating a plan uploads the data that its technique needs, which the scene then keeps.
/// A scene does not change: functions that change something make another scene, which shares the rest.
#[derive(Debug)]
pub struct vr_scene {
    pub(super) scene: Arc<GpuScene>,
    /// Default technique, as `NAME:key=value,...`.
    pub(super) technique: CString,
    pub(super) view: SceneView,
    pub(super) warnings: CString,
}

/// The view of the file that a scene was read from, or the default.
#[derive(Clone, Copy, Debug)]
pub(super) struct SceneView {
    /// `None` if the library chooses it for the data.
    pub(super) camera: Option<Camera>,
    pub(super) clip: Clip,
    pub(super) extent: [u32; 2],
}

/// Kind of the data of a scene.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_data_kind {
    /// A grid.
    VR_DATA_GRID = 1,
    /// A mesh of tetrahedra.
    VR_DATA_MESH = 2,
    /// Scattered points.
    VR_DATA_POINTS = 3,
    /// Trained Gaussian splats.
    VR_DATA_GAUSSIANS = 4,
}

/// Properties of a scene, for placing a camera and making a transfer function.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_scene_info {
    /// sizeof(vr_scene_info).
    pub struct_size: usize,
    /// Least corner of the data's bounding box, whose sides are parallel to the world's axes.
    pub low: [f64; 3],
    /// Greatest corner of the bounding box.
    pub high: [f64; 3],
    /// Smallest and largest finite scalar.
    pub range: [f64; 2],
    /// A vr_data_kind.
    pub data_kind: u32,
    /// Samples along x, y and z; 0 if the data is not a grid.
    pub dims: [u32; 3],
}

// SAFETY: repr(C), numbers, the first its size.
unsafe impl Structure for vr_scene_info {}

impl vr_scene {
    /// Makes a handle of another scene with the same technique, view and warnings.
    pub(super) fn with(&self, scene: Arc<GpuScene>) -> Self {
        Self { scene, technique: self.technique.clone(), view: self.view, warnings: self.warnings.clone() }
    }

    /// Makes a handle as [`Self::with`] does. The default technique depends on surfaces and mode; the technique of a file is kept.
    pub(super) fn with_other_default(&self, scene: Arc<GpuScene>) -> Self {
        let mut made = self.with(scene);
        if self.technique == default_technique(self.scene.scene()) {
            made.technique = default_technique(made.scene.scene());
        }
        made
    }

    /// Returns the scene's view, with a camera chosen for the data if it has none; with sides of 0 also the size.
    fn view(&self, width: u32, height: u32) -> Result<View> {
        let SceneView { camera, clip, extent } = self.view;
        let [width, height] = if [width, height] == [0; 2] { extent } else { [width, height] };
        let camera = match camera {
            Some(camera) => camera,
            None => auto::camera(self.scene.scene(), width, height)?,
        };
        Ok(View::new(camera, width, height)?.with_clip(clip))
    }

    /// Parses a technique; null stands for the scene's own.
    pub(super) fn chosen(&self, caller: &Caller, technique: *const c_char) -> Result<Technique> {
        match caller.text(technique, "technique")? {
            Some(text) => Technique::parse(text),
            None => Technique::parse(&self.technique.to_string_lossy()),
        }
    }
}

pub(super) fn default_technique(scene: &Scene) -> CString {
    c_text(Method::default_for(scene).map_or("", Method::name))
}

/// Makes a scene of data in the caller's memory, which `read` copies. Without knots the transfer function is chosen.
fn create<Info: Structure, D: Into<Data>>(
    caller: Caller,
    gpu: *const vr_gpu,
    (info, name): (*const Info, &str),
    (knots, knot_count): (*const vr_knot, usize),
    scene: *mut *mut vr_scene,
    read: fn(&Caller, &Info) -> Result<D>,
) -> vr_result {
    make(caller, (scene, "scene"), |caller| {
        let gpu = caller.reference(gpu, "gpu")?;
        let info = caller.structure(info, name)?;
        let transfer = data::transfer(caller, knots, knot_count)?;
        let data = read(caller, &info)?.into();
        let transfer = match transfer {
            Some(transfer) => transfer,
            None => auto::transfer(&data)?,
        };
        let scene = Scene::new(data, transfer);
        let technique = default_technique(&scene);
        let view = SceneView { camera: None, clip: Clip::none(), extent: [LoadedScene::DEFAULT_SIDE; 2] };
        Ok(vr_scene { scene: GpuScene::new(&gpu.gpu, scene), technique, view, warnings: CString::default() })
    })
}

/// Makes a scene of a grid in memory, which is copied. Without knots (NULL, 0) the library chooses a transfer function.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_create_grid(
    gpu: *const vr_gpu,
    info: *const vr_grid_info,
    knots: *const vr_knot,
    knot_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    let caller = unsafe { Caller::trusted() };
    create(caller, gpu, (info, "vr_grid_info"), (knots, knot_count), scene, data::grid)
}

/// Makes a scene of tetrahedra in memory, which are copied. Without knots (NULL, 0) the library chooses a transfer function.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_create_mesh(
    gpu: *const vr_gpu,
    info: *const vr_mesh_info,
    knots: *const vr_knot,
    knot_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    let caller = unsafe { Caller::trusted() };
    create(caller, gpu, (info, "vr_mesh_info"), (knots, knot_count), scene, data::mesh)
}

/// Makes a scene of points in memory, which are copied. Without knots (NULL, 0) the library chooses a transfer function.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_create_points(
    gpu: *const vr_gpu,
    info: *const vr_points_info,
    knots: *const vr_knot,
    knot_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    let caller = unsafe { Caller::trusted() };
    create(caller, gpu, (info, "vr_points_info"), (knots, knot_count), scene, data::points)
}

/// Makes a scene of trained Gaussian splats in memory, which are copied. They have colours of their own.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_create_gaussians(
    gpu: *const vr_gpu,
    info: *const vr_gaussians_info,
    scene: *mut *mut vr_scene,
) -> vr_result {
    // SAFETY: the caller's promise.
    let caller = unsafe { Caller::trusted() };
    let no_knots = (std::ptr::null(), 0);
    create(caller, gpu, (info, "vr_gaussians_info"), no_knots, scene, data::gaussians)
}

/// Destroys a scene's handle; NULL is ignored. Plans and recordings made from it stay valid.
///
/// Threads: any, while no other function uses this handle.
///
/// # Safety
///
/// `scene` is NULL, or a handle that was not destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_destroy(scene: *mut vr_scene) {
    // SAFETY: the caller's promise.
    unsafe { destroy(scene) };
}

/// Writes the properties of a scene.
///
/// Threads: any.
///
/// # Safety
///
/// `scene` is NULL or valid; `info` is NULL or valid, with its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_query(scene: *const vr_scene, info: *mut vr_scene_info) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let data = &caller.reference(scene, "scene")?.scene.scene().data;
        let corners = data.corners();
        let (kind, dims) = match data {
            Data::Grid(grid) => (vr_data_kind::VR_DATA_GRID, grid.dims()),
            Data::Mesh(_) => (vr_data_kind::VR_DATA_MESH, [0; 3]),
            Data::Points(_) => (vr_data_kind::VR_DATA_POINTS, [0; 3]),
            Data::Gaussians(_) => (vr_data_kind::VR_DATA_GAUSSIANS, [0; 3]),
        };
        let value = vr_scene_info {
            struct_size: 0,
            low: corners.into_iter().reduce(glam::DVec3::min).unwrap_or_default().into(),
            high: corners.into_iter().reduce(glam::DVec3::max).unwrap_or_default().into(),
            range: data.range(),
            data_kind: kind as u32,
            dims,
        };
        caller.fill(info, value, "vr_scene_info")
    })
}

/// Writes the view of the scene file, or a view that the library chooses for the data, for an image of this size. Width and
/// height 0 stand for the scene's own size.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// `scene` is NULL or valid; `view` is NULL or valid, with its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_view(
    scene: *const vr_scene,
    width: u32,
    height: u32,
    view: *mut vr_view,
) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let scene = caller.reference(scene, "scene")?;
        caller.fill(view, vr_view::of(&scene.view(width, height)?), "vr_view")
    })
}

/// Returns the technique of the scene file, else the default for the data, in the format of vr_plan_info, valid as long as the
/// handle; NULL for NULL.
///
/// Threads: any.
///
/// # Safety
///
/// `scene` is NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_technique(scene: *const vr_scene) -> *const c_char {
    // SAFETY: the caller's promise.
    unsafe { scene.as_ref() }.map_or(std::ptr::null(), |scene| scene.technique.as_ptr())
}

/// Returns the warnings about the file that was read, one per line, "" if there are none, valid as long as the handle; NULL for
/// NULL.
///
/// Threads: any.
///
/// # Safety
///
/// `scene` is NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_warnings(scene: *const vr_scene) -> *const c_char {
    // SAFETY: the caller's promise.
    unsafe { scene.as_ref() }.map_or(std::ptr::null(), |scene| scene.warnings.as_ptr())
}

/// Writes whether a technique, with or without options, supports a scene.
///
/// Fails with VR_ERROR_INVALID for an unknown technique or invalid options.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, strings end with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_draws(
    scene: *const vr_scene,
    technique: *const c_char,
    draws: *mut VkBool32,
) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let scene = caller.reference(scene, "scene")?;
        check_pointer(technique, "technique")?;
        let method = scene.chosen(caller, technique)?.method();
        caller.write(draws, VkBool32::from(method.draws_scene(scene.scene.scene())), "draws")
    })
}
