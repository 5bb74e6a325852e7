//! What C programs draw is what Rust programs do.

use std::ffi::{CStr, CString, c_void};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::Mutex;

use volraster::ash::vk;
use volraster::ffi::*;
use volraster::gpu::DepthProjection;
use volraster::scene::{
    Clip, Field, Kernel, Kernels, Lighting, Mode, Samples, Scene, Shading, SplatRule, Surface, TetScalars,
    TransferFunction,
};
use volraster::technique::Renderer;
use volraster::{GpuScene, RecordInfo, TargetDesc, TargetMode};

use crate::common::caller::{Caller, Depth};
use crate::common::{FOG, SHELLS, draw, draw_on, perspective, technique, view};
use crate::engine::Engine;
use crate::programs::scratch;
use crate::support::*;

/// Frames that C records are those of Rust to the bit: plain, cut, and with a depth image.
#[test]
fn frames_are_those_of_rust() {
    let _turn = turn();
    let engine = Engine::least();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let extent = [40, 30];
    let frame = Caller::new(&own, FORMAT, extent, 16);
    let transfer = TransferFunction::from_rows(&FOG).unwrap();
    let grid = Field::Blobs.sample([16; 3], "u8").unwrap();
    let scene = c_scene(gpu, &grid, &FOG);
    let rust = GpuScene::new(&own, Scene::new(grid, transfer));
    let first = view(perspective(), 1.0, 40, 30);
    let clip = Clip::none().with_plane([0.1, 0.0, 0.0].into(), [1.0, 0.3, 0.0].into()).unwrap();
    let clip = clip.with_crop([-0.8; 3].into(), [0.9, f64::INFINITY, 0.7].into()).unwrap();
    let second = view(perspective(), 1.1, 40, 30).with_clip(clip);
    // Half of the image behind a wall, stored in reverse without a far end.
    let wall: Vec<f32> = (0..1200).map(|i| if i % 40 < 20 { 0.0 } else { 0.5 / 4.6 }).collect();
    let depth = Depth::new(&own, vk::Format::D32_SFLOAT, extent, &wall).unwrap();
    let projection = DepthProjection::perspective(f64::INFINITY, 0.5).unwrap();
    let depth_image = depth.image(&own, projection);
    for (spec, with_depth) in [(c"slabs:step=0.5", true), (c"slices-3d:route=raster", false)] {
        let info = sized!(vr_plan_info {
            technique: spec.as_ptr(),
            format: FORMAT,
            mode: vr_target_mode::VR_TARGET_OVER as u32,
            with_depth: u32::from(with_depth),
        });
        let mut plan = null_mut();
        done!(vr_plan_create(scene, &info, &c_view(&second), &mut plan));
        // SAFETY: a plan.
        let route = text(unsafe { vr_plan_route(plan) });
        assert_eq!(route, if with_depth { "compute" } else { "raster" });
        let target = TargetDesc::caller(FORMAT, TargetMode::Over);
        let target = if with_depth { target.with_depth() } else { target };
        let renderer = Renderer::new(&rust, technique(spec.to_str().unwrap()));
        let mut rust_plan = renderer.prepare(&second, &target).unwrap();
        let mut images = Vec::new();
        for view in [&first, &second] {
            done!(vr_plan_set_view(plan, &c_view(view)));
            frame.begin([0.1, 0.2, 0.3, 1.0]);
            if with_depth {
                depth.fill(frame.commands);
            }
            let c_depth = sized!(vr_depth_image {
                view: depth.view,
                format: vk::Format::D32_SFLOAT,
                extent: vk::Extent2D { width: 40, height: 30 },
                kind: vr_depth_kind::VR_DEPTH_PERSPECTIVE as u32,
                at_zero: f64::INFINITY,
                at_one: 0.5,
            });
            let mut info = record_info(&frame);
            if with_depth {
                info.depth = &raw const c_depth;
            }
            let mut recording = null_mut();
            done!(vr_plan_record(plan, &info, &mut recording));
            let bytes = frame.end(&own);
            let mut status = sized!(vr_status {});
            for _ in 0..2 {
                done!(vr_recording_completed(recording, &mut status));
                assert_eq!((status.struct_size, status.complete), (size_of::<vr_status>(), 1));
            }
            assert!(rust_plan.set_view(view).unwrap());
            frame.begin([0.1, 0.2, 0.3, 1.0]);
            if with_depth {
                depth.fill(frame.commands);
            }
            let recorded = rust_plan
                .record(
                    &mut frame.command_buffer(&own),
                    Some(&frame.target(&own)),
                    with_depth.then_some(&depth_image),
                )
                .unwrap();
            let want = frame.end(&own);
            let rust_status = recorded.completed().unwrap();
            assert!(bytes == want, "{spec:?}");
            // Times differ from frame to frame; their names do not.
            // SAFETY: valid until the recording goes; never null.
            let passes = unsafe { std::slice::from_raw_parts(status.passes, status.pass_count as usize) };
            let names: Vec<String> = passes.iter().map(|pass| text(pass.name)).collect();
            let want: Vec<String> = rust_status.passes.iter().map(|pass| pass.name.clone()).collect();
            assert_eq!(names, want);
            assert!(passes.iter().all(|pass| pass.ms >= 0.0));
            end_recording(recording);
            images.push(bytes);
        }
        assert!(images[0] != images[1]);
        end_plan(plan);
    }
    // And without a command buffer.
    for view in [&first, &second] {
        let want = Renderer::new(&rust, technique("slices-3d")).render(view).unwrap();
        assert!(c_render(scene, None, view) == want.pixels());
    }
    end_scene(scene);
    end_gpu(gpu);
    drop((depth, frame, rust, own));
    engine.end_silently();
}

