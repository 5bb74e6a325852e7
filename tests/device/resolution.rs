//! `resolution=half|quarter`: fewer pixels are drawn, and the image is upsampled.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places in an image, and its values"
)]

use crate::common::*;
use volraster::measure::ImageErrors;
use volraster::scene::{Clip, View};
use volraster::technique::{Renderer, Technique};
use volraster::{GpuScene, Image, TargetDesc};

/// The same view with larger pixels, which cover its height and its width.
fn reduced(view: &View, side: u32) -> View {
    let [width, height] = view.extent();
    let rows = height.div_ceil(side);
    View::new(*view.camera(), (width * rows).div_ceil(height), rows).unwrap().with_clip(*view.clip())
}

/// Cubic convolution (Keys 1981, a = -1/2) of an image that shows the same height with fewer pixels, limited to the range of the
/// nearest four.
fn upsampled(small: &Image, [width, height]: [u32; 2]) -> Image {
    let weight = |x: f64| match x.abs() {
        x if x < 1.0 => (1.5 * x - 2.5) * x * x + 1.0,
        x if x < 2.0 => ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0,
        _ => 0.0,
    };
    let scale = f64::from(small.height()) / f64::from(height);
    let place = |at: u32, side: u32, small: u32| {
        (f64::from(at) + 0.5 - f64::from(side) * 0.5) * scale + f64::from(small) * 0.5 - 0.5
    };
    let texel = |x: f64, y: f64| {
        let inside = |at: f64, side: u32| at.clamp(0.0, f64::from(side - 1)) as u32;
        small.pixel(inside(x, small.width()), inside(y, small.height()))
    };
    let pixel = |x: u32, y: u32, channel: usize| {
        let [x, y] = [place(x, width, small.width()), place(y, height, small.height())];
        let (mut sum, mut range) = (0.0, [f64::INFINITY, f64::NEG_INFINITY]);
        for j in -1..3 {
            for i in -1..3 {
                let [u, v] = [x.floor() + f64::from(i), y.floor() + f64::from(j)];
                let value = f64::from(texel(u, v)[channel]);
                sum += weight(x - u) * weight(y - v) * value;
                if (0..2).contains(&i) && (0..2).contains(&j) {
                    range = [range[0].min(value), range[1].max(value)];
                }
            }
        }
        sum.clamp(range[0], range[1]) as f32
    };
    let pixels =
        (0..width * height).map(|i| [0, 1, 2, 3].map(|channel| pixel(i % width, i / width, channel)));
    Image::new(width, height, pixels.collect()).unwrap()
}

/// Every technique with the option draws the pixels of a smaller image of the same view, at sizes that the squares divide or not.
#[test]
fn fewer_pixels_are_drawn_and_upsampled() {
    let gpu = gpu();
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs.iter().filter(|spec| has_option(spec, "resolution")) {
            for (word, side) in [("half", 2), ("quarter", 4)] {
                for [width, height] in taken(2, [[32, 24], [37, 21]]) {
                    let full = view(perspective(), 1.0, width, height);
                    let small = reduced(&full, side);
                    let draw = |spec: &str, view: &View| {
                        Renderer::new(&scene, technique(spec)).render(view).unwrap()
                    };
                    let wanted = upsampled(&draw(spec, &small), [width, height]);
                    let found = draw(&with_option(spec, "resolution", word), &full);
                    let error = ImageErrors::between(&found, &wanted).unwrap().all.max_abs;
                    assert!(error <= 1e-6, "{spec} {word} {width} x {height}: {error:e}");
                }
            }
        }
    }
}

