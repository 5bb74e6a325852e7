//! Plans, recordings, and what they tell.

use std::ffi::{CString, c_char};
use std::sync::{Mutex, MutexGuard};

use ash::vk;
use ash::vk::Handle as _;
use glam::DMat4;

use super::argument::{self, Structure, choice};
use super::result::{c_text, call, quietly, vr_result};
use super::scene::vr_scene;
use super::view::vr_view;
use super::vulkan::{VkBool32, VkCommandBuffer, VkExtent2D, VkFormat, VkImage, VkImageLayout, VkImageView};
use crate::error::{Error, Result};
use crate::frame::plan::{Plan, Recorded, Status};
use crate::frame::target::{TargetDesc, TargetMode};
use crate::gpu::{CommandBuffer, DepthImage, DepthProjection, Gpu, TargetImage};
use crate::num;
use crate::technique::Renderer;

/// Everything that one frame of one size needs, fixed: pipelines, buffers, images. For several frames in flight there are as many
/// plans.
#[derive(Debug)]
pub struct vr_plan {
    gpu: Gpu,
    renderer: Renderer,
    target: TargetDesc,
    route: CString,
    plan: Mutex<Plan>,
}

/// A recording in a command buffer: it keeps what the commands name, until vr_recording_completed() says that their submission has
/// ended, or vr_recording_discard() that there is none, and then what the frame told.
#[derive(Debug)]
pub struct vr_recording {
    state: Mutex<State>,
}

/// Where a recording is.
#[derive(Debug)]
enum State {
    /// Not known to have ended.
    Pending(Box<Recorded>),
    /// Its status was read.
    Completed(Box<Told>),
    /// Discarded, or its status cannot be read.
    Lost,
}

/// A status for C.
#[derive(Debug)]
struct Told {
    complete: bool,
    passes: Vec<vr_pass_time>,
    counters: Vec<vr_counter>,
    /// What the lists point to.
    _names: Vec<CString>,
}

// SAFETY: the pointers in it are to its own texts, which never change.
unsafe impl Send for Told {}

/// What becomes of what the target image holds.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_target_mode {
    /// Replaced: transparent black where the volume is not.
    VR_TARGET_CLEAR = 1,
    /// Covered: the volume is composited over it.
    VR_TARGET_OVER = 2,
}

/// What a plan is for.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_plan_info {
    /// sizeof(vr_plan_info).
    pub struct_size: usize,
    /// NAME[:key=value,...], such as "slabs:step=0.5". NULL: vr_scene_technique().
    pub technique: *const c_char,
    /// Format of target images. Values are premultiplied linear RGBA; an sRGB format encodes them.
    pub format: VkFormat,
    /// A vr_target_mode.
    pub mode: u32,
    /// Whether each recording has a depth image: nothing behind what it shows is drawn, and what passes through it is cut there.
    pub with_depth: VkBool32,
    /// 0.
    pub reserved: u32,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_plan_info {
    const FIRST: usize = size_of::<Self>();
}

/// How a projection stores depth.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_depth_kind {
    /// Of a perspective camera: at_zero and at_one are distances from the eye along the view.
    VR_DEPTH_PERSPECTIVE = 1,
    /// Of a camera with parallel rays: the same, negative behind the eye.
    VR_DEPTH_ORTHOGRAPHIC = 2,
    /// As `matrix` says.
    VR_DEPTH_MATRIX = 3,
}

/// A depth image of the caller.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_depth_image {
    /// sizeof(vr_depth_image).
    pub struct_size: usize,
    /// Two-dimensional, of one level, one layer and the depth aspect alone. The image has one sample and the usage
    /// VK_IMAGE_USAGE_SAMPLED_BIT.
    pub view: VkImageView,
    /// Its format, one with depth.
    pub format: VkFormat,
    /// Its layout when the commands run. VK_IMAGE_LAYOUT_UNDEFINED stands for VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL. It is left in
    /// that layout, last read in the compute shader stage.
    pub layout: VkImageLayout,
    /// Its size: that of the plan's view.
    pub extent: VkExtent2D,
    /// A vr_depth_kind.
    pub kind: u32,
    /// Depth along the view, in world units, where the image holds 0: near for the usual projection, far for a reversed one,
    /// INFINITY for one without a far end. What holds the far end itself shows no surface.
    pub at_zero: f64,
    /// The same where the image holds 1.
    pub at_one: f64,
    /// From view coordinates to clip coordinates with depths from 0 to 1, column after column.
    pub matrix: [f64; 16],
}

