//! What differs on GPUs, on a software driver: the order of workgroups, coarse filter weights.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::common::*;
use volraster::GpuScene;
use volraster::choice::{self, Goal, Profile};
use volraster::gpu::GpuOptions;
use volraster::scene::Field;

/// No image depends on the order in which workgroups run.
#[test]
fn own_device_permuted_workgroups_change_nothing() {
    for as_hardware in [false, true] {
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
fn own_device_coarse_weights_are_measured_and_avoided() {
    let coarse = gpu_with(GpuOptions { emulate_filter_weights: true, ..GpuOptions::default() });
    // Half of the last bit.
    let error = coarse.filter_error().unwrap();
    assert!((error - 0.5 / 256.0).abs() < 2e-5, "{error:e}");
    let fine = gpu();
    let scene = scene(Field::MarschnerLobb, 40, "f32", &SHELLS);
    let view = view(perspective(), 1.0, 96, 72);
    let rmse = |gpu, filter: &str| {
        let spec = format!("slabs:step=0.0625,integrator=exact,filter={filter}");
        errors(&draw(gpu, &scene, &view, &spec), &scene, &view).all.rmse
    };
    let [hardware, exact] = ["hardware", "exact"].map(|filter| rmse(&coarse, filter));
    assert!(hardware > 1.2 * exact && hardware < 3e-4 && exact < 8e-5, "{hardware:e}, {exact:e}");
    if fine.filter_error().unwrap() < 1e-4 {
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
