//! Scenes of meshes: what scene files may say of them.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::Path;

use crate::folder::{Folder, OPTIONS};
use glam::DVec3;
use volraster::io::scene_file::SceneFile;
use volraster::io::{Data, ReadOptions, write_nrrd, write_vtu};
use volraster::scene::{Field, Points, TetScalars, Tets};

const REST: &str = r#", "transfer": {"preset": "fog"},
    "camera": {"eye": [2,1.5,3.8], "target": [0,0,0], "up": [0,1,0], "fov_y_deg": 42}}"#;

fn mesh(folder: &Folder, spec: &str) -> Tets {
    let loaded = folder.scene(&format!("{{\"mesh\": {spec}{REST}")).unwrap();
    loaded.scene.mesh().unwrap().clone()
}

/// Two arrays at the points, one in the cells.
fn write_mesh(path: &Path) {
    let array = |kind: &str, name: &str, values: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">{values}</DataArray>")
    };
    let document = format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"5\" NumberOfCells=\"2\"><PointData>{}{}</PointData><CellData>{}</CellData>\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">\
         0 0 0 1 0 0 0 1 0 0 0 1 1 1 1</DataArray></Points><Cells>{}{}{}</Cells>\
         </Piece></UnstructuredGrid></VTKFile>",
        array("Float32", "p", "0 1 2 3 4"),
        array("Float32", "q", "5 6 7 8 9"),
        array("Float32", "c", "20 30"),
        array("Int32", "connectivity", "0 1 2 3 1 2 3 4"),
        array("Int32", "offsets", "4 8"),
        array("UInt8", "types", "10 10"),
    );
    fs::write(path, document).unwrap();
}

#[test]
fn a_mesh_is_a_file_or_a_field_on_cubes() {
    let folder = Folder::new();
    write_mesh(&folder.path("mesh.vtu"));
    let field = mesh(&folder, r#"{"field": "blobs", "cubes": 3}"#);
    assert_eq!(field.cells(), Field::Blobs.tets(3).unwrap().cells());
    assert_eq!(field.scalars(), Field::Blobs.tets(3).unwrap().scalars());

    assert_eq!(mesh(&folder, r#"{"file": "mesh.vtu"}"#).range(), [0.0, 4.0]);
    assert_eq!(mesh(&folder, r#"{"file": "mesh.vtu", "array": "q"}"#).range(), [5.0, 9.0]);
    let cells = mesh(&folder, r#"{"file": "mesh.vtu", "array": "cell:c"}"#);
    assert_eq!(cells.scalars(), &TetScalars::Cell(vec![20.0, 30.0]));
    // The option wins over the file's array.
    let options = ReadOptions { array: Some("p".into()), ..OPTIONS };
    let loaded = SceneFile::load(folder.path("scene.json"), &options).unwrap();
    assert_eq!(loaded.scene.mesh().unwrap().range(), [0.0, 4.0]);
    assert_eq!(loaded.file, folder.path("mesh.vtu"));
    // A preset without a range has the data's: of the array that is shown.
    assert_eq!(loaded.scene.transfer.domain(), [0.0, 4.0]);
}

#[test]
fn meshes_are_refused_by_place_and_rule() {
    let folder = Folder::new();
    write_mesh(&folder.path("mesh.vtu"));
    let grid = Field::Ramp.sample([3, 3, 3], "u8").unwrap();
    write_nrrd(folder.path("grid.nrrd"), &grid).unwrap();
    let points = Points::new(vec![DVec3::ZERO, DVec3::X]).unwrap();
    write_vtu(folder.path("points.vtu"), &Data::Points(points), "s").unwrap();

    let of = |spec: &str, parts: &[&str]| {
        folder.refused(&format!("{{\"mesh\": {spec}{REST}"), "scene.json", parts);
    };
    of("{}", &["mesh", "`file` or `field`"]);
    of("7", &["mesh", "object"]);
    of(r#"{"path": "mesh.vtu"}"#, &["mesh.path", "`file`", "`cubes`"]);
    of(r#"{"file": "mesh.vtu", "field": "blobs"}"#, &["mesh", "not both"]);
    of(r#"{"file": "mesh.vtu", "cubes": 3}"#, &["mesh.cubes", "field"]);
    of(r#"{"file": "mesh.vtu", "dims": [2, 2, 2]}"#, &["mesh.dims", "unknown field"]);
    of(r#"{"field": "blobs"}"#, &["mesh.cubes", "missing"]);
    of(r#"{"field": "foam", "cubes": 3}"#, &["mesh.field", "foam", "blobs"]);
    of(r#"{"field": "blobs", "cubes": 3, "array": "p"}"#, &["mesh.array", "\"p\"", "fields"]);
    of(r#"{"field": "blobs", "cubes": 0}"#, &["mesh.cubes", "0: must be 1 to 950"]);
    of(r#"{"field": "blobs", "cubes": -1}"#, &["mesh.cubes", "-1"]);
    of(r#"{"field": "blobs", "cubes": 2.5}"#, &["mesh.cubes", "2.5"]);
    // 80 bytes a cube and 28 a corner, against 2^30.
    of(r#"{"field": "blobs", "cubes": 215}"#, &["mesh.cubes", "limit"]);
    of(r#"{"field": "blobs", "cubes": 4294967295}"#, &["mesh.cubes", "limit"]);
    let file = |spec: &str, file: &str, parts: &[&str]| {
        folder.refused(&format!("{{{spec}{REST}"), file, parts);
    };
    file(r#""mesh": {"file": "grid.nrrd"}"#, "grid.nrrd", &["holds a grid", "`volume`"]);
    file(r#""mesh": {"file": "points.vtu"}"#, "points.vtu", &["holds points", "`points`"]);
    file(r#""volume": {"file": "mesh.vtu"}"#, "mesh.vtu", &["holds a mesh", "`mesh`"]);
    file(r#""volume": {"file": "points.vtu"}"#, "points.vtu", &["holds points", "`points`"]);
    file(r#""mesh": {"file": "mesh.vtu", "array": "r"}"#, "mesh.vtu", &["\"r\"", "no such array"]);
    file(r#""mesh": {"file": "none.vtu"}"#, "none.vtu", &["cannot open"]);
    file(
        r#""volume": {"field": "ramp", "dims": [2,2,2]}, "mesh": {"field": "ramp", "cubes": 1}"#,
        "scene.json",
        &["mesh", "one of"],
    );
    file(
        r#""background": [0,0,0,1]"#,
        "scene.json",
        &["missing", "`volume`, `mesh`, `points` or `gaussians`"],
    );
}

#[test]
fn the_largest_field_within_the_limit_of_memory_is_made() {
    let folder = Folder::new();
    folder.write("scene.json", format!("{{\"mesh\": {{\"field\": \"ramp\", \"cubes\": 5}}{REST}"));
    let bytes = 28 * 216 + 80 * 125;
    assert!(SceneFile::load(folder.path("scene.json"), &ReadOptions::within(bytes)).is_ok());
    assert!(SceneFile::load(folder.path("scene.json"), &ReadOptions::within(bytes - 1)).is_err());
}
