//! The library's door: recording into the caller's command buffer and image.

#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::sync::Arc;

use crate::common::caller::{Caller, Depth};
use crate::common::*;
use glam::DVec3;
use volraster::ash::vk;
use volraster::gpu::{DepthImage, DepthProjection, Gpu, GpuOptions, PipelineCache, TargetImage};
use volraster::scene::{Clip, Field, KernelSize, Scene, TransferFunction, View};
use volraster::technique::{Renderer, Technique};
use volraster::{GpuScene, Plan, RecordInfo, TargetDesc, TargetMode};

fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Every mode, route and kind of format: what lands in the caller's image is the volume, cleared or over
/// what was there.
#[test]
fn the_volume_lands_in_the_caller_s_image() {
    let gpu = gpu();
    let grid = GpuScene::new(&gpu, scene(Field::Blobs, 16, "f32", &FOG));
    let transfer = TransferFunction::from_rows(&FOG).unwrap();
    let mesh = GpuScene::new(&gpu, Scene::new(Field::Blobs.tets(5).unwrap(), transfer));
    let [outside, inside] = [1.0, 0.1].map(|distance| view(perspective(), distance, 40, 30));
    let behind = [0.0, 0.5, 0.25, 1.0_f32];
    let formats = [
        (vk::Format::R32G32B32A32_SFLOAT, 16),
        (vk::Format::R8G8B8A8_UNORM, 4),
        (vk::Format::B8G8R8A8_SRGB, 4),
    ];
    let slices = ["route=compute", "route=raster", "route=raster,order=front-to-back", "target=rgba8"];
    let slices = slices.map(|options| (&grid, format!("slices-3d:step=0.5,{options}")));
    let lists = ["havs", "havs:k=2,chunk=9", "abuffer"].map(|spec| (&mesh, spec.to_string()));
    let warped = ["route=compute,warp=mip", "route=raster", "route=raster,order=front-to-back,warp=bicubic"];
    let warped = warped.map(|options| (&grid, format!("shear-warp:step=0.5,{options}")));
    for (scene, options) in slices.into_iter().chain(lists).chain(warped) {
        // From inside the warp composites several base planes, side by side.
        let view = if options.starts_with("shear-warp") { inside } else { outside };
        let renderer = Renderer::new(scene, Technique::parse(&options).unwrap());
        let alone = renderer.render(&view).unwrap();
        for (format, texel) in formats {
            for mode in [TargetMode::Clear, TargetMode::Over] {
                let mut plan = renderer.prepare(&view, &TargetDesc::caller(format, mode)).unwrap();
                let caller = Caller::new(&gpu, format, [40, 30], texel);
                caller.begin(behind);
                let recorded =
                    plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap();
                let bytes = caller.end(&gpu);
                let status = recorded.completed().unwrap();
                assert!(status.complete);
                for (i, texels) in bytes.chunks_exact(usize::try_from(texel).unwrap()).enumerate() {
                    let volume = alone.pixels()[i].map(f64::from);
                    for c in 0..4 {
                        let old = if mode == TargetMode::Over { f64::from(behind[c]) } else { 0.0 };
                        let want = volume[c] + (1.0 - volume[3]) * old;
                        let (got, want, bound) = match format {
                            vk::Format::R32G32B32A32_SFLOAT => {
                                let at = 4 * c;
                                let got = f32::from_ne_bytes(texels[at..at + 4].try_into().unwrap());
                                // Blended directly into float the picture is not rounded to 8 bits between.
                                (
                                    f64::from(got),
                                    want,
                                    if options.contains("rgba8") { 1.0 / 255.0 } else { 1e-5 },
                                )
                            }
                            // Rounding to 8 bits, half a code each: the result; over, what was there, and in
                            // a fixed-point blender the source, 1 - alpha and their product. With 8-bit
                            // accumulation: at every slice.
                            vk::Format::R8G8B8A8_UNORM => (
                                f64::from(texels[c]) / 255.0,
                                want,
                                if options.contains("rgba8") {
                                    0.04
                                } else if mode == TargetMode::Over {
                                    2.6 / 255.0
                                } else {
                                    0.6 / 255.0
                                },
                            ),
                            _ => {
                                let place = [2, 1, 0, 3][c];
                                let want = if c < 3 { srgb(want) } else { want };
                                // Blending decodes and encodes what is there: the steep end of the curve
                                // doubles an error there. Encoders may be 0.6 codes off.
                                (
                                    f64::from(texels[place]) / 255.0,
                                    want,
                                    if options.contains("rgba8") {
                                        0.04
                                    } else if mode == TargetMode::Over {
                                        3.5 / 255.0
                                    } else {
                                        1.1 / 255.0
                                    },
                                )
                            }
                        };
                        assert!(
                            (got - want).abs() <= bound,
                            "{options} {format:?} {mode:?} pixel {i} channel {c}: {got} is not {want}"
                        );
                    }
                }
            }
        }
    }
}

