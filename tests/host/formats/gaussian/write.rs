//! Written files of splats: decoded here by the rules of their formats, read back, and what they clip.

use std::io::Read as _;

use flate2::read::GzDecoder;
use volraster::glam::DVec3;
use volraster::io::{GaussiansOutput, OutputFormat, read, write_gaussians};
use volraster::scene::{Axes, GaussianParts, Gaussians, TrainedMode, harmonics};

use super::super::support::{OPTIONS, gaussians, shared};
use super::{Differences, compare};
use crate::folder::Folder;

/// Numbers from -1 to 1, the same in every run.
fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1_u32 << 23) as f32 - 1.0
    }
}

/// Splats within the ranges of all formats.
fn splats(count: usize, degree: u32) -> Gaussians {
    let mut next = numbers(7 + u64::from(degree));
    let mut three = |by: f32, to: f32| [0; 3].map(|_| next() * by + to);
    let centres = (0..count).map(|_| three(3.0, 0.5)).collect();
    let log_scales = (0..count).map(|_| three(2.0, -4.0)).collect();
    let mut next = numbers(11);
    let rotations = (0..count).map(|_| [0; 4].map(|_| next())).collect();
    let opacities = (0..count).map(|i| if i == 0 { 1.0 } else { next().abs() }).collect();
    let coefficients = (0..3 * count * harmonics::count(degree)).map(|_| 0.9 * next()).collect();
    let parts = GaussianParts {
        centres,
        rotations,
        log_scales,
        opacities,
        degree,
        harmonics: coefficients,
        axes: Axes::Rub,
        mode: TrainedMode::Antialiased,
    };
    Gaussians::new(parts).unwrap().0
}

fn parts(splats: &Gaussians) -> GaussianParts {
    GaussianParts {
        centres: splats.centres().to_vec(),
        rotations: splats.rotations().to_vec(),
        log_scales: splats.log_scales().to_vec(),
        opacities: splats.opacities().to_vec(),
        degree: splats.degree(),
        harmonics: splats.harmonics().to_vec(),
        axes: splats.axes(),
        mode: splats.mode(),
    }
}

/// Writes splats and reads them back; with the notes of the writer.
fn round(folder: &Folder, name: &str, splats: &Gaussians, spz_version: u32) -> (Gaussians, Vec<String>) {
    let output = GaussiansOutput { spz_version, texts: vec!["Licence: none\nof it".to_owned()] };
    let path = folder.path(name);
    let notes = write_gaussians(&path, splats, &output).unwrap();
    let loaded = read(&path, &OPTIONS).unwrap_or_else(|e| panic!("{name}: {e}"));
    if name.ends_with(".ply") {
        assert_eq!(loaded.report.gaussians.as_ref().unwrap().texts, ["Licence: none of it"]);
    }
    (gaussians(loaded), notes)
}

#[test]
fn what_is_written_is_read_back_within_the_steps_of_its_format() {
    let folder = Folder::new();
    for degree in 0..=3 {
        let made = splats(700, degree);
        for (name, version, axes, [place, covariance, opacity, colour]) in [
            ("a.ply", 4, Axes::Rdf, [0.0, 1e-5, 1e-7, 1e-5]),
            ("a.compressed.ply", 4, Axes::Rdf, [3e-3, 2e-2, 2.1e-3, 0.1]),
            ("a3.spz", 3, Axes::Rub, [1.3e-4, 0.1, 2.1e-3, 0.07]),
            ("a4.spz", 4, Axes::Rub, [1.3e-4, 0.1, 2.1e-3, 0.07]),
        ] {
            let (back, notes) = round(&folder, name, &made, version);
            assert_eq!((back.len(), back.degree(), back.axes()), (700, degree, axes), "{name}");
            assert_eq!(back.mode(), TrainedMode::Antialiased, "{name}");
            let expected: &[&str] =
                if name == "a.ply" { &["1 opacities of 0 or 1 have infinite logits"] } else { &[] };
            assert_eq!(notes, expected, "{name}");
            let found = compare(&back.turned(Axes::Rub), &made, name == "a.compressed.ply");
            let Differences { place: a, covariance: b, opacity: c, colour: d } = found;
            for (what, [_, most], limit) in [
                ("place", a, place),
                ("covariance", b, covariance),
                ("opacity", c, opacity),
                ("colour", d, colour),
            ] {
                assert!(most <= limit, "{name}, degree {degree}: {what} differs by {most}");
            }
        }
    }
    let (fourth, notes) = round(&folder, "a.ply", &splats(5, 4), 4);
    assert!(fourth.degree() == 3 && notes[0].contains("degree 4 left out"), "{notes:?}");
    assert_eq!(round(&folder, "a.spz", &splats(5, 4), 4).0.degree(), 4);
}

