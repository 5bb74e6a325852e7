//! Draws a stereo pair side by side, two plans recorded together, and prints what that costs beside one eye and beside two frames.
//!
//!     cargo run --release --example stereo -- assets/head.json out/stereo.png slices-3d:step=0.5 0.06

use std::time::Instant;

use volraster::ash::vk;
use volraster::glam::DVec2;
use volraster::io::scene_file::LoadedScene;
use volraster::io::{self, ReadOptions};
use volraster::scene::{Camera, View};
use volraster::{
    Error, Gpu, GpuScene, Image, Offscreen, Plan, Renderer, Result, TargetDesc, TargetMode, Technique,
};

fn invalid(what: &str, why: impl Into<String>) -> Error {
    Error::Invalid { what: what.into(), why: why.into() }
}

/// Returns the views of the left and the right eye, `apart` times their distance from the target. Their images show the target at the
/// same place: the eyes look in parallel, and each image is moved.
fn eyes(camera: &Camera, [width, height]: [u32; 2], apart: f64) -> Result<[View; 2]> {
    let middle = View::new(*camera, width, height)?;
    let distance = camera.eye.distance(camera.target);
    let eye = |side: f64| {
        let aside = side * 0.5 * apart * distance;
        let moved = Camera {
            eye: camera.eye + middle.right() * aside,
            target: camera.target + middle.right() * aside,
            ..*camera
        };
        View::new(moved, width, height)?.offset(DVec2::new(aside / distance / middle.pixel_size(), 0.0))
    };
    Ok([eye(-1.0)?, eye(1.0)?])
}

/// Returns the median of the milliseconds that several frames take, each until the host has its pixels, and the last ones.
fn timed(mut frame: impl FnMut() -> Result<Vec<u8>>) -> Result<(f64, Vec<u8>)> {
    let mut times = Vec::new();
    let mut bytes = frame()?;
    for _ in 0..9 {
        let begin = Instant::now();
        bytes = frame()?;
        times.push(1e3 * begin.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok((times[times.len() / 2], bytes))
}

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (Some(scan), Some(picture)) = (arguments.first(), arguments.get(1)) else {
        return Err(invalid("usage", "stereo SCENE|DATA PICTURE [TECHNIQUE] [APART]"));
    };
    let apart: f64 = match arguments.get(3) {
        Some(number) => number.parse().map_err(|_| invalid("apart", format!("\"{number}\"")))?,
        None => 0.06,
    };
    let loaded = LoadedScene::load_any(scan, &ReadOptions::default())?;
    let technique = match arguments.get(2) {
        Some(name) => Technique::parse(name)?,
        None => Technique::default_for(&loaded.scene)?,
    };

    let gpu = Gpu::headless()?;
    println!("{}", gpu.report().name);
    let extent = [loaded.width, loaded.height];
    let views = eyes(&loaded.camera, extent, apart)?;
    let scene = GpuScene::new(&gpu, loaded.scene);
    let renderer = Renderer::new(&scene, technique);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let target = TargetDesc::caller(format, TargetMode::Over).in_part();
    let prepare = |view: &View| renderer.prepare(view, &target);
    let draw = |image: &mut Offscreen, views: &[View], plans: &mut [Plan]| -> Result<Vec<u8>> {
        // Pages come in after a few turns.
        for _ in 0..1000 {
            image.draw_beside(&mut plans.iter_mut().collect::<Vec<_>>(), [0.0; 4])?;
            let (status, bytes) = image.finish()?;
            if status.complete {
                return Ok(bytes);
            }
            for (plan, view) in plans.iter_mut().zip(views) {
                if !plan.load()? {
                    *plan = prepare(view)?;
                }
            }
        }
        Err(invalid(
            "scene",
            "does not fit the device: an eye begins anew while the other goes on".to_string(),
        ))
    };
    let mut plans = [prepare(&views[0])?, prepare(&views[1])?];
    let mut pair = Offscreen::new(&gpu, format, [2 * extent[0], extent[1]])?;
    let mut single = Offscreen::new(&gpu, format, extent)?;
    let (together, bytes) = timed(|| draw(&mut pair, &views, &mut plans))?;
    let [left, right] = &mut plans;
    let mut eye = |i: usize, plan: &mut Plan| draw(&mut single, &views[i..=i], std::slice::from_mut(plan));
    let (one, _) = timed(|| eye(0, left))?;
    let (both, _) = timed(|| eye(0, left).and_then(|_| eye(1, right)))?;
    println!(
        "one eye {one:.2} ms, one after the other {both:.2} ms, together {together:.2} ms: {:.2} times one eye",
        together / one
    );

    let numbers: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect();
    let pixels = numbers.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
    io::write_image(picture, &Image::new(2 * extent[0], extent[1], pixels)?, loaded.background)
}
