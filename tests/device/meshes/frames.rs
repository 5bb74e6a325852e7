//! Frame after frame: the same image each time, other views, scalars and transfer functions, little room.

use volraster::gpu::{GpuOptions, OptionalFeature};
use volraster::measure::ImageErrors;
use volraster::scene::{Camera, Field, Projection, Scene, TetScalars, View};
use volraster::technique::Renderer;
use volraster::{Gpu, GpuScene, TargetDesc};

use crate::common::*;
use crate::meshes::support::*;

/// The same frame is the same to the bit, ten times over, and on another plan.
#[test]
fn frames_repeat_to_the_bit() {
    let gpu = gpu();
    let on_gpu = GpuScene::new(&gpu, Scene::new(needles(5), transfer(&FOG)));
    let view = needles_view(50, 37);
    for spec in ["havs:k=2", "havs:k=2,repair=none", "havs:chunk=9", "abuffer"] {
        let renderer = Renderer::new(&on_gpu, technique(spec));
        let mut frames = renderer.frames(&view).unwrap();
        frames.draw(&view).unwrap();
        let first = frames.read_back().unwrap();
        for _ in 0..9 {
            frames.draw(&view).unwrap();
            assert_eq!(frames.read_back().unwrap(), first, "{spec}");
        }
        assert_eq!(renderer.render(&view).unwrap(), first, "{spec}");
    }
}

/// A plan that is turned to another view draws what a fresh one does: around the mesh, into it, out again, far away.
#[test]
fn turned_plans_draw_as_fresh_ones() {
    let gpu = gpu();
    let scene = cubes(Field::Blobs, 6, &FOG);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    let at = |distance: f64, degrees: f64| {
        let camera = camera(perspective(), distance).orbit(degrees).unwrap();
        View::new(camera, 41, 30).unwrap()
    };
    let mut views: Vec<View> = (0..6).map(|i| at(1.0, 60.0 * f64::from(i))).collect();
    // From where few primitives are seen, each of few pixels, to where all are, and large.
    views.extend([
        at(30.0, 0.0),
        at(0.6, 10.0),
        at(0.1, 20.0),
        at(0.02, 30.0),
        at(0.4, 40.0),
        at(1000.0, 50.0),
    ]);
    for spec in ["havs", "havs:k=1,chunk=16", "abuffer"] {
        let mut frames = Renderer::new(&on_gpu, technique(spec)).frames(&views[0]).unwrap();
        for view in &views {
            frames.draw(view).unwrap();
            let turned = frames.read_back().unwrap();
            // Another scene on the device: what this one has learnt of views does not count.
            let fresh = draw(&gpu, &scene, view, spec);
            assert_eq!(turned, fresh, "{spec}, eye {}", view.camera().eye);
        }
    }
}

/// A plan for a view from afar has no room for one from nearby: `Frames` finds it.
#[test]
fn what_does_not_fit_is_drawn_again_with_more_room() {
    let gpu = gpu();
    let scene = cubes(Field::Blobs, 8, &FOG);
    let far = view(perspective(), 40.0, 64, 64);
    let near = view(perspective(), 0.75, 64, 64);
    for spec in EXACT {
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        let mut frames = Renderer::new(&on_gpu, technique(spec)).frames(&far).unwrap();
        let room = |gpu: &volraster::Gpu| {
            let bins = gpu.memory_report().into_iter().filter(|(name, _)| name == "bins");
            bins.map(|(_, bytes)| bytes).sum::<u64>()
        };
        frames.draw(&far).unwrap();
        let before = room(&gpu);
        frames.draw(&near).unwrap();
        assert!(room(&gpu) > 2 * before, "{spec}: {before} bytes were enough");
        assert_eq!(frames.read_back().unwrap(), draw(&gpu, &scene, &near, spec), "{spec}");
    }
}

