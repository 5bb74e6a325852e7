//! Properties of GPUs on a software driver: another order of workgroups, coarse filter weights, frames in flight.

#![allow(clippy::unwrap_used, clippy::cast_precision_loss, reason = "a test fails by panicking")]

use crate::common::*;
use glam::DVec3;
use volraster::GpuScene;
use volraster::choice::{self, Goal, Profile};
use volraster::gpu::{Gpu, GpuOptions, OptionalFeature, PipelineCache};
use volraster::measure::ImageErrors;
use volraster::scene::{Camera, Data, Field, View};
use volraster::technique::{OptionInfo, Renderer, Technique};

/// No image depends on the order in which workgroups run.
#[test]
fn permuted_workgroups_change_nothing() {
    for as_hardware in taken(2, [false, true]) {
        let [plain, permuted] = [false, true]
            .map(|permute| gpu_with(GpuOptions { permute, as_hardware, ..GpuOptions::default() }));
        let view = view(perspective(), 1.0, 53, 41);
        for ((scene, specs), (other, _)) in every_kind(&plain).into_iter().zip(every_kind(&permuted)) {
            for spec in specs {
                assert_eq!(draw_on(&scene, &view, &spec), draw_on(&other, &view, &spec), "{spec}");
            }
        }
    }
}

/// Weights of 8 bits cost at most what they are expected to, nothing with exact fetches, and a goal below their error is met by these.
#[test]
fn coarse_weights_are_measured_and_avoided() {
    let coarse = gpu_with(GpuOptions { emulate_filter_weights: true, ..GpuOptions::default() });
    let fine = gpu();
    // Half of the last bit; a device that rounds as coarsely itself may be off by a bit more.
    let error = coarse.filter_error().unwrap();
    let is_fine = fine.filter_error().unwrap() < 1e-4;
    let most = if is_fine { 0.5 } else { 1.5 };
    assert!((0.5 / 256.0 - 2e-5..most / 256.0 + 2e-5).contains(&error), "{error:e}");
    let scene = scene(Field::MarschnerLobb, 40, "f32", &SHELLS);
    let view = view(perspective(), 1.0, 96, 72);
    let rmse = |gpu, filter: &str| {
        let spec = format!("slabs:step=0.0625,integrator=exact,filter={filter}");
        errors(&draw(gpu, &scene, &view, &spec), &scene, &view).all.rmse
    };
    let [hardware, exact] = ["hardware", "exact"].map(|filter| rmse(&coarse, filter));
    assert!(hardware > 1.2 * exact && hardware < 3e-4 && exact < 8e-5, "{hardware:e}, {exact:e}");
    if is_fine {
        assert!((rmse(&fine, "hardware") - exact).abs() < 0.2 * exact);
    }
    let chosen = |goal| {
        let on_gpu = GpuScene::new(&coarse, scene.clone());
        let choice = choice::choose(&on_gpu, &view, Goal::MaxError(goal), &Profile::built_in()).unwrap();
        choice.trials[choice.chosen].spec.clone()
    };
    let (below, above) = (chosen(8.5e-5), chosen(2e-3));
    assert!(below.contains("filter=exact") && !above.contains("filter=exact"), "{below}, {above}");
}

/// Two frames in flight are those that are drawn one after the other.
#[test]
fn two_frames_in_flight_are_the_same_as_one() {
    let gpu = gpu();
    let views = [1.0, 0.9, 1.1].map(|distance| view(perspective(), distance, 53, 41));
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs {
            let alone: Vec<_> = views.iter().map(|view| draw_on(&scene, view, &spec)).collect();
            let renderer = Renderer::new(&scene, technique(&spec));
            let [mut first, mut second] = [0, 1].map(|i| renderer.frames(&views[i]).unwrap());
            first.start(&views[0]).unwrap();
            second.start(&views[1]).unwrap();
            assert!(first.start(&views[2]).unwrap_err().to_string().contains("finish it first"));
            first.finish().unwrap();
            assert_eq!(first.read_back().unwrap(), alone[0], "{spec}");
            first.start(&views[2]).unwrap();
            second.finish().unwrap();
            assert_eq!(second.read_back().unwrap(), alone[1], "{spec}");
            first.finish().unwrap();
            assert_eq!(first.read_back().unwrap(), alone[2], "{spec}");
            assert!(first.finish().unwrap_err().to_string().contains("no frame was started"));
            // A frame that is never finished.
            second.start(&views[0]).unwrap();
        }
    }
}