/// Two eyes that are recorded together, of one scene or of two, are those of single recordings to the bit. They share the image that
/// they draw into, where one must wait for the other. The layers watch.
#[test]
fn frames_recorded_together_are_those_recorded_one_by_one() {
    let gpu = gpu();
    let timed = gpu.has(volraster::gpu::OptionalFeature::Timestamps);
    let grid = GpuScene::new(&gpu, scene(Field::Blobs, 16, "f32", &FOG));
    let transfer = TransferFunction::from_rows(&FOG).unwrap();
    let mesh = GpuScene::new(&gpu, Scene::new(Field::Blobs.tets(5).unwrap(), transfer.clone()));
    let points = Field::Blobs.points(300).unwrap().with_size(KernelSize::Radius(0.2)).unwrap();
    let points = GpuScene::new(&gpu, Scene::new(points, transfer));
    let mut pairs = vec![
        [(&mesh, "havs"), (&mesh, "havs")],
        [(&grid, "slabs"), (&grid, "slabs")],
        [(&mesh, "havs:k=2,chunk=9"), (&mesh, "abuffer")],
        [(&points, "splat-ewa"), (&points, "splat-ewa")],
        [(&points, "splat-sheets"), (&grid, "raycast:tolerance=1e-3")],
        [(&grid, "slices-3d:resolution=half,refine=1e-3"), (&mesh, "projected-tets")],
    ];
    if gpu.has(volraster::gpu::OptionalFeature::BlendRgba32f) {
        pairs.push([(&grid, "slabs:route=raster"), (&grid, "shear-warp")]);
        pairs.push([(&mesh, "projected-tets:route=raster"), (&mesh, "projected-tets:route=raster")]);
    }
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let target = TargetDesc::caller(format, TargetMode::Over).in_part();
    // Beside each other, or one over the other.
    for (pair, apart) in pairs.into_iter().flat_map(|pair| [(pair, 40), (pair, 0)]) {
        let eye = |side: f64| view(perspective(), 1.0 + side, 40, 30);
        let draw = |together: bool| {
            let mut plans = [0, 1].map(|i| {
                let (scene, spec) = pair[i];
                let renderer = Renderer::new(scene, Technique::parse(spec).unwrap());
                let mut plan = renderer.prepare(&eye(0.0), &target).unwrap();
                assert!(plan.set_view(&eye(0.01 * i as f64)).unwrap());
                plan
            });
            let caller = Caller::new(&gpu, format, [80, 30], 16);
            caller.begin([0.0, 0.5, 0.25, 1.0]);
            let mut commands = caller.command_buffer(&gpu);
            let targets = [0, 1].map(|i| {
                // SAFETY: image and view live until the test's end, and are 80 pixels wide; the layout is as asked.
                let half =
                    unsafe { TargetImage::from_raw(&gpu, caller.image, caller.view, format, [40, 30]) };
                // SAFETY: the same.
                unsafe { half.at([apart * i, 0]) }
            });
            let info = |i: usize| RecordInfo { target: Some(&targets[i]), ..RecordInfo::default() };
            let recorded = if together {
                let [left, right] = &mut plans;
                Plan::record_together(&mut commands, &mut [(left, info(0)), (right, info(1))]).unwrap()
            } else {
                let each = plans.iter_mut().enumerate();
                each.map(|(i, plan)| plan.record_with(&mut commands, info(i)).unwrap()).collect()
            };
            let bytes = caller.end(&gpu);
            let passes: Vec<usize> = recorded
                .into_iter()
                .map(|recorded| {
                    let status = recorded.completed().unwrap();
                    assert!(status.complete);
                    status.passes.len()
                })
                .collect();
            (bytes, passes)
        };
        let ((one_by_one, single), (together, shared)) = (draw(false), draw(true));
        assert!(one_by_one == together, "{:?}, {apart} apart", pair.map(|(_, spec)| spec));
        if timed {
            // Only composites wait, each for the one before.
            let (most, sum) = (single.iter().max().copied().unwrap_or(0), shared.iter().sum::<usize>());
            assert!(sum == most || sum == most + 1, "{single:?}, {shared:?}");
        }
    }
}

