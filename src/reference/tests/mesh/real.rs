//! Meshes from files: images against brute force, and pieces that meet.

use super::*;
use crate::io::{self, ReadOptions};
use crate::scene::Data;

/// A real mesh, if its file exists.
fn real(name: &str) -> Option<Tets> {
    let path = format!("{}/../shared/data/unstructured/{name}", env!("CARGO_MANIFEST_DIR"));
    if !std::path::Path::new(&path).exists() {
        eprintln!("skipped: no {path}");
        return None;
    }
    match io::read(path, &ReadOptions::default()).unwrap().data {
        Data::Mesh(mesh) => Some(mesh),
        _ => panic!("{name} is no mesh"),
    }
}

/// Bluntfin: cells of very different sizes, coincident points, dropped cells without volume.
#[test]
#[ignore = "make test-all: data that is not part of the project"]
fn a_real_mesh_equals_brute_force() {
    let Some(mesh) = real("bluntfin_tets.vtu") else { return };
    let [lo, hi] = mesh.range();
    let rows = FOG.map(|[s, r, g, b, tau]| [lo + (hi - lo) * s, r, g, b, tau]);
    let scene = mesh_scene(mesh, &rows);
    let mesh = scene.mesh().unwrap();
    // Each ray meets every cell: 16² once, and a few pixels of the other views.
    for view in views(mesh, [16, 16]).into_iter().take(1).chain(views(mesh, [7, 6]).into_iter().skip(1)) {
        let image = render(&scene, &view, &ReferenceOptions::default(), None).unwrap();
        equals_brute_force(&image, &scene, &view, 1);
        assert!(image.pixels().iter().filter(|pixel| pixel[3] > 0.01).count() > 10);
    }
}

/// Cells of a curvilinear grid share faces: along any ray they neither overlap nor leave gaps inside.
#[test]
fn pieces_of_real_meshes_meet() {
    for name in ["bluntfin_tets.vtu", "combustor_tets.vtu", "lox_post_tets.vtu"] {
        let Some(mesh) = real(name) else { continue };
        let [low, high] = mesh.bounds();
        let size = (high - low).length();
        let scene = homogeneous(&mesh, 1.0);
        let mut random = Random(17);
        let (mut met, mut apart) = (0, 0);
        for _ in 0..40 {
            let (a, b) = (random.in_box(low, high), random.in_box(low, high));
            let found = pieces(&scene, a, b - a, EVERYWHERE).unwrap();
            for pair in found.windows(2) {
                let gap = pair[1].t[0] - pair[0].t[1];
                assert!(gap > -1e-13 * size, "{name}: cells {pair:?} overlap by {:e}", -gap);
                met += u32::from(gap < 1e-13 * size);
                apart += u32::from(gap >= 1e-13 * size);
            }
        }
        println!("{name}: {met} pieces meet, {apart} are apart");
        assert!(met > 1000 && apart < met / 200, "{name}: {met} pieces meet, {apart} are apart");
    }
}
