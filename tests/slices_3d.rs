//! `slices-3d` against closed forms and the float64 reference, every route.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use common::*;
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceOptions};
use volraster::scene::Field;
use volraster::technique::{GpuScene, Renderer, Technique};

#[test]
fn smoke() {
    let gpu = gpu();
    println!("{:?}", gpu.report());
    let n: u32 = std::env::var("N").map_or(64, |n| n.parse().unwrap());
    let size: u32 = std::env::var("SIZE").map_or(128, |n| n.parse().unwrap());
    let scene = scene(Field::MarschnerLobb, n, "f32", &SHELLS);
    for projection in [perspective(), orthographic()] {
        for distance in [1.0, 0.12] {
            let view = view(projection, distance, size, size);
            let truth = reference::render(&scene, &view, &ReferenceOptions::default(), None).unwrap();
            let gscene = GpuScene::new(&gpu, scene.clone());
            for route in ["raster", "compute"] {
                for filter in ["hardware", "exact"] {
                    for step in ["1", "0.5"] {
                        let t = Technique::parse(&format!("slices-3d:step={step},route={route},filter={filter}")).unwrap();
                        let renderer = Renderer::new(&gscene, t);
                        let mut frames = renderer.frames(&view).unwrap();
                        frames.draw(&view).unwrap();
                        let mut best = f64::INFINITY;
                        for _ in 0..3 { best = best.min(frames.draw(&view).unwrap().wall_ms); }
                        let image = frames.read_back().unwrap();
                        let e = ImageErrors::between_f64(&image, &truth).unwrap();
                        println!("{projection:?} {distance} {route} {filter} {step}: {best:.1} ms {e}");
                    }
                }
            }
        }
    }
}
