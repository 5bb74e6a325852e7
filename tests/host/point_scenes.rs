//! Scenes of points: what scene files may say of them, and of kernels; what is chosen for real ones.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    reason = "a test fails by panicking, and makes its own numbers"
)]

use std::fs;
use std::path::Path;

use crate::folder::{Folder, OPTIONS};
use crate::formats::support::shared;
use glam::DVec3;
use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{Data, ReadOptions, write_nrrd, write_vtu};
use volraster::scene::{Field, Kernel, KernelSize, Kernels, Model, Points, Scene, View, auto};

/// Points of a scene file.
#[track_caller]
fn points(folder: &Folder, spec: &str) -> Points {
    let loaded = folder.scene(&format!("{{\"points\": {spec}}}")).unwrap_or_else(|e| panic!("{e}"));
    loaded.scene.points().unwrap().clone()
}

const CENTRES: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Scalars, radii, weights and covariances of four points.
fn write_points(path: &Path) {
    let array = |name: &str, components: u32, values: &str| {
        format!(
            "<DataArray type=\"Float32\" Name=\"{name}\" NumberOfComponents=\"{components}\" \
             format=\"ascii\">{values}</DataArray>"
        )
    };
    let covariance = "1 0 0 4 0 9 ".repeat(4);
    let centres: Vec<String> = CENTRES.iter().flatten().map(ToString::to_string).collect();
    let document = format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"4\" NumberOfCells=\"0\"><PointData>{}{}{}{}{}</PointData>\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">{}</DataArray></Points>\
         <Cells><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\"></DataArray>\
         <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\"></DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\"></DataArray></Cells>\
         </Piece></UnstructuredGrid></VTKFile>",
        array("s", 1, "1 2 3 4"),
        array("t", 1, "5 6 7 8"),
        array("h", 1, "0.5 0.5 0.25 1"),
        array("m", 1, "2 3 4 5"),
        array("c", 6, &covariance),
        centres.join(" "),
    );
    fs::write(path, document).unwrap();
}

