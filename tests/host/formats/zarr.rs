//! OME-Zarr: images of an independent writer (`zarr/make.py`), of both versions and of three codecs, and hostile metadata.

use std::path::{Path, PathBuf};

use glam::DVec3;
use volraster::io::{Loaded, ReadOptions, read, read_arrays};
use volraster::scene::{Data, Grid, Samples};

use super::support::{Folder, OPTIONS, assert_refusal};

const DIMS: [u32; 3] = [24, 16, 16];

fn image(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/host/formats/zarr").join(name)
}

/// The samples that `make.py` writes.
fn value(x: u32, y: u32, z: u32) -> f64 {
    f64::from(2 * x + 3 * y + z * z / 2)
}

/// The samples of a coarser level: means of eight, rounded down.
fn coarser(level: u32, x: u32, y: u32, z: u32) -> f64 {
    if level == 0 {
        return value(x, y, z);
    }
    let parts = (0..8).map(|i| coarser(level - 1, 2 * x + (i & 1), 2 * y + (i >> 1 & 1), 2 * z + (i >> 2)));
    (parts.sum::<f64>() / 8.0).floor()
}

fn loaded(path: impl AsRef<Path>, options: &ReadOptions) -> (Grid, Loaded) {
    let path = path.as_ref();
    let loaded = read(path, options).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let Data::Grid(grid) = loaded.data.clone() else { panic!("{}: no grid", path.display()) };
    (grid, loaded)
}

#[track_caller]
fn holds(grid: &Grid, of: impl Fn(u32, u32, u32) -> f64) {
    let [nx, ny, nz] = grid.dims();
    for (z, y, x) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x)))) {
        assert_eq!(grid.value(x, y, z), of(x, y, z), "at {x}, {y}, {z}");
    }
}

fn array(name: &str) -> ReadOptions {
    ReadOptions { array: Some(name.to_owned()), ..OPTIONS.clone() }
}

#[test]
fn levels_of_both_versions_are_read() {
    let (grid, Loaded { report, .. }) = loaded(image("blosc-v2.zarr"), &OPTIONS);
    assert_eq!((grid.dims(), grid.samples().type_name(), report.format), (DIMS, "u8", "OME-Zarr"));
    assert_eq!(grid.spacing(), DVec3::new(0.2, 0.25, 0.5));
    assert_eq!(grid.origin(), DVec3::ZERO);
    assert_eq!(report.notes, ["level 0 of 5: 0"]);
    holds(&grid, value);

    for (level, dims) in [(1, [12, 8, 8]), (2, [6, 4, 4]), (3, [3, 2, 2])] {
        let (grid, Loaded { report, .. }) = loaded(image(&format!("blosc-v2.zarr/{level}")), &OPTIONS);
        assert_eq!(grid.dims(), dims);
        let step = f64::from(1 << level);
        assert_eq!(grid.spacing(), step * DVec3::new(0.2, 0.25, 0.5));
        assert!((grid.origin() - 0.5 * (step - 1.0) * DVec3::new(0.2, 0.25, 0.5)).length() < 1e-15);
        assert_eq!(report.notes, [format!("level {level} of 5: {level}")]);
        holds(&grid, |x, y, z| coarser(level, x, y, z));
    }
    let error = read(image("blosc-v2.zarr/4"), &OPTIONS).unwrap_err();
    assert_refusal(&error, &["shape", "1 x 1 x 1", "at least 2"], "the coarsest level");
}

#[test]
fn channels_are_components() {
    let (grid, Loaded { report, .. }) = loaded(image("shards-v3.zarr"), &OPTIONS);
    assert_eq!((grid.dims(), grid.samples().type_name()), (DIMS, "u16"));
    assert_eq!(grid.origin(), DVec3::new(1.0, 2.0, 3.0));
    assert!(
        report.warnings[0].contains("the first of 2 channels (nuclei, membrane)"),
        "{:?}",
        report.warnings
    );
    holds(&grid, value);
    let (grid, _) = loaded(image("shards-v3.zarr/zarr.json"), &array("values:1"));
    holds(&grid, |x, y, z| 1000.0 - value(x, y, z));
    let (grid, _) = loaded(image("shards-v3.zarr"), &array("values:magnitude"));
    holds(&grid, |x, y, z| f64::from(value(x, y, z).hypot(1000.0 - value(x, y, z)) as f32));
    let all = read_arrays(image("shards-v3.zarr"), &OPTIONS, true).unwrap();
    assert_eq!(all.report.arrays[0].components, 2);
}