/// Depths at which rays become opaque are those of Rust to the bit.
#[test]
fn hit_depths_are_those_of_rust() {
    const DEPTH: vk::Format = vk::Format::R32_SFLOAT;
    let _turn = turn();
    let engine = Engine::least();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let frame = Caller::new(&own, FORMAT, [40, 30], 16);
    let depths = Caller::new(&own, DEPTH, [40, 30], 4);
    let grid = Field::Blobs.sample([16; 3], "u8").unwrap();
    let scene = c_scene(gpu, &grid, &FOG);
    let rust = GpuScene::new(&own, Scene::new(grid, TransferFunction::from_rows(&FOG).unwrap()));
    let view = view(perspective(), 1.0, 40, 30);
    let info = sized!(vr_plan_info {
        technique: c"slabs".as_ptr(),
        format: FORMAT,
        mode: vr_target_mode::VR_TARGET_OVER as u32,
        hit_opacity: 0.25,
        hit_format: DEPTH,
    });
    let mut plan = null_mut();
    done!(vr_plan_create(scene, &info, &c_view(&view), &mut plan));
    let hit_depths = sized!(vr_hit_depths {
        image: depths.image,
        view: depths.view,
        kind: vr_depth_kind::VR_DEPTH_PERSPECTIVE as u32,
        at_zero: f64::INFINITY,
        // Of a world that is twice as large as the scene.
        at_one: 1.0,
        unit: 2.0,
    });
    let begin = || {
        frame.begin([0.0, 0.0, 0.0, 1.0]);
        depths.fill(frame.commands, [0.5; 4]);
    };
    let end = || {
        depths.copy(frame.commands);
        (frame.end(&own), depths.read())
    };
    begin();
    let mut recording = null_mut();
    let null_view = vr_hit_depths { view: vk::ImageView::null(), ..hit_depths };
    for (given, words) in [(null(), "hit depths"), (&raw const null_view, "view of hit depths")] {
        let info = vr_record_info { hit_depths: given, ..record_info(&frame) };
        refused!(vr_plan_record(plan, &info, &mut recording), vr_result::VR_ERROR_INVALID, words);
    }
    let info = vr_record_info { hit_depths: &hit_depths, ..record_info(&frame) };
    done!(vr_plan_record(plan, &info, &mut recording));
    let got = end();
    done!(vr_recording_completed(recording, null_mut()));
    end_recording(recording);
    let target = TargetDesc::caller(FORMAT, TargetMode::Over).with_hit_depths(DEPTH, 0.25).unwrap();
    let mut plan_of_rust = Renderer::new(&rust, technique("slabs")).prepare(&view, &target).unwrap();
    begin();
    let projection = DepthProjection::perspective(f64::INFINITY, 0.5).unwrap();
    let info = RecordInfo {
        target: Some(&frame.target(&own)),
        hit_depths: Some((&depths.target(&own), projection)),
        ..RecordInfo::default()
    };
    let recorded = plan_of_rust.record_with(&mut frame.command_buffer(&own), info).unwrap();
    let want = end();
    recorded.completed().unwrap();
    assert!(got == want);
    let stored = got.1.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap()));
    assert!(stored.clone().any(|s| s > 0.0) && stored.clone().any(|s| s == 0.0));
    end_plan(plan);
    end_scene(scene);
    end_gpu(gpu);
    drop((plan_of_rust, frame, depths, rust, own));
    engine.end_silently();
}

