//! The real files, against what their list says of them; families of files that hold the same.

use std::collections::BTreeSet;
use std::path::Path;

use glam::DVec3;
use volraster::io::{Data, ReadOptions, read};
use volraster::scene::{Anatomy, Grid, TetScalars};

use super::support::{grid, mesh, points, shared, shared_loaded, stored};

/// Extents, spacing and range of values of a volume.
type Volume = (&'static str, [u32; 3], [f64; 3], Option<[f64; 2]>);

const VOLUMES: [Volume; 20] = [
    ("structured/bonsai.nii.gz", [256, 256, 256], [1.0; 3], Some([0.0, 255.0])),
    ("structured/engine.nii.gz", [256, 256, 128], [1.0; 3], Some([0.0, 255.0])),
    ("structured/heptane.nii.gz", [302, 302, 302], [1.0; 3], Some([0.0, 255.0])),
    ("structured/fuel.nii.gz", [64, 33, 32], [1.0; 3], Some([0.0, 255.0])),
    ("structured/CT_pitch.nii.gz", [175, 248, 58], [0.8125, 0.8125, 2.397], Some([0.0, 255.0])),
    ("structured/MR_Gd.nii.gz", [176, 188, 144], [0.977, 0.977, 1.003], Some([0.0, 1653.0])),
    ("structured/fetal_T2.nrrd", [117, 159, 126], [0.859; 3], Some([0.0, 710.68])),
    ("structured/tooth/tooth.nhdr", [103, 94, 161], [1.0; 3], None),
    ("structured/iron_protein.vtk", [68, 68, 68], [1.0; 3], Some([0.0, 255.0])),
    ("structured/hydrogen.vti", [64, 64, 64], [1.0; 3], Some([0.0, 1.0])),
    ("structured/viscous_fingers.vti", [64, 64, 64], [1.0; 3], Some([0.0, 110.96])),
    ("structured/head_mr/HeadMRVolume.mhd", [48, 62, 42], [4.0; 3], None),
    ("structured/frog_labels/frogtissue.mhd", [500, 470, 136], [1.0, 1.0, 1.5], Some([0.0, 29.0])),
    ("structured/heart_mask/mask.mhd", [512, 512, 317], [0.361, 0.361, 0.5], Some([0.0, 1.0])),
    ("structured/headsq/quarter.nhdr", [64, 64, 93], [3.2, 3.2, 1.5], Some([0.0, 3926.0])),
    ("structured/mri_head_anisotropic.tif", [186, 226, 27], [0.5, 0.5, 7.0], None),
    ("structured/spots_16bit.tif", [89, 88, 17], [0.094, 0.094, 0.4], Some([208.0, 54004.0])),
    ("format_conformance/head_i16.npy", [64, 64, 40], [1.0; 3], None),
    ("format_conformance/head_i16_be.json", [64, 64, 40], [3.2, 3.2, 1.5], None),
    ("format_conformance/head_i16_imagej.tif", [64, 64, 40], [3.2, 3.2, 1.5], None),
];

#[test]
fn volumes_have_the_extents_spacings_and_ranges_of_the_list() {
    for (name, dims, spacing, range) in VOLUMES {
        let Some(loaded) = shared_loaded(name) else { continue };
        let grid = grid(loaded);
        assert_eq!(grid.dims(), dims, "{name}");
        // The list has three digits.
        let near = (grid.spacing() - DVec3::from_array(spacing)).abs().cmple(DVec3::splat(6e-4));
        assert!(near.all(), "{name}: spacing {}", grid.spacing());
        if let Some([lo, hi]) = range {
            let [a, b] = grid.range();
            assert!((a - lo).abs() < 6e-3 && (b - hi).abs() < 6e-3, "{name}: range {a} to {b}");
        }
    }
}

/// Points, tetrahedra, array and its range; the counts where other cells were split are of this project.
type Mesh = (&'static str, Option<&'static str>, usize, usize, [f64; 2]);

const MESHES: [Mesh; 13] = [
    ("unstructured/bluntfin_tets.vtu", Some("density"), 40_960, 187_395 - 77, [0.1926, 4.9775]),
    ("unstructured/bluntfin_tets.vtu", Some("speed"), 40_960, 187_395 - 77, [0.0, 3.123]),
    ("unstructured/combustor_tets.vtu", Some("density"), 47_025, 215_040, [0.1978, 0.7104]),
    ("unstructured/combustor_tets.vtu", Some("speed"), 47_025, 215_040, [0.0, 1528.9]),
    ("unstructured/lox_post_tets.vtu", Some("speed"), 109_744, 513_375, [0.0, 1.391]),
    ("unstructured/post_small.vtk", None, 2_288, 8_750, [0.355, 1.641]),
    ("unstructured/aneurysm_flow.vtu", Some("p"), 21_332, 63_008 + 3 * 16_748, [-5.38, 369.06]),
    ("unstructured/aneurysm_flow.vtu", Some("Umag"), 21_332, 63_008 + 3 * 16_748, [0.0, 0.522]),
    ("unstructured/bracket_quadratic.vtu", None, 102_578, 8 * 56_786, [0.014, 23.27]),
    ("unstructured/can_crush_hex.vtu", Some("EQPS"), 6_724, 0, [0.0216, 2.894]),
    ("unstructured/tiny_tets_ascii.vtk", None, 55, 160, [f64::NAN; 2]),
    ("unstructured/tiny_quadratic_tets.vtu", None, 189, 8 * 96, [f64::NAN; 2]),
    ("format_conformance/post_small_msh41_bin.msh", None, 2_288, 8_750, [0.355, 1.641]),
];

#[test]
fn meshes_have_the_counts_and_ranges_of_the_list() {
    for (name, array, count, tets, [lo, hi]) in MESHES {
        let Some(path) = shared(name) else { continue };
        let options = ReadOptions { array: array.map(str::to_owned), ..ReadOptions::default() };
        let mesh = mesh(read(&path, &options).unwrap_or_else(|e| panic!("{e}")));
        assert_eq!(mesh.points().len(), count, "{name}");
        if tets > 0 {
            assert_eq!(mesh.cells().len(), tets, "{name}");
        } else {
            // Hexahedra give five or six.
            assert!((5 * 4_800..=6 * 4_800).contains(&mesh.cells().len()), "{name}: {}", mesh.cells().len());
        }
        let [a, b] = mesh.range();
        let near =
            |x: f64, listed: f64| listed.is_nan() || (x - listed).abs() <= 1e-3 * listed.abs().max(1.0);
        assert!(near(a, lo) && near(b, hi), "{name}: range {a} to {b}");
    }
}

#[test]
fn points_have_the_counts_of_the_list() {
    for (name, array, count, range) in [
        ("particles/bunny_fluid_7706.vtk", Some("velocity"), 7_706, Some([0.063, 5.446])),
        ("particles/sailors_knot_19539.vtk", None, 19_539, None),
        ("particles/fluid_encoded_250.vtu", None, 250, None),
        ("particles/dark_matter_halo.npy", None, 32_314, None),
    ] {
        let Some(path) = shared(name) else { continue };
        let options = ReadOptions { array: array.map(str::to_owned), ..ReadOptions::default() };
        let points = points(read(&path, &options).unwrap_or_else(|e| panic!("{e}")));
        assert_eq!(points.centres().len(), count, "{name}");
        if let Some([lo, hi]) = range {
            let [a, b] = points.range();
            assert!((a - lo).abs() < 1e-3 && (b - hi).abs() < 1e-3, "{name}: range {a} to {b}");
        }
        if name.contains("halo") {
            let [lo, hi] = points.bounds();
            let near = |p: DVec3, x, y, z| (p - DVec3::new(x, y, z)).abs().max_element() < 0.06;
            assert!(near(lo, 74.5, 16.2, 89.0) && near(hi, 78.9, 22.8, 93.2), "{lo} {hi}");
        }
    }
}

/// Where a sample lies in a patient: LPS where the file says what the world's axes are, else its own world.
fn patient(grid: &Grid, index: [f64; 3]) -> DVec3 {
    let p = grid.world_of_index(DVec3::from_array(index));
    match grid.anatomy() {
        Anatomy::Ras => DVec3::new(-p.x, -p.y, p.z),
        Anatomy::Las => DVec3::new(p.x, -p.y, p.z),
        Anatomy::Lps | Anatomy::Unknown => p,
    }
}

#[test]
fn one_head_in_every_format() {
    let Some(reference) = shared_loaded("format_conformance/head_i16.npy") else { return };
    let wanted = stored(&grid(reference));
    let folder = shared("format_conformance").unwrap();
    let mut seen = BTreeSet::new();
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with("head_i16"))
        .collect();
    names.sort();
    let mut placed: Option<(String, DVec3)> = None;
    for name in names {
        // The raw data of two headers.
        if name.ends_with(".raw") {
            continue;
        }
        let grid = grid(shared_loaded(&format!("format_conformance/{name}")).unwrap());
        assert_eq!(grid.samples().type_name(), "i16", "{name}");
        assert!(stored(&grid) == wanted, "{name}: other values");
        if name.ends_with(".npy") {
            continue; // says nothing of space
        }
        let near = (grid.spacing() - DVec3::new(3.2, 3.2, 1.5)).abs().max_element() < 1e-5;
        assert!(near, "{name}: spacing {}", grid.spacing());
        if name.ends_with(".tif") {
            continue; // has no origin
        }
        let corner = patient(&grid, [63.0, 63.0, 39.0]);
        match &placed {
            None => placed = Some((name.clone(), corner)),
            Some((first, other)) => {
                assert!((corner - *other).abs().max_element() < 1e-3, "{name}: {corner}, {first}: {other}");
            }
        }
        seen.insert(Path::new(&name).extension().unwrap().to_owned());
    }
    assert!(seen.len() >= 6, "only {seen:?}");
}

