//! Surfaces in the volume: opaque ones, by every technique; translucent ones, by those that cut lines at them. Against the reference.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    reason = "a test fails by panicking, and makes its own numbers"
)]

use crate::common::caller::{Depth, draw_before};
use crate::common::cut::{self, Case, OWN, views};
use crate::common::*;
use crate::off_centre::off_centre;
use glam::DVec3;
use volraster::ash::vk;
use volraster::gpu::{DepthProjection, Gpu, OptionalFeature};
use volraster::reference;
use volraster::scene::{Clip, Field, Scene, Shading, Surface};
use volraster::technique::{Method, Renderer};
use volraster::{GpuScene, TargetDesc};

/// A ball, a box that it cuts, and a triangle that reaches far beyond the volume on both sides of the eye.
fn opaque() -> Vec<Surface> {
    let low = DVec3::new(-0.75, -0.2, -0.9);
    vec![
        Surface::sphere(DVec3::new(0.35, 0.1, -0.3), 0.45, [0.9, 0.3, 0.2, 1.0], 3)
            .unwrap()
            .with_shading(Shading::Headlight),
        Surface::cuboid(low, low + 0.7, [0.2, 0.7, 0.3, 1.0]).unwrap().with_shading(Shading::Headlight),
        Surface::new(
            vec![
                DVec3::new(-900.0, -0.8, 400.0),
                DVec3::new(900.0, -0.8, 500.0),
                DVec3::new(0.0, -0.85, -700.0),
            ],
            vec![[0, 1, 2]],
            [0.3, 0.4, 0.8, 1.0],
        )
        .unwrap(),
    ]
}

/// Panes that cross each other, inside and outside of the volume, and a ball in a ball.
fn translucent() -> Vec<Surface> {
    let pane = |corners: [[f64; 3]; 4], colour| {
        Surface::new(corners.map(DVec3::from_array).to_vec(), vec![[0, 1, 2], [0, 2, 3]], colour).unwrap()
    };
    vec![
        pane(
            [[-1.2, -0.6, 0.3], [1.2, -0.7, 0.5], [1.2, 0.8, -0.1], [-1.2, 0.9, -0.4]],
            [0.2, 0.5, 1.0, 0.4],
        ),
        pane([[0.1, -1.4, -1.3], [0.1, -1.2, 1.4], [0.2, 1.3, 1.2], [0.3, 1.1, -1.4]], [1.0, 0.7, 0.1, 0.3]),
        Surface::sphere(DVec3::new(-0.2, 0.1, 0.2), 0.5, [0.4, 0.9, 0.5, 0.25], 3)
            .unwrap()
            .with_shading(Shading::Headlight),
        Surface::sphere(DVec3::new(-0.2, 0.1, 0.2), 0.3, [0.9, 0.2, 0.6, 0.5], 3).unwrap(),
    ]
}

/// Scenes with the specs that draw them, and bounds of the root-mean-square error.
fn scenes(gpu: &Gpu) -> Vec<Case> {
    let all = |specs: &[(&str, f64)]| specs.iter().map(|&(spec, bound)| (spec.to_string(), bound)).collect();
    let mut of_mesh = vec![
        ("havs:integrator=exact", 1e-6),
        ("havs:integrator=exact,chunk=3", 1e-6),
        ("abuffer:integrator=exact", 1e-6),
        ("projected-tets:integrator=exact", 1e-6),
        ("projected-tets:integrator=exact,route=raster", 1e-6),
    ];
    if gpu.has(OptionalFeature::OrderedStores) {
        of_mesh.push(("havs:integrator=exact,route=implementation-ordered", 1e-6));
    }
    let of_cells = [("havs:integrator=exact", 1e-6), ("abuffer:integrator=exact", 1e-6)];
    let of_points = [("splat-sheets:sheets=image,step=0.05", 3e-5), ("splat-ewa:footprint=exact", OWN)];
    let mut cases = vec![
        cut::grid(gpu, []),
        ("mesh", cut::mesh(), all(&of_mesh)),
        ("cells", cut::cells(), all(&of_cells)),
        ("points", cut::points(), all(&of_points)),
    ];
    cases.extend(cut::trained());
    cases
}

/// Whether a spec cuts lines at translucent surfaces.
fn cuts(spec: &str) -> bool {
    technique(spec).method().draws_translucent_surfaces()
        && !spec.contains("route=raster")
        && !spec.contains("implementation-ordered")
}

