//! The depths at which rays become opaque: the reference, cut there, has that opacity.

#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use glam::{DVec2, DVec3};
use volraster::ash::vk;
use volraster::gpu::{DepthProjection, Gpu, TargetImage};
use volraster::scene::{Clip, Field, Kernels, Mode, Scene, SplatRule, View};
use volraster::technique::Renderer;
use volraster::{GpuScene, RecordInfo, TargetDesc, TargetMode, reference};

use crate::common::caller::Caller;
use crate::common::*;

const COLOUR: vk::Format = vk::Format::R32G32B32A32_SFLOAT;
const DEPTH: vk::Format = vk::Format::R32_SFLOAT;
/// The first pixel that is drawn of an image.
const CORNER: [u32; 2] = [5, 3];
const NEAR: f64 = 1e-4;
const RANGE: [f64; 2] = [-20.0, 40.0];

fn projection(view: &View) -> DepthProjection {
    match view.is_perspective() {
        true => DepthProjection::perspective(f64::INFINITY, NEAR),
        false => DepthProjection::orthographic(RANGE[0], RANGE[1]),
    }
    .unwrap()
}

/// The depth along the view of each pixel, and the colours.
fn drawn(
    gpu: &Gpu,
    scene: &std::sync::Arc<GpuScene>,
    spec: &str,
    [first, view]: [&View; 2],
    opacity: f64,
) -> (Vec<Option<f64>>, Vec<u8>) {
    // In the middle of larger images, of which the rest stays as it was.
    let target =
        TargetDesc::caller(COLOUR, TargetMode::Over).in_part().with_hit_depths(DEPTH, opacity).unwrap();
    let renderer = Renderer::new(scene, technique(spec));
    let mut plan = renderer.prepare(first, &target).unwrap_or_else(|e| panic!("{spec}: {e}"));
    let extent = view.extent();
    let larger = [extent[0] + 2 * CORNER[0], extent[1] + 2 * CORNER[1]];
    let (colours, depths) = (Caller::new(gpu, COLOUR, larger, 16), Caller::new(gpu, DEPTH, larger, 4));
    let part = |caller: &Caller, format: vk::Format| {
        // SAFETY: image and view live until the end of the call, and have room; the layout is as asked.
        let image = unsafe { TargetImage::from_raw(gpu, caller.image, caller.view, format, extent) };
        // SAFETY: the same.
        unsafe { image.at(CORNER) }
    };
    let inside = |i: usize| {
        let at = [i % larger[0] as usize, i / larger[0] as usize];
        (0..2).all(|a| at[a] >= CORNER[a] as usize && at[a] < (CORNER[a] + extent[a]) as usize)
    };
    for attempt in 0..4 {
        if !plan.set_view(view).unwrap() {
            plan = renderer.prepare(view, &target).unwrap();
        }
        colours.begin([0.0; 4]);
        depths.fill(colours.commands, [0.5; 4]);
        let info = RecordInfo {
            target: Some(&part(&colours, COLOUR)),
            hit_depths: Some((&part(&depths, DEPTH), projection(view))),
            ..RecordInfo::default()
        };
        let recorded = plan.record_with(&mut colours.command_buffer(gpu), info).unwrap();
        depths.copy(colours.commands);
        let bytes: Vec<u8> = colours.end(gpu);
        if recorded.completed().unwrap().complete {
            let stored = depths.read();
            let stored = stored.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap()));
            let stored: Vec<f32> = stored.collect();
            assert!(
                (0..stored.len()).all(|i| inside(i) || stored[i] == 0.5),
                "{spec} writes beyond its part"
            );
            let stored = (0..stored.len()).filter(|&i| inside(i)).map(|i| stored[i]);
            let texels = bytes.chunks_exact(16).enumerate().filter(|(i, _)| inside(*i));
            let bytes = texels.flat_map(|(_, texel)| texel).copied().collect();
            let depth = |stored: f32| match view.is_perspective() {
                true => (stored > 0.0).then(|| NEAR / f64::from(stored)),
                false => (stored < 1.0).then(|| RANGE[0] + f64::from(stored) * (RANGE[1] - RANGE[0])),
            };
            return (stored.map(depth).collect(), bytes);
        }
        assert!(attempt < 3, "{spec} stays incomplete");
        plan = renderer.prepare(view, &target).unwrap();
    }
    unreachable!()
}

