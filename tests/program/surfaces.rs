//! Clip regions and surfaces in scene files, and the reference of such scenes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use crate::folder::Folder;
use glam::DVec3;
use serde_json::{Value, json};
use volraster::io::ReadOptions;
use volraster::io::scene_file::SceneFile;
use volraster::reference::{self, ReferenceOptions};
use volraster::scene::{Clip, Shading, Surface};

/// A scene file of a box of extinction 1.5, with something else in it.
fn document(rest: &str) -> String {
    format!(
        "{{\"volume\": {{\"field\": \"homogeneous\", \"dims\": [3, 3, 3]}},\n\
         \"transfer\": [[0, 0.8, 0.4, 0.1, 1.5]],\n\
         \"camera\": {{\"eye\": [0, 0, 4], \"target\": [0, 0, 0], \"up\": [0, 1, 0], \"half_height\": 0.5}},\n\
         \"image\": {{\"width\": 8, \"height\": 6}}{rest}}}"
    )
}

/// A tetrahedron of four faces; the second file has the same ones as one quadrangle and two triangles with normals.
fn write_files(folder: &Folder) {
    let rows = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 4\nproperty list uchar int vertex_indices\nend_header\n";
    folder.write("a.ply", format!("{header}{rows}3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"));
    let vertices: String = rows.lines().map(|row| format!("v {row}\n")).collect();
    folder.write("b.obj", format!("{vertices}f 1 3 2\nf -4 -3 -1\nf 1 4 3\nf 2 3 4\n"));
}

fn opaque(list: &str) -> String {
    document(&format!(", \"opaque\": {list}"))
}

#[test]
fn surfaces_are_files_boxes_and_spheres() {
    let folder = Folder::new();
    write_files(&folder);
    let loaded = folder
        .scene(&opaque(
            r#"[{"file": "a.ply"}, {"file": "b.obj", "colour": [1, 0.5, 0], "opacity": 0.25, "shade": "flat"},
               {"box": {"low": [0, 0, 0], "high": [1, 2, 3]}, "scale": 2, "translate": [-1, 0, 5]},
               {"sphere": {"centre": [1, 2, 3], "radius": 0.5}},
               {"sphere": {"centre": [1, 2, 3], "radius": 0.5, "subdivisions": 1}, "opacity": 0}]"#,
        ))
        .unwrap();
    let [a, b, brick, ball, coarse] = &loaded.scene.surfaces[..] else { panic!("five are wanted") };
    assert_eq!(a.triangles(), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
    assert_eq!((a.points(), a.triangles()), (b.points(), b.triangles()));
    assert_eq!((a.colour(), a.shading()), ([0.8, 0.8, 0.8, 1.0], Shading::Headlight));
    assert_eq!((b.colour(), b.shading()), ([1.0, 0.5, 0.0, 0.25], Shading::Flat));
    assert!(a.is_opaque() && !b.is_opaque() && !coarse.is_opaque());
    assert_eq!(brick.bounds(), Some([DVec3::new(-1.0, 0.0, 5.0), DVec3::new(1.0, 4.0, 11.0)]));
    let sphere = |n| Surface::sphere(DVec3::new(1.0, 2.0, 3.0), 0.5, [1.0; 4], n).unwrap();
    assert_eq!((ball.points(), ball.triangles()), (sphere(4).points(), sphere(4).triangles()));
    assert_eq!(coarse.triangles(), sphere(1).triangles());
    assert!(folder.scene(&document("")).unwrap().scene.surfaces.is_empty());
    assert!(folder.scene(&opaque("[]")).unwrap().scene.surfaces.is_empty());
}