/// A frame that was recorded and never submitted leaves nothing that the next one could reuse.
#[test]
fn a_discarded_frame_is_not_reused() {
    let gpu = gpu();
    if !routes_of(&gpu, volraster::technique::Method::ProjectedTets).contains(&"raster") {
        return;
    }
    let mesh = Scene::new(Field::Blobs.tets(5).unwrap(), TransferFunction::from_rows(&FOG).unwrap());
    let mesh = GpuScene::new(&gpu, mesh);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let view = view(perspective(), 1.0, 40, 30);
    let renderer = Renderer::new(&mesh, Technique::parse("projected-tets:plane=space").unwrap());
    let mut plan = renderer.prepare(&view, &TargetDesc::caller(format, TargetMode::Clear)).unwrap();
    let caller = Caller::new(&gpu, format, [40, 30], 16);
    caller.begin([0.0; 4]);
    let recorded = plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap();
    // SAFETY: recording.
    unsafe { caller.device.end_command_buffer(caller.commands) }.unwrap();
    recorded.discarded();
    let mut reused = Vec::new();
    for _ in 0..2 {
        caller.begin([0.0; 4]);
        let recorded =
            plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap();
        let bytes = caller.end(&gpu);
        let counters = recorded.completed().unwrap().counters;
        reused.extend(counters.iter().filter(|(name, _)| *name == "fans_reused").map(|(_, count)| *count));
        let floats: Vec<f32> =
            bytes.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap())).collect();
        assert!(floats == renderer.render(&view).unwrap().pixels().as_flattened());
    }
    assert_eq!(reused, [0, 1]);
}

/// Of several frames that are recorded together either all are or none: after a refusal plans can be recorded, and nothing is kept.
#[test]
fn frames_recorded_together_fail_together() {
    let gpu = gpu();
    let grid = GpuScene::new(&gpu, scene(Field::Blobs, 16, "f32", &FOG));
    let mesh = Scene::new(Field::Blobs.tets(5).unwrap(), TransferFunction::from_rows(&FOG).unwrap());
    let mesh = GpuScene::new(&gpu, mesh);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let plain = TargetDesc::caller(format, TargetMode::Over);
    let view = view(perspective(), 1.0, 40, 30);
    let mut plans =
        [(&mesh, "abuffer", plain), (&grid, "slices-2d", plain), (&grid, "slabs", plain.with_depth())].map(
            |(scene, spec, target)| {
                Renderer::new(scene, Technique::parse(spec).unwrap()).prepare(&view, &target).unwrap()
            },
        );
    let caller = Caller::new(&gpu, format, [40, 30], 16);
    let wall = Depth::new(&gpu, vk::Format::D32_SFLOAT, [40, 30], &[0.9; 1200]).unwrap();
    let projection = DepthProjection::perspective(0.1, 10.0).unwrap();
    let (image, depth) = (caller.target(&gpu), wall.image(&gpu, projection));
    let owner = Arc::new(());
    let mut draw = |depth: Option<&DepthImage>, together: bool| {
        caller.begin([0.0; 4]);
        wall.fill(caller.commands);
        let mut commands = caller.command_buffer(&gpu);
        let info = |i: usize| RecordInfo {
            target: Some(&image),
            depth: depth.filter(|_| i == 2),
            owner: Some(Arc::clone(&owner) as _),
            ..RecordInfo::default()
        };
        let recorded = if together {
            let mut all: Vec<_> = plans.iter_mut().enumerate().map(|(i, plan)| (plan, info(i))).collect();
            Plan::record_together(&mut commands, &mut all)
        } else {
            plans.iter_mut().enumerate().map(|(i, plan)| plan.record_with(&mut commands, info(i))).collect()
        };
        let bytes = caller.end(&gpu);
        recorded.map(|recorded| {
            assert!(recorded.into_iter().all(|recorded| recorded.completed().unwrap().complete));
            bytes
        })
    };
    let refused = draw(None, true).unwrap_err().to_string();
    assert!(refused.contains("depth image"), "{refused}");
    assert_eq!(Arc::strong_count(&owner), 1);
    // One over the other, in the order of the list.
    let together = draw(Some(&depth), true).unwrap();
    assert!(together == draw(Some(&depth), false).unwrap());
    assert!(together.iter().any(|&byte| byte != 0));
    assert_eq!(Arc::strong_count(&owner), 1);
}