// SAFETY: repr(C), numbers and handles, the first its size.
unsafe impl Structure for vr_depth_image {
    const FIRST: usize = size_of::<Self>();
}

/// Where a frame is recorded.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_record_info {
    /// sizeof(vr_record_info).
    pub struct_size: usize,
    /// In the recording state, outside of any rendering, of a pool for the device's queue family.
    pub commands: VkCommandBuffer,
    /// With the usage VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT. When the commands run it is in the layout
    /// VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, and earlier accesses are available and visible to the colour attachment output
    /// stage. It is left in that layout, last written in that stage.
    pub image: VkImage,
    /// Of the image: two-dimensional, of one level and one layer.
    pub view: VkImageView,
    /// Its format: that of the plan.
    pub format: VkFormat,
    /// Its size: that of the plan's view.
    pub extent: VkExtent2D,
    /// NULL where the plan is without depth.
    pub depth: *const vr_depth_image,
}

// SAFETY: repr(C), numbers, handles and pointers, the first its size.
unsafe impl Structure for vr_record_info {
    const FIRST: usize = size_of::<Self>();
}

/// Time of a pass.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_pass_time {
    /// The pass.
    pub name: *const c_char,
    /// Milliseconds on the device.
    pub ms: f64,
}

/// Work of a frame, counted on the device.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_counter {
    /// What was counted.
    pub name: *const c_char,
    /// How many.
    pub value: u64,
}

/// What a frame told.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_status {
    /// sizeof(vr_status).
    pub struct_size: usize,
    /// Whether everything was drawn. VK_FALSE where room was short: call vr_plan_prepare() and draw the frame again.
    pub complete: VkBool32,
    /// Number of passes; 0 where the device has no timestamps.
    pub pass_count: u32,
    /// Their times. Valid as long as the recording's handle.
    pub passes: *const vr_pass_time,
    /// Work that only the device knows. Valid as long as the recording's handle.
    pub counters: *const vr_counter,
    /// Number of counters.
    pub counter_count: u32,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_status {
    const FIRST: usize = size_of::<Self>();
}

impl vr_plan {
    /// The plan, unless a panic left it half changed.
    fn plan(&self) -> Result<MutexGuard<'_, Plan>> {
        self.plan
            .lock()
            .map_err(|_| Error::invalid("plan", "an earlier call with it failed by a defect: destroy it"))
    }
}

impl vr_depth_image {
    fn projection(&self) -> Result<DepthProjection> {
        let kinds = [
            vr_depth_kind::VR_DEPTH_PERSPECTIVE,
            vr_depth_kind::VR_DEPTH_ORTHOGRAPHIC,
            vr_depth_kind::VR_DEPTH_MATRIX,
        ];
        match choice(self.kind, &kinds.map(|kind| (kind, kind as u32)), "depth kind")? {
            vr_depth_kind::VR_DEPTH_PERSPECTIVE => DepthProjection::perspective(self.at_zero, self.at_one),
            vr_depth_kind::VR_DEPTH_ORTHOGRAPHIC => DepthProjection::orthographic(self.at_zero, self.at_one),
            vr_depth_kind::VR_DEPTH_MATRIX => {
                DepthProjection::from_matrix(&DMat4::from_cols_array(&self.matrix))
            }
        }
    }

