//! SOG, versions 1 and 2: folders and archives, images and tables, names and sizes that lie.

use std::io::Write as _;

use image_webp::{ColorType, WebPEncoder};
use rawzip::{CompressionMethod, ZipArchiveWriter, path::EntryPath};
use serde_json::{Value, json};
use volraster::io::read;
use volraster::scene::{Axes, Gaussians, TrainedMode};

use super::super::support::*;
use crate::folder::Folder;

/// A lossless image with these pixels, in one row unless the width is given.
fn webp(pixels: &[[u8; 4]], width: usize) -> Vec<u8> {
    let (mut out, height) = (Vec::new(), pixels.len() / width);
    let encoder = WebPEncoder::new(&mut out);
    encoder.encode(pixels.as_flattened(), width as u32, height as u32, ColorType::Rgba8).unwrap();
    out
}

/// An image without alpha.
fn opaque(pixels: &[[u8; 3]]) -> Vec<u8> {
    let mut out = Vec::new();
    let encoder = WebPEncoder::new(&mut out);
    encoder.encode(pixels.as_flattened(), pixels.len() as u32, 1, ColorType::Rgb8).unwrap();
    out
}

/// The functions of a degree but the constant one.
const fn functions(degree: usize) -> usize {
    degree * (degree + 2)
}

/// Three splats of a version and a degree, by file name.
fn files(version: u32, degree: usize) -> Vec<(String, Vec<u8>)> {
    // Zero alpha: colours that were multiplied by it are lost.
    let mut files = vec![
        ("l.webp", opaque(&[[0, 255, 0], [0, 255, 1], [255, 0, 0]])),
        ("u.webp", opaque(&[[0, 255, 128], [0, 255, 0], [255, 0, 64]])),
        ("scales.webp", webp(&[[0, 1, 2, 0], [255, 254, 253, 0], [3; 4]], 3)),
        ("quats.webp", webp(&[[255, 128, 128, 252], [128, 0, 128, 255], [128, 128, 128, 253]], 3)),
        ("sh0.webp", webp(&[[0, 51, 255, 0], [1, 2, 3, 255], [204, 5, 6, 51]], 3)),
    ];
    let number = |i: u32| json!(f64::from(i) / 4.0 - 10.0);
    let table: Vec<Value> = (0..256).map(number).collect();
    let means =
        json!({"mins": [-1, -2, -3], "maxs": [1, 2, 3], "files": ["l.webp", "u.webp"], "shape": [3, 3]});
    let mut meta = if version == 2 {
        json!({
            "version": 2, "count": 3, "antialias": true, "asset": {"generator": "a test", "copyright": "me"},
            "means": means, "scales": {"codebook": table, "files": ["scales.webp"]},
            "quats": {"files": ["quats.webp"]}, "sh0": {"codebook": table, "files": ["sh0.webp"]},
        })
    } else {
        json!({
            "means": means,
            "scales": {"mins": [-10, -9, -8], "maxs": [0, 1, 2], "files": ["scales.webp"]},
            "quats": {"files": ["quats.webp"], "encoding": "quaternion_packed"},
            "sh0": {"mins": [-1, -2, -3, -4], "maxs": [1, 2, 3, 4], "files": ["sh0.webp"]},
        })
    };
    if degree > 0 {
        let width = functions(degree);
        // Two rows of 64 entries; entry 0 is 0s, entry 65 has 1, 2, 3, ...
        let mut palette = vec![[0; 4]; 2 * 64 * width];
        for function in 0..width {
            let first = 1 + 3 * function as u8;
            palette[(64 + 1) * width + function] = [first, first + 1, first + 2, 9];
        }
        files.push(("centroids.webp", webp(&palette, 64 * width)));
        files.push(("labels.webp", webp(&[[0, 0, 7, 7], [65, 0, 0, 0], [65, 0, 1, 255]], 3)));
        let names = ["centroids.webp", "labels.webp"];
        meta["shN"] = if version == 2 {
            json!({"count": 66, "bands": degree, "codebook": table, "files": names})
        } else {
            json!({"shape": [3, 3 * width], "mins": -2, "maxs": 3.1, "quantization": 8, "files": names})
        };
    }
    let files = files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes));
    [("meta.json".to_owned(), meta.to_string().into_bytes())].into_iter().chain(files).collect()
}

