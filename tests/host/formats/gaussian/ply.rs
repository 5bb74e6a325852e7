//! Plain PLY files of splats: every encoding, order and type, what comments say, what is missing.

use volraster::io::{Data, ReadOptions};
use volraster::scene::{Axes, TrainedMode};

use super::super::ply::{ENCODINGS, Encoding, name as encoding_name, put};
use super::super::support::*;

/// Properties with their types, in an order of nobody.
fn properties(degree: u32) -> Vec<(String, char)> {
    let rest = 3 * degree * (degree + 2);
    let mut all: Vec<(String, char)> = [
        ("rot_3", 'f'),
        ("opacity", 'd'),
        ("nx", 'h'),
        ("z", 'f'),
        ("f_dc_1", 'f'),
        ("rot_0", 'b'),
        ("scale_1", 'd'),
        ("x", 'i'),
        ("f_dc_0", 'f'),
        ("rot_1", 'f'),
        ("y", 'f'),
        ("scale_0", 'f'),
        ("f_dc_2", 'd'),
        ("rot_2", 'f'),
        ("scale_2", 'f'),
        ("extra", 'B'),
    ]
    .map(|(name, kind)| (name.to_owned(), kind))
    .to_vec();
    all.extend((0..rest).rev().map(|i| (format!("f_rest_{i}"), 'f')));
    all
}

/// The number of a property of a splat; `x` and `rot_0` are whole.
fn number(name: &str, i: usize) -> f64 {
    let i = i as f64;
    if let Some(place) = name.strip_prefix("f_rest_") {
        return i + place.parse::<f64>().unwrap() / 64.0;
    }
    match name {
        "x" => i,
        "y" => 0.5 - i,
        "z" => 2.25,
        "rot_0" => 2.0,
        "rot_1" | "rot_2" => 0.0,
        "rot_3" => -i,
        "opacity" => i - 1.0,
        "scale_0" => -3.0,
        "scale_1" => -2.5 - i,
        "scale_2" => -4.0,
        "f_dc_0" => 0.25,
        "f_dc_1" => -0.5,
        "f_dc_2" => i,
        _ => 7.0,
    }
}

fn file_of(encoding: Encoding, properties: &[(String, char)], comments: &str) -> Vec<u8> {
    let listed: String = properties
        .iter()
        .map(|(name, kind)| {
            let kind = match kind {
                'b' => "char",
                'B' => "uchar",
                'h' => "short",
                'i' => "int",
                'd' => "double",
                _ => "float",
            };
            format!("property {kind} {name}\n")
        })
        .collect();
    let mut out = format!(
        "ply\nformat {} 1.0\n{comments}element before 1\nproperty int a\nelement vertex 3\n{listed}element after 2\nproperty list uchar int b\nend_header\n",
        encoding_name(encoding)
    )
    .into_bytes();
    let line = |out: &mut Vec<u8>| {
        if encoding == Encoding::Words {
            out.push(b'\n');
        }
    };
    put(&mut out, encoding, 'i', 5.0);
    line(&mut out);
    for i in 0..3 {
        for (name, kind) in properties {
            put(&mut out, encoding, *kind, number(name, i));
        }
        line(&mut out);
    }
    for _ in 0..2 {
        put(&mut out, encoding, 'B', 1.0);
        put(&mut out, encoding, 'i', 9.0);
        line(&mut out);
    }
    out
}

fn file(encoding: Encoding, degree: u32) -> Vec<u8> {
    file_of(encoding, &properties(degree), "comment by hand\n")
}

fn without(name: &str) -> Vec<u8> {
    let mut all = properties(1);
    all.retain(|(own, _)| own != name);
    file_of(Encoding::Little, &all, "")
}

pub fn samples() -> Vec<Sample> {
    let mut all = Vec::new();
    for (encoding, degree) in ENCODINGS.into_iter().zip([1, 3, 0]) {
        all.push(Sample::one("splats", "a.ply", file(encoding, degree)));
    }
    all.push(Sample::one("flat splats", "a.ply", without("scale_2")));
    all
}

#[test]
fn properties_are_found_by_name_in_every_encoding() {
    for encoding in ENCODINGS {
        for degree in 0..=3 {
            let loaded = Sample::one("splats", "a.ply", file(encoding, degree)).loaded();
            let notes = loaded.report.notes.join("; ");
            assert!(notes.contains("those of Gaussian splats"), "{notes}");
            assert!(notes.contains("1 elements \"before\" left out"), "{notes}");
            let splats = gaussians(loaded);
            assert_eq!((splats.len(), splats.degree(), splats.axes()), (3, degree, Axes::Rdf));
            assert_eq!(splats.centres(), [[0.0, 0.5, 2.25], [1.0, -0.5, 2.25], [2.0, -1.5, 2.25]]);
            assert_eq!(splats.log_scales()[2], [-3.0, -4.5, -4.0]);
            let half = 0.5_f32.sqrt();
            assert_eq!(splats.rotations()[0], [1.0, 0.0, 0.0, 0.0]);
            let [w, x, y, z] = splats.rotations()[2];
            assert!((w - half).abs() < 1e-6 && (z + half).abs() < 1e-6 && [x, y] == [0.0; 2]);
            assert_eq!(splats.opacities()[1], 0.5);
            let sigmoid = 1.0 / (1.0 + 1.0_f32.exp());
            assert!((splats.opacities()[0] - sigmoid).abs() < 1e-7);
            // Files have all coefficients of a channel together, splats all channels of a coefficient.
            let rest = (degree * (degree + 2)) as usize;
            let width = 3 * (rest + 1);
            let own = &splats.harmonics()[width..2 * width];
            assert_eq!(own[..3], [0.25, -0.5, 1.0]);
            for (k, channel) in (0..rest).flat_map(|k| (0..3).map(move |c| (k, c))) {
                assert_eq!(own[3 * (k + 1) + channel], 1.0 + (channel * rest + k) as f32 / 64.0);
            }
        }
    }
    let packed = gzip(&file(Encoding::Big, 1));
    assert_eq!(gaussians(Sample::one("packed", "a.ply.gz", packed).loaded()).degree(), 1);
}

