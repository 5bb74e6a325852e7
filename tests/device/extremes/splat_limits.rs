//! Splats that are too small, too large, too many, without a size or a weight; images of every shape; frames that repeat.

use glam::{DMat3, DVec2, DVec3};
use volraster::GpuScene;
use volraster::gpu::GpuOptions;
use volraster::scene::{Camera, KernelSize, Kernels, Model, Points, Projection, Scene, View};
use volraster::technique::{Renderer, Technique};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::splats::*;
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("many splats", CASES);

const NO_STOP: &[(&str, &str)] = &[("stop", "0")];

/// Every pixel's opacity is the closed form's; where that is nothing, nothing is drawn.
fn covered(image: &volraster::Image, view: &View, balls: &[Ball], bound: f64) -> Result<(), String> {
    for (i, pixel) in pixels(view) {
        let got = f64::from(image.pixels()[i][3]);
        let want = opacity(depth(balls, view, pixel, 3.0));
        near(&format!("at {pixel}"), got, want, bound)?;
        // At the rim itself float32 may see the one or the other.
        let beyond = balls.iter().all(|ball| {
            depth(&[Ball { sigma: ball.sigma * (1.0 + 1e-5), ..*ball }], view, pixel, 3.0) == 0.0
        });
        if (want > 1e-4 && got == 0.0) || (beyond && got != 0.0) {
            return Err(format!("at {pixel}: {got}, not {want}"));
        }
    }
    Ok(())
}

/// One splat on the corner of four tiles, from smaller than a pixel to the whole image.
fn tiles(run: &mut Run<'_>) {
    // Pixels of 0.1: tiles meet at 0, 0 and at ±0.8.
    let projection = Projection::Orthographic { half_height: 1.6 };
    let camera = Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 32, 32).unwrap();
    for radius in [0.049, 0.0708, 0.16, 0.81, 9.0] {
        let balls = [
            Ball::new(DVec3::ZERO, radius / 3.0, 1.0 / radius),
            Ball::new(DVec3::new(0.8, -0.8, 0.3), radius / 3.0, 1.0 / radius),
        ];
        by(run, &EXACT, &scene_of(&balls, 3.0, fog(1.0)), &view, NO_STOP, |_, frame| {
            covered(&frame.image, &view, &balls, 1e-5).map_err(|wrong| format!("radius {radius}: {wrong}"))
        });
    }
}

/// A few splats in an image of any shape.
fn image(run: &mut Run<'_>, [width, height]: [u32; 2], modes: &[Mode]) {
    let balls = cloud(1.0, DVec3::ZERO);
    let half_height = 1.1 * (f64::from(height) / f64::from(width)).min(1.0);
    let projection = Projection::Orthographic { half_height };
    let eye = DVec3::new(0.013, 0.0271, 5.0);
    let view =
        View::new(Camera { eye, target: eye - DVec3::Z, up: DVec3::Y, projection }, width, height).unwrap();
    by(run, modes, &scene_of(&balls, 3.0, fog(1.0)), &view, NO_STOP, |_, frame| {
        covered(&frame.image, &view, &balls, 1e-5)
    });
}

/// Points with what shows nothing among them: the same, to the bit, as where their weight is 0.
fn odd_values(run: &mut Run<'_>) {
    let balls = cloud(1.0, DVec3::ZERO);
    let view = view(perspective(), 1.0, 20, 20);
    let tf = transfer(&[[0.0, 0.1, 0.9, 0.4, 1.0], [1.0, 0.3, 0.6, 0.9, 2.0]]);
    let weights: Vec<f32> = balls.iter().map(|ball| ball.tau as f32).collect();
    let scalars: Vec<f32> = (0..12).map(|i| i as f32 / 12.0).collect();
    let sizes: Vec<f32> = balls.iter().map(|ball| (3.0 * ball.sigma) as f32).collect();
    let make = |scalars: &[f32], weights: &[f32], sizes: &[f32]| {
        let points = Points::new(balls.iter().map(|ball| ball.centre).collect()).unwrap();
        let points = points.with_scalars(scalars.to_vec()).unwrap().with_weights(weights.to_vec()).unwrap();
        Scene::new(points.with_size(KernelSize::Radii(sizes.to_vec())).unwrap(), tf.clone())
    };
    let put = |list: &[f32], value: f32| {
        let mut list = list.to_vec();
        // In the middle of sizes: neither bounds nor the median change.
        list[3] = value;
        list
    };
    let without = make(&scalars, &put(&weights, 0.0), &sizes);
    let mut same = vec![
        ("weight NaN", make(&scalars, &put(&weights, f32::NAN), &sizes), &without),
        ("weight -1", make(&scalars, &put(&weights, -1.0), &sizes), &without),
        ("scalar NaN", make(&put(&scalars, f32::NAN), &weights, &sizes), &without),
    ];
    let [low, high] = [0.0, 1.0].map(|s| make(&put(&scalars, s), &weights, &sizes));
    same.push(("scalar infinite", make(&put(&scalars, f32::INFINITY), &weights, &sizes), &high));
    same.push(("scalar negative infinite", make(&put(&scalars, f32::NEG_INFINITY), &weights, &sizes), &low));
    let [none, nan] = [0.0, f32::NAN].map(|r| make(&scalars, &weights, &put(&sizes, r)));
    same.push(("size NaN", nan, &none));
    for (what, odd, plain) in &same {
        let plain = GpuScene::new(run.gpu, (*plain).clone());
        let odd = GpuScene::new(run.gpu, odd.clone());
        for mode in &EXACT {
            let spec = spec_of(mode);
            let images = [&plain, &odd].map(|scene| run.frame(scene, &view, &spec, mode.1));
            let [Some(a), Some(b)] = images else { continue };
            if let Err(wrong) = finite(&b.image).and_then(|()| equal(what, &a.image, &b.image)) {
                run.fail(format!("{mode:?}: {wrong}"));
            }
        }
    }
}

