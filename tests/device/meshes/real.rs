//! Meshes from files, where they are there.

use std::collections::BTreeMap;
use std::path::Path;

use volraster::GpuScene;
use volraster::io::ReadOptions;
use volraster::io::scene_file::LoadedScene;
use volraster::measure::ImageErrors;
use volraster::scene::{Camera, Field, Projection, View};
use volraster::technique::Renderer;

use crate::common::*;
use crate::meshes::support::*;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/unstructured");

/// The automatic camera, parallel from another side, and from inside.
fn cameras(camera: Camera) -> [Camera; 3] {
    let away = camera.eye - camera.target;
    let side = Projection::Orthographic { half_height: away.length() * 0.25 };
    [
        camera,
        Camera { eye: camera.orbit(100.0).unwrap().eye, projection: side, ..camera },
        Camera { eye: camera.target + away * 0.05, projection: perspective(), ..camera },
    ]
}

/// Both techniques on every mesh against the reference: RMSE, and the share of pixels that are wrong in the third digit.
/// Every pixel is as opaque as the reference has it, so that there are neither holes nor specks.
///
/// In `can_crush_hex` deformed bodies reach into each other by up to a thousandth of their size: pieces of a line overlap, and no order
/// of cells is right for all of it. `havs` and `abuffer` sort the pieces of each pixel; `projected-tets` drops relations and says so.
fn assert_files(gpu: &volraster::Gpu, side: u32) {
    let Ok(files) = std::fs::read_dir(FOLDER) else {
        println!("skipped: no {FOLDER}");
        return;
    };
    let mut files: Vec<_> = files.map(|file| file.unwrap().path()).filter(|path| path.is_file()).collect();
    files.sort();
    assert!(!files.is_empty());
    for path in files {
        let loaded = LoadedScene::from_data(&path, &ReadOptions::default()).unwrap();
        let on_gpu = GpuScene::new(gpu, loaded.scene.clone());
        for (i, camera) in cameras(loaded.camera).into_iter().enumerate() {
            let view = View::new(camera, side, side).unwrap();
            let truth = truth(&loaded.scene, &view);
            let mean = truth.pixels().iter().map(|p| p[3]).sum::<f64>() / f64::from(side * side);
            assert!(mean > 1e-3, "{}: nothing to see", path.display());
            for spec in ["abuffer", "havs", "havs:order=back-to-front", "projected-tets"] {
                let drawn = Drawn::new(&on_gpu, &view, spec);
                let errors = ImageErrors::between_f64(&drawn.image, &truth).unwrap();
                let off = |bound: f64| {
                    let pairs = drawn.image.pixels().iter().zip(truth.pixels());
                    pairs.filter(|(p, t)| difference(**p, **t) > bound).count()
                };
                let what = format!(
                    "{} {} {spec}",
                    Path::new(path.file_name().unwrap()).display(),
                    ["front", "side", "inside"][i]
                );
                println!("{what}: {errors}; {} above 1e-3; {:?}", off(1e-3), drawn.counters);
                assert!(errors.all.rmse <= 5e-6, "{what}: {errors}");
                assert_eq!(off(1e-3), 0, "{what}: pixels above 1e-3");
                assert_eq!(errors.non_finite, 0, "{what}");
                assert_eq!(drawn.counter("nan_keys"), 0, "{what}");
            }
        }
    }
}

#[test]
#[ignore = "make test-all: data that is not part of the project"]
fn real_meshes_in_small() {
    assert_files(&gpu(), 64);
}

#[test]
#[ignore = "takes minutes"]
fn real_meshes() {
    assert_files(&gpu(), 256);
}

/// Times of the passes of one technique, `SPEC`, on 34³ cubes.
#[test]
#[ignore = "a figure, not a check"]
fn measure_cubes() {
    let gpu = volraster::Gpu::headless().unwrap();
    let on_gpu = GpuScene::new(&gpu, cubes(Field::Blobs, 34, &FOG));
    let view = view(perspective(), 1.0, 512, 512);
    let spec = std::env::var("SPEC").unwrap_or("havs".into());
    let mut frames = Renderer::new(&on_gpu, technique(&spec)).frames(&view).unwrap();
    let mut walls = Vec::new();
    let mut passes: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for i in 0..12 {
        let time = frames.draw(&view).unwrap();
        if i < 2 {
            if i == 0 {
                println!("{:?}", time.counters);
            }
            continue;
        }
        walls.push(time.wall_ms);
        let mut sums: BTreeMap<String, f64> = BTreeMap::new();
        for pass in time.passes {
            *sums.entry(pass.name).or_default() += pass.ms;
        }
        for (name, ms) in sums {
            passes.entry(name).or_default().push(ms);
        }
    }
    walls.sort_by(f64::total_cmp);
    println!("wall median {:.1} min {:.1}", walls[walls.len() / 2], walls[0]);
    for (name, mut times) in passes {
        times.sort_by(f64::total_cmp);
        println!("{name:30} {:.2}", times[times.len() / 2]);
    }
}