#[test]
fn points_are_a_file_with_its_arrays() {
    let folder = Folder::new();
    write_points(&folder.path("p.vtu"));
    let plain = points(&folder, r#"{"file": "p.vtu"}"#);
    assert_eq!(plain.centres(), CENTRES.map(DVec3::from_array));
    assert_eq!((plain.range(), plain.weights()), ([1.0, 4.0], None));
    // Distances to the nearest: four times 1.
    assert_eq!(plain.size(), &KernelSize::Radius(3.0));

    let named = points(&folder, r#"{"file": "p.vtu", "array": "t", "radius": "h", "weight": "m"}"#);
    assert_eq!(named.range(), [5.0, 8.0]);
    assert_eq!(named.size(), &KernelSize::Radii(vec![0.5, 0.5, 0.25, 1.0]));
    assert_eq!(named.weights().unwrap(), [2.0, 3.0, 4.0, 5.0]);
    let all = points(&folder, r#"{"file": "p.vtu", "radius": 0.125}"#);
    assert_eq!(all.size(), &KernelSize::Radius(0.125));
    assert_eq!(points(&folder, r#"{"file": "p.vtu", "radius": 2}"#).size(), &KernelSize::Radius(2.0));
    let covariances = points(&folder, r#"{"file": "p.vtu", "covariance": "c"}"#);
    assert_eq!(covariances.size(), &KernelSize::Covariances(vec![[1.0, 0.0, 0.0, 4.0, 0.0, 9.0]; 4]));

    let loaded = folder.scene(r#"{"points": {"file": "p.vtu"}}"#).unwrap();
    assert_eq!((loaded.file.as_path(), loaded.scene.kernels), (&*folder.path("p.vtu"), None));
    let note = |loaded: &LoadedScene| loaded.report.notes.join("; ");
    assert!(note(&loaded).contains("radius 3.00: from the spacing of points"), "{}", note(&loaded));
    let loaded = folder.scene(r#"{"points": {"file": "p.vtu", "radius": 1}}"#).unwrap();
    assert!(!note(&loaded).contains("radius"), "{}", note(&loaded));
    // Without a scene file as well.
    let loaded = LoadedScene::from_data(folder.path("p.vtu"), &OPTIONS).unwrap();
    assert_eq!(loaded.scene.points().unwrap().size(), &KernelSize::Radius(3.0));
    assert!(note(&loaded).contains("radius 3.00"), "{}", note(&loaded));
}

/// What the command line asks for wins, key by key; a size of one kind over that of the other.
#[test]
fn the_options_arrays_win_over_the_file_s() {
    let folder = Folder::new();
    write_points(&folder.path("p.vtu"));
    let named = |name: &str| Some(name.to_string());
    let load = |spec: &str, options: &ReadOptions| {
        folder.write("scene.json", format!("{{\"points\": {spec}}}"));
        let loaded = SceneFile::load(folder.path("scene.json"), options).unwrap_or_else(|e| panic!("{e}"));
        loaded.scene.points().unwrap().clone()
    };
    let arrays = r#"{"file": "p.vtu", "array": "s", "radius": 7, "weight": "m"}"#;
    assert_eq!(load(arrays, &OPTIONS).size(), &KernelSize::Radius(7.0));
    let radius = ReadOptions { radius: named("h"), ..OPTIONS };
    assert_eq!(load(arrays, &radius).size(), &KernelSize::Radii(vec![0.5, 0.5, 0.25, 1.0]));
    assert_eq!(load(arrays, &radius).weights().unwrap(), [2.0, 3.0, 4.0, 5.0]);
    let covariance = ReadOptions { covariance: named("c"), ..OPTIONS };
    assert!(matches!(load(arrays, &covariance).size(), KernelSize::Covariances(_)));
    let by_covariance = r#"{"file": "p.vtu", "covariance": "c"}"#;
    assert!(matches!(load(by_covariance, &OPTIONS).size(), KernelSize::Covariances(_)));
    assert!(matches!(load(by_covariance, &radius).size(), KernelSize::Radii(_)));
    let others = ReadOptions { array: named("t"), weight: named("s"), ..OPTIONS };
    let points = load(arrays, &others);
    assert_eq!((points.range(), points.weights().unwrap()), ([5.0, 8.0], &[1.0, 2.0, 3.0, 4.0][..]));
}

#[test]
fn points_are_a_field_at_random_places() {
    let folder = Folder::new();
    let spec = r#"{"field": "blobs", "count": 500, "radius": 0.25}"#;
    let points = points(&folder, spec);
    let own = Field::Blobs.points(500).unwrap();
    assert_eq!((points.centres(), points.scalars()), (own.centres(), own.scalars()));
    assert_eq!(points.size(), &KernelSize::Radius(0.25));
    let loaded = folder.scene(r#"{"points": {"field": "ramp", "count": 1000}}"#).unwrap();
    let KernelSize::Radius(radius) = *loaded.scene.points().unwrap().size() else { panic!() };
    // Of random points the median is at (3 ln 2 / (4 pi n))^(1/3), a little more at the border.
    let spacing = (3.0 * 2.0_f64.ln() / (4.0 * std::f64::consts::PI) / 125.0).cbrt();
    assert!(radius > 3.0 * spacing && radius < 3.0 * 1.2 * spacing, "{radius} {spacing}");
    assert_eq!(loaded.file, folder.path("scene.json"));
    // 28 bytes a point.
    let options = ReadOptions::within(28_000);
    assert!(SceneFile::load(folder.path("scene.json"), &options).is_ok());
    let error = SceneFile::load(folder.path("scene.json"), &ReadOptions::within(27_999)).unwrap_err();
    assert!(error.to_string().contains("points.count"), "{error}");
}

#[test]
fn kernels_are_those_of_the_scene() {
    let folder = Folder::new();
    let load = |json: &str| folder.scene(json).unwrap_or_else(|e| panic!("{json}: {e}")).scene.kernels;
    let points = |keys: &str| load(&format!("{{\"points\": {{\"field\": \"ramp\", \"count\": 9{keys}}}}}"));
    let of_points = Kernels::of_points();
    assert_eq!(points(""), None);
    assert_eq!(points(r#", "kernel": "gaussian""#), Some(of_points));
    assert_eq!(points(r#", "cut": 2.5"#), Some(Kernels { cut: 2.5, ..of_points }));
    let kernels = Kernels { kernel: Kernel::BSpline, model: Model::Interpolate, least: 0.5, ..of_points };
    assert_eq!(points(r#", "kernel": "bspline", "model": "interpolate", "least": 0.5"#), Some(kernels));

    let with = |data: &str, keys: &str| load(&format!("{{{data}, \"kernels\": {{{keys}}}}}"));
    let volume = r#""volume": {"field": "ramp", "dims": [3, 3, 3]}"#;
    let mesh = r#""mesh": {"field": "ramp", "cubes": 1}"#;
    let nine = r#""points": {"field": "ramp", "count": 9}"#;
    let of_samples = Kernels::of_samples();
    assert_eq!(with(volume, ""), Some(of_samples));
    assert_eq!(with(mesh, ""), Some(of_samples));
    assert_eq!(with(nine, ""), Some(of_points));
    assert_eq!(
        with(volume, r#""sigma": 0.9, "cut": 4"#),
        Some(Kernels { sigma: 0.9, cut: 4.0, ..of_samples })
    );
    assert_eq!(with(volume, r#""kernel": "sinc""#), Some(Kernels { kernel: Kernel::Sinc, ..of_samples }));
    assert_eq!(with(volume, r#""model": "density""#), Some(Kernels { model: Model::Density, ..of_samples }));
    assert_eq!(
        with(nine, r#""model": "interpolate""#),
        Some(Kernels { model: Model::Interpolate, ..of_points })
    );
    // Refused for meshes and points.
    let refused = |json: &str, parts: &[&str]| folder.refused(json, "scene.json", parts);
    for (data, keys, parts) in [
        (mesh, r#""kernel": "tent""#, &["kernels.kernel", "\"tent\"", "for grids"][..]),
        (nine, r#""kernel": "sinc""#, &["kernels.kernel", "\"sinc\"", "for grids"]),
        (mesh, r#""sigma": 1"#, &["kernels.sigma", "gaussian kernels on grids"]),
        (volume, r#""kernel": "tent", "sigma": 1"#, &["kernels.sigma", "gaussian"]),
        (volume, r#""kernel": "bspline", "cut": 1"#, &["kernels.cut", "gaussian", "bspline"]),
        (volume, r#""model": "density", "least": 1"#, &["kernels.least", "interpolate"]),
        (volume, r#""kernel": "sinc", "model": "density""#, &["kernels.kernel", "negative lobes"]),
        (volume, r#""kernel": "box""#, &["kernels.kernel", "\"box\"", "tent"]),
        (volume, r#""model": "sum""#, &["kernels.model", "\"sum\"", "density, interpolate"]),
        (volume, r#""sigma": 0"#, &["kernels.sigma", "0.1 to 100"]),
        (volume, r#""cut": 7"#, &["kernels.cut", "0.5 to 6"]),
        (volume, r#""least": 0"#, &["kernels.least", "0.000001"]),
        (volume, r#""radius": 1"#, &["kernels.radius", "unknown field", "`sigma`"]),
    ] {
        refused(&format!("{{{data}, \"kernels\": {{{keys}}}}}"), parts);
    }
    refused(
        r#"{"points": {"field": "ramp", "count": 9, "cut": 2}, "kernels": {"model": "density"}}"#,
        &["points.cut", "not in both"],
    );
    refused(&format!("{{{volume}, \"kernels\": 3}}"), &["kernels", "object"]);
}

#[test]
fn points_are_refused_by_place_and_rule() {
    let folder = Folder::new();
    write_points(&folder.path("p.vtu"));
    write_nrrd(folder.path("grid.nrrd"), &Field::Ramp.sample([3, 3, 3], "u8").unwrap()).unwrap();
    write_vtu(folder.path("mesh.vtu"), &Data::Mesh(Field::Ramp.tets(1).unwrap()), "s").unwrap();
    let of = |spec: &str, file: &str, parts: &[&str]| {
        folder.refused(&format!("{{\"points\": {spec}}}"), file, parts);
    };
    let scene = |spec: &str, parts: &[&str]| of(spec, "scene.json", parts);
    scene("{}", &["points", "`file` or `field`"]);
    scene("7", &["points", "object"]);
    scene(r#"{"path": "p.vtu"}"#, &["points.path", "`file`", "`covariance`", "`count`"]);
    scene(r#"{"file": "p.vtu", "field": "blobs"}"#, &["points", "not both"]);
    scene(r#"{"file": "p.vtu", "count": 3}"#, &["points.count", "field"]);
    scene(r#"{"file": "p.vtu", "sigma": 3}"#, &["points.sigma", "unknown field"]);
    scene(r#"{"file": "p.vtu", "radius": "h", "covariance": "c"}"#, &["points.covariance", "either"]);
    for wrong in ["0", "0.0", "-1", "-0.5", "[1]", "true", "null "] {
        let json = format!("{{\"file\": \"p.vtu\", \"radius\": {wrong}}}");
        if wrong == "null " {
            assert!(folder.scene(&format!("{{\"points\": {json}}}")).is_ok());
        } else {
            scene(&json, &["points.radius"]);
        }
    }
    scene(r#"{"file": "p.vtu", "radius": -2}"#, &["points.radius", "-2: must be positive"]);
    scene(r#"{"file": "p.vtu", "radius": [1]}"#, &["a length, or the name of an array"]);
    scene(r#"{"file": "p.vtu", "kernel": "tent"}"#, &["points.kernel", "\"tent\"", "gaussian and bspline"]);
    scene(r#"{"file": "p.vtu", "model": "sum"}"#, &["points.model", "\"sum\""]);
    scene(r#"{"file": "p.vtu", "cut": 0.1}"#, &["points.cut", "0.5 to 6"]);
    scene(r#"{"file": "p.vtu", "least": 0.1}"#, &["points.least", "model interpolate"]);
    scene(r#"{"field": "blobs"}"#, &["points.count", "missing"]);
    scene(r#"{"field": "foam", "count": 3}"#, &["points.field", "foam", "blobs"]);
    scene(r#"{"field": "blobs", "count": 0}"#, &["points.count", "0: must be at least 1"]);
    scene(r#"{"field": "blobs", "count": -1}"#, &["points.count", "-1"]);
    scene(r#"{"field": "blobs", "count": 4294967295}"#, &["points.count", "limit"]);
    for key in ["array", "radius", "covariance", "weight"] {
        let spec = format!("{{\"field\": \"blobs\", \"count\": 3, \"{key}\": \"q\"}}");
        scene(&spec, &[&format!("points.{key}"), "\"q\"", "fields have no arrays"]);
    }
    of(r#"{"file": "grid.nrrd"}"#, "grid.nrrd", &["holds a grid", "`volume`"]);
    of(r#"{"file": "mesh.vtu"}"#, "mesh.vtu", &["holds a mesh", "`mesh`"]);
    of(r#"{"file": "none.vtu"}"#, "none.vtu", &["cannot open"]);
    for key in ["array", "radius", "covariance", "weight"] {
        of(&format!("{{\"file\": \"p.vtu\", \"{key}\": \"q\"}}"), "p.vtu", &["\"q\"", "no such array"]);
    }
    of(r#"{"file": "p.vtu", "covariance": "h"}"#, "p.vtu", &["covariance has 6 or 9"]);
    let both = r#"{"points": {"file": "p.vtu"}, "mesh": {"field": "ramp", "cubes": 1}}"#;
    folder.refused(both, "scene.json", &["points", "one of"]);
    let options = ReadOptions { weight: Some("q".into()), ..OPTIONS };
    folder.write("scene.json", r#"{"points": {"field": "ramp", "count": 3}}"#);
    let error = SceneFile::load(folder.path("scene.json"), &options).unwrap_err().to_string();
    assert!(error.contains("weight") && error.contains("fields have no arrays"), "{error}");
}

/// Scenes in any unit of length are framed and coloured alike.
#[test]
fn the_automatic_scene_scales_with_the_unit() {
    let folder = Folder::new();
    let mut first: Option<(f64, f64)> = None;
    for scale in [1.0, 1e-9, 1e9] {
        let own = Field::Blobs.points(3000).unwrap();
        let centres = own.centres().iter().map(|p| *p * scale).collect();
        let points = Points::new(centres).unwrap().with_scalars(own.scalars().unwrap().to_vec()).unwrap();
        let path = folder.path("points.vtu");
        write_vtu(&path, &Data::Points(points), "s").unwrap();
        let loaded = LoadedScene::from_data(&path, &OPTIONS).unwrap_or_else(|e| panic!("{scale}: {e}"));
        check_framing(&loaded);
        let distance = (loaded.camera.eye - loaded.camera.target).length() / scale;
        let tau = loaded.scene.transfer.max_tau() * scale;
        let (d, t) = *first.get_or_insert((distance, tau));
        assert!(
            (distance / d - 1.0).abs() < 1e-9 && (tau / t - 1.0).abs() < 1e-9,
            "{scale}: {distance} {tau}"
        );
    }
}

/// Every visible kernel lies in the image of the automatic camera, and they fill it.
#[track_caller]
fn check_framing(loaded: &LoadedScene) {
    let points = loaded.scene.points().unwrap();
    let ([low, high], [a, b]) = (points.reach(), points.bounds());
    assert!(low.cmplt(a).all() && high.cmpgt(b).all(), "{low} {high} {a} {b}");
    let view = View::new(loaded.camera, loaded.width, loaded.height).unwrap();
    let half = f64::from(loaded.width) / 2.0;
    let reach = auto::visible(&loaded.scene).into_iter().map(|corner| {
        let (pixel, depth) = view.project(corner).unwrap();
        assert!(depth > 0.0);
        (pixel.x / half - 1.0).abs().max((pixel.y / half - 1.0).abs())
    });
    let most = reach.fold(0.0, f64::max);
    assert!(loaded.camera_is_automatic && (most - 0.98).abs() < 1e-6, "{most}");
}

#[test]
fn real_points_are_framed_and_overlap() {
    for (name, array, count) in [
        ("particles/bunny_fluid_7706.vtk", None, 7_706),
        ("particles/bunny_fluid_7706.vtk", Some("velocity"), 7_706),
        ("particles/sailors_knot_19539.vtk", None, 19_539),
        ("particles/fluid_encoded_250.vtu", None, 250),
        ("particles/dark_matter_halo.npy", None, 32_314),
    ] {
        let Some(path) = shared(name) else { continue };
        let options = ReadOptions { array: array.map(str::to_owned), ..ReadOptions::default() };
        let loaded = LoadedScene::from_data(&path, &options).unwrap_or_else(|e| panic!("{e}"));
        check_framing(&loaded);
        let points = loaded.scene.points().unwrap();
        assert_eq!(points.centres().len(), count, "{name}");
        let KernelSize::Radius(radius) = *points.size() else { panic!("{name}: {:?}", points.size()) };
        let own = loaded.report.notes.iter().any(|note| note.contains("from the spacing"));
        assert!(own, "{name}: {:?}", loaded.report.notes);
        // Most points are in the reach of several others, few in that of very many.
        let step = count.div_ceil(200);
        let within = |p: &DVec3| points.centres().iter().filter(|q| q.distance(*p) < radius).count();
        let mut reached: Vec<usize> = points.centres().iter().step_by(step).map(within).collect();
        reached.sort_unstable();
        let middle = reached[reached.len() / 2];
        let thin = reached.iter().filter(|n| **n < 4).count();
        println!("{name} {array:?}: radius {radius}, {middle} in reach, {thin} of {} thin", reached.len());
        assert!((8..2000).contains(&middle) && thin * 4 < reached.len(), "{name}: {middle} {thin}");

        let transfer = &loaded.scene.transfer;
        let size = {
            let [a, b] = points.reach();
            (b - a).length()
        };
        assert!(transfer.max_tau() > 0.0 && transfer.max_tau() * size < 1e6, "{name}: {transfer:?}");
        assert_eq!(transfer.knots().len() > 1, points.scalars().is_some(), "{name}: {transfer:?}");
        // The same again, and as a scene that is made by hand.
        let again = LoadedScene::from_data(&path, &options).unwrap();
        assert_eq!((&again.scene.transfer, again.camera), (transfer, loaded.camera), "{name}");
        assert_eq!(&auto::transfer(&loaded.scene.data).unwrap(), transfer, "{name}");
        let by_hand = Scene::new(points.clone(), transfer.clone());
        assert_eq!(by_hand.points().unwrap().size(), &KernelSize::Radius(radius), "{name}");
    }
}
