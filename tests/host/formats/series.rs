//! Series of time steps: collections, lists and names with `*`, and what is refused.

use volraster::io::scene_file::LoadedScene;
use volraster::io::{Data, ReadOptions, Step, read, read_arrays};

use super::support::{Folder, OPTIONS, assert_refusal};

/// A grid of 2 x 2 x 2 samples whose range ends at a number.
fn grid(top: u8) -> Vec<u8> {
    let mut bytes = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n".to_vec();
    bytes.extend([0, 0, 0, 0, 0, 0, 0, top]);
    bytes
}

fn step(step: u32) -> ReadOptions {
    ReadOptions { step: Some(step), ..OPTIONS }
}

/// A folder with grids `s2`, `s3`, `s10`, whose ranges end at these numbers.
fn steps() -> Folder {
    let folder = Folder::new();
    for n in [2, 3, 10] {
        folder.write(&format!("s{n}.nrrd"), grid(n));
    }
    folder
}

#[test]
fn steps_are_read_in_the_order_of_time() {
    let folder = steps();
    let sets = r#"<DataSet timestep="2.5" part="0" file="s10.nrrd"/>
        <DataSet timestep="-1" file="s3.nrrd"></DataSet> <DataSet timestep="1e0" file="./s2.nrrd"/>"#;
    let pvd = |sets: &str| {
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\">\n<Collection>{sets}</Collection></VTKFile>"
        )
    };
    folder.write("timed.pvd", pvd(sets));
    folder.write("listed.pvd", pvd(r#"<DataSet file="s10.nrrd"/><DataSet file="s2.nrrd"/>"#));
    let json = r#"{"file-series-version": "1.0", "files": [{"name": "s10.nrrd", "time": 7}, {"name": "s2.nrrd", "time": 0}]}"#;
    folder.write("a.nrrd.series", json);
    folder.write("scene.json", r#"{"volume": {"file": "timed.pvd"}}"#);
    folder.write("more.json", r#"{"volume": {"file": "s*.nrrd"}}"#);
    for (name, tops, times) in [
        ("timed.pvd", &[3, 2, 10][..], Some(&[-1.0, 1.0, 2.5][..])),
        ("listed.pvd", &[10, 2], None),
        ("a.nrrd.series", &[2, 10], Some(&[0.0, 7.0])),
        ("s*.nrrd", &[2, 3, 10], None),
        ("*1*.nrrd", &[10], None),
        ("scene.json", &[3, 2, 10], Some(&[-1.0, 1.0, 2.5])),
        ("more.json", &[2, 3, 10], None),
    ] {
        let path = folder.path(name);
        for (i, top) in (0..).zip(tops) {
            let loaded = LoadedScene::load_any(&path, &step(i)).unwrap();
            assert_eq!(loaded.scene.data.range(), [0.0, f64::from(*top)], "{name} {i}");
            let data = LoadedScene::read_data(&path, &step(i)).unwrap();
            assert_eq!(data.data.range(), [0.0, f64::from(*top)], "{name} {i}");
            let Step { file, time } = &loaded.report.steps[usize::try_from(i).unwrap()];
            assert!(file.ends_with(format!("s{top}.nrrd")), "{file:?}");
            assert_eq!(*time, times.map(|times| times[usize::try_from(i).unwrap()]), "{name}");
        }
        let first = LoadedScene::load_any(&path, &OPTIONS).unwrap();
        assert_eq!(first.report.steps.len(), tops.len(), "{name}");
        assert_eq!(first.scene.data.range(), [0.0, f64::from(tops[0])], "{name}");
        let error = LoadedScene::load_any(&path, &step(9)).unwrap_err();
        assert_refusal(&error, &["step 9: there are ", &format!("from 0 to {}", tops.len() - 1)], name);
    }
    let arrays = read_arrays(folder.path("timed.pvd"), &step(1), true).unwrap();
    assert!(matches!(read(folder.path("s2.nrrd"), &OPTIONS).unwrap().data, Data::Grid(_)));
    assert_eq!(arrays.report.notes[0], format!("step 1 of 3: {}", folder.path("./s2.nrrd").display()));
    // A file whose name has a star is that file.
    #[cfg(unix)]
    {
        folder.write("t*.nrrd", grid(99));
        folder.write("t1.nrrd", grid(1));
        assert_eq!(read(folder.path("t*.nrrd"), &OPTIONS).unwrap().data.range(), [0.0, 99.0]);
    }
}

#[test]
fn wrong_series_are_refused() {
    let folder = steps();
    let refused = |name: &str, text: &str, parts: &[&str]| {
        folder.write(name, text);
        assert_refusal(&read(folder.path(name), &OPTIONS).unwrap_err(), parts, text);
    };
    let pvd = |sets: &str, parts: &[&str]| {
        let text = format!("<VTKFile type=\"Collection\">\n<Collection>{sets}</Collection></VTKFile>");
        refused("a.pvd", &text, &[&["a.pvd"], parts].concat());
    };
    pvd("", &["steps: there is none"]);
    pvd(r#"<DataSet timestep="0"/>"#, &["line 2, DataSet file: missing"]);
    pvd(r#"<DataSet timestep="soon" file="s2.nrrd"/>"#, &["line 2, DataSet timestep", "\"soon\"", "finite"]);
    pvd(
        r#"<DataSet timestep="0" file="s2.nrrd"/><DataSet file="s3.nrrd"/>"#,
        &["s2.nrrd: has a time, and others"],
    );
    let parts =
        r#"<DataSet timestep="0" part="0" file="s2.nrrd"/><DataSet timestep="0" part="1" file="s3.nrrd"/>"#;
    pvd(parts, &["steps: ", "s2.nrrd and ", "s3.nrrd have the same time", "write them as one .vtu"]);
    refused("a.pvd", "<VTKFile type=\"Else\"/>", &["content: no VTKFile of type Collection"]);
    refused("a.pvd", "no XML at all <", &["a.pvd: line 1", "no XML"]);
    refused("a.series", "{\"files\": 3}", &["a.series: line 1, column 11, files"]);
    refused("a.series", "{\"files\": []}", &["a.series: steps: there is none"]);
    refused("a.series", "{\"files\": [{\"name\": \"gone.vtk\"}]}", &["gone.vtk: cannot open"]);
    refused(
        "a.pvd",
        r#"<VTKFile type="Collection"><DataSet file="a.pvd"/></VTKFile>"#,
        &["a.pvd", "names other files"],
    );
    let error = read(folder.path("none*.nrrd"), &OPTIONS).unwrap_err();
    assert_refusal(&error, &["none*.nrrd: file name: no file fits the pattern"], "pattern");
    for (name, rule) in [("s2.nrrd", "this is no series"), ("field.json", "its data is no series")] {
        folder.write("field.json", r#"{"volume": {"field": "ramp", "dims": [2, 2, 2]}}"#);
        let error = LoadedScene::load_any(folder.path(name), &step(0)).unwrap_err();
        assert_refusal(&error, &[name, "step 0: ", rule], name);
    }
}