/// Every pass of a frame has a timer, whatever the technique, the route and the view: the composite, which is the last pass,
/// reports its time, and so does a draw of the technique before it.
#[test]
fn every_pass_reports_its_time() {
    let gpu = gpu();
    let timed = gpu.has(volraster::gpu::OptionalFeature::Timestamps);
    let clip = Clip::none().with_plane(DVec3::ZERO, DVec3::X).unwrap();
    let clip = clip.with_crop(DVec3::splat(-0.9), DVec3::splat(0.9)).unwrap();
    let clipped = [1.0, 0.1, 3.0].map(|distance| view(perspective(), distance, 40, 30).with_clip(clip));
    let views = [view(perspective(), 1.0, 40, 30), view(perspective(), 0.1, 40, 30)];
    let mut kinds = every_kind(&gpu);
    kinds[0].1.extend(["slices-3d:target=rgba8,dither=blue", "shear-warp:warp=mip"].map(str::to_string));
    let meshes =
        ["projected-tets:route=raster,rank=centroid", "projected-tets:plane=space", "havs:k=2,chunk=9"];
    kinds[1].1.extend(meshes.map(str::to_string));
    let target = TargetDesc::caller(vk::Format::R8G8B8A8_UNORM, TargetMode::Over);
    let caller = Caller::new(&gpu, vk::Format::R8G8B8A8_UNORM, [40, 30], 4);
    let mut plan =
        Renderer::new(&kinds[0].0, technique("slabs")).prepare(&views[0], &target.without_times()).unwrap();
    caller.begin([0.0; 4]);
    let recorded = plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap();
    let _ = caller.end(&gpu);
    assert!(recorded.completed().unwrap().passes.is_empty());
    let draws = ["draw", "march", "resolve", "empty"];
    for (scene, spec) in kinds.iter().flat_map(|(scene, specs)| specs.iter().map(move |spec| (scene, spec))) {
        let renderer = Renderer::new(scene, technique(spec));
        for views in taken(2, [views.as_slice(), &clipped]) {
            let mut plan = renderer.prepare(&views[0], &target).unwrap();
            for view in views {
                if !plan.set_view(view).unwrap() {
                    plan = renderer.prepare(view, &target).unwrap();
                }
                caller.begin([0.0; 4]);
                let recorded =
                    plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap();
                let _ = caller.end(&gpu);
                let passes = recorded.completed().unwrap().passes;
                if !timed {
                    // Debug builds count the passes against the timers all the same.
                    assert!(passes.is_empty(), "{spec}: {passes:?}");
                    continue;
                }
                let names: Vec<&str> = passes.iter().map(|pass| pass.name.as_str()).collect();
                // The warp of an unbounded view draws into an image of any format.
                let direct = spec == "shear-warp:route=raster" && view.clip().is_none();
                let last = if direct { "shear-warp.warp" } else { "composite.draw" };
                assert_eq!(names.last(), Some(&last), "{spec}: {names:?}");
                let own = &names[..names.len() - 1];
                let drawn = own.iter().any(|name| draws.iter().any(|draw| name.ends_with(draw)));
                assert!(drawn, "{spec}: {names:?}");
                assert!(
                    passes.iter().all(|pass| pass.ms.is_finite() && pass.ms >= 0.0),
                    "{spec}: {passes:?}"
                );
                if spec == "projected-tets:route=raster,rank=centroid" && view.clip().is_none() {
                    let mut steps = names.clone();
                    steps.retain(|name| !name.contains(".sort"));
                    let cells =
                        ["points", "boxes", "outlines", "draw"].map(|step| format!("projected-tets.{step}"));
                    let want = [
                        "status.clear",
                        &cells[0],
                        &cells[1],
                        &cells[2],
                        &cells[3],
                        "status",
                        "composite.draw",
                    ];
                    assert_eq!(steps, want);
                    assert!(names.len() > want.len(), "the sort is missing: {names:?}");
                }
            }
        }
    }
}

