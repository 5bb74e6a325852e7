//! Data files: every format in every encoding, real files, hostile ones.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    unreachable_pub,
    dead_code,
    reason = "a test fails by panicking, and makes its own numbers"
)]

mod container;
mod convert;
mod csv;
mod dicom;
mod folder;
mod gaussian;
mod gmsh;
mod metaimage;
mod mutations;
mod nifti;
mod npy;
mod nrrd;
mod ply;
mod raw;
mod real;
mod refused;
mod series;
pub mod support;
mod tiff;
mod triangles;
mod vtk_legacy;
mod vtk_xml;
mod write;
mod zarr;

/// The samples of each reader, by the name of its fuzz target.
fn seeds() -> Vec<(&'static str, Vec<support::Sample>)> {
    let (sidecar, raw) = raw::samples().into_iter().partition(|sample| sample.files[0].0.ends_with(".json"));
    vec![
        ("csv", csv::samples()),
        ("compressed_ply", gaussian::compressed::samples()),
        ("dicom", dicom::samples()),
        ("gaussian_ply", gaussian::ply::samples()),
        ("gltf", gaussian::gltf::samples()),
        ("gmsh", gmsh::samples()),
        ("ksplat", gaussian::ksplat::samples()),
        ("metaimage", metaimage::samples()),
        ("nifti", nifti::samples()),
        ("npy", npy::samples()),
        ("nrrd", nrrd::samples()),
        ("ply", ply::samples()),
        ("raw", raw),
        ("sidecar", sidecar),
        ("sog", gaussian::sog::samples()),
        ("splat", gaussian::splat::samples()),
        ("spz", gaussian::spz::samples()),
        ("tiff", tiff::samples()),
        ("vtk_legacy", vtk_legacy::samples()),
        ("vtk_xml", vtk_xml::samples()),
    ]
}

/// A test of damaged samples for each reader.
macro_rules! damaged {
    ($($format:ident)*) => {
        mod damaged {
            $(
                #[test]
                fn $format() {
                    let seeds = super::seeds();
                    let (name, samples) = seeds.iter().find(|seed| seed.0 == stringify!($format)).unwrap();
                    super::mutations::damage(name, samples);
                }
            )*

            #[test]
            fn every_reader_has_its_test() {
                let tested = [$(stringify!($format)),*];
                assert!(super::seeds().iter().all(|seed| tested.contains(&seed.0)));
            }
        }
    };
}

damaged!(
    csv compressed_ply dicom gaussian_ply gltf gmsh ksplat metaimage nifti npy nrrd ply raw sidecar sog splat spz tiff vtk_legacy vtk_xml
);