fn zip(files: &[(String, Vec<u8>)], deflate: bool) -> Vec<u8> {
    let mut out = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut out);
    for (name, bytes) in files {
        let method = if deflate { CompressionMethod::DEFLATE } else { CompressionMethod::STORE };
        let (mut entry, config) = archive
            .new_file(EntryPath::verbatim(name.as_bytes()))
            .compression_method(method)
            .start()
            .unwrap();
        let descriptor = if deflate {
            let encoder = flate2::write::DeflateEncoder::new(&mut entry, flate2::Compression::best());
            let mut writer = config.wrap(encoder);
            writer.write_all(bytes).unwrap();
            let (encoder, descriptor) = writer.finish().unwrap();
            encoder.finish().unwrap();
            descriptor
        } else {
            let mut writer = config.wrap(&mut entry);
            writer.write_all(bytes).unwrap();
            writer.finish().unwrap().1
        };
        entry.finish(descriptor).unwrap();
    }
    archive.finish().unwrap();
    out
}

fn folder(what: &'static str, files: Vec<(String, Vec<u8>)>) -> Sample {
    Sample { what, files }
}

fn archive(what: &'static str, files: &[(String, Vec<u8>)]) -> Sample {
    Sample::one(what, "a.sog", zip(files, false))
}

pub fn samples() -> Vec<Sample> {
    vec![
        folder("version 1", files(1, 1)),
        folder("version 2", files(2, 2)),
        archive("archive", &files(2, 0)),
        Sample::one("deflated", "a.sog", zip(&files(1, 3), true)),
    ]
}

fn check(splats: &Gaussians, version: u32, degree: usize) {
    assert_eq!((splats.len(), splats.degree(), splats.axes()), (3, degree as u32, Axes::Rdf));
    // -1, 2 and 3 times 32768 / 65535 * 2 - 1; and so on.
    let share = |low: f64, high: f64, word: f64| low + (high - low) * word / 65535.0;
    let place = |value: f64| value.signum() * value.abs().exp_m1();
    let expected = [
        [-1.0, 2.0, share(-3.0, 3.0, 32768.0)],
        [-1.0, 2.0, share(-3.0, 3.0, 1.0)],
        [1.0, -2.0, share(-3.0, 3.0, 16384.0)],
    ];
    for (found, expected) in splats.centres().iter().zip(expected.map(|row| row.map(place))) {
        assert!(
            found.iter().zip(expected).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6),
            "{found:?} {expected:?}"
        );
    }
    let near = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 1e-5, "{a} {b}");
    let byte = |value: f64, [low, high]: [f64; 2]| {
        if version == 2 { value / 4.0 - 10.0 } else { low + (high - low) * value / 255.0 }
    };
    for (k, limits) in [[-10.0, 0.0], [-9.0, 1.0], [-8.0, 2.0]].into_iter().enumerate() {
        let value = [[0.0, 1.0, 2.0], [255.0, 254.0, 253.0], [3.0; 3]].map(|row| row[k]);
        (0..3).for_each(|i| near(splats.log_scales()[i][k], byte(value[i], limits).min(20.0)));
    }
    let (half, small) = (0.5_f32.sqrt(), 4e-3);
    for (found, expected) in
        splats.rotations().iter().zip([[half, half, 0.0, 0.0], [0.0, -half, 0.0, half], [0.0, 1.0, 0.0, 0.0]])
    {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < small), "{found:?} {expected:?}");
    }
    let width = 3 * (1 + functions(degree));
    for (i, row) in [[0.0, 51.0, 255.0], [1.0, 2.0, 3.0], [204.0, 5.0, 6.0]].into_iter().enumerate() {
        for (k, value) in row.into_iter().enumerate() {
            near(splats.harmonics()[i * width + k], byte(value, [-1.0 - k as f64, 1.0 + k as f64]));
        }
    }
    let logit = |byte: f64| 1.0 / (1.0 + (4.0 - 8.0 * byte / 255.0).exp());
    for (found, value) in splats.opacities().iter().zip([0.0, 255.0, 51.0]) {
        near(*found, if version == 2 { value / 255.0 } else { logit(value) });
    }
    for (i, own) in splats.harmonics().chunks(width).enumerate() {
        for (place, k) in own[3..].iter().enumerate() {
            near(*k, byte(if i == 0 { 0.0 } else { 1.0 + place as f64 }, [-2.0, 3.1]));
        }
    }
}

