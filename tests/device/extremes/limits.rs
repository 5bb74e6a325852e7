//! What devices limit: bindings, memory, loops, sizes; and frames that repeat.

use glam::DVec3;
use volraster::GpuScene;
use volraster::gpu::GpuOptions;
use volraster::scene::{Camera, Field, Grid, Projection, Samples, Scene, View};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run, Spec};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("limits", CASES);

/// A buffer of which shaders see this much: bands of tiles are drawn one after the other, and the image is the same. (Bits, because
/// what a pixel's line meets does not depend on where its primitives lie; but the shader of `havs` that finds its buffers by address is
/// compiled anew, and contracts other sums.)
fn narrow_bindings(run: &mut Run<'_>) {
    let scene = Scene::new(Field::Blobs.tets(9).unwrap(), transfer(&FOG));
    let view = view(perspective(), 1.0, 96, 80);
    let images: Vec<_> = {
        let on_gpu = GpuScene::new(run.gpu, scene.clone());
        let specs = Spec::all(run.gpu, &scene.data);
        specs.into_iter().map(|spec| (spec.to_string(), run.frame(&on_gpu, &view, &spec, &[]))).collect()
    };
    let mut bands = 0;
    run.on(GpuOptions { storage_range: Some(128 << 10), ..GpuOptions::default() }, |run| {
        run.each(&scene, &view, &[], |spec, frame| {
            bands = bands.max(frame.counter("bands").unwrap_or(0));
            let whole = images.iter().find(|(name, _)| *name == spec.to_string());
            match whole {
                Some((name, Some(whole))) if name.starts_with("havs") => {
                    let off = apart(&frame.image, &whole.image);
                    if off < t32(1.0) { Ok(()) } else { Err(format!("bands: off by {off:e}")) }
                }
                Some((_, Some(whole))) => equal("bands", &frame.image, &whole.image),
                _ => Err("no frame to compare with".to_string()),
            }
        });
    });
    run.check(bands > 1, || format!("{bands} bands"));
}

/// A march of more turns than one dispatch may make, and one of many slabs: split, the same but for what is rounded
/// between two dispatches.
fn short_loops(run: &mut Run<'_>) {
    let scene = Scene::new(grid([5; 3], DVec3::NEG_ONE, DVec3::ONE, affine), ramp(ENDS[0], ENDS[1]));
    let view = through(5, 5);
    let options: &[(&str, &str)] = &[("step", "0.01"), ("filter", "exact")];
    let mut dispatches = 0;
    run.on(GpuOptions { loop_limit: Some(1500), ..GpuOptions::default() }, |run| {
        run.each(&scene, &view, options, |spec, frame| {
            if spec.route == "compute" {
                dispatches = dispatches.max(frame.counter("dispatches_or_draws").unwrap_or(0));
            }
            assert_depths(&frame.image, &view, |_| t32(400.0), |pixel| affine_depth(&view, pixel))
        });
    });
    run.check(dispatches > 3, || format!("{dispatches} dispatches"));
}

/// Less memory than the data needs is refused before the driver is asked, with both numbers.
fn little_memory(run: &mut Run<'_>) {
    let view = view(perspective(), 1.0, 16, 16);
    run.on(GpuOptions { memory_budget: Some(60_000), ..GpuOptions::default() }, |run| {
        for data in kinds(24, affine) {
            let scene = Scene::new(data, ramp(ENDS[0], ENDS[1]));
            let on_gpu = GpuScene::new(run.gpu, scene.clone());
            for spec in run.specs(&scene.data, |_| true) {
                if run.frame(&on_gpu, &view, &spec, &[]).is_some() {
                    run.fail(format!("{spec} drew what does not fit 60,000 bytes"));
                }
            }
        }
    });
}

/// One voxel more along an axis than the device's volumes have.
fn long_grid(run: &mut Run<'_>) {
    let long = run.gpu.max_image_3d() + 1;
    // Affine along the long axis, and a view of its far end.
    let mut values = Vec::new();
    for _ in 0..4 {
        values.extend((0..long).map(|x| (x % 256) as u8));
    }
    let grid = Grid::new([long, 2, 2], Samples::U8(values)).unwrap();
    let grid = grid.with_placement(DVec3::ONE, DVec3::ZERO, glam::DMat3::IDENTITY).unwrap();
    let [r, g, b] = COLOUR;
    let scene = Scene::new(grid, transfer(&[[0.0, r, g, b, 0.1], [255.0, r, g, b, 2.65]]));
    // Pixels whose rays meet samples themselves, not next to a jump from 255 to 0.
    let last = f64::from(long - 1);
    let target = DVec3::new(last - 8.0, 0.5, 0.5);
    let projection = Projection::Orthographic { half_height: 0.5 };
    let camera = Camera { eye: target + DVec3::Z * 5.0, target, up: DVec3::Y, projection };
    let view = View::new(camera, 9, 1).unwrap();
    run.each(&scene, &view, &[("step", "0.5"), ("filter", "exact")], |_, frame| {
        for x in 0..9_u32 {
            let voxel = long - 1 - 8 + x - 4;
            let tau = 0.1 + 0.01 * f64::from(voxel % 256);
            near(
                &format!("voxel {voxel}"),
                frame.image.pixel(x, 0)[3].into(),
                opacity(tau),
                t32(10.0) + 4e-5,
            )?;
        }
        Ok(())
    });
}

/// An image wider than any device's.
fn wide_image(run: &mut Run<'_>) {
    let view = View::new(*through(1, 1).camera(), View::MAX_SIDE, 1).unwrap();
    for scene in scenes(1, &fog(1.0), |_| 0.5) {
        run.each(&scene, &view, &[("step", "4")], |_, frame| {
            let ends = [0, View::MAX_SIDE / 2];
            let [_, middle] = ends.map(|x| f64::from(frame.image.pixel(x, 0)[3]));
            near("opacity", middle, opacity(2.0), t32(6.0))
        });
    }
}

