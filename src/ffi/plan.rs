//! Plans: a technique prepared for a view and a target.

use std::ffi::{CString, c_char};
use std::sync::Mutex;

use super::argument::{Caller, Structure, check_pointer, choice, flag, reserved};
use super::result::{c_text, call, caught, destroy, lock, make, vr_result};
use super::scene::vr_scene;
use super::view::vr_view;
use super::vulkan::{VkBool32, VkFormat};
use crate::error::Error;
use crate::frame::plan::Plan;
use crate::frame::target::{TargetDesc, TargetMode};
use crate::num;
use crate::technique::Renderer;

/// Everything that frames of one size need: pipelines, buffers, images. Each frame in flight needs a plan of its own.
#[derive(Debug)]
pub struct vr_plan {
    renderer: Renderer,
    target: TargetDesc,
    route: CString,
    pub(super) plan: Mutex<Plan>,
}

/// How the result combines with the contents of the target image.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_target_mode {
    /// It replaces them; pixels without volume become transparent black.
    VR_TARGET_CLEAR = 1,
    /// It is composited over them.
    VR_TARGET_OVER = 2,
}

/// Technique and target of a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_plan_info {
    /// sizeof(vr_plan_info).
    pub struct_size: usize,
    /// Technique with options, NAME[:key=value,...], such as "slabs:step=0.5". NULL: vr_scene_technique().
    pub technique: *const c_char,
    /// Format of target images. Values are premultiplied linear RGBA; an sRGB format encodes them.
    pub format: VkFormat,
    /// A vr_target_mode.
    pub mode: u32,
    /// Whether each recording has a depth image, which cuts the rays of the volume at its surfaces.
    pub with_depth: VkBool32,
    /// Whether the target is a rectangle of a larger image, placed by vr_record_info::corner.
    pub in_part: VkBool32,
    /// Format of the images of hit depths: a colour format with red, such as VK_FORMAT_R32_SFLOAT.
    pub hit_format: VkFormat,
    /// 0.
    pub reserved: u32,
    /// Opacity whose depth on each ray an image of each recording gets, above 0 and below 1; 0: no such image. 1/255 is where the volume
    /// begins to show, 1/2 its apparent surface.
    pub hit_opacity: f64,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_plan_info {}

/// Makes a plan for frames of this view's size. May allocate, compile, upload, submit and wait.
///
/// Fails with VR_ERROR_INVALID for options that do not exist or do not fit the scene, with VR_ERROR_UNSUPPORTED or
/// VR_ERROR_MEMORY if the device lacks a feature or memory, and with VR_ERROR_VULKAN.
///
/// Threads: any; plans of one scene may be created at the same time.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_create(
    scene: *const vr_scene,
    info: *const vr_plan_info,
    view: *const vr_view,
    plan: *mut *mut vr_plan,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (plan, "plan"), |caller| {
        let scene = caller.reference(scene, "scene")?;
        let info = caller.structure(info, "vr_plan_info")?;
        reserved(info.reserved)?;
        let view = caller.structure(view, "vr_view")?.view()?;
        let mode = choice(info.mode, 1, &[TargetMode::Clear, TargetMode::Over], "mode")?;
        let target = TargetDesc::caller(info.format, mode);
        let target = if flag(info.with_depth, "with_depth")? { target.with_depth() } else { target };
        let target = if flag(info.in_part, "in_part")? { target.in_part() } else { target };
        let target = match info.hit_opacity {
            0.0 => target,
            opacity => target.with_hit_depths(info.hit_format, opacity)?,
        };
        let renderer = Renderer::new(&scene.scene, scene.chosen(caller, info.technique)?);
        let plan = renderer.prepare(&view, &target)?;
        Ok(vr_plan { renderer, target, route: c_text(plan.route()), plan: Mutex::new(plan) })
    })
}