fn check(surfaces: &[Surface], translucent: bool, clip: Clip) {
    let gpu = gpu();
    let mut drawn = 0;
    for (name, plain, specs) in scenes(&gpu) {
        let scene = plain.clone().with_surfaces(surfaces.to_vec());
        let on_device = GpuScene::new(&gpu, scene.clone());
        let off_centre =
            off_centre().into_iter().map(|(_, view, ..)| view).take(if exhaustive() { 9 } else { 1 });
        let views = taken(2, views()).into_iter().chain(off_centre).map(|view| view.with_clip(clip));
        for (i, view) in views.enumerate() {
            let truth = truth(&scene, &view);
            for (spec, bound) in &specs {
                if translucent && !cuts(spec) {
                    let renderer = Renderer::new(&on_device, technique(spec));
                    let why = renderer.prepare(&view, &TargetDesc::own()).unwrap_err();
                    let text = why.to_string();
                    assert!(
                        matches!(why, volraster::Error::Invalid { .. })
                            && text.contains("draws no translucent surfaces: "),
                        "{spec}: {text}"
                    );
                    continue;
                }
                let image = draw_on(&on_device, &view, spec);
                let bound = if *bound > 0.0 {
                    *bound
                } else {
                    1.5 * errors(&draw(&gpu, &plain, &view, spec), &plain, &view).all.rmse
                };
                let found = volraster::measure::ImageErrors::between_f64(&image, &truth).unwrap();
                // A line that passes an edge within rounding meets either side of it.
                let off = image
                    .pixels()
                    .iter()
                    .zip(truth.pixels())
                    .filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (f64::from(*a) - b).abs() > 0.02));
                let off = off.count();
                println!(
                    "{name} view {i} {spec}: rmse {:.1e} of {bound:.1e}, worst {:.1e}, {off} off",
                    found.all.rmse, found.all.max_abs
                );
                assert!(found.all.rmse < bound, "{name} view {i} {spec}: {:.1e}", found.all.rmse);
                drawn += 1;
            }
        }
    }
    assert!(drawn >= if exhaustive() { 30 } else { 10 }, "{drawn} images");
}

#[test]
fn opaque_surfaces_hide_what_is_behind_them() {
    check(&opaque(), false, Clip::none());
}

#[test]
fn translucent_surfaces_tint_what_is_behind_them() {
    check(&[opaque(), translucent()].concat(), true, Clip::none());
}

/// Clipping cuts the volume, not the surfaces in it.
#[test]
fn surfaces_see_no_clipping() {
    let clip = Clip::none()
        .with_plane(DVec3::new(0.1, 0.0, 0.2), DVec3::new(-0.5, 0.3, -1.0))
        .unwrap()
        .with_crop(DVec3::splat(-0.9), DVec3::new(0.9, 0.7, 0.8))
        .unwrap();
    check(&[opaque(), translucent()].concat(), true, clip);
}

/// Of techniques that refuse translucent surfaces each says which do not.
#[test]
fn refusals_name_what_works() {
    let gpu = gpu();
    let scene = scene(Field::Blobs, 8, "f32", &FOG).with_surfaces(translucent());
    let on_device = GpuScene::new(&gpu, scene);
    let plain = view(perspective(), 1.0, 40, 30);
    for method in [Method::ShearWarp, Method::SplatSheets, Method::SplatEwa] {
        let renderer = Renderer::new(&on_device, technique(method.name()));
        let why = renderer.prepare(&plain, &TargetDesc::own()).unwrap_err().to_string();
        assert!(why.contains("raycast") && why.contains(method.name()), "{why}");
    }
}

/// A depth image hides surfaces as it hides the volume, and clipping cuts the volume alone. The reference has a black wall in its
/// place, which adds opacity and no light.
#[test]
fn a_depth_image_hides_surfaces_too() {
    let gpu = gpu();
    let clip = Clip::none().with_plane(DVec3::new(0.1, 0.0, 0.2), DVec3::new(-0.5, 0.3, -1.0)).unwrap();
    let wall = Surface::sphere(DVec3::new(0.0, 0.3, 0.1), 0.55, [0.0, 0.0, 0.0, 1.0], 3).unwrap();
    let surfaces = [opaque(), translucent()].concat();
    let scenes = [
        (
            scene(Field::Blobs, 24, "f32", &FOG),
            ["raycast:step=0.25,filter=exact", "slabs:step=0.25,filter=exact"],
        ),
        (cut::mesh(), ["havs:integrator=exact", "abuffer:integrator=exact"]),
    ];
    for (plain, specs) in scenes {
        let on_device = GpuScene::new(&gpu, plain.clone().with_surfaces(surfaces.clone()));
        let with_wall = plain.clone().with_surfaces([surfaces.clone(), vec![wall.clone()]].concat());
        let wall_alone = plain.clone().with_surfaces(vec![wall.clone()]);
        for view in &views()[..2] {
            let view = view.with_clip(clip);
            let depths = reference::depth(&wall_alone, &view).unwrap();
            let stored: Vec<f32> = match view.is_perspective() {
                true => depths.iter().map(|d| (0.03 / d) as f32).collect(),
                false => depths.iter().map(|d| ((d - 9.0) / (0.5 - 9.0)).max(0.0) as f32).collect(),
            };
            let projection = match view.is_perspective() {
                true => DepthProjection::perspective(f64::INFINITY, 0.03),
                false => DepthProjection::orthographic(9.0, 0.5),
            };
            let image = Depth::new(&gpu, vk::Format::D32_SFLOAT, view.extent(), &stored).unwrap();
            let truth = truth(&with_wall, &view);
            for spec in specs {
                let drawn = draw_before(
                    &gpu,
                    &on_device,
                    &view,
                    spec,
                    Some((&image, projection.as_ref().copied().unwrap())),
                );
                let mut worst = 0.0_f64;
                for (drawn, truth) in drawn.pixels().iter().zip(truth.pixels()) {
                    for (a, b) in drawn.iter().zip(truth).take(3) {
                        worst = worst.max((f64::from(*a) - b).abs());
                    }
                }
                let hidden = depths.iter().filter(|d| d.is_finite()).count();
                assert!(hidden > 50 && worst < 5e-3, "{spec}: {worst:.1e}, {hidden} pixels");
            }
        }
    }
}

