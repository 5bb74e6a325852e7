//! Grids and meshes that are larger than the memory they may take: the picture is that of the whole, and memory stays within what was asked for.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a test fails by panicking, and indices are small"
)]

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::time::Instant;

use volraster::io::ReadOptions;
use volraster::io::scene_file::LoadedScene;
use volraster::measure::ImageErrors;
use volraster::reference;
use volraster::scene::{Grid, OnDemand, SampleSource, Samples, Scene, TransferFunction, View};
use volraster::{GpuScene, Image, Result};

use crate::common::{draw_on, gpu};
use crate::folder::Folder;

/// Centres and radii of fog balls in the cube from -1 to 1.
const BALLS: [[f32; 4]; 5] = [
    [0.3, 0.2, -0.1, 0.35],
    [-0.4, 0.1, 0.3, 0.25],
    [0.0, -0.45, 0.2, 0.3],
    [0.2, 0.5, 0.5, 0.2],
    [-0.3, -0.3, -0.5, 0.3],
];

/// Balls of fog with ripples, of `n` samples along each axis: a sum of products of what each axis tells.
#[derive(Debug)]
struct Balls {
    n: u32,
    /// For each axis and index, the factor of each ball and of the ripples.
    factors: [Vec<[f32; 6]>; 3],
}

impl Balls {
    fn new(n: u32) -> Self {
        let factors = [0, 1, 2].map(|axis: usize| {
            let at = |i: u32| {
                let x = i as f32 / (n - 1) as f32 * 2.0 - 1.0;
                let mut all = [(x * 60.0).sin(); 6];
                for (factor, ball) in all.iter_mut().zip(&BALLS) {
                    *factor = (-((x - ball[axis]) / ball[3]).powi(2)).exp();
                }
                all
            };
            (0..n).map(at).collect()
        });
        Self { n, factors }
    }

    fn row(&self, first: u32, y: u32, z: u32, row: &mut [u8]) {
        let (b, c) = (&self.factors[1][y as usize], &self.factors[2][z as usize]);
        let outer: [f32; 6] = std::array::from_fn(|k| b[k] * c[k]);
        for (sample, a) in row.iter_mut().zip(&self.factors[0][first as usize..]) {
            let fog: f32 = (0..5).map(|k| outer[k] * a[k]).sum();
            *sample = (fog * (0.85 + 0.15 * (outer[5] * a[5])) * 255.0).clamp(0.0, 255.0) as u8;
        }
    }

    /// Writes all samples.
    fn write(&self, file: File) {
        let mut out = BufWriter::with_capacity(1 << 22, file);
        let mut row = vec![0; self.n as usize];
        for (z, y) in (0..self.n).flat_map(|z| (0..self.n).map(move |y| (z, y))) {
            self.row(0, y, z, &mut row);
            out.write_all(&row).unwrap();
        }
        out.flush().unwrap();
    }
}

impl SampleSource for Balls {
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> Result<Samples> {
        let mut samples = vec![0; extent.iter().product::<u32>() as usize];
        for (i, row) in samples.chunks_exact_mut(extent[0] as usize).enumerate() {
            let [j, k] = [i as u32 % extent[1], i as u32 / extent[1]];
            self.row(first[0], first[1] + j, first[2] + k, row);
        }
        Ok(Samples::U8(samples))
    }
}

/// Writes the samples to a file, and a scene with them.
fn folder_with(balls: &Balls, size: u32) -> Folder {
    let folder = Folder::new();
    let n = balls.n;
    balls.write(File::create(folder.path("balls.raw")).unwrap());
    folder.write(
        "scene.json",
        format!(
            r#"{{
  "volume": {{"file": "balls.raw", "dims": [{n}, {n}, {n}], "type": "u8", "spacing": [{s}, {s}, {s}], "origin": [-1, -1, -1]}},
  "transfer": [[0, 0.1, 0.2, 0.9, 0], [40, 0.1, 0.2, 0.9, 0], [90, 0.9, 0.5, 0.1, 1.5], [255, 1, 0.9, 0.6, 12]],
  "camera": {{"eye": [2.2, 1.7, 3.1], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 34}},
  "image": {{"width": {size}, "height": {size}}},
  "technique": {{"name": "slabs"}}
}}"#,
            s = 2.0 / f64::from(n - 1)
        ),
    );
    folder
}