/// Other scalars and another transfer function leave points, and for the latter scalars, where they are.
#[test]
fn other_scalars_and_transfer_functions_share_the_mesh() {
    let gpu = gpu();
    let scene = cubes(Field::Blobs, 6, &FOG);
    let view = view(perspective(), 1.0, 41, 30);
    let count = |gpu: &volraster::Gpu, wanted: &str| {
        gpu.memory_report().iter().filter(|(name, _)| name == wanted).count()
    };
    for spec in EXACT {
        let first = GpuScene::new(&gpu, scene.clone());
        let image = draw_on(&first, &view, spec);
        let TetScalars::Point(values) = scene.mesh().unwrap().scalars().clone() else { panic!() };
        let values: Vec<f32> = values.iter().map(|s| 1.0 - s).collect();
        let of_points = TetScalars::Point(values);
        let of_cells = TetScalars::Cell(
            (0..scene.mesh().unwrap().cells().len()).map(|i| (i % 7) as f32 / 7.0).collect(),
        );
        let mut kept = vec![first.clone()];
        for (i, scalars) in [of_points, of_cells].into_iter().enumerate() {
            let other = first.with_scalars(scalars.clone(), transfer(&HAZE)).unwrap();
            let drawn = draw_on(&other, &view, spec);
            let mesh = scene.mesh().unwrap().clone().with_scalars(scalars).unwrap();
            assert_eq!(drawn, draw(&gpu, &Scene::new(mesh, transfer(&HAZE)), &view, spec), "{spec}");
            assert_ne!(drawn, image);
            kept.push(other);
            assert_eq!(count(&gpu, "mesh.points"), 1, "{spec}");
            assert!(count(&gpu, "mesh.scalars") <= i + 2, "{spec}");
        }
        let other = first.with_transfer(transfer(&SHELLS));
        let drawn = draw_on(&other, &view, spec);
        assert_eq!(drawn, draw(&gpu, &cubes(Field::Blobs, 6, &SHELLS), &view, spec), "{spec}");
        assert_eq!(count(&gpu, "mesh.points"), 1, "{spec}");
        assert!(count(&gpu, "mesh.scalars") <= 3, "{spec}");
        // And the first is what it was.
        assert_eq!(draw_on(&first, &view, spec), image);
    }
}

/// Where a shader sees little of a buffer, the image is drawn in bands of tiles, to the same bit.
#[test]
fn bands_change_nothing() {
    if emulates("as-hardware") {
        println!("skipped: the bins of a GPU need more than the 128 KiB that make bands of this image");
        return;
    }
    let scene = Scene::new(needles(7), transfer(&HAZE));
    let view = needles_view(220, 140);
    let specs = ["havs", "havs:k=1", "havs:k=2,chunk=7", "abuffer"];
    let whole: Vec<Drawn> = {
        let gpu = gpu();
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        specs.iter().map(|spec| Drawn::new(&on_gpu, &view, spec)).collect()
    };
    let gpu = gpu_with(GpuOptions { storage_range: Some(128 << 10), ..GpuOptions::default() });
    let on_gpu = GpuScene::new(&gpu, scene);
    for (spec, whole) in specs.iter().zip(&whole) {
        let drawn = Drawn::new(&on_gpu, &view, spec);
        println!("{spec}: {} bands", drawn.counter("bands"));
        assert!(whole.counter("bands") == 1 && drawn.counter("bands") > 1, "{spec}");
        assert_eq!(drawn.image, whole.image, "{spec}");
        assert_eq!(drawn.overflow, whole.overflow, "{spec}");
        for name in ["bin_entries", "kbuffer_overflow_pixels", "primitives"] {
            assert_eq!(drawn.counter(name), whole.counter(name), "{spec} {name}");
        }
    }
    assert!(whole[1].overflows() > 100);
}

/// A mesh whose planes exceed what a descriptor shows is drawn from the corners alone.
#[test]
fn faces_need_no_planes() {
    let scene = Scene::new(Field::Blobs.tets(12).unwrap(), transfer(&HAZE));
    let view = view(perspective(), 1.0, 96, 72);
    let image = |gpu: &Gpu, spec: &str| Drawn::new(&GpuScene::new(gpu, scene.clone()), &view, spec).image;
    let specs = ["havs", "havs:k=1", "havs:repair=none,k=12"];
    let by_planes = specs.map(|spec| image(&gpu(), spec));
    let range = Some(300 << 10);
    let gpu = gpu_with(GpuOptions { storage_range: range, ..GpuOptions::default() });
    for (spec, by_planes) in specs.iter().zip(by_planes) {
        let apart = ImageErrors::between(&image(&gpu, spec), &by_planes).unwrap().all;
        println!("{spec}: {apart:?}");
        // Two roundings of the same places.
        assert!(apart.rmse < 3e-7 && apart.max_abs > 0.0, "{spec}: {apart:?}");
    }
}