/// Frames turn to other views with surfaces in them; what then needs more room gets it.
#[test]
fn frames_turn_with_their_surfaces() {
    let gpu = gpu();
    let scene = scene(Field::Blobs, 16, "f32", &FOG).with_surfaces([opaque(), translucent()].concat());
    let on_device = GpuScene::new(&gpu, scene);
    let far = view(perspective(), 8.0, 40, 30);
    let mut frames = Renderer::new(&on_device, technique("slices-3d")).frames(&far).unwrap();
    for view in taken(2, views()) {
        frames.draw(&view).unwrap();
        let turned = frames.read_back().unwrap();
        assert_eq!(turned.pixels(), draw_on(&on_device, &view, "slices-3d").pixels());
    }
}

/// Surfaces that move, come and go: pictures are those of scenes made afresh, and nothing else is uploaded again.
#[test]
fn surfaces_move_and_data_stays() {
    let gpu = gpu();
    let ball = |x: f64, opacity: f64| {
        Surface::sphere(DVec3::new(x, 0.1, -0.2), 0.4, [0.9, 0.3, 0.2, opacity], 2).unwrap()
    };
    let plain = scene(Field::Blobs, 16, "u8", &FOG);
    let mesh = Scene::new(Field::Blobs.tets(4).unwrap(), cut::fog());
    let balls =
        [vec![ball(0.0, 1.0)], vec![ball(0.3, 1.0), ball(-0.2, 0.5)], Vec::new(), vec![ball(0.1, 1.0)]];
    let view = view(perspective(), 1.0, 40, 30);
    for (plain, spec) in
        [(&plain, "slabs:integrator=integral"), (&plain, "raycast"), (&mesh, "havs"), (&mesh, "abuffer")]
    {
        let first = GpuScene::new(&gpu, plain.clone());
        let mut drawn = vec![draw_on(&first, &view, spec)];
        let held = |report: Vec<(String, u64)>| -> Vec<String> {
            let ours = |name: &String| !name.contains("surface") && !name.contains("layer");
            report.into_iter().map(|(name, _)| name).filter(ours).collect()
        };
        let before = held(gpu.memory_report());
        // The first stays: what were uploaded again would be held twice.
        let mut scene = std::sync::Arc::clone(&first);
        for surfaces in &balls {
            scene = scene.with_surfaces(surfaces.clone());
            let image = draw_on(&scene, &view, spec);
            assert_eq!(held(gpu.memory_report()), before, "{spec}: {} surfaces", surfaces.len());
            let afresh = GpuScene::new(&gpu, plain.clone().with_surfaces(surfaces.clone()));
            assert!(image.pixels() == draw_on(&afresh, &view, spec).pixels(), "{spec}: {surfaces:?}");
            let again = usize::from(surfaces.is_empty());
            let same = drawn.iter().filter(|other| other.pixels() == image.pixels()).count();
            assert_eq!(same, again, "{spec}: {} surfaces", surfaces.len());
            drawn.push(image);
        }
    }
}

/// Hundreds of panes, listed from behind: order comes from depth alone.
#[test]
fn many_panes_are_put_in_order() {
    let gpu = gpu();
    let pane = |i: i32| {
        let z = 0.9 - f64::from(i) * 0.006;
        let corner = |x: f64, y: f64| DVec3::new(x, y, z);
        let corners = vec![corner(-0.8, -0.8), corner(0.8, -0.8), corner(0.8, 0.8), corner(-0.8, 0.8)];
        let colour = if i % 2 == 0 { [1.0, 0.2, 0.1, 0.02] } else { [0.1, 0.3, 1.0, 0.03] };
        Surface::new(corners, vec![[0, 1, 2], [0, 2, 3]], colour).unwrap()
    };
    for turn in [1, -1] {
        let panes = (0..300).map(|i| pane(if turn > 0 { i } else { 299 - i })).collect();
        let scene = scene(Field::Blobs, 12, "f32", &FOG).with_surfaces(panes);
        let view = view(perspective(), 1.0, 24, 24);
        let image = draw(&gpu, &scene, &view, "slabs:step=0.25,filter=exact");
        let found = errors(&image, &scene, &view).all;
        assert!(found.rmse < 3e-4, "{turn}: {:.1e}, worst {:.1e}", found.rmse, found.max_abs);
    }
}
