//! Recordings, the depth images that cut them, and the status of a frame.

use std::ffi::{CString, c_char};
use std::sync::{Mutex, MutexGuard};

use ash::vk;
use glam::DMat4;

use super::argument::{Caller, Structure, check_handle, choice};
use super::plan::vr_plan;
use super::result::{c_text, call, destroy, lock, make, vr_result};
use super::vulkan::{VkBool32, VkCommandBuffer, VkExtent2D, VkFormat, VkImage, VkImageLayout, VkImageView};
use crate::error::{Error, Result};
use crate::frame::plan::{Plan, RecordInfo, Recorded, Status};
use crate::frame::prepared::ErrorBound;
use crate::gpu::{CommandBuffer, DepthImage, DepthProjection, Gpu, TargetImage};
use crate::num;

/// Kind of the mapping from depth to stored values.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_depth_kind {
    /// A perspective camera: at_zero and at_one are distances from the eye along the view.
    VR_DEPTH_PERSPECTIVE = 1,
    /// A camera with parallel rays: at_zero and at_one are distances from the eye along the view, negative behind it.
    VR_DEPTH_ORTHOGRAPHIC = 2,
    /// The mapping of `matrix`.
    VR_DEPTH_MATRIX = 3,
}

/// A depth image of the caller.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_depth_image {
    /// sizeof(vr_depth_image).
    pub struct_size: usize,
    /// A two-dimensional view with one level, one layer and only the depth aspect. Its image has one sample per texel and the
    /// usage VK_IMAGE_USAGE_SAMPLED_BIT.
    pub view: VkImageView,
    /// Format of the view, with depth.
    pub format: VkFormat,
    /// Layout when the commands run. VK_IMAGE_LAYOUT_UNDEFINED stands for VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL. The commands
    /// leave the image in that layout, last read in the compute shader stage.
    pub layout: VkImageLayout,
    /// Size of the image, equal to that of the plan's view. Of a plan with in_part it may be larger, and the plan reads the rectangle at
    /// `corner`.
    pub extent: VkExtent2D,
    /// A vr_depth_kind.
    pub kind: u32,
    /// Depth along the view, in world units, that is stored as 0: near for the usual projection, far for a reversed one,
    /// INFINITY for a reversed one without a far plane. A pixel that stores the far end shows no surface.
    pub at_zero: f64,
    /// Depth along the view, in world units, that is stored as 1.
    pub at_one: f64,
    /// Matrix from view coordinates to clip coordinates with depths from 0 to 1, column by column.
    pub matrix: [f64; 16],
    /// First texel of the rectangle, from the left and the top.
    pub corner: [u32; 2],
    /// World units in one of the scene, where a model matrix scales it: depths are in world units, divided by it. 0: 1.
    pub unit: f64,
}

// SAFETY: repr(C), numbers and handles, the first its size.
unsafe impl Structure for vr_depth_image {}

/// Makes a projection of a vr_depth_kind.
fn projection(
    kind: u32,
    [at_zero, at_one]: [f64; 2],
    matrix: &[f64; 16],
    unit: f64,
) -> Result<DepthProjection> {
    let kinds: [&dyn Fn() -> Result<DepthProjection>; 3] = [
        &|| DepthProjection::perspective(at_zero, at_one),
        &|| DepthProjection::orthographic(at_zero, at_one),
        &|| DepthProjection::from_matrix(&DMat4::from_cols_array(matrix)),
    ];
    let projection = choice(kind, 1, &kinds, "depth kind")?()?;
    if unit == 0.0 { Ok(projection) } else { projection.in_unit(unit) }
}