/// Buffers of which a descriptor shows a part are found by address: the image is the same to the bit, but for the faces of `havs`, which then have no planes.
#[test]
fn buffers_beyond_a_descriptor_are_found_by_address() {
    let scenes = [
        (
            cubes(Field::Blobs, 12, &FOG),
            ["havs", "havs:k=2,repair=none", "abuffer", "projected-tets:route=raster"],
        ),
        (
            Scene::new(Field::Blobs.tets(12).unwrap(), transfer(&HAZE)),
            ["havs:k=1", "havs:k=2,chunk=16", "projected-tets", "projected-tets:shade=vertex"],
        ),
    ];
    let view = view(perspective(), 1.0, 64, 64);
    let gpu = gpu();
    let narrow = gpu_with(GpuOptions { storage_range: Some(16 << 10), ..GpuOptions::default() });
    for (scene, specs) in scenes {
        let [whole, parts] = [&gpu, &narrow].map(|gpu| GpuScene::new(gpu, scene.clone()));
        for spec in specs {
            let draw = |on_gpu| Renderer::new(on_gpu, technique(spec)).render(&view).unwrap();
            let (whole, parts) = (draw(&whole), draw(&parts));
            assert_same_but_for_rounding(&parts, &whole, spec);
        }
    }
}

/// A mesh whose faces come far out of order gets a larger k-buffer once a frame has told, unless the options give one. The image is the same.
#[test]
fn a_k_buffer_grows_where_it_pays() {
    let gpu = gpu();
    let scene = Scene::new(needles(10), transfer(&HAZE));
    let view = needles_view(320, 240);
    let seven = Drawn::new(&GpuScene::new(&gpu, scene.clone()), &view, "havs:k=7");
    let on_gpu = GpuScene::new(&gpu, scene);
    let [first, again] = [0, 1].map(|_| Drawn::new(&on_gpu, &view, "havs"));
    println!("{} and {}", seven.counter("kbuffer_overflow_pixels"), first.counter("kbuffer_overflow_pixels"));
    for drawn in [&first, &again] {
        assert!(drawn.counter("kbuffer_overflow_pixels") * 4 < seven.counter("kbuffer_overflow_pixels"));
        assert_same_but_for_rounding(&drawn.image, &seven.image, "another k");
    }
}

/// Neither more fragments than a buffer holds nor a memory that is too small is anything but an error that says so.
#[test]
fn what_the_device_cannot_hold_is_refused() {
    let scene = cubes(Field::Blobs, 12, &FOG);
    let view = view(perspective(), 1.0, 64, 64);
    let narrow = GpuOptions { storage_range: Some(64 << 10), ..GpuOptions::default() };
    for (options, part) in [
        (GpuOptions { without: vec![OptionalFeature::BufferAddresses], ..narrow }, "limit of 65536"),
        (GpuOptions { memory_budget: Some(500_000), ..GpuOptions::default() }, "budget"),
    ] {
        let gpu = gpu_with(options);
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        // Parts need less.
        for spec in ["havs:parts=1", "abuffer"] {
            let why = Renderer::new(&on_gpu, technique(spec)).prepare(&view, &TargetDesc::own()).unwrap_err();
            assert!(why.to_string().contains(part), "{spec}: {why}");
            assert_eq!(why.exit_code(), 3, "{why}");
        }
    }
}

/// Cells in which nothing is visible may be left out or drawn: the image is the same to the bit.
#[test]
fn empty_space_changes_nothing() {
    let gpu = gpu();
    // Visible in two narrow ranges of the scalar, and nowhere else.
    let rows = [
        [0.2, 1.0, 0.5, 0.2, 0.0],
        [0.25, 1.0, 0.5, 0.2, 9.0],
        [0.3, 1.0, 0.5, 0.2, 0.0],
        [0.6, 0.2, 0.5, 1.0, 0.0],
        [0.65, 0.2, 0.5, 1.0, 20.0],
        [0.7, 0.2, 0.5, 1.0, 0.0],
    ];
    let scene = cubes(Field::Blobs, 10, &rows);
    let on_gpu = GpuScene::new(&gpu, scene);
    for view in [
        view(perspective(), 1.0, 48, 40),
        view(perspective(), 0.1, 48, 40),
        view(orthographic(), 1.0, 48, 40),
    ] {
        for spec in [
            "havs:integrator=exact",
            "havs:integrator=integral,table=256",
            "havs:integrator=full,table=64",
            "abuffer:integrator=exact",
            "abuffer:integrator=integral",
        ] {
            let skip = Drawn::new(&on_gpu, &view, spec);
            let march = Drawn::new(&on_gpu, &view, &format!("{spec},empty-space=march"));
            assert!(skip.counter("primitives") * 10 < march.counter("primitives") * 9, "{spec}");
            let difference = apart(&skip.image, &march.image);
            assert!(difference <= 1e-6, "{spec}: {difference:e}");
        }
    }
}