/// A stereo pair in one image: recorded together it is what single recordings draw, and misuses record nothing.
#[test]
fn frames_recorded_together_are_single_ones() {
    let _turn = turn();
    let engine = Engine::least();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let frame = Caller::new(&own, FORMAT, [80, 30], 16);
    let scene = c_scene(gpu, &Field::Blobs.sample([16; 3], "u8").unwrap(), &FOG);
    let info = sized!(vr_plan_info {
        technique: c"slabs:step=0.5".as_ptr(),
        format: FORMAT,
        mode: vr_target_mode::VR_TARGET_OVER as u32,
        in_part: 1,
    });
    let plans = [0.0, 0.02].map(|aside| {
        let mut plan = null_mut();
        done!(vr_plan_create(scene, &info, &c_view(&view(perspective(), 1.0 + aside, 40, 30)), &mut plan));
        plan
    });
    let whole = record_info(&frame);
    let half = vk::Extent2D { width: 40, height: 30 };
    let infos = [0, 40].map(|left| vr_record_info { extent: half, corner: [left, 0], ..whole });
    let pointers = infos.each_ref().map(std::ptr::from_ref);
    let draw = |together: bool| {
        let mut recordings = [null_mut(); 2];
        frame.begin([0.0, 0.0, 0.0, 1.0]);
        if together {
            done!(vr_plans_record(plans.as_ptr(), pointers.as_ptr(), 2, recordings.as_mut_ptr()));
        } else {
            for (i, recording) in recordings.iter_mut().enumerate() {
                done!(vr_plan_record(plans[i], pointers[i], recording));
            }
        }
        let bytes = frame.end(&own);
        for recording in recordings {
            let mut status = sized!(vr_status {});
            done!(vr_recording_completed(recording, &mut status));
            assert_eq!(status.complete, 1);
            end_recording(recording);
        }
        bytes
    };
    assert!(draw(true) == draw(false));
    let twice = [plans[0]; 2];
    let mut recordings = [std::ptr::dangling_mut(); 2];
    let strange = vr_record_info { commands: <vk::CommandBuffer as vk::Handle>::from_raw(7), ..infos[1] };
    let strange = [pointers[0], &raw const strange];
    let missing = [pointers[0], null()];
    for (plans, infos, words) in [
        (twice, pointers, "given twice"),
        ([plans[0], null_mut()], pointers, "plan"),
        (plans, strange, "one command buffer"),
        (plans, missing, "vr_record_info"),
    ] {
        refused!(
            vr_plans_record(plans.as_ptr(), infos.as_ptr(), 2, recordings.as_mut_ptr()),
            vr_result::VR_ERROR_INVALID,
            words
        );
        assert_eq!(recordings, [null_mut(); 2]);
    }
    done!(vr_plans_record(null(), null(), 0, null_mut()));
    plans.into_iter().for_each(end_plan);
    end_scene(scene);
    end_gpu(gpu);
    drop((frame, own));
    engine.end_silently();
}