#[test]
fn both_versions_are_read_from_folders_and_archives() {
    for version in 1..=2 {
        for degree in 0..=3 {
            let files = files(version, degree);
            let loaded = folder("folder", files.clone()).loaded();
            assert_eq!(loaded.report.format, format!("SOG {version}"));
            let mode = if version == 2 { TrainedMode::Antialiased } else { TrainedMode::Unknown };
            let texts = loaded.report.gaussians.clone().unwrap().texts;
            assert_eq!(texts.first().map(String::as_str), (version == 2).then_some("copyright: me"));
            let splats = gaussians(loaded);
            assert_eq!(splats.mode(), mode);
            check(&splats, version, degree);
            for deflate in [false, true] {
                let bytes = zip(&files, deflate);
                check(&gaussians(Sample::one("zip", "a.sog", bytes.clone()).loaded()), version, degree);
                // Content decides.
                check(&gaussians(Sample::one("zip", "a.zip", bytes).loaded()), version, degree);
            }
            let inner: Vec<_> =
                files.iter().map(|(name, bytes)| (format!("scene/{name}"), bytes.clone())).collect();
            check(&gaussians(archive("in a folder of the archive", &inner).loaded()), version, degree);
            let on_disk = Folder::new();
            for (name, bytes) in &files {
                on_disk.write(&format!("splats/{name}"), bytes);
            }
            for path in ["splats", "splats/meta.json"] {
                let loaded = read(on_disk.path(path), &OPTIONS).unwrap_or_else(|e| panic!("{e}"));
                assert!(loaded.report.notes.is_empty(), "{:?}", loaded.report.notes);
                check(&gaussians(loaded), version, degree);
            }
            let other = on_disk.write("a.sog", zip(&files, true));
            check(&gaussians(read(other, &OPTIONS).unwrap()), version, degree);
        }
    }
}

/// Files with another `meta.json`.
fn changed(version: u32, change: impl Fn(&mut Value)) -> Vec<(String, Vec<u8>)> {
    let mut files = files(version, 1);
    let mut meta = serde_json::from_slice(&files[0].1).unwrap();
    change(&mut meta);
    files[0].1 = meta.to_string().into_bytes();
    files
}

#[test]
fn descriptions_that_lie_are_refused() {
    let refused = |version: u32, change: &dyn Fn(&mut Value), parts: &[&str]| {
        folder("changed", changed(version, change)).refused(parts);
    };
    refused(2, &|meta| meta["version"] = json!(3), &["version", "3: must be 1 or 2"]);
    refused(2, &|meta| meta["count"] = json!(4), &["l.webp", "3 x 1 pixels: must be at least 4"]);
    refused(2, &|meta| meta["count"] = json!(1_000_000), &["1000000 splats: more than an image"]);
    refused(2, &|meta| meta["count"] = json!(null), &["count", "is missing"]);
    refused(1, &|meta| meta["means"]["shape"] = json!([]), &["means.shape", "is missing"]);
    refused(2, &|meta| meta["means"]["files"] = json!(["l.webp"]), &["means", "1 files: must be 2"]);
    refused(2, &|meta| meta["means"]["mins"] = json!([1, 2]), &["means", "2 mins and 3 maxs: must be 3"]);
    refused(2, &|meta| meta["scales"]["codebook"] = json!([1]), &["scales", "1 numbers in the codebook"]);
    refused(2, &|meta| meta["sh0"]["codebook"] = json!(null), &["sh0", "codebook is missing"]);
    refused(1, &|meta| meta["sh0"]["maxs"] = json!(null), &["sh0", "mins and maxs are missing"]);
    refused(1, &|meta| meta["quats"]["encoding"] = json!("other"), &["quats", "must be quaternion_packed"]);
    refused(2, &|meta| meta["shN"]["bands"] = json!(4), &["shN", "bands: must be 1 to 3"]);
    refused(2, &|meta| meta["shN"]["bands"] = json!(2), &["centroids.webp", "192 pixels wide: must be 512"]);
    refused(1, &|meta| meta["shN"]["shape"] = json!([3, 10]), &["shN", "9, 24 or 45"]);
    refused(2, &|meta| meta["shN"]["count"] = json!(65), &["splat 1 has entry 65", "there are 65"]);
    refused(2, &|meta| meta["shN"]["count"] = json!(129), &["128 entries of the palette", "at least 129"]);
    refused(2, &|meta| meta["quats"]["files"] = json!(["none.webp"]), &["cannot open"]);
    for name in ["../quats.webp", "/quats.webp", "a/../quats.webp", "..", "", "a\\..\\b"] {
        let change = |meta: &mut Value| meta["quats"]["files"] = json!([name]);
        refused(2, &change, &["must be the name of a file beside meta.json"]);
        archive("name", &changed(2, change)).refused(&["is missing"]);
    }
    let mut files = files(2, 0);
    files[3].1 = b"RIFF\x04\0\0\0WEBP".to_vec();
    folder("no image", files.clone()).refused(&["scales.webp", "no WebP image"]);
    files.truncate(1);
    files[0].1 = b"{\"means\": \"x.webp\"}".to_vec();
    folder("no description", files.clone()).refused(&["line 1", "means"]);
    files[0].1.resize((1 << 20) + 1, b' ');
    folder("long", files).refused(&["bytes: must have at most 1048576"]);
}