/// Sets another view of the same image size. Allocates nothing and does not wait. Returns VR_NO_ROOM and changes nothing if the
/// plan's capacity is too small for the view, if its size differs, or if it clips and the plan was made without clipping: call
/// vr_plan_prepare() then.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any; calls with one plan wait for each other.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_set_view(plan: *mut vr_plan, view: *const vr_view) -> vr_result {
    // SAFETY: the caller's promise.
    let caller = unsafe { Caller::trusted() };
    caught(|| {
        let plan = caller.reference(plan, "plan")?;
        let view = caller.structure(view, "vr_view")?.view()?;
        Ok(if lock(&plan.plan, "plan")?.set_view(&view)? { vr_result::VR_OK } else { vr_result::VR_NO_ROOM })
    })
}

/// Loads what the last recording lacked of a grid in pages or a mesh or points in parts, since the device has no room for the whole, where vr_status::complete
/// is VK_FALSE. VR_OK says that the next recording goes on with the image, or begins anew where the view has changed since; VR_NO_ROOM that nothing was lacking: call
/// vr_plan_prepare() then. Reads the source of the data, submits and waits.
///
/// Fails with VR_ERROR_INVALID while a recording is not completed, with errors of the data's source, and as vr_plan_create().
///
/// Threads: any; calls with one plan wait for each other.
///
/// # Safety
///
/// Pointers are NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_load(plan: *mut vr_plan) -> vr_result {
    // SAFETY: the caller's promise.
    let caller = unsafe { Caller::trusted() };
    caught(|| {
        let plan = caller.reference(plan, "plan")?;
        Ok(if lock(&plan.plan, "plan")?.load()? { vr_result::VR_OK } else { vr_result::VR_NO_ROOM })
    })
}

/// Makes a plan anew for a view of any size, with the capacity that earlier frames lacked. Resources of its recordings live until
/// these are completed. May allocate, compile, upload, submit and wait.
///
/// Fails as vr_plan_create(), and leaves the plan unchanged.
///
/// Threads: any; calls with one plan wait for each other.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_prepare(plan: *mut vr_plan, view: *const vr_view) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let plan = caller.reference(plan, "plan")?;
        let view = caller.structure(view, "vr_view")?.view()?;
        let mut held = lock(&plan.plan, "plan")?;
        *held = plan.renderer.prepare(&view, &plan.target)?;
        Ok(())
    })
}

/// Returns the route of the technique on this device (raster, compute, ...), valid as long as the handle; NULL for NULL.
///
/// Threads: any.
///
/// # Safety
///
/// `plan` is NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_route(plan: *const vr_plan) -> *const c_char {
    // SAFETY: the caller's promise.
    unsafe { plan.as_ref() }.map_or(std::ptr::null(), |plan| plan.route.as_ptr())
}

/// Destroys a plan's handle; NULL is ignored. Resources of its recordings live until these are completed.
///
/// Threads: any, while no other function uses this handle.
///
/// # Safety
///
/// `plan` is NULL, or a handle that was not destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_destroy(plan: *mut vr_plan) {
    // SAFETY: the caller's promise.
    unsafe { destroy(plan) };
}

/// Draws a frame and waits for it, for tests, thumbnails and files. Writes width * height pixels of premultiplied linear red, green,
/// blue and alpha to `pixels`, row by row, top row first; `float_count` is the number of floats that `pixels` can hold.
///
/// Fails as vr_plan_create(), and with VR_ERROR_TIMEOUT.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes; `pixels` can hold `float_count` floats; `technique` ends with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_render(
    scene: *const vr_scene,
    technique: *const c_char,
    view: *const vr_view,
    pixels: *mut f32,
    float_count: usize,
) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let scene = caller.reference(scene, "scene")?;
        let view = caller.structure(view, "vr_view")?.view()?;
        let technique = scene.chosen(caller, technique)?;
        let [width, height] = view.extent();
        let needed = num::index(width).saturating_mul(num::index(height)).saturating_mul(4);
        if float_count < needed {
            let why = format!("{float_count}: {width} x {height} pixels need {needed}");
            return Err(Error::invalid("float_count", why));
        }
        check_pointer(pixels, "pixels")?;
        let image = Renderer::new(&scene.scene, technique).render(&view)?;
        let floats: &[f32] = image.pixels().as_flattened();
        // SAFETY: the caller's array is large enough, as checked, and separate from the image.
        unsafe { std::ptr::copy_nonoverlapping(floats.as_ptr(), pixels, floats.len().min(needed)) };
        Ok(())
    })
}