/// Kernels of a grid and of points, and trained splats, draw what Rust's do, and are refused by name.
#[test]
fn kernels_and_trained_splats_are_those_of_rust() {
    let _turn = turn();
    let engine = Engine::full();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let view = view(perspective(), 1.0, 40, 30);
    let fog = || TransferFunction::from_rows(&FOG).unwrap();
    let mut none = null_mut();

    let grid = Field::Blobs.sample([12; 3], "u8").unwrap();
    let scene = c_scene(gpu, &grid, &FOG);
    for (info, kernels) in [
        (sized!(vr_kernels_info {}), Kernels::of_samples()),
        (
            sized!(vr_kernels_info {
                kernel: vr_kernel::VR_KERNEL_BSPLINE as u32,
                model: vr_kernel_model::VR_KERNEL_DENSITY as u32,
            }),
            Kernels { kernel: Kernel::BSpline, ..Kernels::of_points() },
        ),
        (
            sized!(vr_kernels_info { sigma: 0.9, cut: 2.5, least: 0.2 }),
            Kernels { sigma: 0.9, cut: 2.5, least: 0.2, ..Kernels::of_samples() },
        ),
    ] {
        let mut other = null_mut();
        done!(vr_scene_with_kernels(scene, &info, &mut other));
        let rust = Scene::new(grid.clone(), fog()).with_kernels(kernels).unwrap();
        let want = draw_on(&GpuScene::new(&own, rust), &view, "splat-sheets");
        // SAFETY: a scene.
        assert!(text(unsafe { vr_scene_technique(other) }).starts_with("splat-"));
        assert!(c_render(other, Some(c"splat-sheets"), &view) == want.pixels(), "{kernels:?}");
        end_scene(other);
    }
    for (info, words) in [
        (sized!(vr_kernels_info { kernel: 5 }), "kernel: 5"),
        (sized!(vr_kernels_info { model: 3 }), "model: 3"),
        (sized!(vr_kernels_info { sigma: -1.0 }), "sigma"),
    ] {
        refused!(vr_scene_with_kernels(scene, &info, &mut none), vr_result::VR_ERROR_INVALID, words);
    }
    end_scene(scene);

    let splats = Field::Blobs.splats(200).unwrap();
    let flat = |list: &[[f32; 3]]| list.as_flattened().as_ptr();
    let info = sized!(vr_gaussians_info {
        splat_count: splats.len(),
        centres: flat(splats.centres()),
        rotations: splats.rotations().as_flattened().as_ptr(),
        log_scales: flat(splats.log_scales()),
        opacities: splats.opacities().as_ptr(),
        harmonics: splats.harmonics().as_ptr(),
        degree: splats.degree(),
        trained: vr_trained_mode::VR_TRAINED_KHRONOS as u32,
    });
    let mut scene = null_mut();
    done!(vr_scene_create_gaussians(gpu, &info, &mut scene));
    let rust = GpuScene::new(&own, Scene::new(splats.clone(), fog()).with_rule(SplatRule::Khr));
    assert!(c_render(scene, None, &view) == draw_on(&rust, &view, "gaussians").pixels());
    let by_ray = c_render(scene, Some(c"gaussians:rule=ray"), &view);
    assert!(by_ray == draw_on(&rust, &view, "gaussians:rule=ray").pixels());
    let kernels = sized!(vr_kernels_info {});
    refused!(
        vr_scene_with_kernels(scene, &kernels, &mut none),
        vr_result::VR_ERROR_INVALID,
        "kernels of their own"
    );
    for (info, words) in [
        (vr_gaussians_info { degree: 5, ..info }, "degree: 5"),
        (vr_gaussians_info { trained: 5, ..info }, "trained: 5"),
        (vr_gaussians_info { harmonics: null(), ..info }, "harmonics"),
        (vr_gaussians_info { splat_count: 0, ..info }, "at least one"),
        (vr_gaussians_info { axes: c"rbu".as_ptr(), ..info }, "left-handed"),
        (vr_gaussians_info { axes: c"xyz".as_ptr(), ..info }, "three letters"),
    ] {
        refused!(vr_scene_create_gaussians(gpu, &info, &mut none), vr_result::VR_ERROR_INVALID, words);
    }
    end_scene(scene);
    end_gpu(gpu);
    drop((rust, own));
    engine.end_silently();
}

