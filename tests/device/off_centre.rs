//! Views of an engine's matrices: off the centre, of pixels that are not square, mirrored, in parts. Every technique against the
//! reference, and against the rays that the matrices tell.

#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]
#![allow(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a test makes its own numbers")]

use crate::bounds::{clip, scenes, truth_before};
use crate::common::caller::{Caller, Depth, draw_before};
use crate::common::cut::{self, OWN, views};
use crate::common::*;
use glam::{DMat4, DVec2, DVec3, DVec4};
use volraster::ash::vk;
use volraster::gpu::{DepthImage, DepthProjection, OptionalFeature, TargetImage};
use volraster::measure::ImageErrors;
use volraster::reference::ReferenceImage;
use volraster::scene::{Camera, ClipY, Field, Lighting, Mode, Projection, Scene, SplatRule, Tets, View};
use volraster::technique::Renderer;
use volraster::{Error, GpuScene, Image, Plan, TargetDesc, TargetMode};

const SIZE: [u32; 2] = [40, 30];

/// The matrix from the world to the coordinates of a camera that looks along -z, x to the right, y up.
fn look(camera: Camera) -> DMat4 {
    glam::dcamera::rh::view::look_at_mat4(camera.eye, camera.target, camera.up)
}

/// A frustum through a rectangle at depth 1: left, right, bottom, top. Depth reversed, without a far plane; y up.
fn frustum([left, right, bottom, top]: [f64; 4]) -> DMat4 {
    let (w, h) = (right - left, top - bottom);
    DMat4::from_cols(
        DVec4::new(2.0 / w, 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 / h, 0.0, 0.0),
        DVec4::new((right + left) / w, (top + bottom) / h, 0.0, -1.0),
        DVec4::new(0.0, 0.0, 0.1, 0.0),
    )
}

/// Parallel rays through a rectangle; depths from 0.5 to 20, y up.
fn parallel([left, right, bottom, top]: [f64; 4]) -> DMat4 {
    let (w, h) = (right - left, top - bottom);
    DMat4::from_cols(
        DVec4::new(2.0 / w, 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 / h, 0.0, 0.0),
        DVec4::new(0.0, 0.0, -1.0 / 19.5, 0.0),
        DVec4::new(-(right + left) / w, -(top + bottom) / h, -0.5 / 19.5, 1.0),
    )
}

/// The other side of y in clip coordinates.
fn flipped(matrix: DMat4) -> DMat4 {
    DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0)) * matrix
}

/// Views with the matrices that made them, y up, and the centred view of the same camera.
pub(crate) fn off_centre() -> Vec<(&'static str, View, View, [DMat4; 2])> {
    let [outside, aside, inside] = views();
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let made = |name, centred: View, projection: DMat4, first: DMat4| {
        let view = first * look(*centred.camera());
        let off = View::from_matrices(view, projection, ClipY::Up, SIZE[0], SIZE[1]).unwrap();
        (name, off, centred, [view, projection])
    };
    let plain = DMat4::IDENTITY;
    vec![
        made("beside", outside, frustum([-0.1, 0.75, -0.5, 0.2]), plain),
        made("far beside", outside, frustum([0.05, 0.3, 0.02, 0.35]), plain),
        made("mirrored", outside, frustum([-0.3, 0.6, -0.4, 0.3]), mirror),
        made("parallel", aside, parallel([-1.9, 1.1, -0.8, 1.7]), plain),
        made("parallel, mirrored", aside, parallel([-1.9, 1.1, -0.8, 1.7]), mirror),
        made("inside", inside, frustum([-0.7, 0.2, -0.1, 0.6]), plain),
    ]
}

