//! What the tests share: structures, messages, handles.

use std::ffi::{CStr, c_char};
use std::ptr::{null, null_mut};

use volraster::ash::vk;
use volraster::ffi::*;
use volraster::scene::{Samples, Shading, Surface, View};

use crate::common::caller::Caller;
use crate::engine::Engine;
pub use crate::engine::turn;

pub const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// A structure with nothing but its size.
macro_rules! sized {
    ($name:ident { $($field:ident: $value:expr),* $(,)? }) => {{
        // SAFETY: zeros are valid.
        let mut info: $name = unsafe { std::mem::zeroed() };
        info.struct_size = size_of::<$name>();
        $(info.$field = $value;)*
        info
    }};
}

pub fn message() -> String {
    // SAFETY: ends with NUL.
    unsafe { CStr::from_ptr(vr_last_error()) }.to_str().unwrap().to_string()
}

#[track_caller]
pub fn done(result: vr_result) {
    assert_eq!(result, vr_result::VR_OK, "{}", message());
}

#[track_caller]
pub fn refused(result: vr_result, code: vr_result, words: &str) {
    assert_eq!(result, code, "{}", message());
    assert!(message().contains(words), "{words}: {}", message());
}

/// A function of the interface succeeds.
macro_rules! done {
    ($call:expr) => {
        // SAFETY: all that the tests pass is valid.
        done(unsafe { $call })
    };
}

/// A function of the interface fails.
macro_rules! refused {
    ($call:expr, $code:expr, $words:expr $(,)?) => {
        // SAFETY: what is wrong is refused before it is followed.
        refused(unsafe { $call }, $code, $words)
    };
}

pub fn text(pointer: *const c_char) -> String {
    assert!(!pointer.is_null());
    // SAFETY: the library's text.
    unsafe { CStr::from_ptr(pointer) }.to_str().unwrap().to_string()
}

macro_rules! ends {
    ($($name:ident: $destroy:ident($handle:ty);)*) => {$(
        /// Each handle is destroyed once.
        pub fn $name(handle: *mut $handle) {
            // SAFETY: the tests do so, too.
            unsafe { $destroy(handle) };
        }
    )*};
}

ends! {
    end_gpu: vr_gpu_destroy(vr_gpu);
    end_scene: vr_scene_destroy(vr_scene);
    end_plan: vr_plan_destroy(vr_plan);
    end_recording: vr_recording_destroy(vr_recording);
}

/// What C programs write into `vr_device_info`.
pub fn with_device<R>(engine: &Engine, use_it: impl FnOnce(vr_device_info) -> R) -> R {
    let mut features13 = vk::PhysicalDeviceVulkan13Features::default()
        .synchronization2(engine.enabled.synchronization2)
        .dynamic_rendering(engine.enabled.dynamic_rendering);
    let names: Vec<_> = engine.enabled.extensions.iter().map(|name| name.as_ptr()).collect();
    let create = vk::DeviceCreateInfo::default().enabled_extension_names(&names).push_next(&mut features13);
    let instance_names = [c"VK_EXT_debug_utils".as_ptr()];
    use_it(sized!(vr_device_info {
        get_instance_proc_addr: Some(engine.entry.static_fn().get_instance_proc_addr),
        instance: engine.instance.handle(),
        api_version: vk::API_VERSION_1_3,
        instance_extension_count: 1,
        instance_extensions: instance_names.as_ptr(),
        physical_device: engine.physical,
        device: engine.device.handle(),
        device_create_info: (&raw const create).cast(),
        queue: engine.queue,
        queue_family: engine.family,
    }))
}

pub fn adopt(engine: &Engine) -> *mut vr_gpu {
    let mut gpu = null_mut();
    // SAFETY: the objects are the engine's, which outlives the handle.
    with_device(engine, |info| done(unsafe { vr_gpu_adopt(&info, &mut gpu) }));
    gpu
}

pub fn knots(rows: &[[f64; 5]]) -> Vec<vr_knot> {
    rows.iter().map(|r| vr_knot { scalar: r[0], colour: [r[1], r[2], r[3]], extinction: r[4] }).collect()
}

/// A view for C.
pub fn c_view(view: &View) -> vr_view {
    let camera = view.camera();
    let volraster::scene::Projection::Perspective { fov_y_deg } = camera.projection else { panic!() };
    let [width, height] = view.extent();
    let mut value = sized!(vr_view {
        eye: camera.eye.into(),
        target: camera.target.into(),
        up: camera.up.into(),
        projection: vr_projection::VR_PROJECTION_PERSPECTIVE as u32,
        fov_y_deg: fov_y_deg,
        width: width,
        height: height,
    });
    for (place, plane) in value.clip_planes.iter_mut().zip(view.clip().planes()) {
        *place = vr_clip_plane { point: plane.point.into(), normal: plane.normal.into() };
        value.clip_plane_count += 1;
    }
    if let Some([low, high]) = view.clip().crop() {
        (value.crop_low, value.crop_high) = (low.into(), high.into());
    }
    value
}

/// A field of the crate's, as a C program would hand it over.
pub fn c_scene(gpu: *const vr_gpu, grid: &volraster::scene::Grid, rows: &[[f64; 5]]) -> *mut vr_scene {
    let Samples::U8(samples) = grid.samples() else { panic!() };
    let axes = grid.index_to_world();
    let rescale = grid.rescale();
    let info = sized!(vr_grid_info {
        dims: grid.dims(),
        sample_type: vr_sample_type::VR_SAMPLE_U8 as u32,
        samples: samples.as_ptr().cast(),
        sample_bytes: samples.len(),
        origin: grid.origin().into(),
        direction: axes.to_cols_array_2d(),
        slope: rescale.slope,
        intercept: rescale.intercept,
    });
    let (knots, mut scene) = (knots(rows), null_mut());
    done!(vr_scene_create_grid(gpu, &info, knots.as_ptr(), knots.len(), &mut scene));
    scene
}

/// A surface for C, which must live as long, and its points, which must, too.
pub fn c_surface(surface: &Surface) -> (vr_surface_info, Vec<[f64; 3]>) {
    let points: Vec<[f64; 3]> = surface.points().iter().map(|p| p.to_array()).collect();
    let shading = match surface.shading() {
        Shading::Flat => vr_shading::VR_SHADING_FLAT,
        Shading::Headlight => vr_shading::VR_SHADING_HEADLIGHT,
    };
    let info = sized!(vr_surface_info {
        points: points.as_ptr().cast(),
        point_count: points.len(),
        triangles: surface.triangles().as_ptr().cast(),
        triangle_count: surface.triangles().len(),
        colour: surface.colour(),
        shading: shading as u32,
    });
    (info, points)
}

pub fn c_render(scene: *const vr_scene, spec: Option<&CStr>, view: &View) -> Vec<[f32; 4]> {
    let [width, height] = view.extent();
    let mut pixels = vec![[f32::NAN; 4]; (width * height) as usize];
    let (spec, view) = (spec.map_or(null(), CStr::as_ptr), c_view(view));
    done!(vr_render(scene, spec, &view, pixels.as_mut_ptr().cast(), 4 * pixels.len()));
    pixels
}

pub fn record_info(frame: &Caller) -> vr_record_info {
    sized!(vr_record_info {
        commands: frame.commands,
        image: frame.image,
        view: frame.view,
        format: frame.format,
        extent: vk::Extent2D { width: frame.extent[0], height: frame.extent[1] },
    })
}