/// Scenes that are made of others, of a mesh, of points and of files draw what Rust's do.
#[test]
fn scenes_are_those_of_rust() {
    let _turn = turn();
    let engine = Engine::full();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let view = view(perspective(), 1.0, 24, 18);
    let [fog, shells] = [&FOG[..], &SHELLS].map(|rows| TransferFunction::from_rows(rows).unwrap());
    let c_shells = knots(&SHELLS);
    let same = |scene: *mut vr_scene, want: Scene, spec: &CStr| {
        let want = draw(&own, &want, &view, spec.to_str().unwrap());
        assert!(want.pixel(12, 9)[3] > 0.05, "{spec:?}");
        assert!(c_render(scene, Some(spec), &view) == want.pixels(), "{spec:?}");
    };
    let mut handles = Vec::new();
    let grid = Field::Blobs.sample([12; 3], "u8").unwrap();
    let first = c_scene(gpu, &grid, &FOG);
    let mut made = null_mut();
    done!(vr_scene_with_transfer(first, c_shells.as_ptr(), c_shells.len(), &mut made));
    same(made, Scene::new(grid.clone(), shells.clone()), c"raycast");
    handles.push(made);
    // Samples of another type.
    let floats: Vec<f32> = (0..12 * 12 * 12).map(|i| (i % 7) as f32 * 30.0).collect();
    let kind = vr_sample_type::VR_SAMPLE_F32 as u32;
    done!(vr_scene_with_samples(first, kind, floats.as_ptr().cast(), 4 * floats.len(), &mut made));
    let other = volraster::scene::Grid::new([12; 3], Samples::F32(floats)).unwrap();
    let other = other.with_placement(glam::DVec3::ONE, grid.origin(), grid.index_to_world()).unwrap();
    same(made, Scene::new(other.with_rescale(grid.rescale()).unwrap(), fog.clone()), c"slabs");
    handles.push(made);
    same(first, Scene::new(grid.clone(), fog.clone()), c"slices-2d");
    // Surfaces come, change, and go; the data stays where it is.
    let (low, glass) = (glam::DVec3::splat(-0.4), [0.2, 0.7, 1.0, 0.5]);
    let cube = Surface::cuboid(low, -low, [0.9, 0.4, 0.1, 1.0]).unwrap().with_shading(Shading::Headlight);
    let ball = Surface::sphere(glam::DVec3::ZERO, 0.8, glass, 2).unwrap();
    let [c_cube, c_ball] = [&cube, &ball].map(c_surface);
    let volumes = || {
        let (mut used, mut budget) = (0, 0);
        done!(vr_gpu_memory(gpu, &mut used, &mut budget));
        used
    };
    let held = volumes();
    assert!(held > 12 * 12 * 12, "{held}");
    for (infos, surfaces, spec) in [
        (vec![&raw const c_cube.0], vec![cube.clone()], c"slices-2d"),
        (vec![&raw const c_cube.0, &raw const c_ball.0], vec![cube.clone(), ball.clone()], c"slices-2d"),
        (Vec::new(), Vec::new(), c"slices-2d"),
    ] {
        done!(vr_scene_with_surfaces(first, infos.as_ptr(), infos.len(), &mut made));
        same(made, Scene::new(grid.clone(), fog.clone()).with_surfaces(surfaces), spec);
        handles.push(made);
    }
    // The last has none, and draws from what the first has uploaded.
    for handle in handles.drain(handles.len() - 3..handles.len() - 1) {
        end_scene(handle);
    }
    assert_eq!(volumes(), held);
    let lighting = Lighting { direction: Some(glam::DVec3::new(1.0, 2.0, 0.5)), ..Lighting::default() };
    let c_lighting = sized!(vr_lighting {
        ambient: lighting.ambient,
        diffuse: lighting.diffuse,
        specular: lighting.specular,
        shininess: lighting.shininess,
        direction: [1.0, 2.0, 0.5],
        least_gradient: -1.0,
    });
    let (lit, maximum) = (vr_mode::VR_MODE_LIT as u32, vr_mode::VR_MODE_MAXIMUM as u32);
    for (mode, c_lighting, want, spec) in [
        (lit, &raw const c_lighting, Mode::Lit(lighting), c"slabs"),
        (lit, null(), Mode::Lit(Lighting::default()), c"raycast"),
        (maximum, null(), Mode::Maximum, c"raycast"),
    ] {
        done!(vr_scene_with_mode(first, mode, c_lighting, &mut made));
        same(made, Scene::new(grid.clone(), fog.clone()).with_mode(want).unwrap(), spec);
        // SAFETY: a scene.
        assert_ne!(text(unsafe { vr_scene_technique(made) }), "slices-3d");
        end_scene(made);
    }
    handles.push(first);

    let mesh = Field::Blobs.tets(4).unwrap();
    let TetScalars::Point(scalars) = mesh.scalars() else { panic!() };
    let points: Vec<[f64; 3]> = mesh.points().iter().map(|p| p.to_array()).collect();
    let mut info = sized!(vr_mesh_info {
        points: points.as_ptr().cast(),
        point_count: points.len(),
        cells: mesh.cells().as_ptr().cast(),
        cell_count: mesh.cells().len(),
        scalars: scalars.as_ptr(),
        scalar_count: scalars.len(),
        scalars_per: vr_scalars_per::VR_SCALARS_PER_POINT as u32,
    });
    let c_fog = knots(&FOG);
    done!(vr_scene_create_mesh(gpu, &info, c_fog.as_ptr(), c_fog.len(), &mut made));
    same(made, Scene::new(mesh.clone(), fog.clone()), c"abuffer");
    handles.push(made);
    let cells: Vec<f32> = (0..mesh.cells().len()).map(|i| (i % 5) as f32 * 0.25).collect();
    let per_cell = vr_scalars_per::VR_SCALARS_PER_CELL as u32;
    let source = made;
    done!(vr_scene_with_scalars(source, per_cell, cells.as_ptr(), cells.len(), null(), 0, &mut made));
    let by_cell = mesh.clone().with_scalars(TetScalars::Cell(cells.clone())).unwrap();
    same(made, Scene::new(by_cell.clone(), fog.clone()), c"havs");
    handles.push(made);
    (info.scalars, info.scalar_count, info.scalars_per) = (cells.as_ptr(), cells.len(), per_cell);
    done!(vr_scene_create_mesh(gpu, &info, c_shells.as_ptr(), c_shells.len(), &mut made));
    same(made, Scene::new(by_cell, shells.clone()), c"havs");
    handles.push(made);

    let splats = Field::Blobs.points(200).unwrap();
    let centres: Vec<[f64; 3]> = splats.centres().iter().map(|p| p.to_array()).collect();
    let scalars = splats.scalars().unwrap();
    let radii = vec![0.3_f32; centres.len()];
    let covariances = vec![[0.02_f32, 0.0, 0.0, 0.03, 0.0, 0.01]; centres.len()];
    use volraster::scene::KernelSize;
    for (radius, size) in [
        (0.0, None),
        (0.4, Some(KernelSize::Radius(0.4))),
        (0.0, Some(KernelSize::Radii(radii.clone()))),
        (0.0, Some(KernelSize::Covariances(covariances.clone()))),
    ] {
        let info = sized!(vr_points_info {
            centres: centres.as_ptr().cast(),
            point_count: centres.len(),
            scalars: scalars.as_ptr(),
            weights: radii.as_ptr(),
            radii: if matches!(size, Some(KernelSize::Radii(_))) { radii.as_ptr() } else { null() },
            covariances: if matches!(size, Some(KernelSize::Covariances(_))) {
                covariances.as_ptr().cast()
            } else {
                null()
            },
            radius: radius,
        });
        done!(vr_scene_create_points(gpu, &info, c_fog.as_ptr(), c_fog.len(), &mut made));
        let want = volraster::scene::Points::new(splats.centres().to_vec()).unwrap();
        let want = want.with_scalars(scalars.to_vec()).unwrap().with_weights(radii.clone()).unwrap();
        let want = match size {
            Some(size) => want.with_size(size).unwrap(),
            None => want.with_estimated_radius(),
        };
        same(made, Scene::new(want, fog.clone()), c"splat-ewa");
        handles.push(made);
    }
    // Nothing draws points among glass; without it, what draws points.
    let (points, mut glass) = (made, null_mut());
    done!(vr_scene_with_surfaces(points, [&raw const c_ball.0].as_ptr(), 1, &mut glass));
    done!(vr_scene_with_surfaces(glass, null(), 0, &mut made));
    // SAFETY: scenes.
    let chosen = [points, glass, made].map(|scene| text(unsafe { vr_scene_technique(scene) }));
    assert_eq!(chosen, ["splat-ewa", "", "splat-ewa"]);
    handles.extend([glass, made]);
    for handle in handles {
        end_scene(handle);
    }
    end_gpu(gpu);
    drop(own);
    engine.end_silently();
}

