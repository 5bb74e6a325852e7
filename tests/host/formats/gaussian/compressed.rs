//! Compressed PLY files: chunks, packed words, bytes of harmonics.

use volraster::scene::harmonics::C0;

use super::super::support::*;

/// A file of `count` splats, with ranges of colours or without, and bytes of harmonics or without.
fn file(count: usize, colours: bool, rest: usize) -> Vec<u8> {
    let mut names = vec!["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"];
    names.extend(["min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z"]);
    if colours {
        names.extend(["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"]);
    }
    let chunks = count.div_ceil(256);
    let mut out = format!("ply\nformat binary_little_endian 1.0\nelement chunk {chunks}\n");
    out.extend(names.iter().map(|name| format!("property float {name}\n")));
    out += &format!("element vertex {count}\n");
    out.extend(
        ["position", "rotation", "scale", "color"].map(|name| format!("property uint packed_{name}\n")),
    );
    if rest > 0 {
        out += &format!("element sh {count}\n");
        out.extend((0..rest).map(|i| format!("property uchar f_rest_{i}\n")));
    }
    out += "end_header\n";
    let mut out = out.into_bytes();
    for chunk in 0..chunks {
        let base = chunk as f32 * 10.0;
        let mut ranges = vec![base, -1.0, 0.0, base + 8.0, 1.0, 4.0, -6.0, -5.0, -4.0, -2.0, -1.0, 0.0];
        if colours {
            ranges.extend([-0.5, 0.0, 0.25, 1.5, 1.0, 0.75]);
        }
        out.extend(ranges.iter().flat_map(|number: &f32| number.to_le_bytes()));
    }
    for i in 0..count as u32 {
        let position = (i % 2048) << 21 | (i % 1024) << 11 | (2047 - i % 2048);
        let rotation = (i % 4) << 30 | 512 << 20 | 700 << 10 | 300;
        let scale = 2047 << 21 | 1023 << 11;
        let colour = (i % 256) << 24 | 255 << 16 | (255 - i % 256);
        for word in [position, rotation, scale, colour] {
            out.extend(word.to_le_bytes());
        }
    }
    out.extend((0..count * rest).map(|i| (i * 7 % 256) as u8));
    out
}

pub fn samples() -> Vec<Sample> {
    vec![
        Sample::one("compressed", "a.compressed.ply", file(3, true, 0)),
        Sample::one("with harmonics", "a.compressed.ply", file(5, false, 9)),
        Sample::one("two chunks", "a.ply", file(260, true, 24)),
    ]
}

