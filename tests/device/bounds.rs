//! What bounds lines: clip planes, a crop box, depth images. Every technique against the reference, cut at the same depths.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a test fails by panicking, and makes its own numbers"
)]

use crate::common::caller::{Caller, Depth, draw_before};
use crate::common::cut::{self, Case, OWN, views};
use crate::common::*;
use glam::{DVec2, DVec3};
use volraster::ash::vk;
use volraster::gpu::{DepthProjection, Gpu, GpuOptions};
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceImage};
use volraster::scene::{Clip, Field, Kernel, Kernels, Model, Scene, View};
use volraster::technique::Renderer;
use volraster::{GpuScene, TargetDesc, TargetMode};

/// What a view's clipping leaves of a pixel's ray, up to a depth along the view.
fn range_of(view: &View, pixel: DVec2, depth: f64) -> ([f64; 2], DVec3, DVec3) {
    let (origin, direction) = view.ray(pixel);
    let begin = if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY };
    let end = depth / direction.dot(view.forward());
    (view.clip().range(origin, direction, [begin, end]), origin, direction)
}

/// The reference of what lies before a depth, which pixels tell.
pub(crate) fn truth_before(
    scene: &Scene,
    view: &View,
    depth: &(dyn Fn(DVec2) -> f64 + Sync),
) -> ReferenceImage {
    let [width, height] = view.extent();
    let pixel = |i: u32| {
        let at = DVec2::new(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
        let (range, origin, direction) = range_of(view, at, depth(at));
        if range[0] < range[1] { reference::ray(scene, origin, direction, range).unwrap() } else { [0.0; 4] }
    };
    use rayon::prelude::*;
    let pixels = (0..width * height).into_par_iter().map(pixel).collect();
    ReferenceImage::new(width, height, pixels).unwrap()
}

/// A plane aslant through the cube, two that cut corners off, and a crop box with open sides: more half-spaces than one dispatch takes.
pub(crate) fn clip() -> Clip {
    Clip::none()
        .with_plane(DVec3::new(0.1, 0.0, 0.2), DVec3::new(-0.5, 0.3, -1.0))
        .unwrap()
        .with_plane(DVec3::new(0.7, 0.7, 0.0), DVec3::new(-1.0, -1.0, -0.2))
        .unwrap()
        .with_plane(DVec3::new(0.0, -0.7, 0.9), DVec3::new(0.1, 1.0, -0.6))
        .unwrap()
        .with_crop(DVec3::new(-0.9, -0.8, f64::NEG_INFINITY), DVec3::new(f64::INFINITY, 0.9, 0.85))
        .unwrap()
}

/// Depth of a wavy wall through the middle of the data, nothing in some pixels.
fn wall(view: &View, pixel: DVec2) -> f64 {
    let middle = -view.camera().eye.dot(view.forward());
    let depth = middle.max(0.0) + 0.3 * (0.2 * pixel.x).sin() - 0.01 * pixel.y;
    if (pixel.x as u32 + pixel.y as u32).is_multiple_of(7) || depth <= 0.05 { f64::INFINITY } else { depth }
}

/// Stored numbers of depths, and what is left of the depths when a format has rounded them.
fn stored(projection: [f64; 2], perspective: bool, bits: Option<u32>, depth: f64) -> (f32, f64) {
    let [at_zero, at_one] = projection;
    let far = if at_zero > at_one { 0.0 } else { 1.0 };
    let s = if depth.is_infinite() {
        far
    } else if perspective {
        let (a, b) = (1.0 / at_zero, 1.0 / at_one);
        (1.0 / depth - a) / (b - a)
    } else {
        (depth - at_zero) / (at_one - at_zero)
    };
    let levels = bits.map(|bits| f64::from((1_u32 << bits) - 1));
    let s = levels.map_or(f64::from(s as f32), |levels| (s * levels).round() / levels);
    let back = if s == far {
        f64::INFINITY
    } else if perspective {
        1.0 / ((1.0 - s) / at_zero + s / at_one)
    } else {
        (1.0 - s) * at_zero + s * at_one
    };
    (s as f32, back)
}

fn projection_of(perspective: bool, [at_zero, at_one]: [f64; 2]) -> DepthProjection {
    let make = if perspective { DepthProjection::perspective } else { DepthProjection::orthographic };
    make(at_zero, at_one).unwrap()
}

/// Homogeneous matter: what is left of it has the length that clipping leaves, by every technique for grids.
#[test]
fn clipped_matter_has_its_length() {
    let gpu = gpu();
    let rows = [[0.0, 0.2, 0.5, 0.9, 0.7], [1.0, 0.2, 0.5, 0.9, 0.7]];
    let grid = GpuScene::new(&gpu, scene(Field::Homogeneous(0.5), 12, "f32", &rows));
    for view in taken(3, views()).into_iter().map(|view| view.with_clip(clip())) {
        for spec in specs(&gpu).iter().filter(|spec| by_pixel(spec)) {
            let image = draw_on(&grid, &view, spec);
            for (i, alpha) in image.pixels().iter().map(|p| f64::from(p[3])).enumerate() {
                let at = DVec2::new((i % 40) as f64 + 0.5, (i / 40) as f64 + 0.5);
                let (range, origin, direction) = range_of(&view, at, f64::INFINITY);
                let length = in_cube(range, origin, direction);
                if on_outline(&view, at) || (length < 1e-3 && chord(&view, at) > 0.0) {
                    continue;
                }
                let want = -(-0.7 * length).exp_m1();
                let bound =
                    2e-6_f64.max(1.2e-7 * 60.0) + 4.0 * 0.7 * view.camera().eye.length() / 16_777_216.0;
                assert!(
                    (alpha - want).abs() < bound,
                    "{spec} {at}: {alpha} is not {want}, {:.1e}",
                    alpha - want
                );
            }
        }
    }
}

/// Scenes with the specs that draw them exactly enough, and the bound of the root-mean-square error.
pub(crate) fn scenes(gpu: &Gpu) -> Vec<Case> {
    let warps = ["warp=bicubic", "warp=mip", "intermediate=auto", "integrator=integral", "step=0.5"];
    let warps = warps
        .map(|option| format!("shear-warp:intermediate=pixel,{option}").replace("pixel,intermediate=", ""));
    let all = |specs: &[(&str, f64)]| specs.iter().map(|&(spec, bound)| (spec.to_string(), bound)).collect();
    let mut of_mesh = vec![
        ("havs:integrator=exact", 1e-6),
        ("havs:integrator=exact,order=back-to-front", 1e-6),
        ("abuffer:integrator=exact", 1e-6),
        ("abuffer:integrator=exact,order=back-to-front", 1e-6),
        ("projected-tets:integrator=exact", 1e-6),
        ("projected-tets:integrator=exact,route=raster", 1e-6),
        ("projected-tets:integrator=exact,plane=space", 5e-6),
    ];
    if gpu.has(volraster::gpu::OptionalFeature::OrderedStores) {
        of_mesh.push(("havs:integrator=exact,route=implementation-ordered", 1e-6));
    }
    let of_cells = [
        ("havs:integrator=exact", 1e-6),
        ("abuffer:integrator=exact", 1e-6),
        ("projected-tets:integrator=exact", 1e-6),
    ];
    let of_points = [
        ("splat-sheets:sheets=image,step=0.05", 3e-5),
        ("splat-sheets:sheets=axis", OWN),
        ("splat-ewa:footprint=exact", OWN),
        ("splat-ewa:footprint=exact,order=pixel", OWN),
        ("splat-ewa:footprint=exact,order=slabs,step=0.05", 3e-5),
        ("splat-ewa:footprint=ewa", OWN),
        ("splat-ewa:footprint=ewa,order=pixel", OWN),
    ];
    let of_kernels = [("splat-sheets:sheets=axis,template=64", OWN), ("splat-sheets:sheets=axis", OWN)];
    let kernels = Kernels { kernel: Kernel::Gaussian, model: Model::Density, ..Kernels::of_samples() };
    let lattice = scene(Field::Blobs, 10, "f32", &FOG).with_kernels(kernels).unwrap();
    let mut cases = vec![
        cut::grid(gpu, warps),
        ("mesh", cut::mesh(), all(&of_mesh)),
        ("cells", cut::cells(), all(&of_cells)),
        ("kernels", lattice, all(&of_kernels)),
        ("points", cut::points(), all(&of_points)),
    ];
    cases.extend(cut::trained());
    cases
}

/// What is clipped and what lies behind a depth image is not drawn, and what passes through is cut there: every technique
/// is as near to the reference as it is without.
#[test]
fn every_technique_is_cut_where_the_reference_is() {
    let gpu = gpu();
    for (turn, (name, scene, specs)) in taken(2, scenes(&gpu)).into_iter().enumerate() {
        let on_device = GpuScene::new(&gpu, scene.clone());
        for (i, plain) in taken(3, views().into_iter().enumerate()) {
            let [width, height] = plain.extent();
            let perspective = plain.is_perspective();
            let at = |i: u32| DVec2::new(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
            let ends = if perspective { [f64::INFINITY, 0.03] } else { [0.5, 9.0] };
            let (values, depths): (Vec<f32>, Vec<f64>) =
                (0..width * height).map(|i| stored(ends, perspective, None, wall(&plain, at(i)))).unzip();
            let projection = projection_of(perspective, ends);
            let image = Depth::new(&gpu, vk::Format::D32_SFLOAT, [width, height], &values).unwrap();
            let depth_of = |p: DVec2| depths[p.y as usize * width as usize + p.x as usize];
            let nothing = |_: DVec2| f64::INFINITY;
            let clipped = plain.with_clip(clip());
            let cases: [(&str, View, bool); 3] =
                [("clip", clipped, false), ("depth", plain, true), ("both", clipped, true)];
            let whole = truth_before(&scene, &plain, &nothing);
            // What blends whole splats has an error of its own, that of the same view with nothing cut.
            let usual = |spec: &str, bound: f64| {
                if bound > 0.0 || (spec.contains("template") && perspective) {
                    return bound;
                }
                let drawn = draw_on(&on_device, &plain, spec);
                1e-3 + 2.0 * ImageErrors::between_f64(&drawn, &whole).unwrap().all.rmse
            };
            let specs: Vec<_> = specs.iter().map(|(spec, bound)| (spec, usual(spec, *bound))).collect();
            for (case, view, with_depth) in taken_from(turn + i, 3, cases) {
                let truth = if with_depth {
                    truth_before(&scene, &view, &depth_of)
                } else {
                    truth_before(&scene, &view, &nothing)
                };
                for (spec, bound) in &specs {
                    if spec.contains("template") && perspective {
                        continue;
                    }
                    let given = with_depth.then_some((&image, projection));
                    let drawn = draw_before(&gpu, &on_device, &view, spec, given);
                    let errors = ImageErrors::between_f64(&drawn, &truth).unwrap();
                    println!(
                        "{name} view {i} {case} {spec}: rmse {:.1e} of {bound:.1e}, worst {:.1e}",
                        errors.all.rmse, errors.all.max_abs
                    );
                    assert!(
                        errors.all.rmse < *bound,
                        "{name} view {i} {case} {spec}: {:.1e}",
                        errors.all.rmse
                    );
                }
            }
        }
    }
}

/// Every format and every way to store depth: near plane first, reversed, without a far end, parallel. What is left of
/// homogeneous matter before the wall has its length.
#[test]
fn depth_is_read_as_it_was_stored() {
    let gpu = gpu();
    let rows = [[0.0, 0.2, 0.5, 0.9, 0.7], [1.0, 0.2, 0.5, 0.9, 0.7]];
    let grid = GpuScene::new(&gpu, scene(Field::Homogeneous(0.5), 12, "f32", &rows));
    let formats = [
        (vk::Format::D32_SFLOAT, None),
        (vk::Format::D16_UNORM, Some(16)),
        (vk::Format::X8_D24_UNORM_PACK32, Some(24)),
        (vk::Format::D24_UNORM_S8_UINT, Some(24)),
    ];
    let infinity = f64::INFINITY;
    let perspectives = [[0.5, 12.0], [12.0, 0.5], [0.5, infinity], [infinity, 0.5], [infinity, 0.001]];
    let mut seen = 0;
    for (ends, plain) in perspectives
        .map(|ends| (ends, view(perspective(), 1.0, 40, 30)))
        .into_iter()
        .chain([[-1.0, 12.0], [12.0, 0.0]].map(|ends| (ends, view(orthographic(), 1.0, 40, 30))))
    {
        let perspective = plain.is_perspective();
        let projection = projection_of(perspective, ends);
        let at = |i: u32| DVec2::new(f64::from(i % 40) + 0.5, f64::from(i / 40) + 0.5);
        for (format, bits) in formats {
            let (values, depths): (Vec<f32>, Vec<f64>) =
                (0..1200).map(|i| stored(ends, perspective, bits, wall(&plain, at(i)))).unzip();
            let Some(image) = Depth::new(&gpu, format, [40, 30], &values) else {
                println!("skipped: {format:?}: the device does not sample it");
                continue;
            };
            seen += 1;
            let drawn = draw_before(&gpu, &grid, &plain, "slices-3d", Some((&image, projection)));
            for (i, alpha) in drawn.pixels().iter().map(|p| f64::from(p[3])).enumerate() {
                let pixel = at(i as u32);
                let (range, origin, direction) = range_of(&plain, pixel, depths[i]);
                if on_outline(&plain, pixel) {
                    continue;
                }
                let want = -(-0.7 * in_cube(range, origin, direction)).exp_m1();
                // Of distances z float32 knows the inverse to 3 / 2^24 of that of the near plane, and what is stored so close: depth to
                // z^2 over the near plane's distance times as much.
                let near = ends[0].min(ends[1]).abs().max(0.5);
                let depth = plain.camera().eye.length() + 1.0;
                let lost = if ends.contains(&infinity) && ends[0] == infinity {
                    depth
                } else {
                    depth * depth / near
                };
                let bound = 4e-6 + 0.7 * 3.0 * lost / 16_777_216.0 * 2.0;
                let what = format!("{format:?} {ends:?} {pixel}: {alpha} is not {want}");
                assert!((alpha - want).abs() < bound, "{what}: {:.1e} of {bound:.1e}", alpha - want);
            }
        }
    }
    assert!(seen >= 14, "{seen} formats of depth");
}

/// What does not fit the view is refused, and so is a plan with a depth image that gets none.
#[test]
fn depth_images_that_do_not_fit_are_refused() {
    let gpu = gpu();
    let grid = GpuScene::new(&gpu, scene(Field::Blobs, 8, "f32", &FOG));
    let plain = view(perspective(), 1.0, 40, 30);
    let format = vk::Format::R8G8B8A8_UNORM;
    let caller = Caller::new(&gpu, format, [40, 30], 4);
    let target = TargetDesc::caller(format, TargetMode::Over).with_depth();
    let mut plan = Renderer::new(&grid, technique("slices-3d")).prepare(&plain, &target).unwrap();
    let right = Depth::new(&gpu, vk::Format::D32_SFLOAT, [40, 30], &[0.5; 1200]).unwrap();
    let small = Depth::new(&gpu, vk::Format::D32_SFLOAT, [40, 29], &[0.5; 1160]).unwrap();
    let projection = DepthProjection::perspective(0.1, 9.0).unwrap();
    let parallel = DepthProjection::orthographic(0.1, 9.0).unwrap();
    let of = |fov: f64, aspect: f64| {
        DepthProjection::from_matrix(&glam::dcamera::rh::proj::vulkan::perspective_infinite_reverse(
            fov, aspect, 0.1,
        ))
        .unwrap()
    };
    let fov = 42_f64.to_radians();
    caller.begin([0.0; 4]);
    let mut commands = caller.command_buffer(&gpu);
    let mut refuse = |depth: Option<volraster::gpu::DepthImage>, part: &str| {
        let why =
            plan.record(&mut commands, Some(&caller.target(&gpu)), depth.as_ref()).unwrap_err().to_string();
        assert!(why.contains(part), "{why}");
    };
    refuse(None, "none is given");
    refuse(Some(small.image(&gpu, projection)), "[40, 30]");
    refuse(Some(right.image(&gpu, parallel)), "orthographic");
    refuse(Some(right.image(&gpu, of(fov, 1.0))), "scales");
    refuse(Some(right.image(&gpu, of(fov * 1.01, 4.0 / 3.0))), "scales");
    right.fill(caller.commands);
    let depth = right.image(&gpu, of(fov, 4.0 / 3.0));
    let recorded = plan.record(&mut commands, Some(&caller.target(&gpu)), Some(&depth)).unwrap();
    let _ = caller.end(&gpu);
    assert!(recorded.completed().unwrap().complete);
}

/// Clipping comes and goes with views; a plan that has none says that it must be prepared anew.
#[test]
fn plans_turn_between_clipped_views() {
    let gpu = gpu();
    let grid = GpuScene::new(&gpu, scene(Field::Blobs, 16, "f32", &FOG));
    let plain = view(perspective(), 1.0, 40, 30);
    let clipped = plain.with_clip(clip());
    let renderer = Renderer::new(&grid, technique("slabs"));
    let mut plan = renderer.prepare(&plain, &TargetDesc::own()).unwrap();
    assert!(plan.set_view(&view(perspective(), 0.9, 40, 30)).unwrap());
    assert!(!plan.set_view(&clipped).unwrap());
    let mut frames = renderer.frames(&plain).unwrap();
    let mut draw = |view: &View| {
        frames.draw(view).unwrap();
        frames.read_back().unwrap()
    };
    let [a, b, c] = [&plain, &clipped, &plain].map(&mut draw);
    assert_eq!(a.pixels(), c.pixels());
    assert_ne!(a.pixels(), b.pixels());
    assert_eq!(b.pixels(), renderer.render(&clipped).unwrap().pixels());
    let far = Clip::none().with_plane(DVec3::splat(1e300), DVec3::X).unwrap();
    let why = renderer.render(&plain.with_clip(far)).unwrap_err().to_string();
    assert!(why.contains("clip plane"), "{why}");
}

/// A dispatch that goes on where another has ended is cut where that was.
#[test]
fn split_marches_are_cut_alike() {
    let few = gpu_with(GpuOptions { loop_limit: Some(400), ..GpuOptions::default() });
    let scene = scene(Field::Blobs, 24, "f32", &FOG);
    let split = GpuScene::new(&few, scene.clone());
    for view in taken(3, views()).into_iter().map(|view| view.with_clip(clip())) {
        let truth = truth_before(&scene, &view, &|_| f64::INFINITY);
        for spec in specs(&few).iter().filter(|spec| spec.contains("compute") && !spec.contains("exact")) {
            let spec = format!("{},filter=exact,empty-space=march", with_option(spec, "step", "0.25"));
            let mut frames = Renderer::new(&split, technique(&spec)).frames(&view).unwrap();
            frames.draw(&view).unwrap();
            let dispatches = frames.plan().counters();
            let dispatches = dispatches.iter().find(|(name, _)| *name == "dispatches_or_draws").unwrap().1;
            assert!(dispatches > 2, "{spec}: {dispatches} dispatches");
            let errors = ImageErrors::between_f64(&frames.read_back().unwrap(), &truth).unwrap();
            let bound = if by_pixel(&spec) { 2e-4 } else { 1e-2 };
            assert!(errors.all.rmse < bound, "{spec}: {:.1e}", errors.all.rmse);
        }
    }
}

/// A float image may hold anything. No number is no surface; what lies beyond the ends is where the projection says.
#[test]
fn odd_depths_hide_what_they_say() {
    let gpu = gpu();
    let rows = [[0.0, 0.2, 0.5, 0.9, 0.7], [1.0, 0.2, 0.5, 0.9, 0.7]];
    let grid = GpuScene::new(&gpu, scene(Field::Homogeneous(0.5), 12, "f32", &rows));
    for plain in [view(perspective(), 1.0, 40, 30), view(orthographic(), 1.0, 40, 30)] {
        let projection = match plain.is_perspective() {
            true => DepthProjection::perspective(f64::INFINITY, 0.03),
            false => DepthProjection::orthographic(9.0, 0.5),
        };
        let open = draw_on(&grid, &plain, "slices-3d");
        // Nothing, infinitely near, behind the eye or beyond the far end, beyond the near end.
        for (stored, hides) in
            [(f32::NAN, false), (f32::INFINITY, true), (-0.5, false), (2.0, true), (f32::NEG_INFINITY, false)]
        {
            let image = Depth::new(&gpu, vk::Format::D32_SFLOAT, [40, 30], &[stored; 1200]).unwrap();
            let depth = (&image, projection.as_ref().copied().unwrap());
            let drawn = draw_before(&gpu, &grid, &plain, "slices-3d", Some(depth));
            let seen = drawn.pixels().iter().any(|p| p[3] > 0.0);
            assert_eq!(seen, !hides, "{stored}");
            assert!(hides || drawn.pixels() == open.pixels(), "{stored}");
        }
    }
}