    /// # Safety
    ///
    /// As [`DepthImage::from_raw`].
    unsafe fn image(&self, gpu: &Gpu) -> Result<DepthImage> {
        if self.view.is_null() {
            return Err(Error::invalid("depth view", "is VK_NULL_HANDLE"));
        }
        let (projection, extent) = (self.projection()?, [self.extent.width, self.extent.height]);
        // SAFETY: the caller's promise.
        let image = unsafe { DepthImage::from_raw(gpu, self.view, self.format, extent, projection) };
        let given = self.layout != vk::ImageLayout::UNDEFINED;
        Ok(if given { image.in_layout(self.layout) } else { image })
    }
}

impl Told {
    fn new(status: Status) -> Self {
        let mut names = Vec::new();
        // A text stays where it is when its owner moves.
        let mut keep = |name: &str| -> *const c_char {
            let name = c_text(name);
            let pointer = name.as_ptr();
            names.push(name);
            pointer
        };
        let passes = status.passes.iter().map(|pass| vr_pass_time { name: keep(&pass.name), ms: pass.ms });
        let passes = passes.collect();
        let counters = status.counters.iter().map(|&(name, value)| vr_counter { name: keep(name), value });
        let counters = counters.collect();
        Self { complete: status.complete, passes, counters, _names: names }
    }

    fn status(&self) -> vr_status {
        vr_status {
            struct_size: 0,
            complete: VkBool32::from(self.complete),
            pass_count: num::count(self.passes.len()),
            passes: self.passes.as_ptr(),
            counters: self.counters.as_ptr(),
            counter_count: num::count(self.counters.len()),
        }
    }
}

/// Fixes everything that frames of this view's size need. May allocate, compile, upload, submit and wait.
///
/// Fails with VR_ERROR_INVALID for options that do not exist or do not fit the scene, VR_ERROR_UNSUPPORTED and VR_ERROR_MEMORY for
/// what the device lacks, VR_ERROR_VULKAN.
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
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(plan, "plan") }?;
        // SAFETY: the caller's promise.
        let scene = unsafe { argument::reference(scene, "scene") }?;
        // SAFETY: the caller's promise.
        let info = unsafe { argument::structure(info, "vr_plan_info") }?;
        argument::reserved(info.reserved)?;
        // SAFETY: the caller's promise.
        let view = unsafe { argument::structure(view, "vr_view") }?.view()?;
        let modes = [
            (TargetMode::Clear, vr_target_mode::VR_TARGET_CLEAR as u32),
            (TargetMode::Over, vr_target_mode::VR_TARGET_OVER as u32),
        ];
        let target = TargetDesc::caller(info.format, choice(info.mode, &modes, "mode")?);
        let target = if info.with_depth == vk::FALSE { target } else { target.with_depth() };
        // SAFETY: the caller's promise.
        let renderer = Renderer::new(&scene.scene, unsafe { scene.chosen(info.technique) }?);
        let plan = renderer.prepare(&view, &target)?;
        let (gpu, route) = (scene.scene.gpu().clone(), c_text(plan.route()));
        *out = Box::into_raw(Box::new(vr_plan { gpu, renderer, target, route, plan: Mutex::new(plan) }));
        Ok(vr_result::VR_OK)
    })
}

/// Turns a plan to another view of the same image size. Allocates nothing, and does not wait. Returns VR_NO_ROOM, and nothing is
/// changed, where the plan has no room for it, the size is another one, or the view is the first with anything cut away: call
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
    call(|| {
        // SAFETY: the caller's promise.
        let plan = unsafe { argument::reference(plan, "plan") }?;
        // SAFETY: the caller's promise.
        let view = unsafe { argument::structure(view, "vr_view") }?.view()?;
        Ok(if plan.plan()?.set_view(&view)? { vr_result::VR_OK } else { vr_result::VR_NO_ROOM })
    })
}