/// An image of the caller that gets the depth at which each pixel's ray reaches vr_plan_info::hit_opacity, as a depth image of the projection
/// would hold a surface there; without one the far end.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_hit_depths {
    /// sizeof(vr_hit_depths).
    pub struct_size: usize,
    /// A colour image of vr_plan_info::hit_format, in the states of vr_record_info::image.
    pub image: VkImage,
    /// A two-dimensional view of the image, with one level and one layer.
    pub view: VkImageView,
    /// A vr_depth_kind.
    pub kind: u32,
    /// Depth along the view, in world units, that is stored as 0.
    pub at_zero: f64,
    /// Depth along the view, in world units, that is stored as 1.
    pub at_one: f64,
    /// Matrix from view coordinates to clip coordinates with depths from 0 to 1, column by column.
    pub matrix: [f64; 16],
    /// First texel of the rectangle, from the left and the top, for plans with in_part; else 0.
    pub corner: [u32; 2],
    /// World units in one of the scene, where a model matrix scales it: depths are in world units, divided by it. 0: 1.
    pub unit: f64,
}

// SAFETY: repr(C), numbers and handles, the first its size.
unsafe impl Structure for vr_hit_depths {}

impl vr_depth_image {
    /// # Safety
    ///
    /// As [`DepthImage::from_raw`].
    unsafe fn image(&self, gpu: &Gpu, in_part: bool) -> Result<DepthImage> {
        check_handle(self.view, "depth view")?;
        if self.corner != [0; 2] && !in_part {
            return Err(Error::invalid(
                "depth corner",
                format!("{:?}: is for plans with in_part", self.corner),
            ));
        }
        let projection = projection(self.kind, [self.at_zero, self.at_one], &self.matrix, self.unit)?;
        let extent = [self.extent.width, self.extent.height];
        // SAFETY: the caller's promise.
        let image = unsafe { DepthImage::from_raw(gpu, self.view, self.format, extent, projection) };
        let image = if in_part { image.at(self.corner) } else { image };
        let given = self.layout != vk::ImageLayout::UNDEFINED;
        Ok(if given { image.in_layout(self.layout) } else { image })
    }
}

/// A recording in a command buffer. It keeps the resources of its commands until vr_recording_completed() says that their
/// submission has ended, or vr_recording_discard() that there is none; then it has the status of the frame.
#[derive(Debug)]
pub struct vr_recording {
    state: Mutex<State>,
}

/// State of a recording.
#[derive(Debug)]
enum State {
    /// It is not known to have ended.
    Pending(Box<Recorded>),
    /// It has ended, and its status was read.
    Completed(Box<Told>),
    /// It was discarded, or its status could not be read.
    Lost,
}

/// The status of a frame for C, with what it points to.
#[derive(Debug)]
struct Told {
    status: vr_status,
    _owned: (Vec<vr_pass_time>, Vec<vr_counter>, Vec<CString>),
}

// SAFETY: its pointers refer to its own lists and texts, which never change.
unsafe impl Send for Told {}

/// Command buffer and images of a recording.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_record_info {
    /// sizeof(vr_record_info).
    pub struct_size: usize,
    /// A command buffer in the recording state, outside of rendering, from a pool for the device's queue family.
    pub commands: VkCommandBuffer,
    /// The target image, with the usage VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT. When the commands run it is in the layout
    /// VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, and earlier accesses are available and visible to the colour attachment output
    /// stage. The commands leave it in that layout, last written in that stage.
    pub image: VkImage,
    /// A two-dimensional view of the image, with one level and one layer.
    pub view: VkImageView,
    /// Format of the view, equal to that of the plan.
    pub format: VkFormat,
    /// Size of the image, or of its rectangle at `corner`, equal to that of the plan's view.
    pub extent: VkExtent2D,
    /// Depth image; NULL if the plan is without depth.
    pub depth: *const vr_depth_image,
    /// First pixel of the rectangle, from the left and the top, for plans with in_part; else 0.
    pub corner: [u32; 2],
    /// Image of hit depths; NULL if the plan is without.
    pub hit_depths: *const vr_hit_depths,
}

// SAFETY: repr(C), numbers, handles and pointers, the first its size.
unsafe impl Structure for vr_record_info {}

/// The images of a recording.
struct Images {
    target: TargetImage,
    depth: Option<DepthImage>,
    hit_depths: Option<(TargetImage, DepthProjection)>,
}