/// A caller's image of the technique's own format is drawn into directly: no image of its own, no
/// composite.
#[test]
fn a_matching_target_costs_nothing() {
    let gpu = fresh_gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, "f32", &FOG));
    let view = view(perspective(), 1.0, 40, 30);
    let renderer = Renderer::new(&scene, Technique::parse("slices-3d:route=raster").unwrap());
    let plan = renderer
        .prepare(&view, &TargetDesc::caller(vk::Format::R32G32B32A32_SFLOAT, TargetMode::Over))
        .unwrap();
    let names: Vec<String> = gpu.memory_report().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["volume", "transfer.knots"]);
    assert_eq!(gpu.pipelines(), ["slices-3d.draw"]);
    drop(plan);
    let plan =
        renderer.prepare(&view, &TargetDesc::caller(vk::Format::B8G8R8A8_SRGB, TargetMode::Over)).unwrap();
    assert_eq!(gpu.pipelines(), ["composite.draw", "slices-3d.draw"]);
    drop(plan);
}

#[test]
fn what_does_not_fit_the_plan_is_refused() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 8, "f32", &FOG));
    let view = view(perspective(), 1.0, 40, 30);
    let renderer = Renderer::new(&scene, Technique::default());
    let format = vk::Format::R8G8B8A8_UNORM;
    let mut plan = renderer.prepare(&view, &TargetDesc::caller(format, TargetMode::Clear)).unwrap();
    let caller = Caller::new(&gpu, format, [40, 30], 4);
    let other = Caller::new(&gpu, format, [41, 30], 4);
    let (mut commands, target) = (caller.command_buffer(&gpu), caller.target(&gpu));
    caller.begin([0.0; 4]);
    let refuse = |result: volraster::Result<volraster::Recorded>| result.unwrap_err().to_string();
    assert!(refuse(plan.record(&mut commands, None, None)).contains("target"));
    assert!(refuse(plan.record(&mut commands, Some(&other.target(&gpu)), None)).contains("41x30"));
    let projection = DepthProjection::perspective(0.1, 9.0).unwrap();
    // SAFETY: any view will do: it is refused before it is looked at.
    let depth =
        unsafe { DepthImage::from_raw(&gpu, caller.view, vk::Format::D32_SFLOAT, [40, 30], projection) };
    assert!(refuse(plan.record(&mut commands, Some(&target), Some(&depth))).contains("with_depth"));
    let recorded = plan.record(&mut commands, Some(&target), None).unwrap();
    assert!(refuse(plan.record(&mut commands, Some(&target), None)).contains("has not been completed"));
    let _ = caller.end(&gpu);
    let passes: Vec<String> =
        recorded.completed().unwrap().passes.into_iter().map(|pass| pass.name).collect();
    let timed = gpu.has(volraster::gpu::OptionalFeature::Timestamps);
    let want = ["slices-3d.tiles.clear", "slices-3d.tiles", "slices-3d.march", "composite.draw"];
    assert_eq!(passes, if timed { want.as_slice() } else { &[] });
    // Completed, the plan can be recorded again.
    caller.begin([0.0; 4]);
    let recorded = plan.record(&mut commands, Some(&target), None).unwrap();
    let _ = caller.end(&gpu);
    assert!(recorded.completed().unwrap().complete);
    let formats = renderer.prepare(&view, &TargetDesc::caller(vk::Format::D32_SFLOAT, TargetMode::Clear));
    assert!(formats.unwrap_err().to_string().contains("D32_SFLOAT"));
}