/// Nothing shows: weights of 0, no transfer, the camera looks away.
fn empty(run: &mut Run<'_>) {
    let balls = cloud(1.0, DVec3::ZERO);
    let weightless: Vec<Ball> = balls.iter().map(|ball| Ball { tau: 0.0, ..*ball }).collect();
    let away = look(DVec3::Z * 5.0, DVec3::Z * 9.0, DVec3::Y, 42.0, 9);
    let past = look(DVec3::Z * 5.0, DVec3::X * 9.0, DVec3::Y, 20.0, 9);
    let front = through(9, 9);
    for (balls, tau, view) in
        [(&weightless, 1.0, &front), (&balls, 0.0, &front), (&balls, 1.0, &away), (&balls, 1.0, &past)]
    {
        by(run, &EXACT, &scene_of(balls, 3.0, fog(tau)), view, &[], |_, frame| {
            let drawn = frame.image.pixels().iter().find(|p| **p != [0.0; 4]);
            drawn.map_or(Ok(()), |p| Err(format!("{p:?} is not nothing")))
        });
    }
}

/// Discs and needles up to a condition of 1e12 against the reference, and among them covariances that are none.
fn covariances(run: &mut Run<'_>) {
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -0.8, 1.3);
    let of = |diagonal: DVec3, turn: DMat3| {
        let s = turn * DMat3::from_diagonal(diagonal) * turn.transpose();
        [s.x_axis.x, s.x_axis.y, s.x_axis.z, s.y_axis.y, s.y_axis.z, s.z_axis.z].map(|x| x as f32)
    };
    let one = DMat3::IDENTITY;
    // Variances, with extinctions that make them visible: the depth of a disc is its thickness.
    let kernels: [([f32; 6], f32); 10] = [
        (of(DVec3::splat(0.02), one), 2.0),
        (of(DVec3::new(0.02, 0.02, 2e-14), one), 2e6),
        (of(DVec3::new(0.02, 0.02, 2e-6), turn), 300.0),
        (of(DVec3::new(0.05, 5e-4, 5e-4), turn), 30.0),
        (of(DVec3::new(0.02, 2e-8, 0.02), one), 1e3),
        ([0.02, 0.0, 0.0, 0.0, 0.0, 0.0], 2.0),
        ([0.0; 6], 2.0),
        ([0.02, 0.04, 0.0, 0.02, 0.0, 0.02], 2.0),
        ([f32::NAN; 6], 2.0),
        (of(DVec3::new(0.02, 0.02, 2e-30), one), 2.0),
    ];
    let places =
        (0..10).map(|i| DVec3::new(f64::from(i % 3) - 1.0, f64::from(i / 3) * 0.6 - 1.0, 0.2 * f64::from(i)));
    let points = Points::new(places.collect()).unwrap();
    let points = points.with_size(KernelSize::Covariances(kernels.iter().map(|k| k.0).collect())).unwrap();
    let scene = Scene::new(points.with_weights(kernels.iter().map(|k| k.1).collect()).unwrap(), fog(1.0));
    let scene = scene.with_kernels(Kernels { cut: 6.0, ..Kernels::of_points() }).unwrap();
    for view in [view(perspective(), 1.0, 40, 32), view(orthographic(), 1.0, 40, 32)] {
        let truth = truth(&scene, &view);
        // In parallel lines affine footprints are exact.
        let ellipses = if view.is_perspective() { &[][..] } else { &[ELLIPSES] };
        by(run, &[&EXACT, ellipses].concat(), &scene, &view, NO_STOP, |_, frame| {
            finite(&frame.image)?;
            for (i, pixel) in pixels(&view) {
                // A rotated disc's covariance has 2^-24 of its largest variance: 6e-8 / 1e-4 of the smallest.
                near(&format!("at {pixel}"), frame.image.pixels()[i][3].into(), truth.pixels()[i][3], 2e-3)?;
            }
            Ok(())
        });
    }
}

