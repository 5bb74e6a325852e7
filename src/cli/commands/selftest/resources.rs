//! Resources that are created, replaced and released: image sizes, uploads, transfer functions, scalars.

use std::sync::Arc;

use volraster::gpu::GpuOptions;
use volraster::scene::TetScalars;
use volraster::{GpuScene, Image, Renderer};

use super::subject::{VIEWS, view};
use super::workbench::{Stop, Trial, Verdict, Workbench, fail};

fn same(what: &str, a: &Image, b: &Image) -> std::result::Result<(), Stop> {
    let bits =
        |image: &Image| -> Vec<[u32; 4]> { image.pixels().iter().map(|p| p.map(f32::to_bits)).collect() };
    if bits(a) == bits(b) { Ok(()) } else { fail(format!("{what}: the images differ")) }
}

/// Compares a scene that shares uploads with the same scene uploaded anew.
fn as_anew(trial: &Trial, what: &str, scene: &Arc<GpuScene>) -> Verdict {
    let anew = GpuScene::new(&trial.gpu, scene.scene().clone());
    same(what, &trial.draw(scene)?, &trial.draw(&anew)?)?;
    Ok("as uploaded anew".to_string())
}

/// Draws other image sizes, down to one pixel, and the first size again.
pub(super) fn resize(workbench: &Workbench, spec: &str) -> Verdict {
    let trial = Trial::new(workbench, spec)?;
    let scene = trial.scene()?;
    let first = trial.draw(&scene)?;
    for size in [[1, 1], [7, 65], [64, 8]] {
        let image = Renderer::new(&scene, trial.technique).render(&view(VIEWS[0], size)?)?;
        if [image.width(), image.height()] != size || image.pixels().iter().flatten().any(|v| !v.is_finite())
        {
            return fail(format!("{} x {}: wrong size or not finite", size[0], size[1]));
        }
    }
    same("the first size again", &first, &trial.draw(&scene)?)?;
    Ok("4 sizes".to_string())
}

/// Compares another transfer function over the same upload with a new upload.
pub(super) fn transfer(workbench: &Workbench, spec: &str) -> Verdict {
    let trial = Trial::new(workbench, spec)?;
    let scene = trial.scene()?;
    let before = trial.draw(&scene)?;
    let other = scene.with_transfer(trial.subject.other_transfer()?);
    let summary = as_anew(&trial, "over the same samples", &other)?;
    same("the first transfer function again", &trial.draw(&scene)?, &before)?;
    Ok(summary)
}

/// Checks that a dropped scene releases its memory, and that a new upload draws the same image.
pub(super) fn upload(workbench: &Workbench, spec: &str) -> Verdict {
    let trial = Trial::new(workbench, spec)?;
    let mut images = Vec::new();
    for _ in 0..3 {
        images.push(trial.image()?);
        let held = trial.gpu.memory_report();
        if !held.is_empty() {
            return fail(format!("memory is still allocated after the scene was dropped: {held:?}"));
        }
    }
    same("the second upload", &images[0], &images[1])?;
    same("the third upload", &images[0], &images[2])?;
    Ok("3 times".to_string())
}

/// Compares other scalars over the same mesh with a new upload.
pub(super) fn scalars(workbench: &Workbench, spec: &str) -> Verdict {
    let trial = Trial::new(workbench, spec)?;
    let scene = trial.scene()?;
    trial.draw(&scene)?;
    let Some(mesh) = scene.scene().mesh() else { return fail("no mesh") };
    let turned = mesh.scalars().values().iter().map(|scalar| 1.0 - scalar).collect();
    let other = scene.with_scalars(TetScalars::Point(turned), trial.subject.other_transfer()?)?;
    as_anew(&trial, "over the same points", &other)
}

/// Checks that a command buffer per pass draws the same image.
pub(super) fn passes(workbench: &Workbench, spec: &str) -> Verdict {
    let image = Trial::new(workbench, spec)?.image()?;
    let by_pass = workbench.open(GpuOptions { command_buffer_by_pass: true, ..GpuOptions::default() })?;
    same("by pass", &Trial::on(by_pass, spec)?.image()?, &image)?;
    Ok("as in one command buffer".to_string())
}
