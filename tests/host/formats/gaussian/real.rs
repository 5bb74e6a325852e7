//! Real files that hold the same splats, as far apart as their list says.

use volraster::glam::DVec3;
use volraster::io::{ReadOptions, read};
use volraster::scene::{Axes, Gaussians};

use super::super::support::{OPTIONS, assert_refusal, gaussians, shared};
use super::{Differences, Spread, compare};

/// Reads splats and turns them to the axes of PLY files.
fn load(name: &str, stored: Option<Axes>) -> Option<Gaussians> {
    let path = shared(&format!("gaussians/{name}"))?;
    let options = ReadOptions { axes: stored.map(Into::into), turn_to: Some(Axes::Rdf), ..OPTIONS };
    let loaded = read(&path, &options).unwrap_or_else(|e| panic!("{e}"));
    Some(gaussians(loaded))
}

/// A file, the file that it is compared with, whether the order differs, and median and largest differences of place, covariance, opacity and colour.
type Row = (&'static str, &'static str, bool, [Spread; 4]);

const NEAR: Spread = [6.8e-10, 1.2e-8];
const PLACE: Spread = [9.6e-5, 1.2e-4];
const CLIPPED: Spread = [5.8e-2, 1.6];

const ROWS: [Row; 9] = [
    (
        "playbot_3k.compressed.ply",
        "playbot_3k.ply",
        true,
        [[1.9e-4, 5.2e-4], [2.7e-3, 8.1e-3], NEAR, [1.9e-2, 3.4e-2]],
    ),
    ("playbot_3k.spz", "playbot_3k.ply", false, [PLACE, [3.2e-2, 6.3e-2], NEAR, CLIPPED]),
    ("playbot_3k_v3.spz", "playbot_3k.ply", false, [PLACE, [3.2e-2, 6.3e-2], NEAR, CLIPPED]),
    ("playbot_3k_v2.spz", "playbot_3k.ply", false, [PLACE, [3.9e-2, 2.2e-1], NEAR, CLIPPED]),
    ("playbot_3k_ext.spz", "playbot_3k.ply", false, [PLACE, [3.2e-2, 6.3e-2], NEAR, CLIPPED]),
    ("playbot_3k_rdf.spz", "playbot_3k.ply", false, [PLACE, [3.2e-2, 6.3e-2], NEAR, CLIPPED]),
    (
        "biker.ply",
        "biker.compressed.ply",
        false,
        [[2.7e-8, 1.2e-7], [1.9e-7, 8.1e-7], [3.4e-9, 1.2e-8], [1.0e-8, 1.7e-8]],
    ),
    (
        "biker.spz",
        "biker.compressed.ply",
        false,
        [[9.7e-5, 1.2e-4], [3.2e-2, 6.5e-2], [0.0; 2], [2.9e-3, 3.7e-3]],
    ),
    (
        "biker.splat",
        "biker.compressed.ply",
        false,
        [[2.7e-8, 1.2e-7], [7.7e-3, 2.1e-2], [0.0; 2], [1.5e-3, 2.0e-3]],
    ),
];

#[test]
fn files_of_the_same_splats_are_no_farther_apart_than_their_formats() {
    for (name, truth, by_place, [place, covariance, opacity, colour]) in ROWS {
        // Written in the axes of PLY without saying so.
        let stored = (name == "playbot_3k_rdf.spz").then_some(Axes::Rdf);
        let (Some(splats), Some(truth)) = (load(name, stored), load(truth, None)) else { continue };
        let found = compare(&splats, &truth, by_place);
        let Differences { place: a, covariance: b, opacity: c, colour: d } = found;
        let text = [a, b, c, d].map(|[median, most]| format!("{median:.1e}, {most:.1e}")).join(" | ");
        println!("{name} | {text}");
        for (what, [median, most], [listed_median, listed_most]) in [
            ("place", a, place),
            ("covariance", b, covariance),
            ("opacity", c, opacity),
            ("colour", d, colour),
        ] {
            // The list is of float64; splats are kept as float32.
            let near = |value: f64, listed: f64| value <= 1.2 * listed + 6e-8;
            assert!(
                near(median, listed_median) && near(most, listed_most),
                "{name}: {what} differs by {median:.3e}, {most:.3e}"
            );
        }
    }
}

#[test]
fn opacities_of_one_and_bounds_are_those_of_the_list() {
    let Some(biker) = load("biker.ply", None) else { return };
    assert_eq!(biker.len(), 152_746);
    assert_eq!(biker.opacities().iter().filter(|opacity| **opacity == 1.0).count(), 198);
    let [low, high] = biker.bounds();
    assert!(low.distance(DVec3::new(-0.621, -3.180, -0.532)) < 1e-3, "{low}");
    assert!(high.distance(DVec3::new(0.414, 0.0, 0.613)) < 1e-3, "{high}");
    let path = shared("gaussians/playbot_31k.spz").unwrap();
    let playbot = gaussians(read(&path, &OPTIONS).unwrap());
    assert_eq!((playbot.len(), playbot.degree(), playbot.axes()), (31_000, 2, Axes::Rub));
    let [low, high] = playbot.bounds();
    assert!(low.distance(DVec3::new(-1.027, -0.044, -1.036)) < 1e-3, "{low}");
    assert!(high.distance(DVec3::new(1.029, 1.081, 1.034)) < 1e-3, "{high}");
}

#[test]
fn minimal_files_are_four_splats() {
    for (name, low, high) in [
        ("minimal-v2.spz", [-1.0, 0.0, -1.0], [0.0; 3]),
        ("minimal-v3.spz", [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ("minimal-v4.spz", [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ("minimal.splat", [-1.0, 0.0, -1.0], [0.0; 3]),
    ] {
        let Some(path) = shared(&format!("gaussians/minimal/{name}")) else { continue };
        let splats = gaussians(read(&path, &OPTIONS).unwrap_or_else(|e| panic!("{e}")));
        assert_eq!((splats.len(), splats.degree()), (4, 0), "{name}");
        let [least, greatest] = splats.bounds();
        assert!(
            least.distance(low.into()) < 1e-3 && greatest.distance(high.into()) < 1e-3,
            "{name}: {least} {greatest}"
        );
    }
    let Some(path) = shared("gaussians/minimal/minimal-raw.spz") else { return };
    let error = read(&path, &OPTIONS).unwrap_err();
    assert_refusal(&error, &["version 2: must be a gzip stream"], "minimal-raw.spz");
}

#[test]
fn extensions_tell_axes_and_unmarked_files_are_right_up_back() {
    let axes = |name: &str| {
        let path = shared(&format!("gaussians/{name}"))?;
        let loaded = read(&path, &OPTIONS).unwrap();
        let about = loaded.report.gaussians.clone().unwrap();
        Some((gaussians(loaded.clone()).axes(), about.axes_from, loaded.report.notes.join("; ")))
    };
    let Some((own, from, notes)) = axes("playbot_3k_ext.spz") else { return };
    assert_eq!((own, from), (Axes::Rdf, "the file"));
    assert!(notes.contains("left out"), "{notes}");
    let (own, from, _) = axes("playbot_3k.spz").unwrap();
    assert!(own == Axes::Rub && from.contains("convention"), "{own:?} {from}");
}
