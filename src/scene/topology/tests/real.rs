//! Faces, seams and outlines of meshes from files.

use super::super::Topology;
use super::check;
use crate::io;
use crate::scene::Tets;

/// Reads a file of the shared data; `None` if it is missing.
pub(crate) fn shared_mesh(name: &str) -> Option<Tets> {
    let root = std::env::var_os("VOLRASTER_DATA").map_or_else(
        || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        std::path::PathBuf::from,
    );
    let path = root.join("unstructured").join(name);
    if !path.exists() {
        eprintln!("skipped: {} is missing", path.display());
        return None;
    }
    let loaded = io::read(&path, &io::ReadOptions::within(1 << 30)).unwrap();
    let io::Data::Mesh(mesh) = loaded.data else { panic!("{name} is no mesh") };
    Some(mesh)
}

/// Real meshes, by ascending size.
pub(crate) const REAL: [&str; 9] = [
    "tiny_tets_ascii.vtk",
    "tiny_quadratic_tets.vtu",
    "post_small.vtk",
    "can_crush_hex.vtu",
    "bracket_quadratic.vtu",
    "aneurysm_flow.vtu",
    "bluntfin_tets.vtu",
    "combustor_tets.vtu",
    "lox_post_tets.vtu",
];

#[test]
fn real_meshes_lose_no_face() {
    for name in REAL {
        let Some(mesh) = shared_mesh(name) else { continue };
        let start = std::time::Instant::now();
        let found = Topology::new(&mesh).unwrap();
        let took = start.elapsed();
        let topology = check(&mesh);
        println!(
            "{name}: {} cells, {} faces, {} on the outline, {} seams, {} split, {:.0} ms",
            mesh.cells().len(),
            found.faces().len(),
            topology.outline().len(),
            topology.seams().len(),
            topology.split(),
            took.as_secs_f64() * 1e3
        );
        let wanted = match name {
            // Only the points coincide at the seam of the O-grid: the diagonals of its quadrilaterals differ
            // on either side.
            "lox_post_tets.vtu" => (27676, 0, 0),
            // Points coincide at the wall.
            "bluntfin_tets.vtu" => (13438, 39, 0),
            // Crushed cells overlap.
            "can_crush_hex.vtu" => (7682, 0, 161),
            "combustor_tets.vtu" => (15616, 0, 0),
            _ => continue,
        };
        assert_eq!((topology.outline().len(), topology.seams().len(), topology.split()), wanted, "{name}");
    }
}