/// Resident memory of this process, in bytes.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
    1024 * line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap()
}

/// Memory and times of frames of turning data, without a layer: `VOLRASTER_FRAMES` frames.
#[test]
#[ignore = "prints figures"]
fn measure_turning() {
    let count: u32 = std::env::var("VOLRASTER_FRAMES").map_or(2000, |text| text.parse().unwrap());
    let gpu = Gpu::new(&GpuOptions { pipeline_cache: PipelineCache::Off, ..GpuOptions::default() }).unwrap();
    for (scene, specs) in every_kind(&gpu) {
        for spec in specs {
            let view_at = |i: u32| {
                let (sin, cos) = (f64::from(i) * 0.01).sin_cos();
                let base = camera(perspective(), 1.0);
                let eye = DVec3::new(
                    base.eye.x * cos + base.eye.z * sin,
                    base.eye.y,
                    base.eye.z * cos - base.eye.x * sin,
                );
                View::new(Camera { eye, ..base }, 64, 48).unwrap()
            };
            let mut frames = Renderer::new(&scene, technique(&spec)).frames(&view_at(0)).unwrap();
            let mut line = String::new();
            let mut begin = 0;
            for part in 0..5 {
                let start = std::time::Instant::now();
                for i in part * count / 5..(part + 1) * count / 5 {
                    frames.draw(&view_at(i)).unwrap();
                }
                let ms = start.elapsed().as_secs_f64() * 5e3 / f64::from(count);
                let now = resident();
                if part == 0 {
                    begin = now;
                }
                line +=
                    &format!(" {ms:.1} ms, {:+.1} MiB;", (now as f64 - begin as f64) / f64::from(1 << 20));
            }
            println!("{spec}:{line} of {} MiB", begin >> 20);
        }
    }
}

/// A device without a feature has the others, and draws the same or refuses by a limit.
#[test]
fn without_features_draws_by_fallbacks() {
    let plain = gpu();
    for feature in taken(3, OptionalFeature::ALL) {
        let gpu = gpu_with(GpuOptions { without: vec![feature], ..GpuOptions::default() });
        for other in OptionalFeature::ALL {
            let follows =
                other == OptionalFeature::OrderedStores && feature == OptionalFeature::FragmentStores;
            assert_eq!(
                gpu.has(other),
                plain.has(other) && other != feature && !follows,
                "{feature:?}, {other:?}"
            );
        }
    }
    let none = gpu_with(GpuOptions::default().emulating("no-features").unwrap());
    assert!(!OptionalFeature::ALL.into_iter().any(|feature| none.has(feature)));
    let view = view(perspective(), 1.0, 53, 41);
    // Volumes of bytes need the filter of 16 bits where that of 8 is coarse.
    let floats = scene(Field::Blobs, 16, "f32", &FOG);
    for ((given, specs), (with_all, _)) in every_kind(&none).into_iter().zip(every_kind(&plain)) {
        let is_grid = matches!(given.scene().data, Data::Grid(_));
        let [given, with_all] = [(&none, given), (&plain, with_all)].map(|(gpu, given)| {
            let mode = given.scene().mode;
            if is_grid { GpuScene::new(gpu, floats.clone().with_mode(mode).unwrap()) } else { given }
        });
        for spec in specs {
            let technique = Technique::parse(&spec).unwrap();
            let has_exact = |info: &OptionInfo| info.key == "filter" && info.words.contains(&"exact");
            // Eight fetches replace a filter that is missing.
            let exact = match technique.method().options().iter().any(has_exact) {
                true => format!("{spec}{}filter=exact", if spec.contains(':') { "," } else { ":" }),
                false => spec.clone(),
            };
            let (image, expected) = (draw_on(&given, &view, &spec), draw_on(&with_all, &view, &exact));
            let errors = ImageErrors::between(&image, &expected).unwrap();
            assert!(errors.non_finite == 0 && errors.all.rmse < 1e-6, "{spec}: {:e}", errors.all.rmse);
        }
    }
}