impl Images {
    fn info(&self) -> RecordInfo<'_> {
        let hit_depths = self.hit_depths.as_ref().map(|(image, projection)| (image, *projection));
        RecordInfo { target: Some(&self.target), depth: self.depth.as_ref(), hit_depths, owner: None }
    }
}

impl vr_record_info {
    /// Returns the images for a plan.
    ///
    /// # Safety
    ///
    /// As [`TargetImage::from_raw`] and [`DepthImage::from_raw`].
    unsafe fn images(&self, caller: &Caller, plan: &Plan) -> Result<Images> {
        check_handle(self.commands, "commands")?;
        check_handle(self.image, "image")?;
        check_handle(self.view, "view")?;
        let depth = (!self.depth.is_null()).then(|| caller.structure(self.depth, "vr_depth_image"));
        // SAFETY: the caller's promise.
        let depth = depth
            .transpose()?
            .map(|depth| unsafe { depth.image(&plan.gpu, plan.is_in_part()) })
            .transpose()?;
        let extent = [self.extent.width, self.extent.height];
        // SAFETY: the caller's promise.
        let target = unsafe { TargetImage::from_raw(&plan.gpu, self.image, self.view, self.format, extent) };
        // SAFETY: the caller's promise.
        let target = unsafe { target.at(self.corner) };
        let hit_depths = (!self.hit_depths.is_null())
            .then(|| {
                let hits = caller.structure(self.hit_depths, "vr_hit_depths")?;
                check_handle(hits.image, "image of hit depths")?;
                check_handle(hits.view, "view of hit depths")?;
                let projection = projection(hits.kind, [hits.at_zero, hits.at_one], &hits.matrix, hits.unit)?;
                let format = plan.hit_depth_format();
                // SAFETY: the caller's promise.
                let image =
                    unsafe { TargetImage::from_raw(&plan.gpu, hits.image, hits.view, format, extent) };
                // SAFETY: the caller's promise.
                Ok((unsafe { image.at(hits.corner) }, projection))
            })
            .transpose()?;
        Ok(Images { target, depth, hit_depths })
    }
}

/// Time of one pass.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_pass_time {
    /// Name of the pass.
    pub name: *const c_char,
    /// Milliseconds on the device.
    pub ms: f64,
}

/// A count of work that the device has done for a frame.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_counter {
    /// Name of the counter.
    pub name: *const c_char,
    /// The count.
    pub value: u64,
}

/// Status of a frame.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_status {
    /// sizeof(vr_status).
    pub struct_size: usize,
    /// Whether everything was drawn. VK_FALSE if pages of a grid, or parts of a mesh or points, are missing: call vr_plan_load(); or if a capacity was too small: call
    /// vr_plan_prepare(). Then draw the frame again.
    pub complete: VkBool32,
    /// Number of passes; 0 if the device has no timestamps.
    pub pass_count: u32,
    /// Times of the passes, valid as long as the recording's handle.
    pub passes: *const vr_pass_time,
    /// Counters, valid as long as the recording's handle.
    pub counters: *const vr_counter,
    /// Number of counters.
    pub counter_count: u32,
    /// How far the image is from the complete one at most, in each component of its premultiplied linear colour and opacity: root of the mean
    /// square over pixels. 0 if it is complete, INFINITY if no bound is known; there is one for grids in pages.
    pub bound_rmse: f64,
    /// The same at any pixel.
    pub bound_greatest: f64,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_status {}