#[test]
fn comments_tell_the_rule_and_the_licence() {
    for (comments, mode) in [
        ("", TrainedMode::Unknown),
        ("comment SplatRenderMode: mip\n", TrainedMode::Antialiased),
        ("comment antialiased 0\n", TrainedMode::Default),
    ] {
        let text = format!("{comments}comment Licence: CC-BY 4.0\ncomment made by a program\n");
        let loaded = Sample::one("said", "a.ply", file_of(Encoding::Little, &properties(0), &text)).loaded();
        assert_eq!(loaded.report.gaussians.clone().unwrap().texts, ["Licence: CC-BY 4.0"]);
        assert_eq!(gaussians(loaded).mode(), mode);
    }
    let flat = Sample::one("flat", "a.ply", without("scale_2")).loaded();
    assert!(flat.report.notes.iter().any(|note| note.contains("flat splats")));
    let flat = gaussians(flat);
    assert_eq!((flat.log_scales()[0][2], flat.mode()), (f32::NEG_INFINITY, TrainedMode::Flat));
}

#[test]
fn a_missing_property_is_named_in_one_line() {
    for name in ["x", "f_dc_1", "f_dc_0", "opacity", "scale_0", "scale_1", "rot_0", "rot_3"] {
        let sample = Sample::one("missing", "a.ply", without(name));
        sample.refused(&["element vertex", name]);
    }
    Sample::one("rest", "a.ply", without("f_rest_3"))
        .refused(&["8 properties f_rest_*: must be 0, 9, 24 or 45"]);
    let mut gap = properties(1);
    gap.iter_mut().find(|(name, _)| name == "f_rest_4").unwrap().0 = "f_rest_9".to_owned();
    Sample::one("gap", "a.ply", file_of(Encoding::Little, &gap, "")).refused(&["f_rest_4", "missing"]);
    let mut short = file(Encoding::Little, 1);
    short.truncate(short.len() - 30);
    Sample::one("short", "a.ply", short).refused(&["element vertex", "cannot hold them"]);
    let many = String::from_utf8_lossy(&file(Encoding::Words, 0)).replace("vertex 3", "vertex 3000000000");
    Sample::one("many", "a.ply", many.into_bytes()).refused(&["cannot hold them"]);
}

#[test]
fn points_are_no_splats_and_splats_are_points_where_arrays_are_named() {
    let mut plain = properties(0);
    plain.retain(|(name, _)| !["f_dc_0", "rot_0"].contains(&name.as_str()));
    let points = Sample::one("points", "a.ply", file_of(Encoding::Little, &plain, "")).loaded();
    assert!(matches!(points.data, Data::Points(_)));
    let options = ReadOptions { array: Some("opacity".to_owned()), ..OPTIONS };
    let sample = Sample::one("named", "a.ply", file(Encoding::Little, 0));
    let named = sample.read(&options).unwrap();
    assert!(matches!(named.data, Data::Points(_)));
    assert!(
        named.report.notes.iter().any(|note| note.contains("Gaussian splats")),
        "{:?}",
        named.report.notes
    );
    let axes = ReadOptions { axes: Some(Axes::Rub.into()), ..OPTIONS };
    let refusal =
        Sample::one("points", "a.ply", file_of(Encoding::Little, &plain, "")).read(&axes).unwrap_err();
    assert_refusal(&refusal, &["axes", "only gaussians have axes to name"], "axes of points");
}

#[test]
fn options_name_axes_and_turn_them() {
    let read =
        |options: ReadOptions| Sample::one("turned", "a.ply", file(Encoding::Big, 1)).read(&options).unwrap();
    let given = read(ReadOptions { axes: Some(Axes::Rub.into()), ..OPTIONS });
    assert_eq!(given.report.gaussians.as_ref().unwrap().axes_from, "given");
    let given = gaussians(given);
    let usual = gaussians(read(OPTIONS));
    assert_eq!((given.axes(), given.centres()), (Axes::Rub, usual.centres()));
    let turned = read(ReadOptions { turn_to: Some(Axes::Rub), ..OPTIONS });
    assert!(turned.report.notes.contains(&"turned from rdf to rub".to_owned()), "{:?}", turned.report.notes);
    let turned = gaussians(turned);
    assert_eq!((turned.axes(), turned.centres()[1]), (Axes::Rub, [1.0, 0.5, -2.25]));
    let mirrored = read(ReadOptions { axes: Some(Axes::named("ruf").unwrap()), ..OPTIONS });
    let mirrored = gaussians(mirrored);
    assert_eq!((mirrored.axes(), mirrored.centres()[1]), (Axes::Luf, [-1.0, -0.5, 2.25]));
}

#[test]
fn what_cannot_be_drawn_is_left_out_with_a_warning() {
    let text = String::from_utf8(file(Encoding::Words, 0)).unwrap();
    // x of the second splat is a whole number: y is not.
    let broken =
        text.replace("-0.5 -3 ", "nan -3 ").replace("property double opacity", "property float opacity");
    let loaded = Sample::one("nan", "a.ply", broken.into_bytes()).loaded();
    let warnings = loaded.report.warnings.join("; ");
    assert!(warnings.contains("1 splats left out: 1 with NaN"), "{warnings}");
    assert_eq!(gaussians(loaded).len(), 2);
}