/// Root of the mean squared difference of some pixels from the truth, and the greatest.
fn apart(image: &Image, pixels: &[[u32; 2]], truth: &[[f64; 4]]) -> (f64, f64) {
    let of_pixel = |(pixel, truth): (&[u32; 2], &[f64; 4])| {
        let drawn = image.pixel(pixel[0], pixel[1]);
        [0, 1, 2, 3].map(|channel| (f64::from(drawn[channel]) - truth[channel]).abs())
    };
    let errors: Vec<f64> = pixels.iter().zip(truth).flat_map(of_pixel).collect();
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    ((squares / errors.len() as f64).sqrt(), errors.into_iter().fold(0.0, f64::max))
}

/// The grid of 512³ samples is drawn with memory for half of it, by every technique that takes pages, as it is drawn whole.
#[test]
fn half_of_the_memory_gives_the_same_picture() {
    let folder = folder_with(&Balls::new(512), 160);
    for technique in ["slabs", "slices-3d:step=0.5", "raycast:step=1", "slices-2d", "shear-warp"] {
        let render = |more: &str| {
            folder.run(&format!("render scene.json --technique {technique} --validate {more}")).done();
        };
        render("-o whole.exr --stats whole.json");
        render("-o paged.exr --stats paged.json --memory 64MiB");
        let [whole, paged] = ["whole.json", "paged.json"].map(|name| folder.json(name));
        let errors = ImageErrors::between(&folder.exr("paged.exr"), &folder.exr("whole.exr")).unwrap().all;
        let read = paged["counters"]["pages_read"].as_u64().unwrap();
        println!(
            "{technique}: {:.1e}, at most {:.1e}; {read} pages; {}",
            errors.rmse, errors.max_abs, paged["counters"]
        );
        assert!(whole["counters"]["pages_read"].is_null());
        // The coordinates of the filter are rounded otherwise; the sums are of the same terms.
        assert!(errors.rmse < 2e-6 && errors.max_abs < 6e-5, "{technique}: {errors:?}");
        // Several frames are drawn, each of which reads what the one before has replaced.
        assert!((64..=2048).contains(&read), "{technique}: {read} of 512 pages");
    }
}