impl Told {
    fn new(status: Status) -> Self {
        let mut names = Vec::new();
        // Moving a `CString` does not move its text.
        let mut keep = |name: &str| -> *const c_char {
            let name = c_text(name);
            let pointer = name.as_ptr();
            names.push(name);
            pointer
        };
        let passes = status.passes.iter().map(|pass| vr_pass_time { name: keep(&pass.name), ms: pass.ms });
        let passes: Vec<_> = passes.collect();
        let counters = status.counters.iter().map(|&(name, value)| vr_counter { name: keep(name), value });
        let counters: Vec<_> = counters.collect();
        let unknown = if status.complete { 0.0 } else { f64::INFINITY };
        let bound = status.bound.unwrap_or(ErrorBound { rmse: unknown, greatest: unknown });
        let status = vr_status {
            struct_size: 0,
            complete: VkBool32::from(status.complete),
            pass_count: num::count(passes.len()),
            passes: passes.as_ptr(),
            counters: counters.as_ptr(),
            counter_count: num::count(counters.len()),
            bound_rmse: bound.rmse,
            bound_greatest: bound.greatest,
        };
        Self { status, _owned: (passes, counters, names) }
    }
}

/// Records a frame into the caller's command buffer, without submission, wait or allocation of device memory. The caller submits,
/// waits for the end of the submission by a fence, a semaphore or an idle queue, and calls vr_recording_completed(). A plan has at
/// most one recording that is not completed.
///
/// Fails with VR_ERROR_INVALID if an image does not fit the plan or the plan's last recording is not completed, and with
/// VR_ERROR_UNSUPPORTED if the device cannot sample the format of the depth image. Nothing is recorded then.
///
/// Threads: any that may record into the command buffer; calls with one plan wait for each other.
///
/// # Safety
///
/// Pointers are NULL or valid, structures with their sizes. The Vulkan objects belong to the plan's device and are as vr_record_info
/// and vr_depth_image require; images and views live until every submission that uses them has ended. The command buffer is not
/// submitted again while a submission of it is pending, and only to the device's queue family.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plan_record(
    plan: *mut vr_plan,
    info: *const vr_record_info,
    recording: *mut *mut vr_recording,
) -> vr_result {
    // SAFETY: the caller's promise.
    make(unsafe { Caller::trusted() }, (recording, "recording"), |caller| {
        let plan = caller.reference(plan, "plan")?;
        let info = caller.structure(info, "vr_record_info")?;
        let mut plan = lock(&plan.plan, "plan")?;
        // SAFETY: the caller's promise.
        let images = unsafe { info.images(caller, &plan) }?;
        // SAFETY: the caller's promise.
        let mut commands = unsafe { CommandBuffer::from_raw(&plan.gpu, info.commands) };
        let recorded = plan.record_with(&mut commands, images.info())?;
        Ok(vr_recording { state: Mutex::new(State::Pending(Box::new(recorded))) })
    })
}

/// Records the frames of `count` plans of one device into one command buffer: the eyes of a stereo pair, the faces of a cube. Their
/// passes lie side by side and wait for each other only where plans share a target, so that a device that one frame does not fill draws
/// them in less than the sum of their times. Images are those of vr_plan_record(). Writes a recording for each plan, each to be
/// completed; the status of the one with the most passes has the times, each with those of the passes beside it.
///
/// Fails as vr_plan_record(), and with VR_ERROR_INVALID if a plan is given twice or `commands` differs. Nothing is recorded then, and
/// `recordings` are NULL.
///
/// Threads: as vr_plan_record().
///
/// # Safety
///
/// As of vr_plan_record(); `plans`, `infos` and `recordings` point to `count` pointers each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_plans_record(
    plans: *const *mut vr_plan,
    infos: *const *const vr_record_info,
    count: u32,
    recordings: *mut *mut vr_recording,
) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let count = num::index(count);
        for i in 0..count {
            caller.write(recordings.wrapping_add(i), std::ptr::null_mut(), "recordings")?;
        }
        let (plans, infos) = (caller.array(plans, count, "plans")?, caller.array(infos, count, "infos")?);
        // Locked by address, so that two threads do not wait for each other.
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&i| plans[i].addr());
        if order.windows(2).any(|pair| plans[pair[0]] == plans[pair[1]]) {
            return Err(Error::invalid("plans", "one is given twice: each frame needs a plan of its own"));
        }
        let locked =
            order.into_iter().map(|i| Ok((i, lock(&caller.reference(plans[i], "plan")?.plan, "plan")?)));
        let mut locked = locked.collect::<Result<Vec<_>>>()?;
        locked.sort_by_key(|(i, _)| *i);
        let infos = infos.iter().map(|&info| caller.structure(info, "vr_record_info"));
        let infos = infos.collect::<Result<Vec<_>>>()?;
        let (Some((_, plan)), Some(first)) = (locked.first(), infos.first()) else { return Ok(()) };
        if infos.iter().any(|info| info.commands != first.commands) {
            return Err(Error::invalid("commands", "must be one command buffer for all plans"));
        }
        // SAFETY: the caller's promise.
        let images = |(info, (_, plan)): (&vr_record_info, &(_, MutexGuard<'_, Plan>))| unsafe {
            info.images(caller, plan)
        };
        let images = infos.iter().zip(&locked).map(images).collect::<Result<Vec<_>>>()?;
        // SAFETY: the caller's promise.
        let mut commands = unsafe { CommandBuffer::from_raw(&plan.gpu, first.commands) };
        let mut plans: Vec<_> =
            locked.iter_mut().map(|(_, plan)| &mut **plan).zip(images.iter().map(Images::info)).collect();
        for (i, recorded) in Plan::record_together(&mut commands, &mut plans)?.into_iter().enumerate() {
            let recording = vr_recording { state: Mutex::new(State::Pending(Box::new(recorded))) };
            caller.write(recordings.wrapping_add(i), Box::into_raw(Box::new(recording)), "recordings")?;
        }
        Ok(())
    })
}