/// The opacity of each pixel's ray up to a depth along the view, within the planes of the view.
fn opacity_to(scene: &Scene, view: &View, depths: &[f64]) -> Vec<f64> {
    let width = view.extent()[0];
    let alpha = |(i, depth): (u32, &f64)| {
        // One of five pixels tells, and the reference takes its time.
        if i % 5 != 0 {
            return f64::NAN;
        }
        let pixel = DVec2::new(f64::from(i % width), f64::from(i / width)) + 0.5;
        let (origin, direction) = view.ray(pixel);
        let [begin, along] = [origin - view.camera().eye, direction].map(|v| v.dot(view.forward()));
        let mut range =
            [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, (depth - begin) / along];
        for plane in view.clip().half_spaces() {
            let (height, rise) = ((origin - plane.point).dot(plane.normal), direction.dot(plane.normal));
            let t = -height / rise;
            if rise > 0.0 { range[0] = range[0].max(t) } else { range[1] = range[1].min(t) }
        }
        if range[0] >= range[1] { 0.0 } else { reference::ray(scene, origin, direction, range).unwrap()[3] }
    };
    (0..).zip(depths).map(alpha).collect()
}

/// A scene, what draws it, and by how much depths may be off.
type Case = (Scene, Vec<&'static str>, f64);

fn cases() -> Vec<Case> {
    let splats = |rule| cut::trained().find(|(name, ..)| *name == rule).unwrap().1;
    let kernels = Scene::new(Field::Blobs.sample([16; 3], "f32").unwrap(), cut::fog());
    let kernels = kernels.with_kernels(Kernels::of_samples()).unwrap();
    vec![
        (
            scene(Field::Blobs, 16, "f32", &FOG),
            vec![
                "raycast:step=0.25",
                "raycast:tolerance=1e-4",
                "slabs:step=0.25",
                "slices-3d:step=0.25,filter=exact",
                "slices-2d:step=0.25,filter=exact",
            ],
            0.01,
        ),
        (cut::mesh(), vec!["havs", "havs:k=2,chunk=9", "abuffer", "projected-tets"], 0.02),
        (cut::cells(), vec!["havs", "abuffer"], 1e-4),
        // A kernel counts where it is densest, or in its sheet.
        (cut::points(), vec!["splat-ewa:pairs=500", "splat-ewa:order=pixel,footprint=ewa"], 0.45),
        (cut::points(), vec!["splat-sheets:step=0.25"], 0.08),
        (kernels, vec!["splat-sheets:sheets=axis"], 0.4),
        (splats(SplatRule::Ray.name()), vec!["gaussians", "gaussians:pairs=700"], 1e-3),
        // The first slab holds as much as 8 % of opacity.
        (splats(SplatRule::Overlap.name()), vec!["gaussians"], 0.6),
        (splats(SplatRule::Integral.name()), vec!["gaussians:step=0.02"], 0.6),
    ]
}

/// The reference that is cut a little before the depth has not reached the opacity, and a little behind it has; where there is no depth the
/// whole ray has not. Colours are those of a plan without.
#[test]
fn the_ray_has_the_opacity_at_its_depth() {
    let gpu = gpu();
    let clip = Clip::none().with_plane(DVec3::new(0.1, 0.0, 0.0), DVec3::new(1.0, 0.3, 0.2)).unwrap();
    for (place, (scene, specs, off)) in cases().into_iter().enumerate() {
        let on_device = GpuScene::new(&gpu, scene.clone());
        // Sides that are no multiples of a tile's.
        let views = [
            view(perspective(), 1.0, 37, 29),
            view(orthographic(), 1.0, 37, 29),
            view(perspective(), 0.1, 37, 29),
        ];
        let seen =
            views.into_iter().enumerate().flat_map(|seen| [1.0 / 255.0, 0.5].map(|opacity| (seen, opacity)));
        for ((i, view), opacity) in taken_from(place, 6, seen) {
            let view = if i == 2 { view } else { view.with_clip(clip) };
            let first = view.offset(DVec2::new(0.3, 0.2)).unwrap();
            for spec in taken(2, &specs) {
                let (depths, colours) = drawn(&gpu, &on_device, spec, [&first, &view], opacity);
                let at = |off: f64| -> Vec<f64> {
                    let ends = depths.iter().map(|depth| depth.map_or(1e6, |depth| depth + off));
                    opacity_to(&scene, &view, &ends.collect::<Vec<_>>())
                };
                let (before, behind) = (at(-off), at(off));
                let cut_away = (0..).zip(&depths).find(|&(pixel, depth)| {
                    let pixel = DVec2::new(f64::from(pixel % 37), f64::from(pixel / 37)) + 0.5;
                    let (origin, direction) = view.ray(pixel);
                    let along = |depth: &f64| {
                        let begin = (origin - view.camera().eye).dot(view.forward());
                        origin + direction * ((depth - begin) / direction.dot(view.forward()))
                    };
                    let height = |place: DVec3| {
                        view.clip()
                            .half_spaces()
                            .map(|plane| (place - plane.point).dot(plane.normal))
                            .fold(1.0, f64::min)
                    };
                    depth.as_ref().map(along).is_some_and(|place| height(place) < -1e-3)
                });
                assert!(cut_away.is_none(), "{spec}, view {i}: {cut_away:?} lies before the clip plane");
                let hits = depths.iter().flatten().count();
                let what = format!("{spec}, view {i}, opacity {opacity}: {hits} hits");
                assert!(hits > 60, "{what}");
                let tolerance = if off > 0.3 { 2e-2 } else { 3e-3 };
                let wrong =
                    depths.iter().zip(before.iter().zip(&behind)).filter(|(depth, (before, behind))| {
                        match depth {
                            Some(_) => **before > opacity + tolerance || **behind < opacity - tolerance,
                            None => **behind > opacity + tolerance,
                        }
                    });
                let wrong: Vec<_> = wrong.collect();
                assert!(
                    wrong.len() <= depths.len() / 1200,
                    "{what}, {} wrong: {:?}",
                    wrong.len(),
                    wrong.first()
                );
                let alone = Renderer::new(&on_device, technique(spec)).render(&view).unwrap();
                let floats = colours.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap()));
                let worst =
                    floats.zip(alone.pixels().as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(worst < 1e-5, "{what}: colours differ by {worst}");
            }
        }
    }
}

