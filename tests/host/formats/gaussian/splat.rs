//! Records of 32 bytes, known by the file name.

use volraster::scene::Axes;
use volraster::scene::harmonics::C0;

use super::super::support::*;

fn record(centre: [f32; 3], scale: [f32; 3], rgba: [u8; 4], rotation: [u8; 4]) -> Vec<u8> {
    let mut out: Vec<u8> = centre.iter().chain(&scale).flat_map(|number| number.to_le_bytes()).collect();
    out.extend(rgba);
    out.extend(rotation);
    out
}

fn file() -> Vec<u8> {
    [
        record([1.0, 2.0, 3.0], [1.0, 0.5, 0.0], [255, 0, 51, 204], [255, 128, 128, 128]),
        record([-1.0, 0.0, 0.5], [2.0, 3.0, 4.0], [0, 255, 102, 255], [128, 0, 128, 128]),
    ]
    .concat()
}

pub fn samples() -> Vec<Sample> {
    vec![Sample::one("records", "a.splat", file()), Sample::one("many records", "a.splat", file().repeat(40))]
}

#[test]
fn records_are_splats() {
    let splats = gaussians(Sample::one("records", "a.splat", file()).loaded());
    assert_eq!((splats.len(), splats.degree(), splats.axes()), (2, 0, Axes::Rdf));
    assert_eq!(splats.centres(), [[1.0, 2.0, 3.0], [-1.0, 0.0, 0.5]]);
    assert_eq!(splats.log_scales()[0], [0.0, 0.5_f32.ln(), f32::NEG_INFINITY]);
    assert_eq!(splats.rotations(), [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0]]);
    assert_eq!(splats.opacities(), [0.8, 1.0]);
    for (found, byte) in splats.harmonics().iter().zip([255.0, 0.0, 51.0, 0.0, 255.0, 102.0]) {
        assert!((f64::from(*found) - (byte / 255.0 - 0.5) / C0).abs() < 1e-6);
    }
}

#[test]
fn sizes_and_names_must_fit() {
    Sample::one("size", "a.splat", &file()[..63]).refused(&["63 bytes: must be a multiple of 32"]);
    Sample::one("empty", "a.splat", Vec::new()).refused(&["at least one"]);
    Sample::one("another name", "a.dat", file()).refused(&["unknown format"]);
    let broken = record([f32::NAN; 3], [1.0; 3], [0; 4], [255; 4]);
    Sample::one("nan", "a.splat", [file(), broken.clone()].concat()).loaded();
    Sample::one("nothing", "a.splat", broken).refused(&["none of 1 can be drawn"]);
    let zero = record([0.0; 3], [1.0; 3], [0; 4], [128; 4]);
    let loaded = Sample::one("zero", "a.splat", [file(), zero].concat()).loaded();
    assert!(loaded.report.warnings[0].contains("quaternion of length 0"), "{:?}", loaded.report.warnings);
}