/// All in a plane across the view: the same order for the same input, and for the reverse the same sum.
fn equal_depths(run: &mut Run<'_>) {
    let mut next = random(17);
    let balls: Vec<Ball> = (0..60).map(|_| Ball::new(DVec3::new(next(), next(), 0.0), 0.15, 2.0)).collect();
    let reversed: Vec<Ball> = balls.iter().rev().copied().collect();
    let projection = Projection::Orthographic { half_height: 1.2 };
    let camera = Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 24, 24).unwrap();
    let scenes =
        [&balls, &balls, &reversed].map(|balls| GpuScene::new(run.gpu, scene_of(balls, 3.0, fog(1.0))));
    for mode in &EXACT {
        let images = [0, 1, 2].map(|i| run.frame(&scenes[i], &view, &spec_of(mode), mode.1));
        let [Some(a), Some(again), Some(reverse)] = images else { continue };
        run.check(a.image == again.image, || format!("{mode:?}: not the same image again"));
        let off = apart(&a.image, &reverse.image);
        run.check(off < t32(60.0), || format!("{mode:?}: {off:e} apart in reverse"));
    }
}

/// Room for so few entries that the image is drawn in many bands: the same, to the bit.
fn bands(run: &mut Run<'_>) {
    let mut next = random(23);
    let balls: Vec<Ball> =
        (0..300).map(|_| Ball::new(DVec3::new(next(), next(), next()), 0.08, 3.0)).collect();
    let view = view(perspective(), 1.0, 60, 45);
    let scene = GpuScene::new(run.gpu, scene_of(&balls, 3.0, fog(1.0)));
    for mode in &EXACT {
        let options = [mode.1, &[("pairs", "200")]].concat();
        let images = [mode.1, &options].map(|options| run.frame(&scene, &view, &spec_of(mode), options));
        let [Some(whole), Some(parts)] = images else { continue };
        let count = parts.counter("bands").unwrap_or(0);
        run.check(count > 3, || format!("{mode:?}: {count} bands"));
        if let Err(wrong) = equal("bands", &whole.image, &parts.image) {
            run.fail(format!("{mode:?}: {wrong}"));
        }
    }
}

/// Splats a tenth of a pixel wide, wherever in a pixel they lie: their sum of opacities over the image is that of their
/// footprints, `2 pi sigma² Ein(peak)`.
fn below_a_pixel(run: &mut Run<'_>) {
    let (side, pixel) = (16_u32, 0.1);
    let sigma = 0.1 * pixel;
    let mut next = random(29);
    let mut balls = Vec::new();
    // Every eighth pixel of 128, each somewhere else in it.
    for y in 0..side {
        for x in 0..side {
            let at =
                DVec2::new(f64::from(x), f64::from(y)) * 8.0 + 4.0 + 0.5 * DVec2::new(next(), next()) - 64.0;
            let place = DVec3::new(at.x * pixel, at.y * pixel, 0.1 * next());
            balls.push(Ball::new(place, sigma, 5.0 / (sigma * (2.0 * std::f64::consts::PI).sqrt())));
        }
    }
    let projection = Projection::Orthographic { half_height: 64.0 * pixel };
    let camera = Camera { eye: DVec3::Z * 50.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 128, 128).unwrap();
    // Ein by its series.
    let (mut ein, mut term) = (0.0, 1.0);
    for k in 1..60 {
        term *= -5.0 / f64::from(k);
        ein -= term / f64::from(k);
    }
    let want = f64::from(side * side) * 2.0 * std::f64::consts::PI * (sigma / pixel).powi(2) * ein;
    let scene = scene_of(&balls, 6.0, fog(1.0));
    for filter in ["auto", "full"] {
        let mode = [(volraster::technique::Method::SplatEwa, &[("footprint", "ewa")] as &[_])];
        by(run, &mode, &scene, &view, &[("stop", "0"), ("filter", filter)], |_, frame| {
            let sum: f64 = frame.image.pixels().iter().map(|p| f64::from(p[3])).sum();
            println!("61c {filter}: {sum} of {want}");
            near("sum of opacities", sum / want, 1.0, 1e-2)
        });
    }
}

