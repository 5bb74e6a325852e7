//! temporary
#![allow(clippy::unwrap_used, reason = "temporary")]
mod common;
use common::*;
use volraster::scene::Field;
use volraster::gpu::{Gpu, GpuOptions};
use volraster::technique::{GpuScene, Renderer, Technique};
#[test]
fn perf() {
    let gpu = Gpu::new(&GpuOptions { no_pipeline_cache: true, ..Default::default() }).unwrap();
    let scene = scene(Field::MarschnerLobb, 128, "f32", &SHELLS);
    let view = view(perspective(), 1.0, 512, 512);
    let gscene = GpuScene::new(&gpu, scene.clone());
    for spec in std::env::var("SPECS").unwrap_or("route=raster;route=compute".into()).split(';') {
        let t = Technique::parse(&format!("slices-3d:{spec}")).unwrap();
        let mut frames = Renderer::new(&gscene, t).frames(&view).unwrap();
        frames.draw(&view).unwrap();
        let cpu = || { let t = std::fs::read_to_string("/proc/self/stat").unwrap(); let f: Vec<f64> = t.rsplit(')').next().unwrap().split_whitespace().skip(11).take(2).map(|x| x.parse().unwrap()).collect(); (f[0] + f[1]) * 10.0 };
        let before = cpu();
        let mut times: Vec<f64> = (0..9).map(|_| frames.draw(&view).unwrap().wall_ms).collect();
        times.sort_by(f64::total_cmp);
        println!("CPU {:.0} ms a frame; {} {spec}: min {:.1} median {:.1} max {:.1} ms", (cpu() - before) / 9.0, gpu.report().driver, times[0], times[4], times[8]);
    }
}
