//! Recordings, and the status of a frame.

use std::ffi::{CString, c_char};
use std::sync::Mutex;

use ash::vk::Handle as _;

use super::argument::{self, Structure};
use super::depth::vr_depth_image;
use super::plan::vr_plan;
use super::result::{c_text, call, quietly, vr_result};
use super::vulkan::{VkBool32, VkCommandBuffer, VkExtent2D, VkFormat, VkImage, VkImageView};
use crate::error::Error;
use crate::frame::plan::{Recorded, Status};
use crate::gpu::{CommandBuffer, TargetImage};
use crate::num;

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

/// The status of a frame for C.
#[derive(Debug)]
struct Told {
    complete: bool,
    passes: Vec<vr_pass_time>,
    counters: Vec<vr_counter>,
    /// Owner of the texts that the lists point to.
    _names: Vec<CString>,
}

// SAFETY: its pointers refer to its own texts, which never change.
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
    /// Size of the image, equal to that of the plan's view.
    pub extent: VkExtent2D,
    /// Depth image; NULL if the plan is without depth.
    pub depth: *const vr_depth_image,
}

// SAFETY: repr(C), numbers, handles and pointers, the first its size.
unsafe impl Structure for vr_record_info {
    const FIRST: usize = size_of::<Self>();
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
    /// Whether everything was drawn. VK_FALSE if a capacity was too small: call vr_plan_prepare() and draw the frame again.
    pub complete: VkBool32,
    /// Number of passes; 0 if the device has no timestamps.
    pub pass_count: u32,
    /// Times of the passes, valid as long as the recording's handle.
    pub passes: *const vr_pass_time,
    /// Counters, valid as long as the recording's handle.
    pub counters: *const vr_counter,
    /// Number of counters.
    pub counter_count: u32,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_status {
    const FIRST: usize = size_of::<Self>();
}

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
    call(|| {
        // SAFETY: the caller's promise.
        let recording = unsafe { argument::reference(recording, "recording") }?;
        let lost = || Error::invalid("recording", "was discarded, or its status could not be read");
        let mut state = recording.state.lock().map_err(|_| lost())?;
        // The state stays `Lost` if the status cannot be read.
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
    if !recording.is_null() {
        // SAFETY: made by `vr_plan_record`, and not destroyed before.
        quietly(|| drop(unsafe { Box::from_raw(recording) }));
    }
}