/// 8 GiB of samples are drawn within 1 GiB of device memory and 2.5 GiB of the process's, as exactly as a small grid.
#[test]
#[ignore = "make test-all: takes 8 GiB of disk and minutes"]
fn a_grid_of_2048_samples_a_side_is_drawn_in_1_gib() {
    const PROBES: u32 = 4096;
    let balls = Balls::new(2048);
    let folder = folder_with(&balls, 1024);
    // A first picture, of an overview.
    let begin = Instant::now();
    let read = ReadOptions { on_demand: Some(0), ..ReadOptions::default() };
    let opened = LoadedScene::load_any(folder.path("scene.json"), &read).unwrap();
    let view = View::new(opened.camera, 1024, 1024).unwrap();
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, opened.scene).overview().unwrap();
    let first = draw_on(&scene, &view, "slabs");
    drop((scene, gpu));
    println!("first picture {:.2} s after opening", begin.elapsed().as_secs_f64());

    let begin = Instant::now();
    folder.run("render scene.json --memory 1GiB -o paged.exr").done();
    println!("complete picture in {:.1} s", begin.elapsed().as_secs_f64());
    let errors = ImageErrors::between(&first, &folder.exr("paged.exr")).unwrap().all;
    println!("the first picture differs from it by {:.1e}, at most {:.1e}", errors.rmse, errors.max_abs);
    // Four times as much as was seen of an overview with a sample for 16 of the grid.
    assert!(errors.rmse < 5e-3, "{errors:?}");
    folder.run("render scene.json --memory 1GiB -o paged.exr --stats paged.json").done();
    let stats = folder.json("paged.json");
    println!("a frame after it: {}; of three: {}", stats["frames"], stats["counters"]);
    let resident = stats["peak_rss_bytes"].as_u64().unwrap();
    assert!(resident <= 5 << 29, "{resident} bytes");

    let whole = OnDemand::new([2048; 3], balls).unwrap();
    let spacing = glam::DVec3::splat(2.0 / 2047.0);
    let grid = Grid::new([2048; 3], Samples::OnDemand(whole)).unwrap();
    let grid = grid.with_placement(spacing, -glam::DVec3::ONE, glam::DMat3::IDENTITY).unwrap();
    let rows = [
        [0.0, 0.1, 0.2, 0.9, 0.0],
        [40.0, 0.1, 0.2, 0.9, 0.0],
        [90.0, 0.9, 0.5, 0.1, 1.5],
        [255.0, 1.0, 0.9, 0.6, 12.0],
    ];
    let scene = Scene::new(grid, TransferFunction::from_rows(&rows).unwrap());
    // Tile by tile, so that neighbouring rays share samples that have been computed.
    let pixels: Vec<[u32; 2]> =
        (0..PROBES).map(|i| [i % 64 * 16 + i / 64 % 16, i / 64 * 16 + i % 16]).collect();
    let truth = reference::pixels(&scene, &view, &pixels).unwrap();
    let (rmse, most) = apart(&folder.exr("paged.exr"), &pixels, &truth);
    println!("rmse {rmse:.2e}, at most {most:.2e}, {resident} bytes resident");
    // Of second order in the slabs, which are thin.
    assert!(rmse < 1e-5 && most < 1.5e-4, "rmse {rmse:.2e}, at most {most:.2e}");
}

/// 20 million tetrahedra, whose faces alone would fill half of it, are drawn within 1 GiB of device memory, as the reference has them.
#[test]
#[ignore = "make test-all: takes minutes"]
fn a_mesh_of_20_million_cells_is_drawn_in_1_gib() {
    const PROBES: u32 = 1024;
    let folder = Folder::new();
    folder.write(
        "scene.json",
        r#"{
  "mesh": {"field": "blobs", "cubes": 159},
  "transfer": [[0, 0.1, 0.2, 0.9, 0.2], [0.3, 0.1, 0.2, 0.9, 0.4], [0.6, 0.9, 0.5, 0.1, 2.5], [1, 1, 0.9, 0.6, 5]],
  "camera": {"eye": [2.2, 1.7, 3.1], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 34},
  "image": {"width": 512, "height": 512}
}"#,
    );
    let begin = Instant::now();
    folder.run("render scene.json --technique havs --memory 1GiB -o parts.exr --stats stats.json").done();
    let stats = folder.json("stats.json");
    println!("{:.1} s; {}; {}", begin.elapsed().as_secs_f64(), stats["frames"], stats["counters"]);
    assert!(stats["counters"]["parts"].as_u64().unwrap() > 1, "{}", stats["counters"]);
    let opened = LoadedScene::load_any(folder.path("scene.json"), &ReadOptions::default()).unwrap();
    assert!(opened.scene.mesh().unwrap().cells().len() > 20_000_000);
    let view = View::new(opened.camera, 512, 512).unwrap();
    let pixels: Vec<[u32; 2]> =
        (0..PROBES).map(|i| [i % 32 * 16 + i / 32 % 16, i / 32 * 16 + i % 16]).collect();
    let truth = reference::pixels(&opened.scene, &view, &pixels).unwrap();
    let (rmse, most) = apart(&folder.exr("parts.exr"), &pixels, &truth);
    println!("rmse {rmse:.2e}, at most {most:.2e}, {} bytes resident", stats["peak_rss_bytes"]);
    // Of the rounding of hundreds of pieces.
    assert!(rmse < 1e-6 && most < 1e-5, "rmse {rmse:.2e}, at most {most:.2e}");
}
