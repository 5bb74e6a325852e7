//! What is refused, and in which words.

use std::ffi::CStr;
use std::ptr::{null, null_mut};

use volraster::ash::vk;
use volraster::ffi::*;
use volraster::scene::{Field, Surface};

use crate::common::caller::Caller;
use crate::common::{FOG, perspective, view};
use crate::engine::Engine;
use crate::support::*;

/// Wrong arguments give codes and words, and nothing is handed out.
#[test]
fn wrong_arguments_are_refused() {
    use vr_result::VR_ERROR_INVALID as INVALID;
    let _turn = turn();
    let engine = Engine::full();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let grid = Field::Blobs.sample([8; 3], "u8").unwrap();
    let scene = c_scene(gpu, &grid, &FOG);
    let c_fog = knots(&FOG);
    let view = c_view(&view(perspective(), 1.0, 40, 30));
    let mut out = std::ptr::dangling_mut::<vr_scene>();
    let info = sized!(vr_grid_info {
        dims: [2; 3],
        sample_type: vr_sample_type::VR_SAMPLE_U8 as u32,
        samples: [0_u8, 1, 2, 3, 4, 5, 6, 7].as_ptr().cast(),
        sample_bytes: 8,
    });
    // SAFETY: what is wrong is refused before it is followed.
    let grid_of = |gpu, info: *const vr_grid_info, knots: &[vr_knot], count, out| unsafe {
        vr_scene_create_grid(gpu, info, knots.as_ptr(), count, out)
    };
    refused(grid_of(gpu, &info, &c_fog, c_fog.len(), null_mut()), INVALID, "scene: is NULL");
    refused(grid_of(null(), &info, &c_fog, c_fog.len(), &mut out), INVALID, "gpu: is NULL");
    assert!(out.is_null());
    refused(grid_of(gpu, null(), &c_fog, c_fog.len(), &mut out), INVALID, "vr_grid_info: is NULL");
    let wrong = |change: &dyn Fn(&mut vr_grid_info), words: &str| {
        let (mut info, mut out) = (info, std::ptr::dangling_mut());
        change(&mut info);
        refused(grid_of(gpu, &info, &c_fog, c_fog.len(), &mut out), INVALID, words);
        assert!(out.is_null());
    };
    wrong(&|info| info.struct_size = 0, "struct_size 0");
    wrong(&|info| info.struct_size -= 8, "struct_size");
    wrong(&|info| info.sample_bytes = 7, "need 8 bytes, 7 are given");
    wrong(&|info| info.dims = [2, 2, 1], "need 4 bytes");
    wrong(&|info| (info.dims, info.sample_bytes) = ([8, 1, 1], 8), "at least 2");
    wrong(&|info| info.samples = null(), "samples: is NULL");
    wrong(&|info| info.sample_type = 77, "sample_type: 77");
    wrong(&|info| info.spacing = [1.0, 0.0, 1.0], "spacing");
    wrong(&|info| info.slope = f64::NAN, "slope");
    refused!(vr_scene_create_grid(gpu, &info, null(), 3, &mut out), INVALID, "knots: is NULL");
    refused(grid_of(gpu, &info, &c_fog, usize::MAX, &mut out), INVALID, "knots");
    let falling = knots(&[[1.0, 0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0, 1.0]]);
    refused(grid_of(gpu, &info, &falling, 2, &mut out), INVALID, "knot 1");

    refused!(vr_scene_with_transfer(scene, null(), 0, &mut out), INVALID, "at least 1");
    refused!(vr_scene_with_samples(scene, 1, [0_u8; 8].as_ptr().cast(), 8, &mut out), INVALID, "need 512");
    // SAFETY: the same.
    let scalars = unsafe { vr_scene_with_scalars(scene, 1, [0_f32; 8].as_ptr(), 8, null(), 0, &mut out) };
    refused(scalars, INVALID, "grid");
    refused!(vr_scene_with_mode(scene, 3, null(), &mut out), INVALID, "mode: 3: must be one of 0, 1, 2");
    let light = sized!(vr_lighting { shininess: 0.5 });
    refused!(vr_scene_with_mode(scene, 1, &light, &mut out), INVALID, "shininess: 0.5");
    refused!(vr_scene_with_mode(scene, 2, &light, &mut out), INVALID, "lighting: belongs to mode lit");
    let surface = Surface::cuboid([-0.5; 3].into(), [0.5; 3].into(), [1.0, 0.5, 0.2, 0.5]).unwrap();
    let (surface, _points) = c_surface(&surface);
    let wrong = |change: &dyn Fn(&mut vr_surface_info), words: &str| {
        let (mut info, mut out) = (surface, std::ptr::dangling_mut());
        change(&mut info);
        refused!(
            vr_scene_with_surfaces(scene, [&raw const surface, &info].as_ptr(), 2, &mut out),
            INVALID,
            words,
        );
        assert!(out.is_null());
    };
    wrong(&|info| info.struct_size = 9, "surfaces[1]: struct_size 9");
    wrong(&|info| info.points = null(), "surfaces[1]: points: is NULL");
    wrong(&|info| info.point_count = 7, "surfaces[1]: surface: triangle");
    wrong(&|info| info.triangles = null(), "triangles: is NULL");
    wrong(&|info| info.colour[3] = 1.5, "opacity");
    wrong(&|info| info.shading = 2, "shading: 2: must be one of 0, 1");
    wrong(&|info| info.reserved = 1, "reserved");
    refused!(vr_scene_with_surfaces(scene, null(), 1, &mut out), INVALID, "surfaces: is NULL");
    refused!(vr_scene_with_surfaces(scene, [null()].as_ptr(), 1, &mut out), INVALID, "surfaces[0]: is NULL");
    done!(vr_scene_with_surfaces(scene, [&raw const surface].as_ptr(), 1, &mut out));
    let mut plan = null_mut();
    let info = sized!(vr_plan_info {
        technique: c"shear-warp".as_ptr(),
        format: FORMAT,
        mode: vr_target_mode::VR_TARGET_CLEAR as u32,
    });
    // SAFETY: all are valid.
    let translucent = unsafe { vr_plan_create(out, &info, &view, &mut plan) };
    refused(translucent, INVALID, "shear-warp draws no translucent surfaces: slices-2d, ");
    assert!(plan.is_null());
    end_scene(out);
    refused!(vr_scene_query(scene, null_mut()), INVALID, "is NULL");
    let mesh = sized!(vr_mesh_info {
        points: [0.0; 12].as_ptr(),
        point_count: 4,
        cells: [0, 1, 2, 9].as_ptr(),
        cell_count: 1,
        scalars: [0.0; 4].as_ptr(),
        scalar_count: 4,
        scalars_per: 1
    });
    for (change, words) in [
        ((|_| ()) as fn(&mut vr_mesh_info), "there are 4 points"),
        (|mesh| mesh.scalar_count = 3, "3 are given, 4 are needed"),
        (|mesh| mesh.scalars_per = 3, "scalars_per: 3"),
        (|mesh| mesh.cells = null(), "cells: is NULL"),
        (|mesh| mesh.reserved = 1, "reserved"),
    ] {
        let mut mesh = mesh;
        change(&mut mesh);
        refused!(vr_scene_create_mesh(gpu, &mesh, c_fog.as_ptr(), 1, &mut out), INVALID, words);
    }
    let both = sized!(vr_points_info {
        centres: [0.0; 6].as_ptr(),
        point_count: 2,
        radii: [1.0; 2].as_ptr(),
        covariances: [1.0; 12].as_ptr()
    });
    refused!(
        vr_scene_create_points(gpu, &both, c_fog.as_ptr(), 1, &mut out),
        INVALID,
        "one of them must be NULL",
    );

    let mut pixels = [0_f32; 4 * 40 * 30];
    let (floats, full) = (pixels.as_mut_ptr(), pixels.len());
    // SAFETY: the same.
    let render = |scene, spec: &CStr, view: *const vr_view, to, room| unsafe {
        vr_render(scene, spec.as_ptr(), view, to, room)
    };
    refused(render(scene, c"slabs", &view, floats, full - 1), INVALID, "4800");
    refused(render(scene, c"slabs", &view, null_mut(), full), INVALID, "pixels: is NULL");
    refused(render(scene, c"slabz", &view, floats, full), INVALID, "must be one of slices-2d");
    refused(render(scene, c"slabs:step=-1", &view, floats, full), INVALID, "step");
    refused(render(scene, c"slabs:step", &view, floats, full), INVALID, "key=value");
    refused(render(scene, c"\xff", &view, floats, full), INVALID, "UTF-8");
    refused(render(scene, c"havs", &view, floats, full), INVALID, "grid");
    refused(render(null(), c"slabs", &view, floats, full), INVALID, "scene: is NULL");
    refused(render(scene, c"slabs", &vr_view { up: [0.0; 3], ..view }, floats, full), INVALID, "up");
    assert!(pixels.iter().all(|&x| x == 0.0));

    let plan_info = sized!(vr_plan_info { format: FORMAT, mode: vr_target_mode::VR_TARGET_CLEAR as u32 });
    let mut plan = std::ptr::dangling_mut();
    // SAFETY: the same.
    let create =
        |info: vr_plan_info, plan: &mut *mut vr_plan| unsafe { vr_plan_create(scene, &info, &view, plan) };
    refused(create(vr_plan_info { mode: 0, ..plan_info }, &mut plan), INVALID, "mode: 0");
    assert!(plan.is_null());
    refused(create(vr_plan_info { in_part: 9, ..plan_info }, &mut plan), INVALID, "in_part: 9");
    refused(create(vr_plan_info { with_depth: 7, ..plan_info }, &mut plan), INVALID, "with_depth: 7");
    let twice = vr_plan_info { technique: c"slabs:step=0.5,step=1".as_ptr(), ..plan_info };
    refused(create(twice, &mut plan), INVALID, "slabs option step: is given twice");
    let unusable = vr_plan_info { format: vk::Format::R8G8B8A8_UINT, ..plan_info };
    refused(create(unusable, &mut plan), vr_result::VR_ERROR_UNSUPPORTED, "R8G8B8A8_UNORM");
    let depth_format = vr_plan_info { format: vk::Format::D16_UNORM, ..plan_info };
    refused(create(depth_format, &mut plan), vr_result::VR_ERROR_UNSUPPORTED, "D16_UNORM");
    done(create(plan_info, &mut plan));
    let larger = vr_view { width: 41, ..view };
    // SAFETY: the same.
    assert_eq!(unsafe { vr_plan_set_view(plan, &larger) }, vr_result::VR_NO_ROOM);
    let frame = Caller::new(&own, FORMAT, [40, 30], 16);
    let target = record_info(&frame);
    let mut recording = std::ptr::dangling_mut();
    frame.begin([0.0; 4]);
    // SAFETY: the same.
    let record = |info: &vr_record_info, recording: &mut *mut vr_recording| unsafe {
        vr_plan_record(plan, info, recording)
    };
    let depth = sized!(vr_depth_image {
        view: frame.view,
        format: vk::Format::D32_SFLOAT,
        extent: target.extent,
        kind: 1,
        at_zero: 1.0,
        at_one: 9.0
    });
    for (info, words) in [
        (vr_record_info { commands: vk::CommandBuffer::null(), ..target }, "commands"),
        (vr_record_info { image: vk::Image::null(), ..target }, "image"),
        (vr_record_info { view: vk::ImageView::null(), ..target }, "view"),
        (vr_record_info { format: vk::Format::R8G8B8A8_UNORM, ..target }, "R8G8B8A8_UNORM"),
        (vr_record_info { extent: vk::Extent2D { width: 40, height: 31 }, ..target }, "40x31"),
        (vr_record_info { depth: &depth, ..target }, "depth"),
        (vr_record_info { depth: &vr_depth_image { at_one: 1.0, ..depth }, ..target }, "different"),
        (vr_record_info { depth: &vr_depth_image { kind: 4, ..depth }, ..target }, "kind: 4"),
        (vr_record_info { depth: &vr_depth_image { kind: 3, ..depth }, ..target }, "of its own"),
        (
            vr_record_info { depth: &vr_depth_image { view: vk::ImageView::null(), ..depth }, ..target },
            "NULL_HANDLE",
        ),
    ] {
        refused(record(&info, &mut recording), INVALID, words);
        assert!(recording.is_null());
    }
    done(record(&target, &mut recording));
    let mut second = std::ptr::dangling_mut();
    refused(record(&target, &mut second), INVALID, "has not been completed");
    assert!(second.is_null());
    // SAFETY: the submission has ended.
    let completed = |status: *mut vr_status| unsafe { vr_recording_completed(recording, status) };
    frame.end(&own);
    let mut status = sized!(vr_status {});
    status.struct_size = 3;
    refused(completed(&mut status), INVALID, "struct_size 3");
    done(completed(null_mut()));
    refused!(vr_recording_completed(null_mut(), null_mut()), INVALID, "recording: is NULL");
    end_recording(recording);
    // A frame that is dropped.
    frame.begin([0.0; 4]);
    done(record(&target, &mut recording));
    done!(vr_recording_discard(recording));
    done!(vr_recording_discard(recording));
    refused!(vr_recording_completed(recording, &mut status), INVALID, "discarded");
    end_recording(recording);
    // SAFETY: not pending.
    unsafe { engine.device.reset_command_buffer(frame.commands, vk::CommandBufferResetFlags::empty()) }
        .unwrap();
    frame.begin([0.0; 4]);
    done(record(&target, &mut recording));
    frame.end(&own);
    done!(vr_recording_completed(recording, null_mut()));
    end_recording(recording);

    let (mut used, mut budget) = (0, 0);
    done!(vr_gpu_memory(gpu, &mut used, &mut budget));
    assert!(used > 0 && used < budget);
    refused!(vr_gpu_memory(null(), &mut used, &mut budget), INVALID, "gpu");
    // SAFETY: null is nothing.
    assert!(unsafe { vr_gpu_name(null()) }.is_null());
    // SAFETY: null is nothing.
    assert!(unsafe { vr_scene_technique(null()) }.is_null());
    // SAFETY: null is nothing.
    assert!(unsafe { vr_plan_route(null()) }.is_null());
    // Null is nothing.
    for (plan, scene, gpu) in [(plan, scene, gpu), (null_mut(), null_mut(), null_mut())] {
        end_plan(plan);
        end_scene(scene);
        end_gpu(gpu);
    }
    end_recording(null_mut());
    drop((frame, own));
    engine.end_silently();
}
