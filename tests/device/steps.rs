//! The passes of frames, as the documents list them.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use crate::common::*;
use volraster::scene::{Field, Scene, TransferFunction};
use volraster::technique::Renderer;
use volraster::{GpuScene, TargetDesc};

/// `docs/TECHNIQUES.md` lists the passes of small scenes. Devices other than a software rasteriser sort by other digits.
#[test]
fn the_document_lists_the_passes_of_frames() {
    let gpu = gpu();
    let grid = GpuScene::new(&gpu, scene(Field::Blobs, 16, "f32", &FOG));
    let transfer = TransferFunction::from_rows(&FOG).unwrap();
    let mesh = GpuScene::new(&gpu, Scene::new(Field::Blobs.tets(3).unwrap(), transfer));
    let points = GpuScene::new(&gpu, cut::points());
    let view = view(perspective(), 1.0, 40, 30);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/TECHNIQUES.md");
    let mut document = std::fs::read_to_string(&path).unwrap();
    let written = document.clone();
    for (name, scene) in [("slabs", &grid), ("shear-warp", &grid), ("havs", &mesh), ("splat-ewa", &points)] {
        let plan = Renderer::new(scene, technique(name)).prepare(&view, &TargetDesc::own()).unwrap();
        let steps = plan.steps();
        assert!(!steps.is_empty() && steps.iter().all(|step| step.contains("writes")), "{name}: {steps:#?}");
        let mark = format!("<!-- steps of {name} -->\n");
        let (before, rest) = document.split_once(&mark).unwrap();
        let (_, after) = rest.split_once("<!-- end -->\n").unwrap();
        document = format!("{before}{mark}```text\n{}\n```\n<!-- end -->\n{after}", steps.join("\n"));
    }
    if std::env::var_os("VOLRASTER_WRITE_STEPS").is_some() {
        std::fs::write(&path, document).unwrap();
        return;
    }
    let remake = "VOLRASTER_WRITE_STEPS=1 tools/test.sh -- lists_the_passes writes it";
    let usual = gpu.is_software() && !emulates("as-hardware");
    assert!(!usual || document == written, "docs/TECHNIQUES.md lists other passes; {remake}");
}
