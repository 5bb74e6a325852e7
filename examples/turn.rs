//! Draws a scan from eight sides with one plan: the library without the program.
//!
//!     cargo run --release --example turn -- assets/head.json out

use std::path::PathBuf;

use volraster::io::{self, ReadOptions};
use volraster::scene::file::LoadedScene;
use volraster::{Error, Gpu, GpuScene, Renderer, Result, Technique};

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(scan), Some(folder)) = (arguments.next(), arguments.next()) else {
        return Err(Error::Invalid { what: "usage".into(), why: "turn SCENE|DATA FOLDER".into() });
    };
    let (scan, folder) = (PathBuf::from(scan), PathBuf::from(folder));
    std::fs::create_dir_all(&folder).map_err(|source| Error::Io {
        path: folder.clone(),
        action: "cannot create",
        source,
    })?;
    let loaded = LoadedScene::load_any(&scan, &ReadOptions::default())?;

    let first = loaded.view(loaded.width, loaded.height)?;

    let gpu = Gpu::headless()?;
    println!("{}", gpu.report().name);
    let scene = GpuScene::new(&gpu, loaded.scene);
    let renderer = Renderer::new(&scene, Technique::parse("slices-3d:step=0.5")?);
    let mut frames = renderer.frames(&first)?;
    for side in 0..8_u8 {
        let camera = loaded.camera.orbit(45.0 * f64::from(side))?;
        let time = frames.draw(&first.with_camera(camera)?)?;
        let path = folder.join(format!("turn-{side}.png"));
        io::write_image(&path, &frames.read_back()?, loaded.background)?;
        println!("{}: {:.1} ms", path.display(), time.wall_ms);
    }
    Ok(())
}