/// Makes a plan anew for a view of any size, with room for what frames were short of. What recordings of it still name stays until
/// they are completed. May allocate, compile, upload, submit and wait.
///
/// Fails as vr_plan_create(), and the plan is what it was.
///
/// Threads: any; calls with one plan wait for each other.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_prepare(plan: *mut vr_plan, view: *const vr_view) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let plan = unsafe { argument::reference(plan, "plan") }?;
        // SAFETY: the caller's promise.
        let view = unsafe { argument::structure(view, "vr_view") }?.view()?;
        let mut held = plan.plan()?;
        *held = plan.renderer.prepare(&view, &plan.target)?;
        Ok(vr_result::VR_OK)
    })
}

/// How the technique draws on this device: raster, compute, ...; NULL for NULL. Valid as long as the handle.
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

/// Records a frame into the caller's command buffer: no submission, no wait, no device memory. The caller submits, sees the
/// submission end by a fence, a semaphore or an idle queue, and calls vr_recording_completed(). A plan has one recording at a time
/// that was not completed.
///
/// Fails with VR_ERROR_INVALID where an image is not what the plan is for, or its last recording was not completed,
/// VR_ERROR_UNSUPPORTED for a depth image of a format that the device cannot sample. Nothing was recorded then.
///
/// Threads: any that may record into the command buffer; calls with one plan wait for each other.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes. The Vulkan objects are of the plan's device and as vr_record_info and
/// vr_depth_image say; images and views live until every submission that uses them has ended. The command buffer is submitted at
/// most once at a time, to the device's queue family.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_record(
    plan: *mut vr_plan,
    info: *const vr_record_info,
    recording: *mut *mut vr_recording,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(recording, "recording") }?;
        // SAFETY: the caller's promise.
        let plan = unsafe { argument::reference(plan, "plan") }?;
        // SAFETY: the caller's promise.
        let info = unsafe { argument::structure(info, "vr_record_info") }?;
        let nulls = [
            (info.commands.is_null(), "commands"),
            (info.image.is_null(), "image"),
            (info.view.is_null(), "view"),
        ];
        if let Some((_, name)) = nulls.iter().find(|(null, _)| *null) {
            return Err(Error::invalid(*name, "is VK_NULL_HANDLE"));
        }
        let depth = if info.depth.is_null() {
            None
        } else {
            // SAFETY: the caller's promise.
            let depth = unsafe { argument::structure(info.depth, "vr_depth_image") }?;
            // SAFETY: the caller's promise.
            Some(unsafe { depth.image(&plan.gpu) }?)
        };
        // SAFETY: the caller's promise.
        let mut commands = unsafe { CommandBuffer::from_raw(&plan.gpu, info.commands) };
        let extent = [info.extent.width, info.extent.height];
        // SAFETY: the caller's promise.
        let target = unsafe { TargetImage::from_raw(&plan.gpu, info.image, info.view, info.format, extent) };
        let recorded = plan.plan()?.record(&mut commands, Some(&target), depth.as_ref())?;
        let state = Mutex::new(State::Pending(Box::new(recorded)));
        *out = Box::into_raw(Box::new(vr_recording { state }));
        Ok(vr_result::VR_OK)
    })
}

/// Destroys a plan's handle; NULL is nothing. What recordings of it name stays until they are completed.
///
/// Threads: any, while no other function uses this handle.
///
/// # Safety
///
/// `plan` is NULL, or a handle that was not destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_destroy(plan: *mut vr_plan) {
    if !plan.is_null() {
        // SAFETY: made by `vr_plan_create`, and not destroyed before.
        quietly(|| drop(unsafe { Box::from_raw(plan) }));
    }
}