/// Stored values are those of the matrix of an engine, whatever the kind of projection; parallel mappings tell distances.
#[test]
fn depths_are_stored_by_any_projection() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Homogeneous(1.0), 4, "f32", &FOG));
    let view = view(perspective(), 1.0, 24, 18);
    let target = TargetDesc::caller(COLOUR, TargetMode::Clear).with_hit_depths(DEPTH, 1e-3).unwrap();
    let mut plan = Renderer::new(&scene, technique("raycast")).prepare(&view, &target).unwrap();
    let mut stored = |projection: DepthProjection| -> Vec<f32> {
        let (colours, depths) =
            (Caller::new(&gpu, COLOUR, [24, 18], 16), Caller::new(&gpu, DEPTH, [24, 18], 4));
        colours.begin([0.0; 4]);
        depths.fill(colours.commands, [0.5; 4]);
        let info = RecordInfo {
            target: Some(&colours.target(&gpu)),
            hit_depths: Some((&depths.target(&gpu), projection)),
            ..RecordInfo::default()
        };
        let recorded = plan.record_with(&mut colours.command_buffer(&gpu), info).unwrap();
        depths.copy(colours.commands);
        colours.end(&gpu);
        recorded.completed().unwrap();
        depths.read().chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap())).collect()
    };
    let distances = stored(DepthProjection::orthographic(0.0, 100.0).unwrap());
    let matrix = glam::dcamera::rh::proj::vulkan::perspective(0.6, 4.0 / 3.0, 0.5, 50.0);
    let kinds = [
        (DepthProjection::from_matrix(&matrix).unwrap(), [0.5, 50.0]),
        (DepthProjection::perspective(50.0, 0.5).unwrap(), [50.0, 0.5]),
        (DepthProjection::perspective(0.5, f64::INFINITY).unwrap(), [0.5, f64::INFINITY]),
    ];
    assert!(distances.iter().any(|&d| d < 1.0) && distances.contains(&1.0));
    for (projection, [zero, one]) in kinds {
        for (value, distance) in stored(projection).into_iter().zip(&distances) {
            let depth = 100.0 * f64::from(*distance);
            let want = (1.0 / depth - 1.0 / zero) / (1.0 / one - 1.0 / zero);
            let want = if *distance == 1.0 { if one > zero { 1.0 } else { 0.0 } } else { want };
            assert!(
                (f64::from(value) - want).abs() < 1e-6,
                "{projection:?}: {value} for {depth}, not {want}"
            );
        }
    }
}

