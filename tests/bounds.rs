//! What bounds lines: clip planes, a crop box, depth images. Every technique against the reference, cut at the same depths.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    reason = "a test fails by panicking, and makes its own numbers"
)]

mod common;

use std::sync::Arc;

use common::caller::{Caller, Depth};
use common::*;
use glam::{DVec2, DVec3};
use volraster::Image;
use volraster::ash::vk;
use volraster::gpu::{DepthProjection, Gpu};
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceImage};
use volraster::scene::{Clip, Field, KernelSize, Kernels, Points, Scene, TransferFunction, View};
use volraster::technique::{GpuScene, Renderer, TargetDesc, TargetMode};

/// What a view's clipping leaves of a pixel's ray, up to a depth along the view.
fn range_of(view: &View, pixel: DVec2, depth: f64) -> ([f64; 2], DVec3, DVec3) {
    let (origin, direction) = view.ray(pixel);
    let begin = if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY };
    let end = depth / direction.dot(view.forward());
    (view.clip().range(origin, direction, [begin, end]), origin, direction)
}

/// The reference of what lies before a depth, which pixels tell.
fn truth_before(scene: &Scene, view: &View, depth: &(dyn Fn(DVec2) -> f64 + Sync)) -> ReferenceImage {
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

/// Draws into an image of the caller, behind whose depths nothing shows.
fn draw_before(
    gpu: &Gpu,
    scene: &Arc<GpuScene>,
    view: &View,
    spec: &str,
    depth: Option<(&Depth, DepthProjection)>,
) -> Image {
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let [width, height] = view.extent();
    let caller = Caller::new(gpu, format, [width, height], 16);
    let renderer = Renderer::new(scene, technique(spec));
    let mut target = TargetDesc::caller(format, TargetMode::Clear);
    if depth.is_some() {
        target = target.with_depth();
    }
    for _ in 0..8 {
        let mut plan = renderer.prepare(view, &target).unwrap_or_else(|error| panic!("{spec}: {error}"));
        caller.begin([0.25; 4]);
        if let Some((depth, _)) = depth {
            depth.fill(caller.commands);
        }
        let image = depth.map(|(depth, projection)| depth.image(gpu, projection));
        let mut commands = caller.command_buffer(gpu);
        let recorded = plan.record(&mut commands, Some(&caller.target(gpu)), image.as_ref()).unwrap();
        let bytes = caller.end(gpu);
        if recorded.completed().unwrap().complete {
            let float = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
            let pixel = |t: &[u8]| [float(t), float(&t[4..]), float(&t[8..]), float(&t[12..])];
            return Image::new(width, height, bytes.chunks_exact(16).map(pixel).collect()).unwrap();
        }
    }
    panic!("{spec}: never complete");
}

/// A plane aslant through the cube, one that cuts a corner off, and a crop box with open sides.
fn clip() -> Clip {
    Clip::none()
        .with_plane(DVec3::new(0.1, 0.0, 0.2), DVec3::new(-0.5, 0.3, -1.0))
        .unwrap()
        .with_plane(DVec3::new(0.7, 0.7, 0.0), DVec3::new(-1.0, -1.0, -0.2))
        .unwrap()
        .with_crop(DVec3::new(-0.9, -0.8, f64::NEG_INFINITY), DVec3::new(f64::INFINITY, 0.9, 0.85))
        .unwrap()
}

/// Depth of a wavy wall through the middle of the data, nothing in some pixels.
fn wall(view: &View, pixel: DVec2) -> f64 {
    let middle = -view.camera().eye.dot(view.forward());
    let depth = middle.max(0.0) + 0.3 * (0.2 * pixel.x).sin() - 0.01 * pixel.y;
    if (pixel.x as u32 + pixel.y as u32) % 7 == 0 || depth <= 0.05 { f64::INFINITY } else { depth }
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

fn views() -> [View; 3] {
    [view(perspective(), 1.0, 40, 30), view(orthographic(), 1.0, 40, 30), view(perspective(), 0.1, 40, 30)]
}

/// Homogeneous matter: what is left of it has the length that clipping leaves, by every technique for grids.
#[test]
fn clipped_matter_has_its_length() {
    let gpu = gpu();
    let rows = [[0.0, 0.2, 0.5, 0.9, 0.7], [1.0, 0.2, 0.5, 0.9, 0.7]];
    let grid = GpuScene::new(&gpu, scene(Field::Homogeneous(0.5), 12, "f32", &rows));
    for view in views().map(|view| view.with_clip(clip())) {
        for spec in specs(&gpu).iter().filter(|spec| by_pixel(spec)) {
            let image = draw_on(&grid, &view, spec);
            for (i, alpha) in image.pixels().iter().map(|p| f64::from(p[3])).enumerate() {
                let at = DVec2::new((i % 40) as f64 + 0.5, (i / 40) as f64 + 0.5);
                let ([begin, end], origin, direction) = range_of(&view, at, f64::INFINITY);
                let inside = |p: DVec2| {
                    let chord = chord(&view, p);
                    chord > 0.0
                };
                let mut range = [begin, end];
                for axis in 0..3 {
                    let (a, b) =
                        ((-1.0 - origin[axis]) / direction[axis], (1.0 - origin[axis]) / direction[axis]);
                    range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
                }
                let length = (range[1] - range[0]).max(0.0);
                if on_outline(&view, at) || (length < 1e-3 && inside(at)) {
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
