//! Real files in .ksplat, SOG and glTF, as far from their sources as their list says.

use volraster::glam::{DMat3, DVec3};
use volraster::io::{ReadOptions, read};
use volraster::scene::{Axes, Gaussians, TrainedMode, harmonics};

use super::super::support::{OPTIONS, gaussians, shared};
use super::{Differences, Spread, colour, compare, directions, spread};

/// Reads splats and turns them to the axes of PLY files.
fn load(name: &str) -> Option<Gaussians> {
    let path = shared(&format!("gaussians/{name}"))?;
    let options = ReadOptions { turn_to: Some(Axes::Rdf), ..OPTIONS };
    Some(gaussians(read(&path, &options).unwrap_or_else(|e| panic!("{e}"))))
}

/// Fails unless differences are at most 1.2 times the listed medians and largest ones: of place, covariance, opacity, colour.
fn assert_near(name: &str, found: &Differences, listed: [Spread; 4]) {
    let Differences { place, covariance, opacity, colour } = *found;
    let found = [place, covariance, opacity, colour];
    let text = found.map(|[median, most]| format!("{median:.1e}, {most:.1e}")).join(" | ");
    println!("{name} | {text}");
    for ((what, found), listed) in
        ["place", "covariance", "opacity", "colour"].into_iter().zip(found).zip(listed)
    {
        // The list is of float64; splats are kept as float32.
        let near = found.iter().zip(listed).all(|(found, listed)| *found <= 1.2 * listed + ROUNDING);
        assert!(near, "{name}: {what} differs by {:.3e}, {:.3e}", found[0], found[1]);
    }
}

/// Of float32 numbers.
const ROUNDING: f64 = 6e-8;
const OPACITY: Spread = [6.8e-10, 1.2e-8];

/// A file, whether its order is another, and median and largest differences of place, covariance, opacity and colour.
const ROWS: [(&str, bool, [Spread; 4]); 5] = [
    ("playbot_3k_sog", false, [[1.4e-8, 5.9e-8], [2.5e-8, 1.2e-7], OPACITY, [5.6e-17, 8.9e-16]]),
    ("playbot_3k.glb", false, [[0.0; 2], [3.6e-8, 1.1e-7], [4.5e-10, 3.0e-8], [2.2e-16, 1.8e-15]]),
    ("playbot_3k_l1.ksplat", true, [[3.0e-5, 3.8e-5], [7.5e-4, 2.0e-3], [6.8e-10, 3.9e-3], [3.5e-3, 1.6]]),
    ("playbot_3k_l2.ksplat", true, [[3.0e-5, 3.8e-5], [7.5e-4, 2.0e-3], [6.8e-10, 3.9e-3], [2.0e-2, 1.7]]),
    ("playbot_3k_sog_v1", false, [[1.4e-8, 5.9e-8], [1.6e-2, 3.3e-2], [8.9e-5, 4.0e-3], [1.3e-1, 9.9e-1]]),
];

#[test]
fn files_are_no_farther_from_their_source_than_their_formats() {
    let Some(truth) = load("playbot_3k.ply") else { return };
    for (name, by_place, listed) in ROWS {
        let Some(splats) = load(name) else { continue };
        assert_near(name, &compare(&splats, &truth, by_place), listed);
    }
}

#[test]
fn nodes_of_a_file_turn_its_splats() {
    let (Some(path), Some(truth)) = (shared("gaussians/playbot_node.glb"), load("playbot_3k.ply")) else {
        return;
    };
    // In the axes of the file, which holds every second splat in those of PLY files.
    let splats = gaussians(read(&path, &OPTIONS).unwrap_or_else(|e| panic!("{e}")));
    assert_eq!((splats.len(), splats.axes(), splats.mode()), (1500, Axes::Luf, TrainedMode::Khronos));
    let matrix = DMat3::from_cols_array_2d(&[
        [0.391_378, 0.240_977, -0.196_859],
        [0.274_399, -0.416_444, 0.035_763],
        [-0.146_726, -0.136_029, -0.458_222],
    ])
    .transpose();
    let turn = matrix * 2.0;
    let bases = directions().into_iter().map(|d| [d, turn.transpose() * d].map(|d| harmonics::basis(2, d)));
    let bases: Vec<_> = bases.collect();
    let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut all = [const { Vec::new() }; 4];
    for (i, j) in (0..splats.len()).map(|i| (i, 2 * i)) {
        let centre = matrix * truth.centre(j) + DVec3::new(1.0, 0.5, -2.0);
        all[0].push((splats.centre(i) - centre).abs().max_element());
        let covariance = matrix * truth.covariance(j) * matrix.transpose();
        all[1].push(norm(splats.covariance(i) - covariance) / norm(covariance));
        all[2].push(f64::from((splats.opacities()[i] - truth.opacities()[j]).abs()));
        let worst = |[own, other]: &[[f64; 25]; 2]| {
            (colour(&splats, i, own) - colour(&truth, j, other)).abs().max_element()
        };
        all[3].push(bases.iter().map(worst).fold(0.0, f64::max));
    }
    let [place, covariance, opacity, colour] = all.map(spread);
    let found = Differences { place, covariance, opacity, colour };
    // The matrix has six digits; quaternions have 16 bits with a sign, opacities 16 bits.
    assert_near("playbot_node.glb", &found, [[1e-6, 2e-6], [6e-5, 1e-4], [4e-6, 8e-6], [2e-6, 2e-5]]);
    // Left unturned, colours would be others.
    assert!(bases.iter().any(|[own, other]| colour_differs(&splats, &truth, own, other)));
}

fn colour_differs(splats: &Gaussians, truth: &Gaussians, own: &[f64; 25], other: &[f64; 25]) -> bool {
    (0..splats.len()).any(|i| {
        let (seen, same) = (colour(splats, i, own), colour(truth, 2 * i, own));
        seen.distance(same) > 0.1 && seen.distance(colour(truth, 2 * i, other)) < 1e-4
    })
}

#[test]
fn an_archive_holds_the_splats_of_its_copy_in_spz() {
    let (Some(splats), Some(copy)) = (load("playbot_31k.sog"), load("playbot_31k.spz")) else { return };
    assert_eq!((splats.len(), splats.degree()), (31_000, 2));
    let listed = [[9.7e-5, 1.2e-4], [3.1e-2, 6.4e-2], [0.0; 2], [5.9e-2, 2.6]];
    assert_near("playbot_31k.spz", &compare(&copy, &splats, false), listed);
    let Some(folder) = load("playbot_3k_sog/meta.json") else { return };
    assert_near(
        "playbot_3k_sog/meta.json",
        &compare(&folder, &load("playbot_3k_sog").unwrap(), false),
        [[0.0; 2]; 4],
    );
}

#[test]
fn the_minimal_file_is_four_splats() {
    let Some(splats) = load("minimal/minimal.ksplat") else { return };
    assert_eq!((splats.len(), splats.degree()), (4, 0));
    let [low, high] = splats.bounds().map(|bound| bound.to_array());
    assert_eq!((low, high), ([-1.0, 0.0, -1.0], [0.0; 3]));
}