/// Clip planes cut the fewer pixels, and a plan of them turns.
#[test]
fn upsampled_images_are_clipped_and_turn() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, cut::mesh());
    let [first, ..] = cut::views();
    let [width, height] = first.extent();
    let clip = Clip::none().with_plane(glam::DVec3::new(0.1, 0.0, 0.0), glam::DVec3::X).unwrap();
    let renderer = |spec: &str| Renderer::new(&scene, technique(spec));
    let mut frames = renderer("havs:resolution=half").frames(&first.with_clip(clip)).unwrap();
    for degrees in [0.0, 25.0] {
        let camera = first.camera().orbit(degrees).unwrap();
        let turned = View::new(camera, width, height).unwrap().with_clip(clip);
        frames.draw(&turned).unwrap();
        let small = reduced(&turned, 2);
        let wanted = upsampled(&renderer("havs").render(&small).unwrap(), [width, height]);
        let found = frames.read_back().unwrap();
        assert!(ImageErrors::between(&found, &wanted).unwrap().all.max_abs <= 1e-6, "{degrees}");
        assert_eq!(frames.overflow_map().unwrap().unwrap().len(), (width * height) as usize);
    }
}

/// Which pixels of an image show cells between four pixels of `small` beyond whose second differences `refine` lies.
fn redrawn(small: &Image, [width, height]: [u32; 2], refine: f32) -> Vec<bool> {
    let scale = f64::from(small.height()) / f64::from(height);
    let cell = |at: u32, side: u32, small: u32| {
        ((f64::from(at) + 0.5 - f64::from(side) * 0.5) * scale + f64::from(small) * 0.5 - 0.5).floor()
    };
    let texel = |x: f64, y: f64| {
        let inside = |at: f64, side: u32| at.clamp(0.0, f64::from(side - 1)) as u32;
        small.pixel(inside(x, small.width()), inside(y, small.height()))
    };
    let difference = |a: [f32; 4], b: [f32; 4], c: [f32; 4]| {
        (0..4).map(|i| ((a[i] - b[i]) + (c[i] - b[i])).abs()).fold(0.0, f32::max)
    };
    let bends = |x: u32, y: u32| {
        let [x, y] = [cell(x, width, small.width()), cell(y, height, small.height())];
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[i, j]| [x + i, y + j]);
        corners.into_iter().any(|[x, y]| {
            difference(texel(x - 1.0, y), texel(x, y), texel(x + 1.0, y)) > refine
                || difference(texel(x, y - 1.0), texel(x, y), texel(x, y + 1.0)) > refine
        })
    };
    (0..width * height).map(|i| bends(i % width, i / width)).collect()
}

/// With `refine` pixels are drawn all the same where the smaller image bends, to the bit as without `resolution`; the others are
/// upsampled. A plan turns, and clip planes cut both.
#[test]
fn pixels_are_redrawn_where_the_smaller_image_bends() {
    let gpu = gpu();
    let clip = Clip::none().with_plane(glam::DVec3::new(0.3, 0.0, 0.0), glam::DVec3::NEG_X).unwrap();
    let mut drawn = 0;
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs.iter().filter(|spec| has_option(spec, "refine")) {
            for (word, side, refine, clip) in
                [("half", 2, 0.02_f32, Clip::none()), ("quarter", 4, 0.005, clip), ("half", 2, 1e9, clip)]
            {
                let size = [61, 40];
                let refined =
                    with_option(&with_option(spec, "resolution", word), "refine", &refine.to_string());
                // Raster refuses.
                let Ok(refined_technique) = Technique::parse(&refined) else { continue };
                let first = view(perspective(), 1.0, size[0], size[1]).with_clip(clip);
                let mut frames = Renderer::new(&scene, refined_technique).frames(&first).unwrap();
                drawn += 1;
                for degrees in [0.0, 20.0] {
                    let turned = first.with_camera(first.camera().orbit(degrees).unwrap()).unwrap();
                    let draw = |view: &View| Renderer::new(&scene, technique(spec)).render(view).unwrap();
                    let (small, full) = (draw(&reduced(&turned, side)), draw(&turned));
                    let (upsampled, redrawn) = (upsampled(&small, size), redrawn(&small, size, refine));
                    let counters = frames.draw(&turned).unwrap().counters;
                    let found = frames.read_back().unwrap();
                    let what = format!("{refined} at {degrees} degrees");
                    let count = redrawn.iter().filter(|&&redrawn| redrawn).count();
                    assert_eq!(counters, [("redrawn_pixels", count as u64)], "{what}");
                    assert_eq!(refine < 1e9, count > 0 && count < redrawn.len(), "{what}: {count}");
                    for (i, redrawn) in (0..).zip(redrawn) {
                        let [x, y] = [i % size[0], i / size[0]];
                        let (found, wanted) =
                            (found.pixel(x, y), [&upsampled, &full][usize::from(redrawn)].pixel(x, y));
                        let near =
                            (0..4).all(|c| (found[c] - wanted[c]).abs() <= if redrawn { 0.0 } else { 1e-6 });
                        assert!(near, "{what}, pixel {x}, {y}: {found:?}, not {wanted:?}");
                    }
                }
            }
        }
    }
    assert!(drawn >= if exhaustive() { 12 } else { 6 }, "{drawn}");
}