#[test]
fn archives_that_lie_are_refused() {
    let with = |name: &str| {
        let mut files = files(2, 0);
        files.push((name.to_owned(), b"x".to_vec()));
        archive("name", &files)
    };
    for name in ["../x", "a/../x", "..\\x", "/x"] {
        with(name).refused(&["entry", "must lie within the archive"]);
    }
    with("sh0.webp").refused(&["\"sh0.webp\"", "is there twice"]);
    with("a/meta.json").loaded();
    archive("no meta", &files(2, 0)[1..]).refused(&["there is no meta.json"]);
    archive("missing", &files(2, 0)[..5]).refused(&["\"sh0.webp\"", "is missing"]);
    let whole = zip(&files(2, 0), false);
    let mut damaged = whole.clone();
    let at = whole.windows(4).position(|window| window == b"VP8L").unwrap();
    damaged[at + 30] ^= 1;
    Sample::one("checksum", "a.sog", damaged).refused(&["is damaged"]);
    Sample::one("cut", "a.sog", &whole[..whole.len() - 30]).refused(&["zip archive"]);
    // The sizes of the first entry in the directory.
    let directory = whole.windows(4).position(|window| window == b"PK\x01\x02").unwrap();
    for (at, parts) in [(20, ["meta.json", "packed in"]), (24, ["meta.json", "more than fits"])] {
        let mut long = whole.clone();
        long[directory + at + 3] = 255;
        Sample::one("size", "a.sog", long).refused(&parts);
    }
    let mut method = whole.clone();
    method[directory + 10] = 12;
    Sample::one("method", "a.sog", method).refused(&["must be stored or deflated"]);
    let mut encrypted = whole;
    encrypted[directory + 8] |= 1;
    Sample::one("encrypted", "a.sog", encrypted).refused(&["is encrypted"]);
    // A bomb: the size in the directory is a lie.
    let mut files = files(2, 0);
    files[1].1 = vec![0; 1 << 16];
    let mut bomb = zip(&files, true);
    let size = (1_u32 << 16).to_le_bytes();
    let places: Vec<usize> =
        (0..bomb.len() - 4).filter(|at| bomb[*at..at + 4] == size && *at > 100).collect();
    places.into_iter().for_each(|at| bomb[at..at + 4].copy_from_slice(&99_u32.to_le_bytes()));
    Sample::one("bomb", "a.sog", bomb).refused(&["l.webp"]);
    // Other archives are as unknown as before.
    Sample::one("other", "a.zip", zip(&[("a.txt".to_owned(), b"x".to_vec())], false))
        .refused(&["ZIP is not supported"]);
}