/// Depths are refused in one line where rays have none, and before any recording.
#[test]
fn depths_are_refused_where_there_are_none() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 24, 18);
    let plain = TargetDesc::caller(COLOUR, TargetMode::Clear);
    let target = plain.with_hit_depths(DEPTH, 0.5).unwrap();
    let refused = |scene: Scene, spec: &str, words: &str| {
        let scene = GpuScene::new(&gpu, scene);
        let text = Renderer::new(&scene, technique(spec)).prepare(&view, &target).unwrap_err().to_string();
        assert!(text.contains(words) && !text.contains('\n'), "{spec}: {text}");
    };
    let grid = || scene(Field::Blobs, 8, "f32", &FOG);
    refused(grid(), "shear-warp", "base planes");
    refused(grid(), "slices-3d:resolution=half", "resolution");
    refused(grid().with_mode(Mode::Maximum).unwrap(), "raycast", "maximum");
    refused(cut::mesh(), "havs:order=back-to-front", "front-to-back");
    if gpu.has(volraster::gpu::OptionalFeature::BlendRgba32f) {
        refused(grid(), "slices-3d:route=raster", "route=compute");
        refused(cut::mesh(), "projected-tets:route=raster", "route=compute");
    }
    let trained = Scene::new(Field::Blobs.splats(90).unwrap(), cut::fog()).with_rule(SplatRule::Khr);
    refused(trained, "gaussians", "no depth on a ray");
    refused(grid(), "slabs:stop=0.6", "smaller stop");
    for opacity in [0.0, -1.0, 1.0, f64::NAN, 1e-9] {
        assert!(plain.with_hit_depths(DEPTH, opacity).is_err(), "{opacity}");
    }
    let scene = GpuScene::new(&gpu, grid());
    let renderer = Renderer::new(&scene, technique("raycast"));
    for format in [vk::Format::UNDEFINED, vk::Format::D32_SFLOAT, vk::Format::R32_UINT] {
        let target = plain.with_hit_depths(format, 0.5).unwrap();
        let text = renderer.prepare(&view, &target).unwrap_err().to_string();
        assert!(
            text.contains("image of hit depths of format") && text.contains(&format!("{format:?}")),
            "{text}"
        );
    }
    let caller = Caller::new(&gpu, COLOUR, [24, 18], 16);
    caller.begin([0.0; 4]);
    let image = caller.target(&gpu);
    let projection = projection(&view);
    for (target, hit_depths, words) in [
        (target, None, "given is none"),
        (target, Some((&image, projection)), "given is an image of R32G32B32A32_SFLOAT"),
        (plain, Some((&image, projection)), "for none"),
    ] {
        let mut plan = renderer.prepare(&view, &target).unwrap();
        let info = RecordInfo { target: Some(&image), hit_depths, ..RecordInfo::default() };
        let text = plan.record_with(&mut caller.command_buffer(&gpu), info).unwrap_err().to_string();
        assert!(text.contains("hit depths") && text.contains(words), "{text}");
    }
    caller.end(&gpu);
}