/// A plan turns where drawing all pixels would take several dispatches, and drawing fewer takes one.
#[test]
fn plans_of_several_dispatches_turn() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(volraster::scene::Field::Blobs, 24, "f32", &FOG));
    let view = view(perspective(), 1.0, 512, 512);
    let spec = "raycast:step=0.008,resolution=quarter,refine=0.1";
    let mut plan = Renderer::new(&scene, technique(spec)).prepare(&view, &TargetDesc::own()).unwrap();
    let steps = plan.steps();
    let times =
        |pass: &str| steps.iter().find(|step| step.starts_with(pass)).map(|step| step.contains("(2 times)"));
    assert_eq!([times("raycast.march:"), times("raycast.redraw:")], [Some(false), Some(true)], "{steps:?}");
    assert!(plan.set_view(&view).unwrap());
}

/// `refine` needs fewer pixels, and a route that draws single ones.
#[test]
fn refinement_has_its_conditions() {
    let refused = |spec: &str| Technique::parse(spec).unwrap_err().to_string();
    assert!(refused("slabs:refine=0.1").contains("resolution"));
    assert!(refused("slabs:resolution=half,refine=0.1,route=raster").contains("compute"));
    assert!(refused("slices-3d:resolution=half,refine=0.1,dither=blue,target=rgba8").contains("compute"));
    assert!(refused("slabs:resolution=half,refine=0").contains("positive"));
    assert!(refused("shear-warp:refine=0.1").contains("refine"));
}

/// Where the volume fills the image, wide or high, the error is small up to its edges.
#[test]
fn upsampled_images_reach_the_edges() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(volraster::scene::Field::Blobs, 24, "f32", &FOG));
    for [width, height] in [[240, 21], [21, 240], [97, 65]] {
        let view = view(perspective(), 0.1, width, height);
        let draw = |spec: &str| Renderer::new(&scene, technique(spec)).render(&view).unwrap();
        for (word, bound) in [("half", 0.02), ("quarter", 0.05)] {
            let upsampled = draw(&format!("slabs:resolution={word}"));
            let error = ImageErrors::between(&upsampled, &draw("slabs")).unwrap().all.max_abs;
            assert!(error <= bound, "{width} x {height} {word}: {error:e}");
        }
    }
}

/// Edges of surfaces and of a depth image would blur: both are refused.
#[test]
fn edges_of_other_images_need_every_pixel() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, cut::mesh());
    let [view, ..] = cut::views();
    let format = volraster::ash::vk::Format::R8G8B8A8_UNORM;
    let target = TargetDesc::caller(format, volraster::TargetMode::Over);
    let renderer = Renderer::new(&scene, technique("havs:resolution=quarter"));
    let why = renderer.prepare(&view, &target.with_depth()).unwrap_err().to_string();
    assert!(why.contains("resolution") && why.contains("depth image"), "{why}");
    renderer.prepare(&view, &target).unwrap();
}
