//! Draws a scan from all around, frame by frame with one plan, using the library without the program.
//!
//!     cargo run --release --example turntable -- assets/head.json out 36 slices-3d:step=0.5

use std::path::PathBuf;

use volraster::io::scene_file::LoadedScene;
use volraster::io::{self, ReadOptions};
use volraster::scene::View;
use volraster::{Error, Gpu, GpuScene, Renderer, Result, Technique};

fn invalid(what: &str, why: impl Into<String>) -> Error {
    Error::Invalid { what: what.into(), why: why.into() }
}

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (Some(scan), Some(folder)) = (arguments.first(), arguments.get(1)) else {
        return Err(invalid("usage", "turntable SCENE|DATA FOLDER [FRAMES] [TECHNIQUE]"));
    };
    let frames: u32 = match arguments.get(2) {
        Some(number) => number.parse().map_err(|_| invalid("frames", format!("\"{number}\"")))?,
        None => 36,
    };
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder).map_err(|source| Error::Io {
        path: folder.clone(),
        action: "cannot create",
        source,
    })?;
    let loaded = LoadedScene::load_any(scan, &ReadOptions::default())?;
    let technique = match arguments.get(3) {
        Some(name) => Technique::parse(name)?,
        None => Technique::default_for(&loaded.scene)?,
    };

    let gpu = Gpu::headless()?;
    println!("{}", gpu.report().name);
    let scene = GpuScene::new(&gpu, loaded.scene);
    let renderer = Renderer::new(&scene, technique);
    let first = View::new(loaded.camera, loaded.width, loaded.height)?;
    let mut plan = renderer.frames(&first)?;
    for frame in 0..frames {
        let camera = loaded.camera.orbit(360.0 * f64::from(frame) / f64::from(frames))?;
        let time = plan.draw(&View::new(camera, loaded.width, loaded.height)?)?;
        let path = folder.join(format!("turntable-{frame:03}.png"));
        io::write_image(&path, &plan.read_back()?, loaded.background)?;
        println!("{}: {:.1} ms", path.display(), time.wall_ms);
    }
    Ok(())
}