#[test]
fn a_rescaled_head_has_its_values() {
    let Some(reference) = shared_loaded("format_conformance/head_i16.npy") else { return };
    let wanted = grid(reference);
    let scaled = grid(shared_loaded("format_conformance/head_u16_slope.nii.gz").unwrap());
    for z in 0..40 {
        for (x, y) in [(0, 0), (31, 20), (63, 63), (5, 40)] {
            let value = 0.5 * (wanted.value(x, y, z) + 1024.0) - 1024.0;
            assert_eq!(scaled.value(x, y, z), value);
        }
    }
}

#[test]
fn one_mesh_in_every_format() {
    let Some(reference) = shared_loaded("unstructured/post_small.vtk") else { return };
    let wanted = mesh(reference);
    let TetScalars::Point(values) = wanted.scalars() else { panic!() };
    let mut count = 0;
    for entry in std::fs::read_dir(shared("format_conformance").unwrap()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.starts_with("post_small") {
            continue;
        }
        let found =
            match read(shared(&format!("format_conformance/{name}")).unwrap(), &ReadOptions::default()) {
                Ok(loaded) => mesh(loaded),
                // Refused by its name, if at all.
                Err(error) if name.contains("lzma") && error.to_string().contains("LZMA") => continue,
                Err(error) => panic!("{error}"),
            };
        assert!(found.cells() == wanted.cells(), "{name}: other cells");
        let TetScalars::Point(other) = found.scalars() else { panic!() };
        // What is printed has fewer digits.
        let (place, value) = if name.contains("ascii") { (2e-6, 2e-6) } else { (0.0, 0.0) };
        let far = found.points().iter().zip(wanted.points()).map(|(a, b)| (*a - *b).abs().max_element());
        assert!(far.fold(0.0, f64::max) <= place, "{name}: other points");
        let off = other.iter().zip(values).map(|(a, b)| f64::from((a - b).abs()));
        assert!(off.fold(0.0, f64::max) <= value, "{name}: other values");
        count += 1;
    }
    assert!(count >= 9, "only {count} files");
}

#[test]
fn a_series_of_a_tilted_gantry_is_read_with_a_warning() {
    let Some(path) = shared("structured/dicom_ge_head") else { return };
    if !cfg!(feature = "dicom") {
        return;
    }
    let loaded = read(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(!loaded.report.warnings.is_empty());
    let Data::Grid(grid) = loaded.data else { panic!() };
    assert_eq!(&grid.dims()[..2], [512, 512]);
    assert!((grid.spacing().x - 0.488).abs() < 1e-3, "{}", grid.spacing());
}
