//! Folders.

use std::io::Read as _;

use volraster::io::{ReadOptions, read};
use volraster::scene::Samples;

use crate::formats::support::{Folder, OPTIONS, assert_refusal, grid, shared};
use crate::formats::tiff::{LITTLE, Page, Value};

/// A slice of 3 x 2 bytes.
fn slice(value: u8) -> Page {
    Page::grey(3, 2, 8, 1, vec![value; 6])
}

fn refused(folder: &Folder, parts: &[&str]) {
    assert_refusal(&read(folder.path(""), &OPTIONS).unwrap_err(), parts, "folder");
}

#[test]
fn slices_in_the_order_of_their_numbers() {
    let folder = Folder::new();
    for number in [10, 8, 9, 11] {
        folder.write(&format!("slice{number}.tif"), LITTLE.file(&[slice(number)]));
    }
    folder.write(".hidden", "x");
    folder.write("Thumbs.db", "x");
    folder.write("README.md", "x");
    folder.write("list.txt", "x");
    std::fs::create_dir(folder.path("more")).unwrap();
    let loaded = read(folder.path(""), &OPTIONS).unwrap();
    assert!(loaded.report.warnings.is_empty(), "{:?}", loaded.report.warnings);
    let beside = "1 folder is not looked into".to_owned();
    assert!(loaded.report.notes.contains(&beside), "{:?}", loaded.report.notes);
    let left_out = "left out: .hidden, README.md, Thumbs.db, list.txt".to_owned();
    assert!(loaded.report.notes.contains(&left_out), "{:?}", loaded.report.notes);
    assert_eq!(loaded.report.format, "TIFF slices");
    let image = grid(loaded);
    assert_eq!(image.dims(), [3, 2, 4]);
    let values: Vec<f64> = (0..4).map(|z| image.value(2, 1, z)).collect();
    assert_eq!(values, [8.0, 9.0, 10.0, 11.0]);

    folder.write("slice13.tif", LITTLE.file(&[slice(13)]));
    let warnings = read(folder.path(""), &OPTIONS).unwrap().report.warnings;
    assert!(warnings[0].contains("after slice11.tif comes slice13.tif"), "{warnings:?}");
    let one = read(folder.path("slice13.tif"), &OPTIONS).unwrap_err();
    assert_refusal(&one, &["slice13.tif: pages: 1 slice", "name their folder"], "one slice");
}

#[test]
fn scales_of_the_first_slice_count() {
    let folder = Folder::new();
    for number in 0..3 {
        let page = slice(number).text("ImageJ=1.54f\nunit=um\nspacing=3\n");
        let page = page.with(282, Value::Fraction(2, 1)).with(283, Value::Fraction(4, 1)).short(296, 1);
        folder.write(&format!("{number}.tif"), LITTLE.file(&[page]));
    }
    let image = grid(read(folder.path(""), &OPTIONS).unwrap());
    assert_eq!(image.spacing().to_array(), [0.5, 0.25, 3.0]);
}

/// Slices and lists of files with whole planes stay in their files, which are opened to read them.
#[test]
fn planes_stay_in_their_files() {
    let on_demand = ReadOptions { on_demand: Some(1), ..OPTIONS };
    let slices = Folder::new();
    for number in 0..4 {
        let values = (0..6).map(|i| 10 * number + i).collect();
        slices.write(&format!("{number}.tif"), LITTLE.file(&[Page::grey(3, 2, 8, 1, values)]));
    }
    let list = Folder::new();
    for (name, first) in [("a.raw", 0), ("b.raw", 20)] {
        list.write(name, (0..12).map(|i| first + 10 * (i / 6) + i % 6).collect::<Vec<u8>>());
    }
    let header =
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 2 4\nencoding: raw\ndata file: LIST 3\na.raw\nb.raw\n";
    list.write("list.nhdr", header);
    for (folder, name, last) in [(&slices, "", "3.tif"), (&list, "list.nhdr", "b.raw")] {
        let [whole, own] =
            [&OPTIONS, &on_demand].map(|options| grid(read(folder.path(name), options).unwrap()));
        let Samples::OnDemand(samples) = own.samples() else { panic!("{name}: was read") };
        for (first, extent) in [([0; 3], [3, 2, 4]), ([1, 1, 1], [2, 1, 2]), ([0, 0, 2], [3, 1, 2])] {
            let part = samples.read(first, extent).unwrap();
            for i in 0..part.len() as u32 {
                let place = [i % extent[0], i / extent[0] % extent[1], i / extent[0] / extent[1]];
                let [x, y, z] = [0, 1, 2].map(|axis| first[axis] + place[axis]);
                assert_eq!(part.get(i as usize), whole.value(x, y, z), "{name} {place:?}");
            }
        }
        let bytes = std::fs::read(folder.path(last)).unwrap();
        folder.write(last, &bytes[..bytes.len() - 1]);
        let error = samples.read([0; 3], [3, 2, 4]).unwrap_err();
        let rule = format!("{last}: file: has {} bytes: it had {}", bytes.len() - 1, bytes.len());
        assert_refusal(&error, &[&rule], name);
        samples.read([0; 3], [3, 2, 2]).unwrap();
        std::fs::remove_file(folder.path(last)).unwrap();
        assert!(samples.read([0; 3], [3, 2, 4]).unwrap_err().to_string().contains(last), "{name}");
    }
    slices.write("3.tif", LITTLE.file(&[Page::grey(3, 2, 8, 1, vec![0; 6]).short(259, 5)]));
    let error = read(slices.path(""), &on_demand).unwrap_err();
    assert_refusal(&error, &["3.tif: page 1: strip or tile 0", "LZW"], "a packed slice");
}