#[test]
fn bytes_are_those_of_the_rules_of_spz() {
    let folder = Folder::new();
    let made = splats(9, 1);
    write_gaussians(folder.path("a.spz"), &made, &GaussiansOutput { spz_version: 3, texts: Vec::new() })
        .unwrap();
    let mut bytes = Vec::new();
    GzDecoder::new(std::fs::File::open(folder.path("a.spz")).unwrap()).read_to_end(&mut bytes).unwrap();
    assert_eq!(bytes[..16], *b"NGSP\x03\0\0\0\x09\0\0\0\x01\x0c\x01\0");
    assert_eq!(bytes.len(), 16 + 9 * (9 + 1 + 3 + 3 + 4 + 9));
    let [positions, opacities, colours, scales, rotations, rest] =
        [16, 16 + 81, 16 + 90, 16 + 117, 16 + 144, 16 + 180].map(|at| &bytes[at..]);
    for i in 0..9 {
        for k in 0..3 {
            let at = 9 * i + 3 * k;
            let steps = i32::from_le_bytes([0, positions[at], positions[at + 1], positions[at + 2]]) >> 8;
            assert!(
                (f64::from(steps) / 4096.0 - f64::from(made.centres()[i][k])).abs() <= 0.5 / 4096.0 + 1e-9
            );
            let log = f64::from(scales[3 * i + k]) / 16.0 - 10.0;
            assert!((log - f64::from(made.log_scales()[i][k])).abs() <= 0.5 / 16.0 + 1e-9);
            let dc = (f64::from(colours[3 * i + k]) / 255.0 - 0.5) / 0.15;
            assert!((dc - f64::from(made.harmonics()[12 * i + k])).abs() <= 0.5 / 255.0 / 0.15 + 1e-9);
        }
        assert!(
            (f64::from(opacities[i]) / 255.0 - f64::from(made.opacities()[i])).abs() <= 0.5 / 255.0 + 1e-9
        );
        for k in 0..9 {
            let coefficient = (f64::from(rest[9 * i + k]) - 128.0) / 128.0;
            assert!((coefficient - f64::from(made.harmonics()[12 * i + 3 + k])).abs() <= 0.5 / 128.0 + 1e-9);
        }
        let word = u32::from_le_bytes(rotations[4 * i..4 * i + 4].try_into().unwrap());
        let [w, x, y, z] = made.rotations()[i].map(f64::from);
        let xyzw = [x, y, z, w];
        let largest = (word >> 30) as usize;
        assert!(xyzw.iter().all(|part| part.abs() <= xyzw[largest].abs() + 1e-7));
        let others = (0..4).filter(|part| *part != largest).zip([20, 10, 0]);
        for (part, shift) in others {
            let size = f64::from(word >> shift & 511) / 511.0 * 0.5_f64.sqrt();
            let value = if word >> shift & 512 == 0 { size } else { -size };
            // The largest part is positive.
            let expected = xyzw[part] * xyzw[largest].signum();
            assert!((value - expected).abs() <= 0.5 / 511.0 * 0.5_f64.sqrt() + 1e-7, "{value} {expected}");
        }
    }
}