#[test]
fn words_are_unpacked_within_the_ranges_of_their_chunk() {
    for colours in [true, false] {
        let splats = gaussians(Sample::one("compressed", "a.ply", file(600, colours, 9)).loaded());
        assert_eq!((splats.len(), splats.degree()), (600, 1));
        for i in [0, 1, 2, 3, 255, 256, 599] {
            let base = 10.0 * (i / 256) as f64;
            let [x, y, z] = splats.centres()[i].map(f64::from);
            assert!((x - (base + 8.0 * i as f64 / 2047.0)).abs() < 1e-6, "{i}: {x}");
            assert!((y - (-1.0 + 2.0 * i as f64 / 1023.0)).abs() < 1e-6, "{i}: {y}");
            assert!((z - 4.0 * (2047 - i) as f64 / 2047.0).abs() < 1e-6, "{i}: {z}");
            assert_eq!(splats.log_scales()[i], [-2.0, -1.0, -4.0]);
            let byte = (i % 256) as f64 / 255.0;
            assert!((f64::from(splats.opacities()[i]) - (1.0 - byte)).abs() < 1e-7);
            let [low, high] =
                if colours { [[-0.5, 0.0, 0.25], [1.5, 1.0, 0.75]] } else { [[0.0; 3], [1.0; 3]] };
            let own = &splats.harmonics()[12 * i..12 * (i + 1)];
            for (c, share) in [byte, 1.0, 0.0].into_iter().enumerate() {
                let colour = low[c] + (high[c] - low[c]) * share;
                assert!((f64::from(own[c]) - (colour - 0.5) / C0).abs() < 1e-6);
            }
            for place in 0..9 {
                let byte = ((9 * i + place) * 7 % 256) as f32;
                let expected = match byte {
                    0.0 => -4.0,
                    255.0 => 4.0,
                    _ => 8.0 * ((byte + 0.5) / 256.0 - 0.5),
                };
                assert_eq!(own[3 * (place % 3 + 1) + place / 3], expected);
            }
            let others = [512.0, 700.0, 300.0].map(|v: f64| (v / 1023.0 - 0.5) * 2.0_f64.sqrt());
            let mut parts = others.to_vec();
            parts.insert(i % 4, (1.0 - others.iter().map(|v| v * v).sum::<f64>()).sqrt());
            for (part, expected) in splats.rotations()[i].into_iter().zip(parts) {
                assert!((f64::from(part) - expected).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn elements_may_come_in_any_order() {
    let (count, bytes) = (5, file(5, true, 9));
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let [chunk, vertex, sh] =
        ["element chunk", "element vertex", "element sh"].map(|name| header.find(name).unwrap());
    let mut rest = &bytes[end + 11..];
    let mut next = |size: usize| {
        let (part, left) = rest.split_at(size);
        rest = left;
        part
    };
    let [ranges, words, coefficients] = [18 * 4, 16 * count, 9 * count].map(&mut next);
    let camera = "element camera 2\nproperty uchar a\nproperty list uchar short b\n";
    let turned = [
        &header.as_bytes()[..chunk],
        &header.as_bytes()[sh..],
        camera.as_bytes(),
        &header.as_bytes()[vertex..sh],
        &header.as_bytes()[chunk..vertex],
        b"end_header\n",
        coefficients,
        &[7, 1, 0, 0, 7, 0],
        words,
        ranges,
    ];
    let loaded = Sample::one("other order", "a.ply", turned.concat()).loaded();
    assert_eq!(loaded.report.notes, ["2 elements \"camera\" left out"]);
    let (made, usual) = (gaussians(loaded), gaussians(Sample::one("usual order", "a.ply", bytes).loaded()));
    assert_eq!((made.centres(), made.harmonics()), (usual.centres(), usual.harmonics()));
    assert_eq!(made.rotations(), usual.rotations());
}

#[test]
fn counts_and_properties_must_fit() {
    let text = |from: &str, to: &str| {
        let bytes = file(3, true, 9);
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap();
        let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
        assert!(header.contains(from), "{from}");
        [header.replacen(from, to, 1).into_bytes(), bytes[end..].to_vec()].concat()
    };
    let refused = |from: &str, to: &str, parts: &[&str]| {
        Sample::one("broken", "a.compressed.ply", text(from, to)).refused(parts);
    };
    refused("element chunk 1", "element chunk 2", &["2 for 3 vertices: must be one for each 256"]);
    refused("element vertex 3", "element vertex 300", &["1 for 300 vertices"]);
    refused("element sh 3", "element sh 2", &["2 for 3 vertices: must be one for each"]);
    refused("property float max_y", "property float other", &["\"max_y\" is missing"]);
    refused("property float max_b", "property float other", &["\"max_b\" is missing"]);
    refused("packed_scale", "packed_other", &["\"packed_scale\" is missing"]);
    refused("uint packed_color", "float packed_color", &["packed_color: must be of type uint"]);
    refused("f_rest_8", "other", &["8 properties f_rest_*"]);
    let mut short = file(3, true, 9);
    short.pop();
    Sample::one("short", "a.ply", short).refused(&["element sh", "cannot hold them"]);
    let mut long = file(3, true, 9);
    long.push(0);
    Sample::one("long", "a.ply", long).refused(&["more than the header announces"]);
}