/// Rays are those of the matrices, for both directions of y, and a place is projected to where the matrices have it.
#[test]
fn a_view_has_the_rays_of_its_matrices() {
    for (name, view, _, [world, projection]) in off_centre() {
        let down = View::from_matrices(world, flipped(projection), ClipY::Down, SIZE[0], SIZE[1]).unwrap();
        // The same to rounding: the sign of y is exact.
        assert_eq!(down, view, "{name}");
        // The model's matrix is the world's: lengths stay the scene's.
        let model = DMat4::from_scale(DVec3::splat(250.0)) * world;
        let scaled = View::from_matrices(
            model,
            projection * DMat4::from_scale(DVec3::splat(0.004)),
            ClipY::Up,
            SIZE[0],
            SIZE[1],
        );
        let scaled = scaled.unwrap();
        let both = projection * world;
        for (_, pixel) in pixels(&view) {
            let (origin, direction) = view.ray(pixel);
            for t in [1.0, 3.5] {
                let point = origin + direction * t;
                let ndc = both.project_point3(point);
                let [x, y] = [(ndc.x + 1.0) * 20.0, (1.0 - ndc.y) * 15.0];
                assert!((DVec2::new(x, y) - pixel).length() < 1e-9, "{name} {pixel}: {x} {y}");
                let (back, depth) = view.project(point).unwrap();
                assert!((back - pixel).length() < 1e-9, "{name} {pixel}: {back}");
                let ahead = -(world.transform_point3(point)).z;
                assert!((depth - ahead).abs() < 1e-9, "{name}: {depth} {ahead}");
                let (back, _) = scaled.project(point).unwrap();
                assert!((back - pixel).length() < 1e-8, "{name} scaled, {pixel}: {back}");
            }
        }
    }
}

/// A camera's matrices make the camera's view, and what is no view is refused.
#[test]
fn matrices_of_a_camera_are_its_view() {
    let [outside, aside, _] = views();
    let half = 21_f64.to_radians().tan();
    let width = half * 4.0 / 3.0;
    let projections =
        [frustum([-width, width, -half, half]), parallel([-1.6 * 4.0 / 3.0, 1.6 * 4.0 / 3.0, -1.6, 1.6])];
    for (view, projection) in [outside, aside].into_iter().zip(projections) {
        let world = look(*view.camera());
        let got = View::from_matrices(world, projection, ClipY::Up, 40, 30).unwrap();
        assert!(
            (got.pixel_size() - view.pixel_size()).abs() < 1e-14 && (got.pixel_aspect() - 1.0).abs() < 1e-14
        );
        assert!((got.camera().eye - view.camera().eye).length() < 1e-13);
        for (_, pixel) in pixels(&view) {
            let ((a, d), (b, e)) = (got.ray(pixel), view.ray(pixel));
            assert!((a - b).length() < 1e-13 && (d - e).length() < 1e-13, "{pixel}");
        }
        let why = |world, projection| {
            View::from_matrices(world, projection, ClipY::Up, 40, 30).unwrap_err().to_string()
        };
        assert!(why(world * f64::NAN, projection).contains("finite"));
        // Parallel rays that run aslant to the view's axis; a perspective is off the centre by the same change.
        let mut aslant = projection;
        aslant.z_axis.x = 0.5;
        assert_eq!(View::from_matrices(world, aslant, ClipY::Up, 40, 30).is_ok(), view.is_perspective());
        assert!(why(world, DMat4::ZERO).contains("no image"));
        assert!(why(DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)) * world, projection).contains("no image"));
        let skewed = why(world * DMat4::from_scale(DVec3::new(1.0, 3.0, 5.0)), projection);
        assert!(skewed.contains(if view.is_perspective() { "skew" } else { "z axis" }), "{skewed}");
        let sides = View::from_matrices(world, projection, ClipY::Up, 0, 30).unwrap_err().to_string();
        assert!(sides.contains("width"), "{sides}");
    }
}