/// Declares that the submission of a recording has ended: a fence or a semaphore was signalled, or the queue is idle. Frees the
/// resources of the recording, and writes the status of the frame; later calls write the same. `status` may be NULL.
///
/// Fails with VR_ERROR_VULKAN if the status cannot be read, though it frees the resources, and with VR_ERROR_INVALID for a
/// recording that was discarded.
///
/// Threads: any; calls with one recording wait for each other.
///
/// # Safety
///
/// `recording` is NULL or valid, and no submission of it is pending; `status` is NULL or valid, with its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_recording_completed(
    recording: *mut vr_recording,
    status: *mut vr_status,
) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let recording = caller.reference(recording, "recording")?;
        let lost = || Error::invalid("recording", "was discarded, or its status could not be read");
        let mut state = recording.state.lock().map_err(|_| lost())?;
        // The state stays `Lost` if the status cannot be read.
        *state = match std::mem::replace(&mut *state, State::Lost) {
            State::Pending(recorded) => State::Completed(Box::new(Told::new(recorded.completed()?))),
            known => known,
        };
        let State::Completed(told) = &*state else { return Err(lost()) };
        if status.is_null() { Ok(()) } else { caller.fill(status, told.status, "vr_status") }
    })
}

/// Declares that a recording will not be submitted, or not again, for instance because a resized window made its frame obsolete.
/// Frees the resources of the recording, and the plan can record again. Does nothing for a recording that was completed or
/// discarded.
///
/// Fails with VR_ERROR_INVALID for NULL.
///
/// Threads: any; calls with one recording wait for each other.
///
/// # Safety
///
/// `recording` is NULL or valid, and no submission of it is pending or will be made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_recording_discard(recording: *mut vr_recording) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let recording = caller.reference(recording, "recording")?;
        let mut state = lock(&recording.state, "recording")?;
        match std::mem::replace(&mut *state, State::Lost) {
            State::Pending(recorded) => recorded.discarded(),
            known => *state = known,
        }
        Ok(())
    })
}

/// Destroys a recording's handle; NULL is ignored. If it was neither completed nor discarded, its resources are never freed, since
/// the device may still use them, and the plan cannot record until vr_plan_prepare().
///
/// Threads: any, while no other function uses this handle.
///
/// # Safety
///
/// `recording` is NULL, or a handle that was not destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_recording_destroy(recording: *mut vr_recording) {
    // SAFETY: the caller's promise.
    unsafe { destroy(recording) };
}
