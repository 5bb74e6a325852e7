//! Formats that raster accumulates in, early ends, opaque first layers, brightness.

use glam::DVec3;
use volraster::gpu::OptionalFeature;
use volraster::scene::{Scene, View};

use crate::extremes::catalogue::{Case, Family, Run, Spec};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("targets", CASES);

const LAYERS: u32 = 10_000;

/// Nearest float of 11 significant bits, or the one towards zero. Normal numbers only.
fn half(x: f64, nearest: bool) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    let quantum = (x.log2().floor().max(-14.0) - 10.0).exp2();
    let steps = x / quantum;
    quantum * if nearest { steps.round_ties_even() } else { steps.floor() }
}

/// What is left of a value stored in a format.
fn stored(target: &str, x: f64, nearest: bool) -> f64 {
    let most = match target {
        "rgba8" => 255.0,
        "rgba16" => 65535.0,
        "rgba16f" => return half(x, nearest),
        _ => return f64::from(x as f32),
    };
    (x.clamp(0.0, 1.0) * most).round() / most
}

/// Opacity front to back and a colour of 0.8 back to front, every blend stored.
fn blended(target: &str, order: &str, nearest: bool) -> f64 {
    let share = opacity(1.0 / f64::from(LAYERS));
    (0..LAYERS).fold(0.0, |sum, _| {
        let next = if order == "front-to-back" {
            sum + (1.0 - sum) * share
        } else {
            0.8 * share + (1.0 - share) * sum
        };
        stored(target, next, nearest)
    })
}

/// The table of the notes on numerics, od 1 in 10,000 layers: what a model of blending loses in this format, within a
/// fifth. The model stores every blend: to nearest, or, as drivers may with half floats, towards zero. How the blend
/// itself is rounded before it is stored is the device's affair, where the share of a layer is a few steps of the
/// format: a 10,000th is 6.6 steps of 16 bits, of which half a step is 8 %. It is off by no more than half a step a
/// layer, and the growth stops where a layer's share is below that.
fn layers(run: &mut Run<'_>, target: &str) {
    if target == "rgba32f" && !run.gpu.has(OptionalFeature::BlendRgba32f) {
        return;
    }
    let transfer = transfer(&[[0.0, 0.8, 0.8, 0.8, 0.5]]);
    let scene = Scene::new(grid([2; 3], DVec3::NEG_ONE, DVec3::ONE, |_| 0.5), transfer);
    let step = format!("{}", 1.0 / f64::from(LAYERS));
    for (order, channel, factor) in [("front-to-back", 3, 1.0), ("back-to-front", 0, 0.8)] {
        let want = factor * opacity(1.0);
        let models = [true, false].map(|nearest| blended(target, order, nearest));
        let claims = |spec: &Spec| spec.has("target") && spec.route == "raster";
        let options: &[(&str, &str)] = &[("step", &step), ("order", order), ("target", target)];
        run.only(claims, &scene, &through(2, 2), options, |_, frame| {
            let got = f64::from(frame.image.pixel(1, 1)[channel]);
            if target == "rgba32f" {
                return near("blended", got, want, t32(LAYERS.into()));
            }
            let off = |model: f64| (got - model).abs() <= 0.2 * (model - want).abs();
            // Half a step of 65,535 for each of the layers' blends, as the loss goes on: the equilibrium of a share s
            // less half a step q/2 instead of s is off by q / (2 s) = 7.6 % of the colour.
            let rounded =
                target == "rgba16" && (got - want).abs() <= 1.2 * want * 0.5 / 65535.0 / opacity(1e-4);
            if models.into_iter().any(off) || rounded {
                Ok(())
            } else {
                Err(format!(
                    "{order}: {got} of {want}; stored to nearest it would be {}, towards zero {}",
                    models[0], models[1]
                ))
            }
        });
    }
}

/// Rounded at random, the mean over 4,096 pixels is exact: within 3 standard errors of the largest noise, 0.06 of
/// eight bits.
fn dithered(run: &mut Run<'_>) {
    let scene = Scene::new(grid([2; 3], DVec3::NEG_ONE, DVec3::ONE, |_| 0.5), fog(0.5));
    let view = through(64, 64);
    let mut differ = 0;
    for word in ["alpha", "blue"] {
        let claims = |spec: &Spec| spec.has("dither") && spec.route == "raster" && spec.integrator != "full";
        let options: &[(&str, &str)] =
            &[("step", "0.00390625"), ("target", "rgba8"), ("dither", word), ("seed", "5")];
        run.only(claims, &scene, &view, options, |_, frame| {
            let pixels = frame.image.pixels();
            let mean = pixels.iter().map(|p| f64::from(p[3])).sum::<f64>() / pixels.len() as f64;
            differ += usize::from(pixels.iter().any(|p| p[3] != pixels[0][3]));
            near("mean opacity", mean, opacity(1.0), 3.0 * 0.06 / 64.0)
        });
    }
    run.check(differ > 0, || "nothing is noisy".to_string());
}