/// Every technique draws what the reference does, also where clip planes or a depth image bound rays.
#[test]
fn every_technique_draws_views_off_the_centre() {
    let gpu = gpu();
    // Ranks that the host finds, and those by distances, whose cells are not mended.
    let ranks = ["rank=mpvo,repair=none", "rank=centroid,repair=none"];
    let ranks = ranks.map(|options| (format!("projected-tets:integrator=exact,{options}"), 1e-6));
    // A mesh without every third cell: rays leave it and enter it again.
    let whole = Field::Blobs.tets(5).unwrap();
    let kept = whole.cells().iter().enumerate().filter(|(i, _)| i % 3 != 0).map(|(_, cell)| *cell);
    let (tets, _) = Tets::new(whole.points().to_vec(), kept.collect(), whole.scalars().clone()).unwrap();
    let holes = ("holes", Scene::new(tets, cut::fog()), vec![("havs:integrator=exact".to_string(), 1e-6)]);
    for (place, (name, scene, mut specs)) in scenes(&gpu).into_iter().chain([holes]).enumerate() {
        if ["mesh", "holes"].contains(&name) {
            specs.extend(ranks.clone());
        }
        let on_device = GpuScene::new(&gpu, scene.clone());
        for (kind, view, centred, [_, projection]) in taken_from(place, 6, off_centre()) {
            // A wall at the depth of the data's middle, in a part of the image.
            let behind = -view.camera().eye.dot(view.forward());
            let wall = |p: DVec2| if p.x < 22.0 { behind.max(0.0) + 0.2 } else { f64::INFINITY };
            let depths = pixels(&view).map(|(_, p)| {
                let ndc = projection.project_point3(DVec3::new(0.0, 0.0, -wall(p))).z;
                if wall(p).is_finite() {
                    ndc as f32
                } else if view.is_perspective() {
                    0.0
                } else {
                    1.0
                }
            });
            let values: Vec<f32> = depths.collect();
            let image = Depth::new(&gpu, vk::Format::D32_SFLOAT, SIZE, &values).unwrap();
            let cut = (&image, DepthProjection::from_matrix(&projection).unwrap());
            let nothing = |_: DVec2| f64::INFINITY;
            let clipped = view.with_clip(clip());
            let whole = truth_before(&scene, &view, &nothing);
            let usual = truth_before(&scene, &centred, &nothing);
            let (cut_off, hidden) =
                (truth_before(&scene, &clipped, &nothing), truth_before(&scene, &view, &wall));
            let cases = [
                ("whole", view, None, &whole),
                ("clipped", clipped, None, &cut_off),
                ("before a wall", view, Some(cut), &hidden),
            ];
            for (case, (what, seen, given, truth)) in cases.into_iter().enumerate() {
                for (spec, bound) in taken_from(place + case, 3, &specs) {
                    if spec.contains("template") && view.is_perspective() {
                        continue;
                    }
                    // What blends whole splats or resamples has an error of its own, that of the camera's view, or of this one uncut.
                    let bound = if spec.contains("plane=space") {
                        // At outlines the rasteriser rounds; how many pixels lie there is the view's.
                        4.0 * bound
                    } else if *bound > OWN {
                        *bound
                    } else {
                        let own = |view: &View, truth: &ReferenceImage| {
                            ImageErrors::between_f64(&draw_on(&on_device, view, spec), truth)
                                .unwrap()
                                .all
                                .rmse
                        };
                        let usual = own(&centred, &usual);
                        let here = own(&view, &whole);
                        assert!(
                            here < 1e-3 + 2.0 * usual,
                            "{name} {kind} {spec}: {here:.1e}, centred {usual:.1e}"
                        );
                        1e-3 + 2.0 * here
                    };
                    let drawn = draw_before(&gpu, &on_device, &seen, spec, given);
                    let errors = ImageErrors::between_f64(&drawn, truth).unwrap().all;
                    println!(
                        "{name} {kind}, {what}, {spec}: rmse {:.1e} of {bound:.1e}, worst {:.1e}",
                        errors.rmse, errors.max_abs
                    );
                    assert!(
                        errors.rmse < bound,
                        "{name} {kind}, {what}, {spec}: {:.1e} of {bound:.1e}",
                        errors.rmse
                    );
                }
            }
        }
    }
}

