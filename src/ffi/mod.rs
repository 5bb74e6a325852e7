//! The library for C programs; `include/volraster.h` declares it.
//!
//! Handles are boxes behind opaque pointers. A handle keeps everything alive that it was made from, so that handles may be
//! destroyed in any order. Each function catches panics, checks pointers for null, and stores a message for [`vr_last_error`]
//! when it fails. Structures begin with their size; see `argument`.
//!
//! May use everything but the program. Used by C programs only. `argument`, `result` and `vulkan` are the basis of the other
//! files, which have functions and their structures.

#![expect(unsafe_code, reason = "reads and writes through pointers from C")]
#![expect(non_camel_case_types, reason = "C names")]

mod adopt;
mod argument;
mod data;
mod depth;
mod gpu;
mod info;
mod load;
mod plan;
mod recording;
mod result;
mod samples;
mod scene;
mod scene_with;
mod view;
mod vulkan;

pub use adopt::{vr_callback, vr_device_info, vr_gpu_adopt};
pub use data::{
    vr_grid_info, vr_knot, vr_mesh_info, vr_points_info, vr_scalars_per, vr_shading, vr_surface_info,
};
pub use depth::{vr_depth_image, vr_depth_kind};
pub use gpu::{
    vr_gpu, vr_gpu_create, vr_gpu_destroy, vr_gpu_handles, vr_gpu_info, vr_gpu_memory, vr_gpu_name,
    vr_gpu_objects, vr_gpu_with_queue, vr_queue_callback, vr_validation,
};
pub use info::{
    vr_option_info, vr_technique_count, vr_technique_info, vr_technique_parse, vr_technique_query, vr_version,
};
pub use load::{vr_progress_callback, vr_read_info, vr_scene_load};
pub use plan::{
    vr_plan, vr_plan_create, vr_plan_destroy, vr_plan_info, vr_plan_prepare, vr_plan_route, vr_plan_set_view,
    vr_render, vr_target_mode,
};
pub use recording::{
    vr_counter, vr_pass_time, vr_plan_record, vr_record_info, vr_recording, vr_recording_completed,
    vr_recording_destroy, vr_recording_discard, vr_status,
};
pub use result::{vr_last_error, vr_last_vulkan_result, vr_result};
pub use samples::vr_sample_type;
pub use scene::{
    vr_data_kind, vr_scene, vr_scene_create_grid, vr_scene_create_mesh, vr_scene_create_points,
    vr_scene_destroy, vr_scene_draws, vr_scene_info, vr_scene_query, vr_scene_technique, vr_scene_view,
    vr_scene_warnings,
};
pub use scene_with::{
    vr_scene_with_samples, vr_scene_with_scalars, vr_scene_with_surfaces, vr_scene_with_transfer,
};
pub use view::{vr_clip_plane, vr_projection, vr_view};
pub use vulkan::*;