/// What is behind an opaque layer does not show, to the bit.
fn hidden(run: &mut Run<'_>) {
    // Dense in front, where z is above 0; two different pasts behind.
    let rows = [
        [0.0, 0.1, 0.9, 0.4, 0.7],
        [1.0, 0.9, 0.2, 0.1, 2.0],
        [1.0, 0.3, 0.6, 0.9, 1e9],
        [2.0, 0.3, 0.6, 0.9, 1e9],
    ];
    let behind =
        |scale: f64| move |p: DVec3| if p.z >= 0.0 { 2.0 } else { scale * (0.5 - 0.3 * p.z + 0.2 * p.x) };
    let (a, b) = (scenes(4, &transfer(&rows), behind(1.0)), scenes(4, &transfer(&rows), behind(0.3)));
    for (a, b) in a.iter().zip(&b) {
        for step in ["0.25", "1"] {
            let options: &[(&str, &str)] = &[("step", step)];
            run.pairs([a, b], [&through(5, 5), &through(5, 5)], [options; 2], |_, a, b| {
                let opaque = a.pixels().iter().all(|p| p[3] == 1.0);
                if opaque { equal("behind", a, b) } else { Err(format!("opacity {}", a.pixel(2, 2)[3])) }
            });
        }
    }
}

/// A ray that ends early is off by no more than what it says, in colours up to 1.
fn early(run: &mut Run<'_>, stop: f64) {
    let transfer = ramp(1.0, 9.0);
    for scene in scenes(8, &transfer, affine) {
        let text = format!("{stop}");
        let mut ends = 0;
        let options: [&[(&str, &str)]; 2] =
            [&[("step", "0.1"), ("stop", &text)], &[("step", "0.1"), ("stop", "0")]];
        let view = through(6, 6);
        run.every_pair([&scene; 2], [&view; 2], options, |_, early, whole| {
            ends += usize::from(apart(early, whole) > 0.0);
            near("off by", apart(early, whole), 0.0, stop + 2e-6)
        });
        run.check(ends > 0, || format!("{stop} ends nothing"));
    }
}

/// Twice the colour is twice the image: to the bit, because a power of two rounds nothing.
fn brighter(run: &mut Run<'_>) {
    let rows = [[0.0, 0.1, 0.4, 0.3, 0.2], [0.6, 0.5, 0.2, 0.1, 2.0], [1.0, 0.3, 0.5, 0.4, 5.0]];
    let twice = rows.map(|[s, r, g, b, tau]| [s, 2.0 * r, 2.0 * g, 2.0 * b, tau]);
    let view: View = through(5, 5);
    let options: &[(&str, &str)] = &[("step", "0.1")];
    for (a, b) in scenes(4, &transfer(&rows), affine).iter().zip(&scenes(4, &transfer(&twice), affine)) {
        run.every_pair([a, b], [&view; 2], [options; 2], |_, a, b| {
            let same = |(a, b): (&[f32; 4], &[f32; 4])| [2.0 * a[0], 2.0 * a[1], 2.0 * a[2], a[3]] == *b;
            let right = a.pixels().iter().zip(b.pixels()).all(same);
            if right { Ok(()) } else { Err(format!("{:?} and {:?}", a.pixel(2, 2), b.pixel(2, 2))) }
        });
    }
}

const CASES: &[Case] = &[
    Case {
        number: "30a",
        name: "10,000 layers into rgba8",
        expect: "what storing each blend leaves: nothing",
        tolerance: "20 % of the loss",
        run: |run| layers(run, "rgba8"),
    },
    Case {
        number: "30b",
        name: "10,000 layers into rgba16",
        expect: "what storing each blend leaves",
        tolerance: "20 % of the loss, or 1.2 half steps a layer",
        run: |run| layers(run, "rgba16"),
    },
    Case {
        number: "30c",
        name: "10,000 layers into rgba16f",
        expect: "what storing each blend leaves, to nearest or towards zero",
        tolerance: "20 % of the loss",
        run: |run| layers(run, "rgba16f"),
    },
    Case {
        number: "30d",
        name: "10,000 layers into rgba32f",
        expect: "1 - 1/e",
        tolerance: "t32(1e4)",
        run: |run| layers(run, "rgba32f"),
    },
    Case {
        number: "32",
        name: "the first layers are opaque",
        expect: "what lies behind has no effect",
        tolerance: "exact",
        run: hidden,
    },
    Case {
        number: "33a",
        name: "rays that end at 1e-2",
        expect: "off by 1e-2 at most",
        tolerance: "2e-6",
        run: |run| early(run, 1e-2),
    },
    Case {
        number: "33b",
        name: "rays that end at 1e-3",
        expect: "off by 1e-3 at most",
        tolerance: "2e-6",
        run: |run| early(run, 1e-3),
    },
    Case {
        number: "33c",
        name: "rays that end at 1e-4",
        expect: "off by 1e-4 at most",
        tolerance: "2e-6",
        run: |run| early(run, 1e-4),
    },
    Case {
        number: "65",
        name: "256 layers into rgba8, rounded at random",
        expect: "the mean is exact",
        tolerance: "2.8e-3, three standard errors",
        run: dithered,
    },
    Case {
        number: "5.1",
        name: "twice the colour",
        expect: "twice the image",
        tolerance: "exact",
        run: brighter,
    },
];