/// A mirrored view draws the mirrored image, and knows on which side of a face there is a cell: else pixels would be drawn again as if
/// cells overlapped there, right but slowly.
#[test]
fn a_mirrored_view_of_a_mesh_needs_no_repair() {
    let gpu = gpu();
    let camera = *views()[0].camera();
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let [plain, mirrored] = [DMat4::IDENTITY, mirror].map(|first| {
        let matrices = (first * look(camera), frustum([-0.6, 0.6, -0.45, 0.45]));
        View::from_matrices(matrices.0, matrices.1, ClipY::Up, SIZE[0], SIZE[1]).unwrap()
    });
    let mut routes = vec!["havs", "abuffer", "projected-tets"];
    if gpu.has(OptionalFeature::OrderedStores) {
        routes.push("havs:route=implementation-ordered");
    }
    for scene in [cut::mesh(), cut::cells()] {
        let on_device = GpuScene::new(&gpu, scene);
        for spec in &routes {
            let [(image, overlaps), (other, mirrored)] = [&plain, &mirrored].map(|view| {
                let mut frames = Renderer::new(&on_device, technique(spec)).frames(view).unwrap();
                let time = frames.draw(view).unwrap();
                let overlaps = time.counters.iter().find(|(name, _)| *name == "overlap_pixels");
                (frames.read_back().unwrap(), overlaps.map(|(_, count)| *count))
            });
            assert_eq!(mirrored, overlaps, "{spec}");
            for y in 0..SIZE[1] {
                for x in 0..SIZE[0] {
                    let (a, b) = (image.pixel(x, y), other.pixel(SIZE[0] - 1 - x, y));
                    let far = (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
                    assert!(far < 1e-4, "{spec} {x} {y}: {a:?} {b:?}");
                }
            }
        }
    }
}

/// Fans in space serve every view from an eye, but not the mirrored one, and cut depths are in the scene's unit.
#[test]
fn plans_turn_to_mirrored_views() {
    let gpu = gpu();
    let on_device = GpuScene::new(&gpu, cut::mesh());
    let plain = views()[0];
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)) * look(*plain.camera());
    let frustum = frustum([-0.6, 0.6, -0.45, 0.45]);
    let mirrored = View::from_matrices(mirror, frustum, ClipY::Up, SIZE[0], SIZE[1]).unwrap();
    for spec in ["projected-tets:plane=space,integrator=exact", "projected-tets:rank=mpvo", "havs"] {
        let renderer = Renderer::new(&on_device, technique(spec));
        let mut frames = renderer.frames(&plain).unwrap();
        for view in [&plain, &mirrored, &plain] {
            frames.draw(view).unwrap();
            let got = frames.read_back().unwrap();
            let want = renderer.render(view).unwrap();
            let far =
                got.pixels().iter().zip(want.pixels()).map(|(a, b)| (a[3] - b[3]).abs()).fold(0.0, f32::max);
            assert!(far < 1e-5 && want.pixels().iter().any(|p| p[3] > 0.1), "{spec}: {far}");
        }
    }
    // In a model of ten times the size the engine's depths are ten of the scene's.
    let scene = scene(Field::Blobs, 12, "f32", &FOG);
    let on_device = GpuScene::new(&gpu, scene.clone());
    let model = DMat4::from_scale(DVec3::splat(10.0));
    let view =
        View::from_matrices(look(*plain.camera()) * model, frustum, ClipY::Up, SIZE[0], SIZE[1]).unwrap();
    let behind = -view.camera().eye.dot(view.forward());
    let image =
        Depth::new(&gpu, vk::Format::D32_SFLOAT, SIZE, &[(0.1 / (10.0 * behind)) as f32; 1200]).unwrap();
    let projection = DepthProjection::from_matrix(&frustum).unwrap();
    assert!(projection.in_unit(0.0).is_err());
    let given = Some((&image, projection.in_unit(10.0).unwrap()));
    let drawn = draw_before(&gpu, &on_device, &view, "raycast:step=0.25,filter=exact", given);
    let truth = truth_before(&scene, &view, &|_| behind);
    let errors = ImageErrors::between_f64(&drawn, &truth).unwrap().all;
    assert!(errors.rmse < 2e-4, "{:.1e}", errors.rmse);
}

/// Trained splats by the rules of the image, whose ellipses depend on the place in it.
#[test]
fn rules_of_the_image_hold_off_the_centre() {
    let gpu = gpu();
    for rule in [SplatRule::Khr, SplatRule::Inria, SplatRule::Antialiased] {
        let scene = Scene::new(Field::Blobs.splats(400).unwrap(), cut::fog()).with_rule(rule);
        let on_device = GpuScene::new(&gpu, scene.clone());
        for (kind, view, ..) in off_centre() {
            let errors = errors(&draw_on(&on_device, &view, "gaussians"), &scene, &view).all;
            println!("{} {kind}: rmse {:.1e}, worst {:.1e}", rule.name(), errors.rmse, errors.max_abs);
            assert!(errors.rmse < 2e-5, "{} {kind}: {:.1e}", rule.name(), errors.rmse);
        }
    }
}