/// Seventy thousand splats in one tile: more than a loop has turns on some devices, which draw them in several rounds. Others need one
/// or two.
fn crowded(run: &mut Run<'_>) {
    let count = 70_000;
    let mut next = random(31);
    let balls: Vec<Ball> =
        (0..count).map(|_| Ball::new(DVec3::new(0.3 * next(), 0.3 * next(), next()), 0.02, 3e-3)).collect();
    let projection = Projection::Orthographic { half_height: 0.35 };
    let camera = Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 8, 8).unwrap();
    let scene = scene_of(&balls, 3.0, fog(1.0));
    let draw = |run: &mut Run<'_>, limited: bool| {
        by(run, &EXACT, &scene, &view, NO_STOP, |_, frame| {
            let rounds = frame.counter("rounds").unwrap_or(0);
            if (limited && rounds < 2) || (!limited && rounds > 2) {
                return Err(format!("{rounds} rounds"));
            }
            // A pixel sees one in twenty.
            covered(&frame.image, &view, &balls, t32(4000.0))
        });
    };
    let limited = run.gpu.loop_limit().is_ok_and(|limit| limit != u32::MAX);
    draw(run, limited);
    run.on(GpuOptions { loop_limit: Some(40_000), ..GpuOptions::default() }, |run| draw(run, true));
}

/// The same frame, a hundred times, by each mode and model.
fn repeated(run: &mut Run<'_>) {
    let mut next = random(37);
    let balls: Vec<Ball> =
        (0..200).map(|_| Ball::new(DVec3::new(next(), next(), next()), 0.12, 1.0)).collect();
    let view = view(perspective(), 1.0, 20, 18);
    let scalars: Vec<f32> = (0..200).map(|i| i as f32 / 200.0).collect();
    let points = points_of(&balls).with_scalars(scalars).unwrap();
    for model in [Model::Density, Model::Interpolate] {
        let scene = Scene::new(points.clone(), transfer(&FOG));
        let scene = scene.with_kernels(Kernels { model, ..Kernels::of_points() }).unwrap();
        let scene = GpuScene::new(run.gpu, scene);
        let whole = |mode: &&Mode| model == Model::Density || EXACT[2..].contains(mode);
        for mode in EXACT.iter().filter(whole) {
            let spec = spec_of(mode);
            let Some(first) = run.frame(&scene, &view, &spec, mode.1) else { continue };
            let technique = Technique::parse(&spec.with(mode.1)).unwrap();
            let mut frames = Renderer::new(&scene, technique).frames(&view).unwrap();
            for i in 1..100 {
                frames.draw(&view).unwrap();
                if frames.read_back().unwrap() != first.image {
                    run.fail(format!("{mode:?}: frame {i} differs"));
                    break;
                }
            }
        }
    }
}

const CASES: &[Case] = &[
    Case {
        number: "44g",
        name: "splats in images of 1 x 1, 1 x 64, 17 x 13, 33 x 7",
        expect: "closed form, also in the last row and column",
        tolerance: "1e-5",
        run: |run| {
            for size in [[1, 1], [1, 64], [17, 13], [33, 7]] {
                image(run, size, &EXACT);
            }
        },
    },
    Case {
        number: "44h",
        name: "splats in images of 16384 x 1 and 1 x 16384",
        expect: "closed form",
        tolerance: "1e-5",
        run: |run| {
            image(run, [16384, 1], &EXACT);
            image(run, [1, 16384], &EXACT[..1]);
        },
    },
    Case {
        number: "45",
        name: "splats on the corners of tiles, of half a pixel to the whole image",
        expect: "closed form; exactly 0 where it is 0",
        tolerance: "1e-5",
        run: tiles,
    },
    Case {
        number: "46",
        name: "covariances of condition up to 1e12, of rank 1, zero, indefinite, NaN",
        expect: "the reference; nothing",
        tolerance: "2e-3",
        run: covariances,
    },
    Case {
        number: "24c",
        name: "weights negative and NaN, scalars NaN and infinite, sizes 0 and NaN",
        expect: "the image without them, or with the last knot's scalar",
        tolerance: "exact",
        run: odd_values,
    },
    Case {
        number: "7b",
        name: "splats of no weight, no extinction, out of sight",
        expect: "0",
        tolerance: "exact",
        run: empty,
    },
    Case {
        number: "48",
        name: "all splats at one depth, and in reverse",
        expect: "the same image",
        tolerance: "exact; t32(60)",
        run: equal_depths,
    },
    Case {
        number: "50",
        name: "capacity for 200 tile entries",
        expect: "the same image, in bands",
        tolerance: "exact",
        run: bands,
    },
    Case {
        number: "61c",
        name: "256 splats of a tenth of a pixel, filtered",
        expect: "their opacity in all",
        tolerance: "1e-2",
        run: below_a_pixel,
    },
    Case {
        number: "66b",
        name: "70,000 splats in one tile",
        expect: "closed form, in one round or several",
        tolerance: "t32(4000)",
        run: crowded,
    },
    Case {
        number: "67b",
        name: "the same frame of splats 100 times",
        expect: "the same image",
        tolerance: "exact",
        run: repeated,
    },
];