/// Says that the submission of a recording has ended: a fence or a semaphore was signalled, or the queue is idle. Frees what the
/// recording kept, and tells what the frame told. `status` may be NULL. Called again it tells the same.
///
/// Fails with VR_ERROR_VULKAN where the status cannot be read, though what the recording kept is freed, and with
/// VR_ERROR_INVALID for a recording that was discarded.
///
/// Threads: any; calls with one recording wait for each other.
///
/// # Safety
///
/// `recording` is NULL or valid, and the device has no more use for what it recorded; `status` is NULL or valid, with its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_recording_completed(
    recording: *mut vr_recording,
    status: *mut vr_status,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let recording = unsafe { argument::reference(recording, "recording") }?;
        let lost = || Error::invalid("recording", "was discarded, or its status could not be read");
        let mut state = recording.state.lock().map_err(|_| lost())?;
        // Lost, if the status cannot be read.
        *state = match std::mem::replace(&mut *state, State::Lost) {
            State::Pending(recorded) => State::Completed(Box::new(Told::new(recorded.completed()?))),
            known => known,
        };
        let State::Completed(told) = &*state else { return Err(lost()) };
        if !status.is_null() {
            // SAFETY: the caller's promise.
            unsafe { argument::fill(status, told.status(), "vr_status") }?;
        }
        Ok(vr_result::VR_OK)
    })
}

/// Says that a recording will not be submitted, or not again: its command buffer was reset, freed or forgotten, as when a frame is
/// dropped because the window changed. Frees what the recording kept. The plan can be recorded again. Of a recording that was
/// completed or discarded: does nothing.
///
/// Fails with VR_ERROR_INVALID for NULL.
///
/// Threads: any; calls with one recording wait for each other.
///
/// # Safety
///
/// `recording` is NULL or valid, and no submission of what it recorded is pending or will be made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_recording_discard(recording: *mut vr_recording) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let recording = unsafe { argument::reference(recording, "recording") }?;
        let poisoned =
            |_| Error::invalid("recording", "an earlier call with it failed by a defect: destroy it");
        let mut state = recording.state.lock().map_err(poisoned)?;
        *state = match std::mem::replace(&mut *state, State::Lost) {
            State::Pending(recorded) => {
                recorded.discarded();
                State::Lost
            }
            known => known,
        };
        Ok(vr_result::VR_OK)
    })
}

/// Destroys a recording's handle; NULL is nothing. Where it was neither completed nor discarded, what the recording kept is never
/// freed, for the device may still use it, and the plan records no more until vr_plan_prepare().
///
/// Threads: any, while no other function uses this handle.
///
/// # Safety
///
/// `recording` is NULL, or a handle that was not destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_recording_destroy(recording: *mut vr_recording) {
    if !recording.is_null() {
        // SAFETY: made by `vr_plan_record`, and not destroyed before.
        quietly(|| drop(unsafe { Box::from_raw(recording) }));
    }
}

/// Draws a frame and waits for it: for tests, thumbnails and files. `pixels` gets width * height times premultiplied linear red,
/// green, blue and alpha, row by row, top row first; `float_count` is the number of floats that it has room for.
///
/// Fails as vr_plan_create(), and with VR_ERROR_TIMEOUT.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes, `pixels` as large as is said, `technique` NULL or text.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_render(
    scene: *const vr_scene,
    technique: *const c_char,
    view: *const vr_view,
    pixels: *mut f32,
    float_count: usize,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let scene = unsafe { argument::reference(scene, "scene") }?;
        // SAFETY: the caller's promise.
        let view = unsafe { argument::structure(view, "vr_view") }?.view()?;
        // SAFETY: the caller's promise.
        let technique = unsafe { scene.chosen(technique) }?;
        let [width, height] = view.extent();
        let needed = num::index(width).saturating_mul(num::index(height)).saturating_mul(4);
        if float_count < needed {
            let why = format!("{float_count}: {width} x {height} pixels need {needed}");
            return Err(Error::invalid("float_count", why));
        }
        // SAFETY: the caller's promise.
        let _ = unsafe { argument::reference(pixels.cast_const(), "pixels") }?;
        let image = Renderer::new(&scene.scene, technique).render(&view)?;
        let floats: &[f32] = image.pixels().as_flattened();
        // SAFETY: room for them was checked, and they are the library's own.
        unsafe { std::ptr::copy_nonoverlapping(floats.as_ptr(), pixels, floats.len().min(needed)) };
        Ok(vr_result::VR_OK)
    })
}