#[test]
fn words_are_those_of_the_rules_of_compressed_ply() {
    let folder = Folder::new();
    let made = splats(300, 1);
    write_gaussians(folder.path("a.compressed.ply"), &made, &GaussiansOutput::default()).unwrap();
    let bytes = std::fs::read(folder.path("a.compressed.ply")).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    assert!(header.contains("element chunk 2\n") && header.contains("element sh 300\n"), "{header}");
    assert_eq!(bytes.len(), end + 2 * 18 * 4 + 300 * (16 + 9));
    let float =
        |at: usize| f64::from(f32::from_le_bytes(bytes[end + 4 * at..end + 4 * at + 4].try_into().unwrap()));
    let word = |i: usize, k: usize| {
        let at = end + 144 + 16 * i + 4 * k;
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    };
    // In the axes of PLY: a half turn about x.
    let turned: Vec<DVec3> = (0..300).map(|i| made.centre(i) * DVec3::new(1.0, -1.0, -1.0)).collect();
    let mut left: Vec<usize> = (0..300).collect();
    for i in 0..300 {
        let chunk = 18 * (i / 256);
        let position = word(i, 0);
        let shares = [(position >> 21, 2047), (position >> 11 & 1023, 1023), (position & 2047, 2047)];
        let mut place = DVec3::ZERO;
        let mut step = DVec3::ZERO;
        for (k, (code, most)) in shares.into_iter().enumerate() {
            let [low, high] = [float(chunk + k), float(chunk + 3 + k)];
            place[k] = low + (high - low) * f64::from(code) / f64::from(most);
            step[k] = 0.5 * (high - low) / f64::from(most) + 1e-6;
        }
        // Each splat is one of those that were given.
        let near = left.iter().position(|&j| (place - turned[j]).abs().cmple(step).all());
        let j = left.swap_remove(near.unwrap_or_else(|| panic!("{i}: {place}")));
        let alpha = f64::from(word(i, 3) & 255) / 255.0;
        assert!((alpha - f64::from(made.opacities()[j])).abs() <= 0.5 / 255.0 + 1e-9);
        let red =
            float(chunk + 12) + (float(chunk + 15) - float(chunk + 12)) * f64::from(word(i, 3) >> 24) / 255.0;
        let expected = 0.5 + harmonics::C0 * f64::from(made.harmonics()[12 * j]);
        assert!((red - expected).abs() <= 0.5 / 255.0);
        // f_rest_0 is that of red and y, whose sign the half turn changes.
        let byte = f64::from(bytes[end + 144 + 300 * 16 + 9 * i]);
        let coefficient = 8.0 * ((byte + 0.5) / 256.0 - 0.5);
        assert!((coefficient + f64::from(made.harmonics()[12 * j + 3])).abs() <= 4.0 / 256.0 + 1e-6);
    }
}