/// Files: what they ask for, and how far they were read.
#[test]
fn files_are_read() {
    let _turn = turn();
    let engine = Engine::full();
    let gpu = adopt(&engine);
    let data = scratch("read.nrrd");
    volraster::io::write_nrrd(&data, &Field::Blobs.sample([16; 3], "u16").unwrap()).unwrap();
    let scene_file = scratch("read.json");
    let document = r#"{
        "volume": {"file": "read.nrrd"},
        "transfer": [[0, 1, 1, 1, 0], [1, 1, 1, 1, 4]],
        "camera": {"eye": [3, 2, 1], "target": [0, 0, 0], "up": [0, 0, 1], "half_height": 1.5},
        "image": {"width": 31, "height": 17},
        "clip": {"crop": {"low": [-1, -1, 0], "high": [1, 1, 1]}},
        "technique": {"name": "slabs", "step": 2}
    }"#;
    std::fs::write(&scene_file, document).unwrap();
    extern "C" fn progress(done: u64, all: u64, user: *mut c_void) {
        // SAFETY: the cell of this test, which waits.
        let seen = unsafe { &*user.cast::<Mutex<Vec<(u64, u64)>>>() };
        seen.lock().unwrap().push((done, all));
    }
    let seen: Mutex<Vec<(u64, u64)>> = Mutex::default();
    let info = sized!(vr_read_info { progress: Some(progress), user: (&raw const seen).cast_mut().cast() });
    let path = |path: &Path| CString::new(path.to_str().unwrap()).unwrap();
    let mut scene = null_mut();
    done!(vr_scene_load(gpu, path(&data).as_ptr(), &info, &mut scene));
    assert!(!seen.lock().unwrap().is_empty());
    let mut told = sized!(vr_scene_info {});
    done!(vr_scene_query(scene, &mut told));
    assert_eq!((told.data_kind, told.dims), (vr_data_kind::VR_DATA_GRID as u32, [16; 3]));
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(near(told.low[0], -1.0) && near(told.high[2], 1.0) && told.range[0] < told.range[1], "{told:?}");
    // SAFETY: a scene.
    assert_eq!(text(unsafe { vr_scene_technique(scene) }), "slices-3d");
    let mut view = sized!(vr_view {});
    for (asked, want) in [([0, 0], [512, 512]), ([20, 10], [20, 10])] {
        done!(vr_scene_view(scene, asked[0], asked[1], &mut view));
        assert_eq!(([view.width, view.height], view.clip_plane_count), (want, 0));
        assert_eq!(view.projection, vr_projection::VR_PROJECTION_PERSPECTIVE as u32);
    }
    let mut pixels = [0_f32; 4 * 200];
    done!(vr_render(scene, null(), &view, pixels.as_mut_ptr(), pixels.len()));
    assert!(pixels.chunks(4).any(|p| p[3] > 0.1));
    end_scene(scene);

    done!(vr_scene_load(gpu, path(&scene_file).as_ptr(), null(), &mut scene));
    // SAFETY: a scene.
    assert_eq!(text(unsafe { vr_scene_technique(scene) }), "slabs:step=2");
    // SAFETY: a scene.
    assert_eq!(text(unsafe { vr_scene_warnings(scene) }), "");
    done!(vr_scene_view(scene, 0, 0, &mut view));
    assert_eq!(([view.width, view.height], view.eye, view.half_height), ([31, 17], [3.0, 2.0, 1.0], 1.5));
    assert_eq!((view.crop_low[2], view.crop_high), (0.0, [1.0; 3]));
    let mut draws = 7;
    for (spec, want) in [(c"raycast", 1), (c"havs:k=4", 0)] {
        done!(vr_scene_draws(scene, spec.as_ptr(), &mut draws));
        assert_eq!(draws, want);
    }
    end_scene(scene);
    for (name, code, words) in
        [(c"/no/such/file.nrrd", vr_result::VR_ERROR_IO, "cannot"), (c"/", vr_result::VR_ERROR_FILE, "/")]
    {
        scene = std::ptr::dangling_mut();
        refused!(vr_scene_load(gpu, name.as_ptr(), null(), &mut scene), code, words);
        assert!(scene.is_null());
    }
    std::fs::write(&scene_file, document.replace("\"step\": 2", "\"stride\": 2")).unwrap();
    // SAFETY: all are valid.
    let result = unsafe { vr_scene_load(gpu, path(&scene_file).as_ptr(), null(), &mut scene) };
    assert!(result == vr_result::VR_ERROR_FILE || result == vr_result::VR_ERROR_INVALID, "{}", message());
    assert!(message().contains("stride"), "{}", message());
    end_gpu(gpu);
    engine.end_silently();
}
