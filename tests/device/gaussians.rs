//! Trained splats against the float64 reference of each rule.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers of test scenes")]

use crate::common::*;
use glam::DVec3;
use volraster::Image;
use volraster::gpu::GpuOptions;
use volraster::measure::ImageErrors;
use volraster::reference::ReferenceImage;
use volraster::scene::{
    Camera, Clip, GaussianParts, Gaussians, Projection, Scene, SplatRule, Surface, TransferFunction, View,
};
use volraster::technique::Renderer;
use volraster::{Gpu, GpuScene, TargetDesc};

/// A number from -1 to 1, the same for each place.
fn number(i: usize) -> f32 {
    let hash = (i as u32).wrapping_mul(2_654_435_761) ^ 0x5bd1_e995;
    (hash.wrapping_mul(2_246_822_519) >> 8) as f32 / 8_388_608.0 - 1.0
}

/// A cloud of splats of the sizes and shapes that scenes have.
fn cloud(count: usize, degree: u32) -> GaussianParts {
    let width = 3 * (degree as usize + 1).pow(2);
    let place = |i: usize| [0, 1, 2].map(|k| 0.9 * number(11 * i + k));
    GaussianParts {
        centres: (0..count).map(place).collect(),
        rotations: (0..count).map(|i| [1.1, number(7 * i), number(7 * i + 1), number(7 * i + 2)]).collect(),
        log_scales: (0..count).map(|i| [3, 4, 5].map(|k| -3.2 + 1.2 * number(13 * i + k))).collect(),
        opacities: (0..count).map(|i| 0.5 + 0.49 * number(17 * i)).collect(),
        degree,
        harmonics: (0..count * width)
            .map(|i| number(5 * i) / if i % width < 3 { 1.0 } else { 6.0 })
            .collect(),
        ..GaussianParts::default()
    }
}

fn scene(parts: GaussianParts, rule: SplatRule) -> Scene {
    Scene::new(Gaussians::new(parts).unwrap().0, TransferFunction::from_rows(&[[0.0; 5]]).unwrap())
        .with_rule(rule)
}

fn seen(projection: Projection, eye: DVec3) -> View {
    let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::NEG_Y, projection };
    View::new(camera, 70, 52).unwrap()
}

fn views() -> [View; 3] {
    [
        seen(Projection::Perspective { fov_y_deg: 40.0 }, DVec3::new(1.0, -0.7, -3.0)),
        seen(Projection::Perspective { fov_y_deg: 70.0 }, DVec3::new(0.2, 0.1, -0.4)),
        seen(Projection::Orthographic { half_height: 1.2 }, DVec3::new(1.0, -0.7, -3.0)),
    ]
}

fn compared(gpu: &Gpu, scene: &Scene, view: &View, options: &str) -> ([f64; 2], Image) {
    compared_with(&truth(scene, view), gpu, scene, view, options)
}

fn compared_with(
    truth: &ReferenceImage,
    gpu: &Gpu,
    scene: &Scene,
    view: &View,
    options: &str,
) -> ([f64; 2], Image) {
    let image = draw(gpu, scene, view, &format!("gaussians{options}"));
    let all = ImageErrors::between_f64(&image, truth).unwrap().all;
    ([all.rmse, all.max_abs], image)
}

/// Parts are those of the image by rules that depend on its edges, of full and of half resolution, and beyond the image by parallel lines.
#[test]
fn parts_keep_the_edges_of_the_whole() {
    let gpu = gpu();
    let camera = |projection| Camera {
        eye: DVec3::new(0.2, 0.1, -0.9),
        target: DVec3::ZERO,
        up: DVec3::NEG_Y,
        projection,
    };
    let view = |projection, width| View::new(camera(projection), width, 64).unwrap();
    let splats = scene(cloud(900, 0), SplatRule::Inria);
    let near = view(Projection::Perspective { fov_y_deg: 70.0 }, 128);
    let same = |part: &Image, whole: &Image, corner: u32, what: &str| {
        let width = part.width();
        let far = |i: usize| {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let want = whole.pixel(corner + x, y);
            (0..4).any(|c| (part.pixel(x, y)[c] - want[c]).abs() > 1e-4)
        };
        let apart = (0..part.pixels().len()).filter(|&i| far(i)).count();
        assert!(200 * apart <= part.pixels().len(), "{what}: {apart}");
    };
    for spec in ["gaussians", "gaussians:resolution=half"] {
        let part = draw(&gpu, &splats, &near.part([64, 0], [64, 64]).unwrap(), spec);
        let whole = draw(&gpu, &splats, &near, spec);
        // Half the resolution is upsampled, and across the side of the part from less.
        let inner = if spec == "gaussians" { 0 } else { 8 };
        let pixels = (0..64 * (64 - inner)).map(|i| part.pixel(inner + i % (64 - inner), i / (64 - inner)));
        let part = Image::new(64 - inner, 64, pixels.collect()).unwrap();
        same(&part, &whole, 64 + inner, spec);
    }
    let parallel = |width| view(Projection::Orthographic { half_height: 0.6 }, width);
    let beside = draw(&gpu, &splats, &parallel(64).part([64, 0], [64, 64]).unwrap(), "gaussians");
    same(&beside, &draw(&gpu, &splats, &parallel(192), "gaussians"), 128, "beyond");
    assert!(beside.pixels().iter().any(|pixel| pixel[3] > 0.1));
}