/// Sizes that are no multiples of a tile, down to a pixel.
#[test]
fn every_size_is_a_part_of_the_same_picture() {
    let gpu = gpu();
    let scene = cubes(Field::Blobs, 4, &HAZE);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    for (width, height) in taken(3, [(1, 1), (17, 9), (1, 64), (64, 1), (8, 8), (9, 8), (7, 23), (65, 3)]) {
        let view = View::new(camera(perspective(), 1.0), width, height).unwrap();
        let truth = truth(&scene, &view);
        for spec in ["havs", "abuffer", "havs:chunk=4", "havs:k=15,chunk=4"] {
            let image = draw_on(&on_gpu, &view, spec);
            assert_eq!((image.width(), image.height()), (width, height));
            assert_true(&format!("{width} x {height} {spec}"), &image, &truth, &scene, &view, ROUNDING, 1);
        }
    }
}

/// A transfer function that shows nothing, and a mesh behind the eye or beside the image: transparent black.
#[test]
fn nothing_to_see_is_transparent() {
    let gpu = gpu();
    let clear = cubes(Field::Blobs, 3, &[[0.0, 1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0, 0.0]]);
    let shown = cubes(Field::Blobs, 3, &HAZE);
    let ahead = view(perspective(), 1.0, 30, 20);
    let turned = |camera: Camera| View::new(Camera { target: camera.eye * 2.0, ..camera }, 30, 20).unwrap();
    let aside = Camera {
        target: camera(perspective(), 1.0).eye + glam::DVec3::Y * 0.9 + glam::DVec3::X,
        ..camera(perspective(), 1.0)
    };
    let small = Camera { projection: Projection::Perspective { fov_y_deg: 5.0 }, ..aside };
    let cases = [
        ("clear", &clear, ahead),
        ("behind", &shown, turned(camera(perspective(), 1.0))),
        ("beside", &shown, View::new(small, 30, 20).unwrap()),
    ];
    for (what, scene, view) in cases {
        assert!(truth(scene, &view).pixels().iter().all(|p| *p == [0.0; 4]), "{what}");
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        for spec in [
            "havs",
            "abuffer",
            "havs:chunk=3",
            "havs:empty-space=march",
            "abuffer:order=back-to-front",
            "havs:k=15",
        ] {
            let drawn = Drawn::new(&on_gpu, &view, spec);
            assert!(drawn.image.pixels().iter().all(|p| *p == [0.0; 4]), "{what} {spec}");
            assert_eq!(drawn.overflows(), 0, "{what} {spec}");
            if what == "clear" && !spec.contains("march") {
                assert_eq!(drawn.counter("primitives"), 0, "{spec}");
            }
        }
    }
}

/// A plan serves a whole turn around the mesh: every frame is complete, and none is prepared again.
#[test]
fn a_plan_serves_a_whole_turn() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, cubes(Field::Blobs, if exhaustive() { 34 } else { 10 }, &FOG));
    let side = if exhaustive() { 512 } else { 96 };
    let first = view(perspective(), 1.0, side, side);
    let format = volraster::ash::vk::Format::R32G32B32A32_SFLOAT;
    let target = TargetDesc::caller(format, volraster::TargetMode::Over);
    for spec in ["havs", "abuffer", "projected-tets"] {
        let mut plan = Renderer::new(&scene, technique(spec)).prepare(&first, &target).unwrap();
        let mut frame = volraster::Offscreen::new(&gpu, format, first.extent()).unwrap();
        for degrees in (0..360).step_by(if exhaustive() { 8 } else { 24 }) {
            let turned = first.with_camera(first.camera().orbit(degrees.into()).unwrap()).unwrap();
            assert!(plan.set_view(&turned).unwrap(), "{spec} {degrees}");
            frame.draw(&mut plan, [0.0; 4]).unwrap();
            assert!(frame.finish().unwrap().0.complete, "{spec} {degrees}");
        }
    }
}