#[test]
fn what_is_clipped_is_told_in_one_line() {
    let folder = Folder::new();
    let mut far = parts(&splats(4, 1));
    far.centres[0] = [5000.0, 0.0, 0.0];
    let (back, notes) = round(&folder, "far.spz", &Gaussians::new(far.clone()).unwrap().0, 4);
    assert_eq!(notes, ["coordinates are multiples of 2^-10"]);
    assert!((back.centres()[0][0] - 5000.0).abs() < 1e-3);
    far.centres[0] = [1e9, 0.0, 0.0];
    far.log_scales[1] = [f32::NEG_INFINITY, 9.0, -1.0];
    far.harmonics[0] = 12.0;
    far.harmonics[3] = -5.0;
    let made = Gaussians::new(far).unwrap().0;
    let (_, notes) = round(&folder, "clipped.spz", &made, 3);
    let clipped = "clipped to the range of the format: 1 colours, 1 harmonics, 1 coordinates, 2 lengths";
    let words = |text: &str| {
        let mut words: Vec<String> = text.split([',', ':']).map(|word| word.trim().to_owned()).collect();
        words.sort();
        words
    };
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert_eq!(words(&notes[1]), words(clipped));
    let (back, notes) = round(&folder, "clipped.compressed.ply", &made, 4);
    assert_eq!(notes, ["clipped to the range of the format: 1 harmonics", "1 lengths of 0 become e^-20"]);
    assert!(back.log_scales().iter().any(|scales| scales[0] == -20.0));
    let (back, _) = round(&folder, "clipped.ply", &made, 4);
    assert_eq!(back.log_scales()[1][0], f32::NEG_INFINITY);
    // A scene of less than a unit of length.
    let mut small = parts(&splats(4, 0));
    small.centres = vec![[0.001, 0.002, 0.003], [0.0; 3], [0.003; 3], [-0.001; 3]];
    let (back, notes) = round(&folder, "small.spz", &Gaussians::new(small.clone()).unwrap().0, 4);
    assert_eq!(notes, ["coordinates are multiples of 2^-20"]);
    assert!((f64::from(back.centres()[0][0]) - 0.001).abs() < 1e-6);
    // All flat along z: the property is left out.
    small.log_scales.iter_mut().for_each(|scales| scales[2] = f32::NEG_INFINITY);
    small.mode = TrainedMode::Unknown;
    let (back, _) = round(&folder, "flat.ply", &Gaussians::new(small).unwrap().0, 4);
    assert!(!String::from_utf8_lossy(&std::fs::read(folder.path("flat.ply")).unwrap()).contains("scale_2"));
    assert_eq!((back.mode(), back.log_scales()[0][2]), (TrainedMode::Flat, f32::NEG_INFINITY));
}

#[test]
fn real_splats_lose_no_more_than_elsewhere() {
    let Some(path) = shared("gaussians/playbot_3k.ply") else { return };
    let (folder, made) = (Folder::new(), gaussians(read(&path, &OPTIONS).unwrap()));
    for (name, by_place, [place, covariance, colour]) in [
        ("a.compressed.ply", true, [[1.9e-4, 5.2e-4], [2.7e-3, 8.1e-3], [1.9e-2, 3.4e-2]]),
        ("a.spz", false, [[9.6e-5, 1.2e-4], [3.2e-2, 6.3e-2], [5.8e-2, 1.6]]),
    ] {
        write_gaussians(folder.path(name), &made, &GaussiansOutput::default()).unwrap();
        let back = gaussians(read(folder.path(name), &OPTIONS).unwrap());
        let found = compare(&back.turned(Axes::Rdf), &made, by_place);
        let bytes = std::fs::metadata(folder.path(name)).unwrap().len();
        println!("{name}: {bytes} bytes, {found:?}");
        for ([median, most], [listed_median, listed_most]) in
            [(found.place, place), (found.covariance, covariance), (found.colour, colour)]
        {
            assert!(median <= 1.2 * listed_median && most <= 1.2 * listed_most, "{name}: {median} {most}");
        }
    }
}

#[test]
fn names_and_versions_must_fit() {
    let folder = Folder::new();
    let made = splats(2, 0);
    assert_eq!(OutputFormat::of("a.compressed.PLY").unwrap(), OutputFormat::CompressedPly);
    assert_eq!(OutputFormat::of("a.ply").unwrap(), OutputFormat::GaussianPly);
    let version = GaussiansOutput { spz_version: 2, texts: Vec::new() };
    let error = write_gaussians(folder.path("a.spz"), &made, &version).unwrap_err();
    assert!(error.to_string().contains("2: must be 3 or 4"), "{error}");
    let error = write_gaussians(folder.path("a.vtu"), &made, &GaussiansOutput::default()).unwrap_err();
    assert!(error.to_string().contains("must end in .ply, .compressed.ply or .spz"), "{error}");
}