#[test]
fn steps_of_time_are_those_of_a_series() {
    let (grid, Loaded { report, .. }) = loaded(image("gzip-v3.zarr"), &OPTIONS);
    assert!(report.notes.contains(&"step 0 of 2".to_owned()), "{:?}", report.notes);
    holds(&grid, value);
    let (grid, _) = loaded(image("gzip-v3.zarr"), &ReadOptions { step: Some(1), ..OPTIONS.clone() });
    holds(&grid, |x, y, z| value(x, y, z) + 7.0);
    for (name, step, parts) in
        [("gzip-v3.zarr", 2, ["axis \"t\"", "2 steps"]), ("blosc-v2.zarr", 0, ["step 0", "no series"])]
    {
        let error = read(image(name), &ReadOptions { step: Some(step), ..OPTIONS.clone() }).unwrap_err();
        assert_refusal(&error, &parts, name);
    }
}

/// Chunks that are missing hold the fill value; the order of bytes and of axes in memory is that of the array.
#[test]
fn plain_arrays_are_read() {
    let (grid, Loaded { report, .. }) = loaded(image("plain-v2.zarr"), &OPTIONS);
    assert_eq!((grid.dims(), grid.samples().type_name(), grid.spacing()), (DIMS, "i16", DVec3::ONE));
    assert!(report.notes.is_empty() && report.warnings.is_empty());
    holds(&grid, |x, y, z| if z < 10 { -value(x, y, z) } else { -5.0 });
}

/// On demand, boxes are those of the whole, and the overview is a coarser level, where it lies.
#[test]
fn large_images_stay_in_their_files() {
    for (name, options) in [
        ("blosc-v2.zarr", OPTIONS.clone()),
        ("gzip-v3.zarr", OPTIONS.clone()),
        ("shards-v3.zarr", array("values:1")),
        ("plain-v2.zarr", OPTIONS.clone()),
    ] {
        let (whole, _) = loaded(image(name), &options);
        let (grid, _) = loaded(image(name), &ReadOptions { on_demand: Some(1), ..options });
        let Samples::OnDemand(samples) = grid.samples() else { panic!("{name}: in memory") };
        for (first, extent) in [([0; 3], DIMS), ([3, 5, 7], [9, 8, 4]), ([23, 15, 15], [1; 3])] {
            let part = samples.read(first, extent).unwrap();
            for i in 0..part.len() as u32 {
                let [x, y, z] = [i % extent[0], i / extent[0] % extent[1], i / extent[0] / extent[1]];
                let [x, y, z] = [first[0] + x, first[1] + y, first[2] + z];
                assert_eq!(part.get(i as usize), whole.value(x, y, z), "{name}: {x}, {y}, {z}");
            }
        }
        let overview = grid.overview();
        if name == "plain-v2.zarr" {
            assert_eq!(overview.dims(), DIMS);
            continue;
        }
        assert_eq!(overview.dims(), [12, 8, 8]);
        // The lattice is centred in the same box.
        let middle = |grid: &Grid| grid.corners().iter().sum::<DVec3>() / 8.0;
        assert!(
            (middle(&overview) - middle(&grid)).length() < 1e-12,
            "{name}: {} {}",
            middle(&overview),
            middle(&grid)
        );
        let [x, y, z] = [5, 3, 2];
        let one = |x, y, z| if name.starts_with('s') { 1000.0 - value(x, y, z) } else { value(x, y, z) };
        let eight = (0..8).map(|i| one(2 * x + (i & 1), 2 * y + (i >> 1 & 1), 2 * z + (i >> 2))).sum::<f64>();
        assert_eq!(overview.value(x, y, z), (eight / 8.0).floor(), "{name}");
    }
}

/// A folder with a copy of an image, one file of which is changed.
fn changed(folder: &Folder, name: &str, file: &str, from: &str, to: &str) -> PathBuf {
    let copy = folder.path("copy.zarr");
    let _ = std::fs::remove_dir_all(&copy);
    copy_all(&image(name), &copy);
    let path = copy.join(file);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{file}: no {from}");
    std::fs::write(path, text.replacen(from, to, 1)).unwrap();
    copy
}

fn copy_all(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let to = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy_all(&path, &to);
        } else {
            std::fs::copy(&path, to).unwrap();
        }
    }
}