/// A recording without enough room says so, in a status that costs no wait; the next plan has it. What is drawn then is what
/// a plan for that view draws.
#[test]
fn a_short_capacity_is_reported_and_the_next_plan_has_it() {
    let gpu = gpu();
    let transfer = TransferFunction::from_rows(&FOG).unwrap();
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let target = TargetDesc::caller(format, TargetMode::Clear);
    let caller = Caller::new(&gpu, format, [40, 30], 16);
    let (far, near) = (view(perspective(), 30.0, 40, 30), view(perspective(), 0.8, 40, 30));
    for spec in ["havs", "abuffer", "havs:chunk=9"] {
        let mesh = Scene::new(Field::Blobs.tets(6).unwrap(), transfer.clone());
        let renderer = Renderer::new(&GpuScene::new(&gpu, mesh), Technique::parse(spec).unwrap());
        let draw = |plan: &mut volraster::Plan| {
            caller.begin([0.0; 4]);
            let recorded =
                plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap();
            let bytes = caller.end(&gpu);
            (bytes, recorded.completed().unwrap())
        };
        let mut plan = renderer.prepare(&far, &target).unwrap();
        assert!(draw(&mut plan).1.complete, "{spec}");
        assert!(plan.set_view(&near).unwrap());
        let status = draw(&mut plan).1;
        assert!(!status.complete && !status.counters.is_empty(), "{spec}: {status:?}");
        let mut tries = 0;
        let drawn = loop {
            let (bytes, status) = draw(&mut renderer.prepare(&near, &target).unwrap());
            if status.complete {
                break bytes;
            }
            tries += 1;
            assert!(tries < 4, "{spec}: {status:?}");
        };
        let alone = renderer.render(&near).unwrap();
        let bytes: Vec<u8> = alone.pixels().iter().flatten().flat_map(|c| c.to_ne_bytes()).collect();
        assert!(bytes == drawn, "{spec}");
    }
}

/// Two plans recorded on one scene, and everything but the recordings dropped before they are submitted.
#[test]
fn recordings_keep_what_they_name() {
    let gpu = gpu();
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let view = view(perspective(), 1.0, 40, 30);
    let callers = [Caller::new(&gpu, format, [40, 30], 16), Caller::new(&gpu, format, [40, 30], 16)];
    let mut recordings = Vec::new();
    {
        let scene = GpuScene::new(&gpu, scene(Field::Blobs, 16, "f32", &FOG));
        for (caller, route) in callers.iter().zip(["compute", "raster"]) {
            let technique = Technique::parse(&format!("slices-3d:route={route}")).unwrap();
            let mut plan = Renderer::new(&scene, technique)
                .prepare(&view, &TargetDesc::caller(format, TargetMode::Clear))
                .unwrap();
            caller.begin([0.0; 4]);
            recordings.push(
                plan.record(&mut caller.command_buffer(&gpu), Some(&caller.target(&gpu)), None).unwrap(),
            );
        }
    }
    let images: Vec<Vec<u8>> = callers.iter().map(|caller| caller.end(&gpu)).collect();
    for recording in recordings {
        assert!(recording.completed().unwrap().complete);
    }
    let alpha = |bytes: &[u8]| -> f64 {
        bytes.chunks_exact(16).map(|t| f64::from(f32::from_ne_bytes(t[12..16].try_into().unwrap()))).sum()
    };
    let (a, b) = (alpha(&images[0]), alpha(&images[1]));
    assert!(a > 10.0 && (a - b).abs() < 1e-2, "{a} {b}");
}

/// The pipeline cache is written, read again, and ignored when it is damaged.
#[test]
fn the_pipeline_cache_survives_damage() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("pipeline-cache");
    let _ = std::fs::remove_dir_all(&folder);
    let run = |expected: &str| {
        undisturbed(|| {
            let gpu = Gpu::new(&GpuOptions {
                pipeline_cache: PipelineCache::Folder(folder.clone()),
                validation: volraster::gpu::Validation::On,
                ..GpuOptions::default()
            })
            .unwrap();
            let scene = GpuScene::new(&gpu, scene(Field::Blobs, 8, "f32", &FOG));
            let view: View = view(perspective(), 1.0, 20, 20);
            let image = Renderer::new(&scene, Technique::default()).render(&view).unwrap();
            let log = gpu.validation_log();
            drop((scene, gpu));
            assert!(log.messages().is_empty(), "{expected}: {:?}", log.messages());
            image
        })
    };
    let first = run("no cache");
    let files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(files.len(), 1, "{files:?}");
    let good = std::fs::read(&files[0]).unwrap();
    assert!(good.len() > 52, "{} bytes", good.len());
    assert_eq!(run("a good cache"), first);
    for damage in
        [good[..good.len() - 1].to_vec(), vec![0xff; 4096], [&good[..40], &[1], &good[41..]].concat()]
    {
        std::fs::write(&files[0], &damage).unwrap();
        assert_eq!(run("a damaged cache"), first);
        assert_eq!(std::fs::read(&files[0]).unwrap(), good, "the cache is written anew");
    }
}