/// Images are the reference's from afar, from within and by parallel lines, of every degree of harmonics, in columns and in pixels, in one band and in several.
#[test]
fn each_rule_is_its_reference() {
    let gpu = gpu();
    for (i, view) in views().into_iter().enumerate() {
        for (_, rule) in taken_from(i, 2, SplatRule::ALL) {
            for (degree, options) in taken(4, [(0, ""), (2, ":pairs=700"), (3, ":spread=pixels"), (4, "")]) {
                let ([rmse, most], image) = compared(&gpu, &scene(cloud(900, degree), rule), &view, options);
                println!("{i} {} degree {degree}{options}: {:.1e}, {:.1e}", rule.name(), rmse, most);
                let bound = match rule {
                    SplatRule::Inria => 2e-4,
                    SplatRule::Overlap | SplatRule::Integral => 1e-3,
                    _ => 1e-4,
                };
                assert!(rmse < bound, "{i} {} {degree}{options}: {:e}", rule.name(), rmse);
                assert!(image.pixels().iter().any(|pixel| pixel[3] > 0.9));
            }
        }
    }
}

/// Slabs lose the order of what they hold: of second order in their number.
#[test]
fn errors_of_overlapping_splats_fall_with_the_step() {
    let gpu = gpu();
    for rule in ["overlap", "integral"].map(|name| SplatRule::named(name).unwrap()) {
        let (scene, view) = (scene(cloud(900, 1), rule), views()[0]);
        let truth = truth(&scene, &view);
        let [coarse, usual, fine] = [":step=0.16", ":step=0.04", ":step=0.01"]
            .map(|options| compared_with(&truth, &gpu, &scene, &view, options).0[0]);
        println!("{}: {coarse:.1e}, {usual:.1e}, {fine:.1e}", rule.name());
        assert!(usual < coarse / 8.0 && fine < usual / 5.0, "{}: {coarse:e} {usual:e} {fine:e}", rule.name());
    }
}

/// What takes several dispatches of few loop iterations is what one draws.
#[test]
fn images_do_not_depend_on_the_loop_limit() {
    let gpu = gpu();
    let limited = gpu_with(GpuOptions { loop_limit: Some(4500), ..GpuOptions::default() });
    let view = View::new(*views()[0].camera(), 8, 8).unwrap();
    for (_, rule) in SplatRule::ALL {
        // The repair of a pixel goes through its whole bin in one dispatch.
        let options = if rule == SplatRule::Ray {
            ["order=depth", "order=depth,spread=pixels"]
        } else {
            ["", "spread=pixels"]
        };
        let scene = scene(cloud(6000, 0), rule);
        for options in taken_from(rule.name().len(), 2, options.map(|options| format!("gaussians:{options}")))
        {
            let whole = draw(&gpu, &scene, &view, &options);
            let on_limited = GpuScene::new(&limited, scene.clone());
            let mut frames = Renderer::new(&on_limited, technique(&options)).frames(&view).unwrap();
            frames.draw(&view).unwrap();
            let counters = frames.plan().counters();
            let rounds = counters.iter().find(|(name, _)| *name == "rounds").unwrap().1;
            let error = ImageErrors::between(&frames.read_back().unwrap(), &whole).unwrap().all.max_abs;
            println!("{} {options}: {rounds} rounds, {error:.1e}", rule.name());
            assert!(error < 1e-6, "{} {options}: {error:e}", rule.name());
            assert!(rounds > 1, "{} {options}", rule.name());
        }
    }
}

/// A splat has at most a fifth more bytes than its numbers as half floats, with a place in single precision.
#[test]
fn splats_have_few_bytes() {
    let gpu = gpu();
    for degree in 0..=4_u64 {
        let scene = GpuScene::new(&gpu, scene(cloud(50, degree as u32), SplatRule::Khr));
        let plan =
            Renderer::new(&scene, technique("gaussians")).prepare(&views()[0], &TargetDesc::own()).unwrap();
        let found = plan.counters().into_iter().find(|(name, _)| *name == "splat_bytes").unwrap().1;
        let halves = 12 + 2 * (4 + 3 + 1 + 3 * (degree + 1).pow(2));
        println!("degree {degree}: {found} of {halves}");
        assert!(5 * found <= 6 * halves, "degree {degree}: {found} bytes");
    }
}

/// A rule that is asked for comes before the scene's; only rules with depths have an order of each pixel's own, surfaces and clip planes.
#[test]
fn options_and_cuts_follow_the_rule() {
    let gpu = gpu();
    let view = views()[0];
    let khr = scene(cloud(200, 1), SplatRule::Khr);
    let try_draw = |scene: &Scene, view: &View, options: &str| {
        Renderer::new(&GpuScene::new(&gpu, scene.clone()), technique(&format!("gaussians:{options}")))
            .render(view)
    };
    let by_option = try_draw(&khr, &view, "rule=ray").unwrap();
    assert!(by_option == try_draw(&khr.clone().with_rule(SplatRule::Ray), &view, "").unwrap());
    let why =
        |scene: &Scene, view: &View, options: &str| try_draw(scene, view, options).unwrap_err().to_string();
    assert!(why(&khr, &view, "order=pixel").contains("no depth on a ray"));
    assert!(why(&khr, &view, "rule=integral,order=depth").contains("order: rule=integral needs no order"));
    assert!(why(&khr, &view, "rule=ray,step=0.1").contains("step: rule=ray has no slabs"));
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, y]| DVec3::new(x, y, 0.1));
    let wall =
        |alpha| Surface::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], [0.2, 0.4, 0.1, alpha]).unwrap();
    let cut = khr.clone().with_surfaces(vec![wall(1.0)]);
    assert!(why(&cut, &view, "").contains("ray, overlap, integral have"));
    let clip = Clip::none().with_plane(DVec3::ZERO, DVec3::NEG_Z).unwrap();
    assert!(why(&khr, &view.with_clip(clip), "").contains("ray, overlap, integral have"));
}