#[test]
fn what_does_not_fit_is_named() {
    let folder = Folder::new();
    refused(&folder, &["files: holds nothing: slices in TIFF files, one DICOM series"]);
    folder.write("a.txt", "nothing");
    std::fs::create_dir(folder.path("b")).unwrap();
    refused(&folder, &["holds 1 other file, 1 folders"]);
    std::fs::remove_dir(folder.path("b")).unwrap();
    for number in 1..4 {
        folder.write(&format!("{number}.tif"), LITTLE.file(&[slice(number)]));
    }
    folder.write("2.tif", LITTLE.file(&[Page::grey(2, 3, 8, 1, vec![0; 6])]));
    refused(&folder, &["2.tif: page 1: 2 x 3 pixels", "all slices must be as the first, 3 x 2"]);
    folder.write("2.tif", LITTLE.file(&[slice(1), slice(2)]));
    refused(&folder, &["2.tif: pages: 2: a file of a series of slices has 1"]);
    folder.write("2.tif", "damaged");
    refused(&folder, &["2.tif: byte 0: must be II or MM"]);
    folder.write("2.tif", LITTLE.file(&[slice(2)]));
    folder.write("c.nrrd", b"NRRD0004\n");
    refused(&folder, &["holds 3 TIFF files, 1 NRRD file, 1 other file"]);
}

#[test]
fn one_data_file_is_read() {
    let folder = Folder::new();
    folder.write("notes.txt", "x");
    folder.write("stack.tif", LITTLE.file(&[slice(1), slice(2)]));
    assert_eq!(grid(read(folder.path(""), &OPTIONS).unwrap()).dims(), [3, 2, 2]);
    std::fs::remove_file(folder.path("stack.tif")).unwrap();
    let header = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: v.img\n";
    folder.write("v.nhdr", header);
    folder.write("v.img", [0, 1, 2, 3, 4, 5, 6, 7]);
    let loaded = read(folder.path(""), &OPTIONS).unwrap();
    assert!(
        loaded.report.notes.contains(&"left out: notes.txt, v.img".to_owned()),
        "{:?}",
        loaded.report.notes
    );
    assert_eq!(*grid(loaded).samples(), Samples::U8((0..8).collect()));
}

#[cfg(not(feature = "dicom"))]
#[test]
fn dicom_is_refused_by_name() {
    let folder = Folder::new();
    let path = folder.write("a", [&[0; 128][..], b"DICM\x02\0\x10\0"].concat());
    let parts = ["a: format: DICOM: this program was built without the feature \"dicom\""];
    assert_refusal(&read(&path, &OPTIONS).unwrap_err(), &parts, "file");
    folder.write("b.dcm", "x");
    refused(&folder, &parts);
}

/// Files of a ZIP archive, whose sizes stand before each.
fn unzip(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let number = |at: usize, size: usize| {
        bytes[at..at + size].iter().rev().fold(0, |sum, &byte| sum << 8 | usize::from(byte))
    };
    // Sizes may stand only in the directory at the end.
    let end = bytes.windows(4).rposition(|window| window == b"PK\x05\x06").unwrap();
    let (count, mut at) = (number(end + 10, 2), number(end + 16, 4));
    let mut files = Vec::new();
    for _ in 0..count {
        let (method, packed, name_len) = (number(at + 10, 2), number(at + 20, 4), number(at + 28, 2));
        let local = number(at + 42, 4);
        let name = String::from_utf8_lossy(&bytes[at + 46..at + 46 + name_len]).into_owned();
        let begin = local + 30 + number(local + 26, 2) + number(local + 28, 2);
        let data = &bytes[begin..begin + packed];
        let mut file = Vec::new();
        match method {
            0 => file.extend_from_slice(data),
            _ => drop(flate2::read::DeflateDecoder::new(data).read_to_end(&mut file).unwrap()),
        }
        files.push((name, file));
        at += 46 + name_len + number(at + 30, 2) + number(at + 32, 2);
    }
    files
}

#[test]
fn a_real_series_of_slices() {
    let Some(path) = shared("structured/c_elegans_em_tiff_series.zip") else { return };
    let folder = Folder::new();
    let mut slices: Vec<(String, Vec<u8>)> = unzip(&std::fs::read(path).unwrap())
        .into_iter()
        .filter(|(name, bytes)| name.ends_with(".tif") && !bytes.is_empty())
        .collect();
    slices.sort();
    for (name, bytes) in &slices {
        folder.write(name.rsplit('/').next().unwrap(), bytes);
    }
    let loaded = read(folder.path(""), &OPTIONS).unwrap();
    assert!(loaded.report.warnings.is_empty(), "{:?}", loaded.report.warnings);
    let grid = grid(loaded);
    assert_eq!(grid.dims(), [256, 256, slices.len() as u32]);
    let Samples::U8(values) = grid.samples() else { panic!() };
    for (slice, (name, bytes)) in values.chunks_exact(1 << 16).zip(&slices) {
        // Each file has one strip at byte 219.
        assert_eq!(slice, &bytes[219..219 + (1 << 16)], "{name}");
    }
}
