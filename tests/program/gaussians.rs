//! Gaussian splats by the program: what `info` says, what `convert` writes, what options are refused.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use serde_json::json;

use crate::folder::Folder;

/// A PLY file of four splats in text; the last one cannot be drawn.
fn ply() -> String {
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
        "rot_1", "rot_2", "rot_3",
    ];
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!(
        "ply\nformat ascii 1.0\ncomment Licence: CC0\ncomment antialiased 1\nelement vertex 4\n{properties}end_header\n"
    );
    header
        + "0 0 0 1 0 0 inf -1 -1 -1 1 0 0 0\n\
           1 0 0 0 1 0 0 -1 -3 -2 1 0 0 0\n\
           0 2 0 0 0 1 2 -9 -9 -9 1 0 0 0\n\
           0 0 nan 0 0 0 0 0 0 0 1 0 0 0\n"
}

#[test]
fn info_describes_splats() {
    let folder = Folder::new();
    folder.write("a.ply", ply());
    let run = folder.run("info a.ply --json");
    let facts: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    for (key, value) in [
        ("kind", json!("gaussians")),
        ("splats", json!(3)),
        ("degree", json!(0)),
        ("axes", json!("rdf")),
        ("axes_from", json!("the convention of PLY files")),
        ("trained_as", json!("antialiased")),
        ("texts", json!(["Licence: CC0"])),
        ("left_out", json!({"nan": 1, "infinite": 0, "rotation": 0})),
        ("opaque_share", json!(1.0 / 3.0)),
        ("subpixel_share", json!(1.0 / 3.0)),
    ] {
        assert_eq!(facts[key], value, "{key}");
    }
    let median = facts["anisotropy"]["median"].as_f64().unwrap();
    assert!((median - 1.0).abs() < 1e-6, "{median}");
    assert_eq!(facts["camera"]["up"], json!([0.0, -1.0, 0.0]));
    assert!(facts["transfer"].is_null());
    let text = folder.run("info a.ply --stored-axes rfu").out;
    for part in [
        "rfu (right, front, up), from: given",
        "trained as  antialiased",
        "Licence: CC0",
        "1 splats left out: 1 with NaN",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // The scene that is printed is read as the file is.
    let scene = folder.run("info a.ply --scene --stored-axes luf --turn-to rub").out;
    folder.write("scene.json", &scene);
    let scene: serde_json::Value = serde_json::from_str(&scene).unwrap();
    assert_eq!(scene["gaussians"]["axes"], "luf");
    assert_eq!(scene["gaussians"]["turn_to"], "rub");
    let facts = folder.run("info scene.json --json").out;
    assert_eq!(serde_json::from_str::<serde_json::Value>(&facts).unwrap()["axes"], "rub");
}

#[test]
fn convert_turns_splats_into_the_axes_of_the_format() {
    let folder = Folder::new();
    folder.write("a.ply", ply());
    let line = folder.run("convert a.ply a.spz").out;
    assert!(line.contains("PLY of Gaussian splats: 3 splats of degree 0, rdf"), "{line}");
    let facts = |file: &str| -> serde_json::Value {
        serde_json::from_str(&folder.run(&format!("info {file} --json")).out).unwrap()
    };
    let spz = facts("a.spz");
    assert_eq!((&spz["format"], &spz["axes"]), (&json!("SPZ 4"), &json!("rub")));
    assert_eq!(spz["bounds"], json!([[0.0, -2.0, 0.0], [1.0, 0.0, 0.0]]));
    assert_eq!(spz["trained_as"], "antialiased");
    folder.run("convert a.spz b.spz --spz-version 3 --stored-axes rdf");
    let turned = facts("b.spz");
    assert_eq!(
        (&turned["format"], &turned["bounds"]),
        (&json!("SPZ 3"), &json!([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]]))
    );
    folder.run("convert a.spz b.compressed.ply");
    assert_eq!(facts("b.compressed.ply")["format"], "compressed PLY");
    let back = folder.run("convert a.spz b.ply");
    assert!(back.out.contains("1 opacities of 0 or 1 have infinite logits"), "{}", back.out);
    assert_eq!(facts("b.ply")["bounds"], json!([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]]));
    // Points of a table of arrays.
    folder.run("convert a.ply a.vtu");
    assert_eq!(facts("a.vtu")["kind"], "points");
}

#[test]
fn options_that_do_not_fit_are_refused() {
    let folder = Folder::new();
    folder.write("a.ply", ply());
    folder.write("points.csv", "x,y,z\n0,0,0\n1,1,1\n");
    for (line, part) in [
        ("info a.ply --preset fog", "--preset: gaussians have colours of their own"),
        ("info a.ply --scale 2", "--scale: gaussians have colours of their own"),
        ("info a.ply --stored-axes rru", "must be three letters"),
        ("info a.ply --turn-to ruf", "must be right-handed, such as luf"),
        ("info points.csv --stored-axes rdf", "only gaussians have axes"),
        ("convert points.csv a.spz", "must hold gaussians"),
        ("convert a.ply a.spz --spz-version 2", "3..=4"),
        ("convert a.ply a.nrrd", "must end in .vtu"),
    ] {
        let run = folder.run(line);
        assert!(run.code == 2 && run.err.contains(part), "{line}: {}{}", run.out, run.err);
    }
}

/// Each rule is drawn and compared with its own truth, and rules with each other.
#[test]
fn compare_measures_rules_against_their_own_truths() {
    let folder = Folder::new();
    let whole = ply().replace("vertex 4", "vertex 3").replace("0 0 nan 0 0 0 0 0 0 0 1 0 0 0\n", "");
    folder.write("a.ply", whole);
    let run = folder.run("compare a.ply -o out --size 24x18 --validate").done();
    assert!(run.out.contains("distances between rules"), "{}", run.out);
    let errors = folder.json("out/errors.json");
    let errors = errors.as_array().unwrap();
    assert_eq!(errors.len(), 6);
    for entry in errors {
        let rule = entry["options"]["rule"].as_str().unwrap();
        assert_eq!(entry["image"], format!("gaussians-{rule}.exr"));
        assert!(entry["rmse"].as_f64().unwrap() < 1e-3, "{rule}: {}", entry["rmse"]);
        assert!(folder.path(&format!("out/reference-{rule}.exr")).exists());
    }
    let distances = folder.json("out/distances.json");
    let distances = distances.as_array().unwrap();
    assert_eq!(distances.len(), 15);
    let between = |rules: [&str; 2]| {
        let found = distances.iter().find(|distance| distance["rules"] == json!(rules)).unwrap();
        found["rmse"].as_f64().unwrap()
    };
    assert!(between(["khr", "inria"]) > 2e-3);
    // What is asked for alone has one truth, of its own rule.
    folder.run("compare a.ply -o one --size 24x18 --techniques gaussians:rule=ray --validate").done();
    assert!(folder.json("one/errors.json")[0]["rmse"].as_f64().unwrap() < 1e-5);
    assert!(!folder.path("one/distances.json").exists());
}