/// The headlight shades along the rays of the view, and maxima are found on them.
#[test]
fn lit_grids_hold_off_the_centre() {
    let gpu = gpu();
    for (mode, specs) in [
        (
            Mode::Lit(Lighting::default()),
            vec!["slices-3d:step=0.25,filter=exact", "raycast:step=0.25,filter=exact"],
        ),
        (Mode::Maximum, vec!["raycast:step=0.25,filter=exact"]),
    ] {
        let scene = scene(Field::Blobs, 20, "f32", &FOG).with_mode(mode).unwrap();
        let on_device = GpuScene::new(&gpu, scene.clone());
        for (kind, view, ..) in off_centre() {
            for spec in &specs {
                let errors = errors(&draw_on(&on_device, &view, spec), &scene, &view).all;
                println!("{kind} {spec}: rmse {:.1e}, worst {:.1e}", errors.rmse, errors.max_abs);
                assert!(errors.rmse < 2e-3, "{kind} {spec}: {:.1e}", errors.rmse);
            }
        }
    }
}

/// A frame lands in a rectangle of the caller's image, cut by the same rectangle of its depth image, and leaves the rest; by every
/// technique, whether it clears or composites, the same as in an image of its own.
#[test]
fn a_frame_lands_in_a_rectangle_of_a_larger_image() {
    let gpu = gpu();
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let (large, corner) = ([64, 48], [17, 9]);
    let view = off_centre().remove(0).1;
    let behind = -view.camera().eye.dot(view.forward());
    let stored = |x: u32| if x < 22 { (0.1 / (behind + 0.2)) as f32 } else { 0.0 };
    let inside = |i: u32| {
        let [x, y] = [(i % large[0]).wrapping_sub(corner[0]), (i / large[0]).wrapping_sub(corner[1])];
        (x < SIZE[0] && y < SIZE[1]).then_some([x, y])
    };
    // Elsewhere a surface is at the eye.
    let values: Vec<f32> =
        (0..large[0] * large[1]).map(|i| inside(i).map_or(1.0, |[x, _]| stored(x))).collect();
    let depth = Depth::new(&gpu, vk::Format::D32_SFLOAT, large, &values).unwrap();
    let own: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(|i| stored(i % SIZE[0])).collect();
    let own = Depth::new(&gpu, vk::Format::D32_SFLOAT, SIZE, &own).unwrap();
    let projection = DepthProjection::perspective(f64::INFINITY, 0.1).unwrap();
    let (frame, small) = (Caller::new(&gpu, format, large, 16), Caller::new(&gpu, format, SIZE, 16));
    let clear = [0.25, 0.5, 0.125, 1.0];
    let part = |caller: &Caller| {
        // SAFETY: image and view outlive the submission, and have room for the rectangle.
        unsafe { TargetImage::from_raw(&gpu, caller.image, caller.view, format, SIZE) }
    };
    // SAFETY: the image has room for it, or it is refused.
    let at = |caller: &Caller, corner| unsafe { part(caller).at(corner) };
    let floats = |bytes: &[u8]| -> Vec<f32> {
        bytes.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect()
    };
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs {
            for (mode, with_depth) in [(TargetMode::Clear, false), (TargetMode::Over, true)] {
                let target = TargetDesc::caller(format, mode);
                let target = if with_depth { target.with_depth() } else { target };
                let renderer = Renderer::new(&scene, technique(&spec));
                let plan = match renderer.prepare(&view, &target) {
                    Err(Error::Unsupported { .. }) if with_depth => continue,
                    plan => plan.unwrap(),
                };
                let draw = |mut plan: Plan,
                            caller: &Caller,
                            target: &TargetImage,
                            image: DepthImage,
                            depth: &Depth| {
                    caller.begin(clear);
                    depth.fill(caller.commands);
                    let image = with_depth.then_some(image);
                    let recorded =
                        plan.record(&mut caller.command_buffer(&gpu), Some(target), image.as_ref());
                    let recorded = recorded.unwrap();
                    let bytes = caller.end(&gpu);
                    (recorded.completed().unwrap().complete, floats(&bytes))
                };
                let (whole, want) =
                    draw(plan, &small, &small.target(&gpu), own.image(&gpu, projection), &own);
                let mut plan = renderer.prepare(&view, &target.in_part()).unwrap();
                assert!(plan.set_view(&view).unwrap());
                let image = depth.image(&gpu, projection).at(corner);
                let (complete, got) = draw(plan, &frame, &at(&frame, corner), image, &depth);
                assert!(whole && complete, "{spec}");
                for (i, got) in (0..).zip(got.chunks_exact(4)) {
                    let Some([x, y]) = inside(i) else {
                        assert_eq!(got, clear, "{spec}: {i} is outside");
                        continue;
                    };
                    let at = 4 * (y * SIZE[0] + x) as usize;
                    let far = got.iter().zip(&want[at..]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(far < 1e-5, "{spec} {mode:?} {x} {y}: {got:?}");
                }
            }
        }
    }
    // What is no part of the plan's is refused.
    let grid = GpuScene::new(&gpu, scene(Field::Blobs, 8, "f32", &FOG));
    let whole = TargetDesc::caller(format, TargetMode::Over).with_depth();
    let mut plan = Renderer::new(&grid, technique("raycast")).prepare(&view, &whole).unwrap();
    frame.begin(clear);
    let mut refuse = |target: TargetImage, depth: DepthImage, part: &str| {
        let why = plan.record(&mut frame.command_buffer(&gpu), Some(&target), Some(&depth)).unwrap_err();
        assert!(why.to_string().contains(part), "{why}");
    };
    refuse(at(&frame, corner), own.image(&gpu, projection), "TargetDesc::in_part");
    refuse(part(&frame), depth.image(&gpu, projection), "room for it");
    refuse(part(&frame), depth.image(&gpu, projection).at([25, 0]), "room for it");
    refuse(part(&frame), depth.image(&gpu, projection).at([u32::MAX, 0]), "room for it");
    let _ = frame.end(&gpu);
}