#[test]
fn surfaces_are_refused_by_place_and_rule() {
    let folder = Folder::new();
    write_files(&folder);
    folder.write("bad.obj", "v 1 2 3\nf 1 1 2\n");
    folder.write("c.txt", "v 1 2 3\n");
    let of = |list: &str, parts: &[&str]| folder.refused(&opaque(list), "scene.json", parts);
    let ball = r#""sphere": {"centre": [0, 0, 0], "radius": 1}"#;
    of("[7]", &["opaque[0]", "`file`, `box` or `sphere`"]);
    of("[{}]", &["opaque[0]: must have exactly one of `file`, `box` and `sphere`"]);
    of(&format!("[{{{ball}}}, {{\"file\": \"a.ply\", {ball}}}]"), &["opaque[1]: must have exactly one"]);
    of(r#"[{"path": "a.ply"}]"#, &["opaque[0].path", "unknown field `path`", "`file`", "`translate`"]);
    of(r#"[{"box": {"low": [0, 0, 0], "hi": 1}}]"#, &["opaque[0].box.hi", "`low`", "`high`"]);
    of(r#"[{"box": {"low": [0, 0, 0]}}]"#, &["opaque[0].box", "high"]);
    of(r#"[{"sphere": {"centre": [0, 0], "radius": 1}}]"#, &["opaque[0].sphere.centre", "length 2"]);
    of(r#"[{"box": {"low": [0, 0, 0], "high": [1, 0, 1]}}]"#, &["opaque[0].box: ", "low must be below high"]);
    of(
        r#"[{"sphere": {"centre": [0, 0, 0], "radius": -1}}]"#,
        &["opaque[0].sphere.radius: -1: must be positive"],
    );
    let fine =
        |n: u32| format!(r#"[{{"sphere": {{"centre": [0, 0, 0], "radius": 1, "subdivisions": {n}}}}}]"#);
    of(&fine(10), &["opaque[0].sphere.subdivisions: 10: must be at most 9"]);
    let with = |rest: &str| format!("[{{{ball}, {rest}}}]");
    of(&with(r#""colour": [1, 2]"#), &["opaque[0].colour", "length 2"]);
    of(
        &with(r#""colour": [1, -0.5, 2]"#),
        &["opaque[0].colour: [1.0, -0.5, 2.0]: must be three numbers from 0 on"],
    );
    of(&with(r#""opacity": 1.5"#), &["opaque[0].opacity: 1.5: must lie in [0, 1]"]);
    of(&with(r#""shade": "phong""#), &["opaque[0].shade: \"phong\": must be one of flat, headlight"]);
    of(&with(r#""scale": 0"#), &["opaque[0].scale: 0: must be positive and finite"]);
    let far = r#"[{"box": {"low": [0, 0, 0], "high": [1, 1, 1e10]}, "scale": 1e300}]"#;
    of(far, &["opaque[0].scale: point 4: ", "must be finite"]);
    // Files are named themselves.
    let file = |name: &str, parts: &[&str]| {
        folder.refused(&opaque(&format!("[{{\"file\": \"{name}\"}}]")), name, parts)
    };
    file("none.ply", &["cannot open"]);
    file("bad.obj", &["line 2: vertex 2: there are 1"]);
    file("c.txt", &["content", "PLY (.ply)"]);
    // Keys are checked before files are read.
    of(r#"[{"file": "bad.obj"}, {"file": "bad.obj", "opacity": 2}]"#, &["opaque[1].opacity"]);
}

#[test]
fn all_surfaces_together_stay_within_the_limit_of_memory() {
    let folder = Folder::new();
    let ball = r#"{"sphere": {"centre": [0, 0, 0], "radius": 1, "subdivisions": 5}}"#;
    let path = folder.write("scene.json", opaque(&format!("[{ball}, {ball}]")));
    // 20,480 triangles and 10,242 corners each.
    let each = 480 << 10;
    assert!(SceneFile::load(&path, &ReadOptions::within(2 * each + 48)).is_ok());
    let text = SceneFile::load(&path, &ReadOptions::within(2 * each - 1)).unwrap_err().to_string();
    assert!(text.contains("opaque[1].sphere.subdivisions: 5: takes 491520 bytes"), "{text}");
}

fn clip(spec: &str) -> String {
    document(&format!(", \"clip\": {spec}"))
}

#[test]
fn clip_regions_are_planes_and_a_box_with_open_sides() {
    let folder = Folder::new();
    let of = |spec: &str| folder.scene(&clip(spec)).unwrap().clip;
    assert_eq!(folder.scene(&document("")).unwrap().clip, Clip::none());
    assert_eq!(of("{}"), Clip::none());
    let planes = r#"{"planes": [{"point": [1, 2, 3], "normal": [0, 0, -2]}, {"point": [0, 0, 0], "normal": [1, 1, 0]}]}"#;
    let want = Clip::none().with_plane(DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_Z).unwrap();
    assert_eq!(of(planes), want.with_plane(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0)).unwrap());
    let (low, high) = (DVec3::new(-1.0, f64::NEG_INFINITY, 0.0), DVec3::new(f64::INFINITY, 2.0, 3.0));
    let want = Clip::none().with_crop(low, high).unwrap();
    assert_eq!(of(r#"{"crop": {"low": [-1, null, 0], "high": [null, 2, 3]}}"#), want);
    assert_eq!(want.half_spaces().count(), 4);
    assert_eq!(of(r#"{"crop": {"low": [0, 0, 0]}}"#).half_spaces().count(), 3);

    let refused = |spec: &str, parts: &[&str]| folder.refused(&clip(spec), "scene.json", parts);
    refused("[]", &["clip", "`planes` and `crop`"]);
    refused(r#"{"plane": []}"#, &["clip.plane", "`planes`", "`crop`"]);
    refused(
        r#"{"planes": [{"point": [0, 0, 0], "normal": [0, 0, 0]}]}"#,
        &["clip.planes[0].normal: ", "length"],
    );
    refused(r#"{"planes": [{"point": [0, 0, 0]}]}"#, &["clip.planes[0]", "normal"]);
    refused(r#"{"planes": [{"point": [0, 0, null], "normal": [0, 0, 1]}]}"#, &["clip.planes[0].point"]);
    let seven = [r#"{"point": [0, 0, 0], "normal": [0, 0, 1]}"#; 7].join(",");
    refused(&format!("{{\"planes\": [{seven}]}}"), &["clip.planes[6]", "at most 6"]);
    refused(r#"{"crop": {"low": [0, 0, 0], "high": [1, 1, 0]}}"#, &["clip.crop: ", "low must be below high"]);
    refused(r#"{"crop": {"lo": [0, 0, 0]}}"#, &["clip.crop.lo", "`low`", "`high`"]);
}

/// A view at another size keeps the cuts, and one by another camera, too.
#[test]
fn views_of_a_scene_are_cut() {
    let folder = Folder::new();
    let loaded = folder.scene(&clip(r#"{"crop": {"low": [0, 0, 0]}}"#)).unwrap();
    let view = loaded.view(30, 20).unwrap();
    assert_eq!((view.extent(), *view.clip(), *view.camera()), ([30, 20], loaded.clip, loaded.camera));
    let turned = view.with_camera(loaded.camera.orbit(30.0).unwrap()).unwrap();
    assert_eq!((turned.extent(), turned.clip()), (view.extent(), view.clip()));
    assert_ne!(turned.camera(), view.camera());
    // An automatic camera is chosen for the size.
    let ramp = r#"{"volume": {"field": "ramp", "dims": [3, 4, 5]}, "clip": {"crop": {"low": [0, 0, 0]}}}"#;
    let loaded = folder.scene(ramp).unwrap();
    let tall = loaded.view(100, 600).unwrap();
    let square = loaded.view(loaded.width, loaded.height).unwrap();
    assert!(
        tall.camera() != square.camera() && *square.camera() == loaded.camera && *tall.clip() == loaded.clip
    );
}

const REST: &str = r#", "opaque": [{"box": {"low": [-9, -9, -1], "high": [9, 9, -0.5]}, "colour": [0, 1, 0], "shade": "flat"},
    {"box": {"low": [-9, -9, 1.5], "high": [9, 9, 1.75]}, "colour": [0, 0, 1], "opacity": 0.5}],
    "clip": {"planes": [{"point": [0, 0, 0.25], "normal": [0, 0, -1]}], "crop": {"low": [null, null, -3]}}"#;

/// Two panes of glass, 3/4 of the box, an opaque wall, along the z axis.
fn want() -> [f64; 4] {
    let left = (-1.5_f64 * 0.75).exp();
    let volume = 0.25 * (1.0 - left);
    [0.8 * volume, 0.4 * volume + 0.25 * left, 0.1 * volume + 0.75, 1.0]
}

#[test]
fn the_reference_of_a_scene_file_is_its_closed_form() {
    let folder = Folder::new();
    let loaded = folder.scene(&document(REST)).unwrap();
    let view = loaded.view(loaded.width, loaded.height).unwrap();
    let image = reference::render(&loaded.scene, &view, &ReferenceOptions::default(), None).unwrap();
    for pixel in image.pixels() {
        assert!(pixel.iter().zip(want()).all(|(got, want)| (got - want).abs() < 1e-12), "{pixel:?}");
    }
    let depths = reference::depth(&loaded.scene, &view).unwrap();
    assert!(depths.iter().all(|depth| (depth - 4.5).abs() < 1e-13));
}

#[test]
fn the_program_tells_and_draws_clips_and_surfaces() {
    let folder = Folder::new();
    folder.write("scene.json", document(REST));
    let told = folder.run("info scene.json --json").done().json();
    assert_eq!(told["surfaces"].as_array().unwrap().len(), 2);
    assert_eq!(
        told["surfaces"][1],
        json!({
            "points": 8, "triangles": 12, "bounds": [[-9.0, -9.0, 1.5], [9.0, 9.0, 1.75]], "colour": [0.0, 0.0, 1.0],
            "opacity": 0.5, "shade": "headlight",
        })
    );
    assert_eq!(
        told["clip"],
        json!({
            "planes": [{"point": [0.0, 0.0, 0.25], "normal": [0.0, 0.0, -1.0]}],
            "crop": {"low": [null, null, -3.0], "high": [null, null, null]},
        })
    );
    let text = folder.run("info scene.json").done().out;
    for part in [
        "surfaces   12 triangles, [-9, -9, -1] to [9, 9, -0.5], colour [0, 1, 0], opacity 1, flat",
        "\n             12 triangles, [-9, -9, 1.5] to [9, 9, 1.75], colour [0, 0, 1], opacity 0.5, headlight",
        "kept       plane through [0, 0, 0.25] along [0, 0, -1]",
        "\n             box [-, -, -3] to [-, -, -]",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    folder.run("reference scene.json -o out.exr --size 16x12").done();
    let image = folder.exr("out.exr");
    assert_eq!((image.width(), image.height()), (16, 12));
    for pixel in image.pixels() {
        assert!(
            pixel.iter().zip(want()).all(|(got, want)| (f64::from(*got) - want).abs() < 1e-6),
            "{pixel:?}"
        );
    }
    folder.write("scene.json", document(""));
    let told = folder.run("info scene.json --json").done().json();
    assert_eq!((&told["surfaces"], &told["clip"]), (&json!([]), &Value::Null));
    let text = folder.run("info scene.json").done().out;
    assert!(!text.contains("surfaces") && !text.contains("kept"), "{text}");
}