#[test]
fn hostile_metadata_is_refused_in_one_line() {
    let folder = Folder::new();
    let huge = "4611686018427387904";
    let cases: &[(&str, &str, &str, &str, &[&str])] = &[
        (
            "blosc-v2.zarr",
            ".zattrs",
            "\"path\": \"0\"",
            "\"path\": \"../0\"",
            &["datasets[0]", "within the folder"],
        ),
        (
            "blosc-v2.zarr",
            ".zattrs",
            "\"path\": \"0\"",
            "\"path\": \"/etc\"",
            &["datasets[0]", "within the folder"],
        ),
        (
            "blosc-v2.zarr",
            ".zattrs",
            "\"path\": \"0\"",
            "\"path\": \"\"",
            &["datasets[0]", "within the folder"],
        ),
        ("blosc-v2.zarr", ".zattrs", "\"path\": \"0\"", "\"path\": \"9\"", &["copy.zarr/9", "array"]),
        ("blosc-v2.zarr", ".zattrs", "\"path\": \"0\"", "\"path\": 0", &["line", "path"]),
        ("blosc-v2.zarr", ".zattrs", "0.5", "1e400", &["line", "number out of range"]),
        ("blosc-v2.zarr", ".zattrs", "0.5", "-0.5", &["scale", "-0.5"]),
        ("blosc-v2.zarr", ".zattrs", "0.5", "0", &["scale", "must"]),
        ("blosc-v2.zarr", ".zattrs", "0.5,", "", &["coordinateTransformations", "3 numbers"]),
        ("blosc-v2.zarr", ".zattrs", "\"scale\"", "\"affine\"", &["line", "affine"]),
        ("blosc-v2.zarr", ".zattrs", "\"name\": \"z\"", "\"name\": \"x\"", &["axes", "z, y and x"]),
        ("blosc-v2.zarr", ".zattrs", "\"space\"", "\"time\"", &["axes", "z, y and x"]),
        ("blosc-v2.zarr", ".zattrs", "\"multiscales\"", "\"scales\"", &["multiscales", "one of its arrays"]),
        (
            "blosc-v2.zarr",
            ".zattrs",
            "\"multiscales\"",
            "\"plate\": {}, \"multiscales\"",
            &["plate", "one of them"],
        ),
        ("blosc-v2.zarr", ".zattrs", "{", "[", &["line 2"]),
        ("blosc-v2.zarr", "0/.zarray", "16,", &format!("{huge},"), &["shape", huge, "4294967295"]),
        ("blosc-v2.zarr", "0/.zarray", "24", huge, &["shape", huge, "4294967295"]),
        ("blosc-v2.zarr", "0/.zarray", "8,", "0,", &["array"]),
        ("blosc-v2.zarr", "0/.zarray", "8,", &format!("{huge},"), &["chunk shape", "limit"]),
        ("blosc-v2.zarr", "0/.zarray", "8,", "-8,", &["array"]),
        ("blosc-v2.zarr", "0/.zarray", "\"|u1\"", "\"|b1\"", &["data type", "uint8, int8"]),
        ("blosc-v2.zarr", "0/.zarray", "\"|u1\"", "\"<U7\"", &["0"]),
        ("blosc-v2.zarr", "0/.zarray", "\"|u1\"", "\"<u4\"", &["chunks"]),
        ("blosc-v2.zarr", "0/.zarray", "blosc", "lzma", &["array", "lzma"]),
        ("blosc-v2.zarr", "0/.zarray", "blosc", "zlib", &["array"]),
        ("blosc-v2.zarr", "0/.zarray", "\"zarr_format\": 2", "\"zarr_format\": 7", &["array"]),
        ("gzip-v3.zarr", "zarr.json", "\"group\"", "\"array\"", &["array"]),
        ("gzip-v3.zarr", "zarr.json", "\"t\"", "\"q\"", &["read"]),
        ("gzip-v3.zarr", "zarr.json", "\"time\"", "\"angle\"", &["axis \"t\"", "2 entries"]),
        ("gzip-v3.zarr", "0/zarr.json", "\"gzip\"", "\"zstd\"", &["array"]),
        ("gzip-v3.zarr", "0/zarr.json", "\"float32\"", "\"complex64\"", &["array", "complex64"]),
        ("gzip-v3.zarr", "0/zarr.json", "\"float32\"", "\"float64\"", &["chunks"]),
        ("gzip-v3.zarr", "0/zarr.json", "\"shape\": [", "\"shape\": [1,1,1,1,1,1,1,1,1,1,", &["array"]),
        ("shards-v3.zarr", "0/zarr.json", "8,", "7,", &["chunk", "[1, 7, 8, 8]"]),
        ("shards-v3.zarr", "0/zarr.json", "16", huge, &["0"]),
    ];
    let mut wrong = Vec::new();
    for &(name, file, from, to, parts) in cases {
        let path = changed(&folder, name, file, from, to);
        let text = read(&path, &OPTIONS).map_or_else(|error| error.to_string(), |_| "read".to_owned());
        println!("{name}/{file}: {from} -> {to}: {text}");
        if text.contains('\n') || parts.iter().any(|part| !text.contains(part)) {
            wrong.push(format!("{name}/{file}: {from} -> {to}: {parts:?} are not in: {text}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