/// The parts of an image join to the image, and an offset of whole pixels moves it.
#[test]
fn parts_join_to_the_image() {
    let gpu = gpu();
    let [outside, aside, _] = views();
    let beside = off_centre().remove(0).1;
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs.iter().filter(|spec| by_pixel(spec)) {
            for view in taken(2, [outside, aside, beside]) {
                let whole = draw_on(&scene, &view, spec);
                let near = |part: &Image, corner: [i32; 2], what: &str| {
                    for (i, pixel) in part.pixels().iter().enumerate() {
                        let x = corner[0] + (i as u32 % part.width()) as i32;
                        let y = corner[1] + (i as u32 / part.width()) as i32;
                        let [x, y] = [u32::try_from(x), u32::try_from(y)];
                        let (Ok(x), Ok(y)) = (x, y) else { continue };
                        if x >= SIZE[0] || y >= SIZE[1] {
                            continue;
                        }
                        let want = whole.pixel(x, y);
                        let far = (0..4).map(|c| (pixel[c] - want[c]).abs()).fold(0.0, f32::max);
                        assert!(far < 2e-3, "{what} {spec} {x} {y}: {pixel:?} is not {want:?}");
                    }
                };
                for (corner, extent) in [([0, 0], [17, 30]), ([17, 0], [23, 30]), ([-5, 11], [31, 24])] {
                    near(&draw_on(&scene, &view.part(corner, extent).unwrap(), spec), corner, "part");
                }
                let moved = view.offset(DVec2::new(3.0, -2.0)).unwrap();
                near(&draw_on(&scene, &moved, spec), [-3, 2], "offset");
            }
        }
    }
    assert!(outside.part([0, 0], [0, 4]).unwrap_err().to_string().contains("width"));
    assert!(outside.offset(DVec2::new(f64::NAN, 0.0)).unwrap_err().to_string().contains("finite"));
    let orthographic = matches!(aside.camera().projection, Projection::Orthographic { .. });
    assert!(orthographic);
}