/// The same frame, a hundred times.
fn repeated(run: &mut Run<'_>) {
    let view = view(perspective(), 1.0, 16, 14);
    let data: [volraster::scene::Data; 2] =
        [Field::MarschnerLobb.sample([12; 3], "f32").unwrap().into(), Field::Blobs.tets(4).unwrap().into()];
    for data in data {
        let rows: &[[f64; 5]] = if matches!(data, volraster::scene::Data::Grid(_)) { &SHELLS } else { &FOG };
        let scene = Scene::new(data, transfer(rows));
        let on_gpu = GpuScene::new(run.gpu, scene.clone());
        for spec in run.specs(&scene.data, |_| true) {
            let Some(first) = run.frame(&on_gpu, &view, &spec, &[]) else { continue };
            let renderer = volraster::technique::Renderer::new(&on_gpu, technique(&spec.with(&[])));
            let mut frames = renderer.frames(&view).unwrap();
            for i in 1..if exhaustive() { 100 } else { 6 } {
                frames.draw(&view).unwrap();
                if frames.read_back().unwrap() != first.image {
                    run.fail(format!("{spec}: frame {i} differs"));
                    break;
                }
            }
        }
    }
}

/// From coarse steps to fine ones: the error falls by the rule's order down to a floor of rounding, and stays below
/// what pieces may round. A single cell with a curved scalar; the middle of each step, or a line between its ends: 2.
fn sweep(run: &mut Run<'_>) {
    let corners = vec![0.1, 0.9, 0.8, 0.35, 0.75, 0.2, 0.3, 1.0];
    let grid = Grid::new([2; 3], Samples::F32(corners)).unwrap();
    let grid = grid.with_placement(DVec3::splat(2.0), DVec3::NEG_ONE, glam::DMat3::IDENTITY).unwrap();
    let scene = Scene::new(grid, transfer(&[[0.0, 0.1, 0.9, 0.4, 0.0], [1.0, 0.9, 0.2, 0.5, 3.0]]));
    // Where rounding is all that is left, fewer pixels tell as much.
    let views = [20, 8].map(|side| view(perspective(), 1.0, side, side));
    let truths = views.each_ref().map(|view| truth(&scene, view));
    let on_gpu = GpuScene::new(run.gpu, scene.clone());
    // The 2-D table has an error of its own.
    let claims = |spec: &Spec| spec.has("step") && spec.integrator != "full" && !spec.blurs(&scene.data);
    for spec in run.specs(&scene.data, claims) {
        let mut errors = Vec::new();
        for exponent in 3..=13 {
            // Voxels are 2 wide; so many steps in 2 units.
            let steps = f64::from(exponent).exp2();
            let step = format!("{}", 1.0 / steps);
            let options = [&[("step", step.as_str())], &FINE[1..]].concat();
            let (view, truth) = match exponent {
                ..10 => (&views[0], &truths[0]),
                _ => (&views[1], &truths[1]),
            };
            let Some(frame) = run.frame(&on_gpu, view, &spec, &options) else { continue };
            let mut all: Vec<f64> = pixels(view)
                .filter(|(_, pixel)| chord(view, *pixel) > 0.85)
                .map(|(i, _)| {
                    let pair = frame.image.pixels()[i].into_iter().zip(truth.pixels()[i]);
                    pair.map(|(a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
                })
                .collect();
            all.sort_by(f64::total_cmp);
            let median = all[all.len() / 2];
            errors.push((steps, median));
            // As deep as the cube's diagonal, which is 1.74 times 2 units.
            let floor = t32(1.74 * steps);
            if steps >= 1024.0 && median > floor {
                run.fail(format!("{spec}: {steps} steps: {median:e} is above the floor of {floor:e}"));
            }
        }
        for pair in errors.windows(2) {
            let order = (pair[0].1 / pair[1].1).log2();
            // Above the floor by a factor of ten.
            if pair[1].1 > 2e-5 && (order - 2.0).abs() > 0.3 {
                run.fail(format!("{spec}: order {order} at {} steps: {errors:?}", pair[1].0));
            }
        }
        run.check(errors.first().is_some_and(|first| first.1 > 1e-4), || format!("{spec}: {errors:?}"));
    }
}

const CASES: &[Case] = &[
    Case {
        number: "52",
        name: "shaders see 128 KiB of a buffer",
        expect: "the same image, in bands",
        tolerance: "exact",
        run: narrow_bindings,
    },
    Case {
        number: "66",
        name: "1500 loop iterations per invocation",
        expect: "closed form, in several dispatches",
        tolerance: "t32(400)",
        run: short_loops,
    },
    Case {
        number: "52b",
        name: "60,000 bytes of device memory",
        expect: "refused",
        tolerance: "",
        run: little_memory,
    },
    Case {
        number: "52c",
        name: "one voxel more along an axis than the device allows for a volume",
        expect: "refused, or the closed form",
        tolerance: "t32(10) + 4e-5",
        run: long_grid,
    },
    Case {
        number: "44f",
        name: "image of 32768 x 1",
        expect: "refused, or the closed form",
        tolerance: "t32(6)",
        run: wide_image,
    },
    Case {
        number: "67",
        name: "the same frame 100 times",
        expect: "the same image",
        tolerance: "exact",
        run: repeated,
    },
    Case {
        number: "70",
        name: "2^3 to 2^13 steps",
        expect: "second order down to the floor",
        tolerance: "order 0.3; floor t32",
        run: sweep,
    },
];
