//! The program from outside: exit codes, messages, files.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;
use std::process::Command;

use crate::folder::{Folder, Run, SCHEMA, is_accepted};
use serde_json::Value;
use volraster::GpuScene;
use volraster::gpu::{Gpu, GpuOptions, PipelineCache};
use volraster::io::scene_file::SceneFile;
use volraster::io::{Data, ReadOptions, known_formats, write_vtu};
use volraster::scene::{KernelSize, Points, TetScalars, Tets, View};
use volraster::technique::{Renderer, Technique, scene_schema};

/// A field small enough to draw in milliseconds, with a camera and a technique of its own.
const SCENE: &str = r#"{
  "volume": {"field": "marschner-lobb", "dims": [16, 16, 16], "type": "f32"},
  "transfer": {"preset": "shells", "range": [0, 1]},
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42},
  "image": {"width": 64, "height": 48},
  "technique": {"name": "slices-3d", "step": 0.5}
}"#;

/// A folder for one test; all share a cache.
fn empty() -> Folder {
    Folder::with_cache(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli-cache"))
}

/// The same with a scene file in it.
fn with_scene() -> Folder {
    let folder = empty();
    folder.write("scene.json", SCENE);
    folder
}

/// `--view` and `--zoom` are those of the library, whatever camera the scene has.
#[test]
fn views_are_sides_or_angles() {
    use volraster::scene::auto::{Side, camera_of};
    let folder = with_scene();
    for (options, side, zoom) in [
        ("--view left", Side::Left, 1.0),
        ("--view -30,20 --zoom 2", Side::From(-30.0, 20.0), 2.0),
        ("--view 90,-90", Side::From(90.0, -90.0), 1.0),
    ] {
        folder.run(&format!("-q render scene.json -o view.exr {options}")).done();
        let loaded = folder.scene(SCENE).unwrap();
        let camera = camera_of(&loaded.scene, side, 64, 48).unwrap().zoomed(zoom).unwrap();
        let scene = GpuScene::new(&Gpu::new(&GpuOptions::default()).unwrap(), loaded.scene);
        let technique = Technique::parse("slices-3d:step=0.5").unwrap();
        let image = Renderer::new(&scene, technique).render(&View::new(camera, 64, 48).unwrap()).unwrap();
        assert_eq!(folder.exr("view.exr"), image, "{options}");
        assert!(image.pixels().iter().any(|pixel| pixel[3] > 0.1), "{options}");
    }
    let render = |rest: &str| folder.run(&format!("render scene.json -o out.exr {rest}"));
    for view in ["sideways", "1", "0,91", "nan,0"] {
        render(&format!("--view {view}")).fails(2, &["--view", view, "front, back, left", "two angles"]);
    }
    render("--zoom 0").fails(2, &["--zoom", "'0'", "positive"]);
}

/// Presets, ranges, shapes of extinction, colour maps and backgrounds are those of the library, in the order of the documents.
#[test]
fn looks_are_chosen_by_options() {
    use volraster::io::scene_file::Preset;
    use volraster::scene::{ColourMap, Opacity, TransferFunction, auto};
    let folder = with_scene();
    folder.run("-q convert scene.json grid.nrrd").done();
    let data = &volraster::io::read(folder.path("grid.nrrd"), &ReadOptions::default()).unwrap().data;
    let automatic = auto::transfer(data).unwrap();
    let preset = |name: &str, range| Preset::named(name).unwrap().transfer(data, None, range, None).unwrap();
    let fitted = |transfer: &TransferFunction| auto::fitted(data, None, transfer, 5.0).unwrap();
    let peak = Opacity::parse("peak@0.5,0.1").unwrap();
    for (options, mode, want) in [
        ("--preset ct-bone", "lit", preset("ct-bone", None)),
        ("--preset ct-bone --mode emission", "emission", preset("ct-bone", None)),
        ("--preset mip", "maximum", preset("mip", None)),
        (
            "--preset fog --range 0.2..0.8 --colormap viridis --scale 2",
            "emission",
            preset("fog", Some([0.2, 0.8])).coloured(ColourMap::Viridis).thickened(2.0).unwrap(),
        ),
        ("--opacity peak@0.5,0.1 --shade", "lit", fitted(&peak.over(&automatic).unwrap())),
        ("--range -1..2", "emission", fitted(&automatic.stretched([-1.0, 2.0]).unwrap())),
        ("--colormap turbo", "emission", automatic.coloured(ColourMap::Turbo)),
    ] {
        let text = folder.run(&format!("info grid.nrrd --scene {options}")).done().out;
        let scene = folder.scene(&text).unwrap().scene;
        assert_eq!((scene.transfer, scene.mode.name()), (want, mode), "{options}");
    }
    // A technique of a scene file is kept for its own look.
    let scene = |options: &str| {
        folder.run(&format!("-q render scene.json -o out.exr --stats out.stats {options}")).done()
    };
    for (options, technique) in [("--scale 2", "slices-3d"), ("--preset ct-bone", "slabs")] {
        scene(options);
        assert_eq!(folder.json("out.stats")["technique"], technique, "{options}");
    }
    for white in ["#ffffff", "white"] {
        folder
            .run(&format!(
                "-q render grid.nrrd -o out.png --background {white} --size 8x8 --preset log --range 90..99"
            ))
            .done();
        let picture = image::open(folder.path("out.png")).unwrap().to_rgb8();
        assert!(picture.pixels().all(|pixel| pixel.0 == [255; 3]), "{white}");
    }
    for (options, parts) in [
        ("--preset smoke", vec!["--preset", "'smoke'", "ct-bone"]),
        ("--colormap jet", vec!["--colormap", "'jet'", "viridis"]),
        ("--range 2..1", vec!["--range", "'2..1'", "the first below the second"]),
        ("--opacity cube", vec!["--opacity", "'cube'", "peak@S"]),
        ("--background nothing", vec!["--background", "'nothing'", "white"]),
        ("--preset log --range -1..1", vec!["range: [-1, 1]", "above zero"]),
        ("--preset fog --isosurface 1", vec!["--preset", "cannot be used with", "--isosurface"]),
        ("--shade --mode emission", vec!["--shade", "cannot be used with", "--mode"]),
        ("--opacity log --range -1..1", vec!["opacity: log", "above zero"]),
    ] {
        folder.run(&format!("render grid.nrrd -o none.exr {options}")).fails(2, &parts);
    }
}

/// `info --scene` prints a scene that draws the same picture to the bit as the data file by itself.
#[test]
fn the_automatic_scene_is_a_scene_file() {
    let folder = with_scene();
    folder.run("-q convert scene.json grid.nrrd").done();
    folder.write("mesh.json", r#"{"mesh": {"field": "blobs", "cubes": 4}}"#);
    folder.run("-q convert mesh.json mesh.vtu").done();
    let rows = (0..60).map(|i| format!("{},{},{},{},{}\n", i % 5, i / 5 % 4, i / 20, i - 20, 1 + i % 3));
    folder.write("points.csv", format!("x,y,z,charge,radius\n{}", rows.collect::<String>()));
    for (data, options) in [
        ("grid.nrrd", ""),
        ("grid.nrrd", " --view left --zoom 1.5 --mode lit"),
        ("grid.nrrd", " --isosurface 0.5"),
        ("grid.nrrd", " --preset ct-vessels --range 0..1 --background #204060"),
        ("mesh.vtu", " --view iso"),
        ("points.csv", " --array charge --radius radius"),
    ] {
        let scene = folder.run(&format!("info {data} --scene{options}")).done();
        folder.write("own.json", &scene.out);
        assert!(SCHEMA.is_valid(&scene.json()), "{}", scene.out);
        folder.run(&format!("-q render {data} -o data512.exr{options}")).done();
        folder.run("-q render own.json -o scene512.exr").done();
        assert_eq!(folder.exr("data512.exr"), folder.exr("scene512.exr"), "{data}{options}");
    }
    folder.run("info scene.json --scene").fails(2, &["scene.json", "--scene", "is one already"]);
}

/// `schema` prints the schema of the library, and the schema has no objection to what `info --scene` prints.
#[test]
fn the_schema_is_printed_and_accepts_automatic_scenes() {
    let folder = empty();
    assert_eq!(folder.run("schema").done().json(), serde_json::from_str::<Value>(&scene_schema()).unwrap());
    folder.run("-q schema --json").fails(2, &["--json"]);
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let shared = own.join("../shared/data");
    let shared = [
        "format_conformance/head_i16.nii.gz",
        "format_conformance/post_small_ascii_none.vtu",
        "particles/dark_matter_halo.npy",
    ]
    .map(|name| shared.join(name));
    let data = shared.into_iter().filter(|path| path.exists());
    for path in data.chain([own.join("assets/head.nrrd")]) {
        let scene = folder.run(&format!("info {} --scene", path.display()));
        assert_eq!(scene.code, 0, "{}", scene.err);
        folder.write("own.json", &scene.out);
        assert!(is_accepted(&folder.path("own.json"), &ReadOptions::default()), "{}", scene.out);
        assert!(SCHEMA.is_valid(&scene.json()), "{}", scene.out);
    }
}

/// A picture of nothing is drawn, with a warning that says why.
#[test]
fn a_picture_of_nothing_has_a_reason() {
    let folder = empty();
    for (name, from, to, why) in [
        ("away", "\"target\": [0, 0, 0]", "\"target\": [4, 3, 7.6]", "outside of the camera's view"),
        ("beside", "\"target\": [0, 0, 0]", "\"target\": [9, 0, 0]", "outside of the camera's view"),
        ("clear", "\"range\": [0, 1]", "\"range\": [5, 6]", "no extinction at the data's scalars"),
        (
            "cut",
            "\"image\"",
            "\"clip\": {\"crop\": {\"low\": [3, 3, 3]}}, \"image\"",
            "the crop box may have cut away",
        ),
    ] {
        assert!(SCENE.contains(from), "{from}");
        folder.write("scene.json", SCENE.replace(from, to));
        let run = folder.run(&format!("render scene.json -o {name}.png"));
        run.complains(0, &["warning: the picture shows nothing", why]);
        folder.run(&format!("-q render scene.json -o {name}.png")).done();
    }
}

/// What is no regular file is written into, links stay, and a file that becomes too large leaves nothing.
#[cfg(unix)]
#[test]
fn outputs_harm_nothing() {
    use std::os::unix::fs::symlink;
    let folder = with_scene();
    symlink("/dev/null", folder.path("null.nrrd")).unwrap();
    symlink("real.nrrd", folder.path("link.nrrd")).unwrap();
    symlink("/dev/stdout", folder.path("out.json")).unwrap();
    let before = folder.names("");
    folder.run("-q convert scene.json null.nrrd").done();
    let stats = folder.run("-q render scene.json -o null.exr --stats out.json").done();
    assert_eq!(stats.json()["technique"], "slices-3d");
    assert!(folder.path("null.nrrd").is_symlink() && folder.path("out.json").is_symlink());
    // What the shell has opened stays what it is: the statistics follow what is in it.
    let program = env!("CARGO_BIN_EXE_volraster");
    let line = format!(
        "echo before > all.txt; {program} -q render scene.json -o null.exr --stats out.json >> all.txt"
    );
    let run = Command::new("bash").args(["-c", &line]).current_dir(folder.root()).output().unwrap();
    Run::of(run, &line).done();
    assert!(folder.text("all.txt").starts_with("before\n{"), "{}", folder.text("all.txt"));
    folder.run("-q convert scene.json link.nrrd").done();
    assert!(folder.path("link.nrrd").is_symlink() && folder.path("real.nrrd").is_file());
    // 16 KiB of samples, of which 4 may be written.
    let limited = format!("ulimit -f 4; exec {program} convert scene.json large.nrrd");
    let run = Command::new("bash").args(["-c", &limited]).current_dir(folder.root()).output().unwrap();
    Run::of(run, &limited).fails(1, &["large.nrrd", "cannot write", "File too large"]);
    assert_eq!(folder.names("").len(), before.len() + 3);
}

#[test]
fn wrong_usage_and_input_are_exit_code_2_and_one_line() {
    let folder = with_scene();
    let json = |technique: &str| SCENE.replace(r#""step": 0.5"#, technique);
    folder.write("key.json", SCENE.replace("\"image\"", "\"imago\""));
    folder.write("option.json", json(r#""step": 0"#));
    folder.write("file.txt", "no volume");
    let before = folder.names("");
    let render = |rest: &str| folder.run(&format!("render scene.json -o out.exr --size 8x8 {rest}"));

    folder.run("render missing.json -o out.exr").fails(2, &["missing.json", "cannot open"]);
    folder.run("render missing.nrrd -o out.exr").fails(2, &["missing.nrrd", "cannot open"]);
    folder.run("render file.txt -o out.exr").fails(2, &["file.txt", "known format"]);
    folder.run("render key.json -o out.exr").fails(2, &["key.json", "line 5", "imago", "background"]);
    folder.run("render option.json -o out.exr").fails(2, &["option.json", "step", "0", "positive"]);

    render("--technique slices-4d").fails(2, &["technique", "slices-4d", "slices-3d"]);
    render("--technique slices-3d:step=-1").fails(2, &["slices-3d", "step", "\"-1\"", "positive"]);
    render("--technique slices-3d:filter=cubic").fails(2, &["filter", "\"cubic\"", "hardware, exact"]);
    render("--technique slices-3d:steps=1").fails(2, &["steps", "must be one of step"]);
    render("--technique slices-3d:step").fails(2, &["step", "key=value"]);
    render("--frames 0").fails(2, &["--frames", "'0'", "1.."]);
    render("--frames 2 --orbit nan").fails(2, &["--orbit", "'nan'", "finite"]);
    render("--orbit 3").fails(2, &["--frames"]);
    render("--max-error -1").fails(2, &["--max-error", "'-1'", "positive"]);
    render("--budget -1").fails(2, &["--budget", "'-1'", "positive"]);
    render("--technique slices-3d:step=1,step=2").fails(2, &["slices-3d option step", "given twice"]);
    render("--colour red").fails(2, &["--colour"]);
    for size in ["8", "0x8", "8x0", "8x32769", "axb"] {
        let run = folder.run(&format!("render scene.json -o out.exr --size {size}"));
        run.fails(2, &["--size", size, "1 to 32768"]);
    }
    folder.run("render scene.json").fails(2, &["--output"]);
    folder.run("reference scene.json -o out.exr --samples 65").fails(2, &["--samples", "'65'", "64"]);
    folder.run("compare scene.json -o out --techniques slices-3d,slices-9d").fails(2, &["slices-9d"]);
    folder.run("compare scene.json -o out --against gone.exr").fails(2, &["gone.exr", "cannot open"]);
    folder.run("bench gone -o out").fails(2, &["suite", "gone", "standard"]);
    folder.run("bench scene.json -o out --only no-such").fails(2, &["--only", "no-such"]);
    folder.run("info missing.nrrd").fails(2, &["missing.nrrd"]);
    folder.run("info scene.json --array a").fails(2, &["scene.json", "array", "\"a\"", "no arrays"]);
    folder.run("info scene.json --weight w").fails(2, &["scene.json", "array \"w\"", "a grid has no weight"]);
    render("--array a").fails(2, &["scene.json", "\"a\"", "no arrays"]);
    folder.run("reference scene.json -o out.exr --array a").fails(2, &["\"a\"", "no arrays"]);
    folder.run("compare scene.json -o out --array a").fails(2, &["\"a\"", "no arrays"]);
    folder.run("bench scene.json -o out --array a").fails(2, &["\"a\"", "no arrays"]);
    folder.run("bench -o out --array a").fails(2, &["--array", "\"a\"", "standard"]);
    assert_eq!(folder.names(""), before);
}

#[test]
fn where_the_output_cannot_be_written_nothing_is_drawn_and_nothing_is_left() {
    let folder = with_scene();
    std::fs::create_dir(folder.path("folder.exr")).unwrap();
    folder.write("file", "in the way");
    let before = folder.names("");
    // The place is looked at first: the missing scene and the missing device are not the error.
    for name in ["out.jpg", "out", "exr"] {
        folder.run(&format!("render gone.json -o {name}")).fails(2, &[name, ".exr or .png"]);
    }
    for name in ["gone/out.exr", "file/out.png", "/proc/out.exr"] {
        let none = [("VOLRASTER_DEVICE", "none")];
        folder.run_in(&format!("render scene.json -o {name}"), &none).fails(2, &[name, "cannot write"]);
        folder.run(&format!("reference gone.json -o {name}")).fails(2, &[name, "cannot write"]);
        let stats = format!("render gone.json -o out.exr --stats {name}");
        folder.run(&stats).fails(2, &[name, "cannot write"]);
    }
    folder.run("render gone.json -o folder.exr").fails(2, &["folder.exr", "folder"]);
    folder.run("render scene.json -o out.exr --stats out.exr").fails(2, &["--stats", "image"]);
    folder.run("render scene.json -o out.exr --stats scene.json").fails(2, &["--stats", "input"]);
    folder.run("compare gone.json -o file").fails(2, &["file", "not a folder"]);
    folder.run("compare gone.json -o file/deep").fails(2, &["file/deep", "not a folder"]);
    folder.run("bench gone -o file").fails(2, &["file", "not a folder"]);
    assert_eq!(folder.names(""), before);
}

#[test]
fn without_a_device_the_exit_code_is_3_and_nothing_is_left() {
    let folder = with_scene();
    let before = folder.names("");
    let none = [("VOLRASTER_DEVICE", "none")];
    let says = ["no usable Vulkan device", "name"];
    folder.run_in("render scene.json -o out.exr --stats out.json", &none).fails(3, &says);
    folder.run_in("compare scene.json -o out", &none).fails(3, &says);
    folder.run_in("bench scene.json -o out", &none).fails(3, &says);
    folder.run("render scene.json -o out.exr --device no-such-device").fails(3, &["no-such-device"]);
    // The list is printed all the same, with the reasons.
    let list = folder.run_in("devices --json", &none);
    assert_eq!((list.code, list.err.lines().count()), (3, 1), "{}", list.err);
    let devices = list.json()["devices"].as_array().unwrap().clone();
    assert!(!devices.is_empty());
    assert!(devices.iter().all(|device| device["chosen"] == false && device["reason"] != ""));
    // The option wins over the environment; every name contains the empty one.
    folder.run_in("render scene.json -o out.exr --size 8x6 --device=", &none).done();
    assert_eq!(folder.names(""), [vec!["out.exr".to_string()], before].concat());
}

/// Float32 pixels of the library's own picture of a scene file.
fn drawn_by_the_library(scene: &Path, technique: &str) -> volraster::Image {
    let loaded = SceneFile::load(scene, &ReadOptions::default()).unwrap();
    let view = View::new(loaded.camera, loaded.width, loaded.height).unwrap();
    let gpu = Gpu::new(&GpuOptions { pipeline_cache: PipelineCache::Off, ..GpuOptions::default() }).unwrap();
    let scene = GpuScene::new(&gpu, loaded.scene);
    Renderer::new(&scene, Technique::parse(technique).unwrap()).render(&view).unwrap()
}

#[test]
fn a_render_is_the_library_s_and_goes_to_exr_and_png() {
    let folder = with_scene();
    let run = folder.run("render scene.json -o out.exr --validate").done();
    assert_eq!(run.out.lines().count(), 1, "{}", run.out);
    for part in ["slices-3d", "compute", "64 x 48", " ms", "out.exr"] {
        assert!(run.out.contains(part), "{part}: {}", run.out);
    }
    let image = folder.exr("out.exr");
    assert_eq!([image.width(), image.height()], [64, 48]);
    assert!(image.pixels().iter().any(|pixel| pixel[3] > 0.5), "nothing is drawn");
    // The scene's own options hold, also when its technique is named; others when they are given.
    assert_eq!(image, drawn_by_the_library(&folder.path("scene.json"), "slices-3d:step=0.5"));
    folder.run("render scene.json -o named.exr --technique slices-3d --validate").done();
    assert_eq!(image, folder.exr("named.exr"));
    folder.run("render scene.json -o coarse.exr --technique slices-3d:step=2 --validate").done();
    let coarse = folder.exr("coarse.exr");
    assert_ne!(image, coarse);
    assert_eq!(coarse, drawn_by_the_library(&folder.path("scene.json"), "slices-3d:step=2"));

    let run = folder.run("render scene.json -o out.png --size 20x10 --quiet --validate").done();
    assert_eq!(run.out, "");
    let png = std::fs::read(folder.path("out.png")).unwrap();
    assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
    // Width and height, big-endian, follow the first chunk's length and name.
    assert_eq!(png[16..24], [0, 0, 0, 20, 0, 0, 0, 10]);
    assert_eq!(folder.names(""), ["coarse.exr", "named.exr", "out.exr", "out.png", "scene.json"]);
}

/// Options replace mode and transfer function of a scene file, and its technique, which is for its own look.
#[test]
fn modes_and_isosurfaces_are_drawn() {
    let folder = with_scene();
    for (options, keys, technique) in [
        ("--mode lit", r#""mode": "lit""#, "slabs"),
        ("--mode maximum", r#""mode": "maximum""#, "raycast"),
        ("--isosurface 0.3", r#""mode": "lit""#, "slabs"),
        ("--isosurface 0.3 --mode emission", r#""mode": "emission""#, "slices-3d"),
    ] {
        let run = folder.run(&format!("render scene.json -o out.exr --validate {options}")).done();
        assert!(run.out.contains(&format!("{technique} (compute)")), "{options}: {}", run.out);
        let mut scene: serde_json::Value = folder.json("scene.json");
        let keys: serde_json::Value = serde_json::from_str(&format!("{{{keys}}}")).unwrap();
        scene["mode"] = keys["mode"].clone();
        if options.starts_with("--isosurface") {
            scene["transfer"] = serde_json::json!({"isosurface": 0.3});
        }
        folder.write("shown.json", scene.to_string());
        assert_eq!(
            folder.exr("out.exr"),
            drawn_by_the_library(&folder.path("shown.json"), technique),
            "{options}"
        );
    }
    folder.run("render scene.json -o out.exr --mode mip").fails(2, &["mode", "emission, lit, maximum"]);
    folder.run("render scene.json -o out.exr --isosurface 9").fails(2, &["isosurface: 9", "scalars from"]);
    let slabs = "render scene.json -o out.exr --mode maximum --technique slabs";
    folder.run(slabs).fails(2, &["slabs", "grid of mode maximum", "raycast would"]);
    let errors =
        folder.run("compare scene.json -o compared --mode lit --techniques slices-3d:step=0.25").done();
    assert!(errors.out.contains("slices-3d"), "{}", errors.out);
    assert!(folder.json("compared/errors.json")[0]["rmse"].as_f64().unwrap() < 2e-3);
}

#[test]
fn stats_follow_the_schema_and_the_picture_of_an_orbit_is_that_of_angle_0() {
    let folder = with_scene();
    folder.run("render scene.json -o still.exr --validate").done();
    let run = folder
        .run("render scene.json -o orbit.exr --frames 3 --orbit -30 --stats stats.json --validate")
        .done();
    assert!(run.out.contains("median of 3"), "{}", run.out);
    assert_eq!(folder.exr("still.exr"), folder.exr("orbit.exr"));

    let stats = folder.json("stats.json");
    assert_eq!(stats["schema"], 1);
    assert_eq!((&stats["technique"], &stats["route"]), (&"slices-3d".into(), &"compute".into()));
    assert_eq!(stats["options"]["step"], 0.5);
    assert_eq!(stats["options"]["filter"], "hardware");
    assert_eq!(stats["image"], serde_json::json!([64, 48]));
    for key in ["name", "driver", "api"] {
        assert!(!stats["device"][key].as_str().unwrap().is_empty(), "{key}");
    }
    let frames = stats["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 3);
    for frame in frames {
        assert!(frame["wall_ms"].as_f64().unwrap() > 0.0);
        // A device may have no timestamps: then both keys are absent.
        if let Some(gpu_ms) = frame["gpu_ms"].as_f64() {
            let passes = frame["passes"].as_object().unwrap();
            assert!(!passes.is_empty());
            let sum: f64 = passes.values().map(|ms| ms.as_f64().unwrap()).sum();
            assert!((sum - gpu_ms).abs() <= 1e-9 * gpu_ms, "{frame}");
            // All but what follows the frame, for the image that is written.
            let moved = stats["pass_bytes"].as_object().unwrap();
            assert!(moved.keys().all(|pass| passes.contains_key(pass)), "{moved:?}, {passes:?}");
        } else {
            assert!(frame.get("passes").is_none());
        }
    }
    for key in ["load", "device", "prepare"] {
        assert!(stats["setup_ms"][key].as_f64().unwrap() > 0.0, "{key}");
    }
    // 16^3 samples of 4 bytes at least.
    assert!(stats["device_bytes"]["volume"].as_u64().unwrap() >= 16384, "{stats}");
    let drawn = &stats["pass_bytes"]["slices-3d.march"];
    assert!(drawn[0].as_u64().unwrap() >= 16384 && drawn[1] == 64 * 48 * 16, "{stats}");
    assert!(!stats["pipelines"].as_array().unwrap().is_empty());
    assert!(stats["counters"]["slices"].as_u64().unwrap() > 16, "{stats}");
    assert_eq!(stats["validation_messages"], 0);
    if cfg!(target_os = "linux") {
        assert!(stats["peak_rss_bytes"].as_u64().unwrap() > 1 << 20);
    }
    assert_eq!(folder.names(""), ["orbit.exr", "scene.json", "stats.json", "still.exr"]);
}

#[test]
fn data_alone_gives_a_picture() {
    let folder = empty();
    let head = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/head.nrrd");
    // Narrow: a camera for a square picture would cut the head off at the sides.
    let line = format!("render {head} -o head.exr --size 16x64 --technique slices-3d:step=2 --validate");
    folder.run(&line).done();
    let image = folder.exr("head.exr");
    let covered = image.pixels().iter().filter(|pixel| pixel[3] > 0.1).count();
    let share = covered as f64 / image.pixels().len() as f64;
    // Neither empty nor a solid block.
    assert!((0.05..0.95).contains(&share), "{share}");
    let edge = (0..64).flat_map(|y| [image.pixel(0, y), image.pixel(15, y)]);
    assert!(edge.into_iter().all(|pixel| pixel[3] < 0.05), "the head is cut off at the sides");
}

#[test]
fn the_reference_is_drawn_and_filtered() {
    let folder = with_scene();
    folder.run("reference scene.json -o one.exr --size 24x18").done();
    folder.run("reference scene.json -o four.exr --size 24x18 --samples 2").done();
    folder.run("reference scene.json -o two.png --size 24x18").done();
    let (one, four) = (folder.exr("one.exr"), folder.exr("four.exr"));
    assert_eq!([one.width(), one.height()], [24, 18]);
    let mean = |image: &volraster::Image| image.pixels().iter().map(|p| f64::from(p[3])).sum::<f64>() / 432.0;
    assert!(mean(&one) > 0.05);
    assert_ne!(one, four);
    // Both sample the same picture.
    assert!((mean(&one) - mean(&four)).abs() < 0.02, "{} {}", mean(&one), mean(&four));
}

#[test]
fn compare_measures_each_technique() {
    let folder = with_scene();
    let run = folder.run("compare scene.json -o out --size 32x24 --techniques slices-3d,slices-3d:step=4,ends=plane --techniques slices-3d:step=0.125,filter=exact --validate").done();
    let errors = folder.json("out/errors.json");
    let errors = errors.as_array().unwrap();
    assert_eq!(errors.len(), 3);
    let of = |i: usize, key: &str| errors[i][key].as_f64().unwrap();
    for (i, step) in [0.5, 4.0, 0.125].into_iter().enumerate() {
        assert_eq!(errors[i]["technique"], "slices-3d");
        assert_eq!(errors[i]["options"]["step"], step);
        assert!(of(i, "max") >= of(i, "p999") && of(i, "p999") >= of(i, "p99"), "{i}");
        assert!(of(i, "max") >= of(i, "rmse") && of(i, "wall_ms") > 0.0, "{i}");
        assert_eq!(errors[i]["errors"]["all"]["rmse"], errors[i]["rmse"]);
        assert_eq!(errors[i]["errors"]["width"], 32);
    }
    // Thinner slabs of a smooth field are better, and no technique is perfect.
    assert!(
        of(2, "rmse") < 5e-3 && of(2, "rmse") < of(0, "rmse") && of(0, "rmse") < of(1, "rmse"),
        "{errors:?}"
    );
    assert!(of(2, "rmse") > 1e-9 && of(0, "rmse") < 0.1);
    assert_eq!(run.out.lines().count(), 4, "{}", run.out);
    let mut files: Vec<String> = ["slices-3d-compute", "slices-3d-compute-2", "slices-3d-compute-3"]
        .iter()
        .flat_map(|stem| [".exr", ".heat.png", ".png"].map(|ending| format!("{stem}{ending}")))
        .chain(["errors.json", "reference.exr", "reference.png", "report.html"].map(str::to_string))
        .collect();
    files.sort();
    assert_eq!(folder.names("out"), files);

    // The reference rounded to float32 is the same truth within that rounding.
    let line = "compare scene.json -o again --size 32x24 --techniques slices-3d --against out/reference.exr --validate";
    folder.run(line).done();
    let again = folder.json("again/errors.json")[0]["rmse"].as_f64().unwrap();
    assert!((again - of(0, "rmse")).abs() < 1e-7, "{again} {}", of(0, "rmse"));
    assert!(!folder.path("again/reference.exr").exists());
    // A picture is its own truth.
    folder.run(&line.replace("reference.exr", "slices-3d-compute.exr")).done();
    assert_eq!(folder.json("again/errors.json")[0]["max"], 0.0);
    // A picture of another size is no truth, and nothing is written for it.
    let line = "compare scene.json -o third --size 16x24 --against out/reference.exr";
    folder.run(line).fails(2, &["out/reference.exr", "32 x 24", "16 x 24"]);
    assert!(!folder.path("third").exists());
}

#[test]
fn compare_all_draws_every_route_and_says_what_it_skips() {
    let folder = with_scene();
    // What only raster does is skipped by the other route.
    let scene = SCENE.replace(r#""step": 0.5"#, r#""order": "front-to-back""#);
    folder.write("order.json", scene);
    let run = folder.run("compare order.json -o order --size 8x6 --validate").done();
    assert!(run.out.contains("skipped: slices-3d/compute: "), "{}", run.out);
    let errors = folder.json("order/errors.json");
    let routes: Vec<&str> = errors
        .as_array()
        .unwrap()
        .iter()
        .filter(|e| e["technique"] == "slices-3d")
        .map(|e| e["route"].as_str().unwrap())
        .collect();
    assert_eq!(routes, ["raster"]);

    folder.run("compare scene.json -o all --size 8x6 --validate").done();
    let more = "compare scene.json -o more --size 8x6 --techniques all;slices-3d:step=4 --validate";
    folder.run(more).done();
    let errors = folder.json("all/errors.json");
    assert_eq!(
        folder.json("more/errors.json").as_array().unwrap().len(),
        errors.as_array().unwrap().len() + 1
    );
    let routes: Vec<&str> = errors.as_array().unwrap().iter().map(|e| e["route"].as_str().unwrap()).collect();
    assert!(routes.contains(&"compute") && routes.contains(&"raster"), "{routes:?}");
    assert!(
        errors
            .as_array()
            .unwrap()
            .iter()
            .filter(|e| e["technique"] == "slices-3d")
            .all(|e| e["options"]["step"] == 0.5)
    );
}

/// Lines of a bench's results.
fn bench_cases(folder: &Folder) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.path("out/bench.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn bench_checks_each_case_and_times_it() {
    let folder = with_scene();
    let run = folder.run("bench scene.json -o out --size 16x12").done();
    let cases = bench_cases(&folder);
    // The cases and their heading; the fronts' name, heading and six techniques; a line below each.
    assert_eq!(run.out.lines().count(), 1 + cases.len() + 1 + 8 + 1, "{}", run.out);
    let slices: Vec<&Value> = cases.iter().filter(|case| case["technique"] == "slices-3d").collect();
    // Seven steps by compute and three by raster; the exact filter by both; three targets, no dithering and two
    // kinds of it, marching, prefiltering, never stopping and stopping.
    assert_eq!(slices.len(), 7 + 3 + 2 + 3 + 3 + 1 + 1 + 2);
    for case in &cases {
        for key in
            ["version", "device", "driver", "api", "scene", "projection", "sweep", "technique", "route"]
        {
            assert!(!case[key].as_str().unwrap().is_empty(), "{key}: {case}");
        }
        assert!(case["software"].is_boolean() && case["options"].is_object());
        assert_eq!(case["size"], serde_json::json!([16, 12]));
        if case.get("skipped").is_some() {
            continue;
        }
        assert!(case["errors"]["all"]["rmse"].as_f64().unwrap() < 0.5, "{case}");
        assert!(case.get("wrong").is_none(), "{case}");
        assert!(case["frames"].as_u64().unwrap() >= 9, "{case}");
        let wall = |key: &str| case["wall_ms"][key].as_f64().unwrap();
        assert!(
            wall("p10") > 0.0 && wall("p10") <= wall("median") && wall("median") <= wall("p90"),
            "{case}"
        );
    }
    let step = |step: f64| slices.iter().find(|case| case["step"] == step).unwrap();
    assert!(step(0.25)["errors"]["all"]["rmse"].as_f64() < step(2.0)["errors"]["all"]["rmse"].as_f64());
    let slabs = |integrator: &str| {
        cases.iter().any(|case| case["technique"] == "slabs" && case["options"]["integrator"] == integrator)
    };
    assert!(["integral", "full", "exact"].into_iter().all(slabs));
    let plain = |case: &&Value| case["technique"] == "slices-2d" && case["options"]["step"] == "slices";
    assert!(cases.iter().find(plain).unwrap().get("step").is_none());

    let mut files = folder.names("out");
    // Passes have a time where the device has timestamps.
    files.retain(|name| !name.starts_with("passes-scene-perspective."));
    assert_eq!(
        files,
        [
            "bench.jsonl",
            "fronts-scene-perspective.svg",
            "fronts.json",
            "peaks.json",
            "report.html",
            "roof-scene-perspective.svg",
            "table.md"
        ]
    );
    let peaks = folder.json("out/peaks.json");
    for case in cases.iter().filter(|case| case.get("skipped").is_none()) {
        // Each drawn case states what bounds it, and its share of that peak of the device.
        let bound = &case["bound"];
        let by = bound["by"].as_str().unwrap();
        let least = bound["least_ms"][by].as_f64().unwrap();
        assert!(least > 0.0 && peaks[by].as_f64().unwrap() > 1e4, "{case}");
        let share = least / case["wall_ms"]["median"].as_f64().unwrap();
        let timed = case.get("gpu_ms").is_none();
        assert!(!timed || (bound["share"].as_f64().unwrap() / share - 1.0).abs() < 1e-9, "{case}");
        let fetches = case["counters"].get("fetches").and_then(Value::as_f64);
        let kinds: Vec<&String> = bound["least_ms"].as_object().unwrap().keys().collect();
        let is_fetch = |kind: &&&String| kind.starts_with("filtered.") || kind.starts_with("texels.");
        assert_eq!(kinds.iter().filter(is_fetch).count(), usize::from(fetches.is_some()), "{case}");
        assert!(case["bytes"][1].as_u64().unwrap() >= 4 * 16 * 12, "{case}");
    }
    let report = folder.text("out/report.html");
    assert!(report.contains("<svg") && report.contains("Peaks of the device"), "{report}");
    let fronts = folder.json("out/fronts.json");
    assert_eq!((&fronts[0]["scene"], &fronts[0]["projection"]), (&"scene".into(), &"perspective".into()));
    assert_eq!(fronts[0]["plot"], "fronts-scene-perspective.svg");
    let lines = fronts[0]["fronts"].as_array().unwrap();
    assert_eq!(lines.len(), 6);
    for line in lines {
        let members = line["members"].as_array().unwrap();
        assert!(!members.is_empty(), "{line}");
        for member in members {
            // What is on a front was measured, and nothing of the technique beats it.
            let [ms, rmse] = [&member["ms"], &member["rmse"]].map(|value| value.as_f64().unwrap());
            let of_technique = cases.iter().filter(|case| case["technique"] == line["technique"]);
            let costs: Vec<(f64, f64)> = of_technique
                .filter_map(|case| {
                    Some((case["wall_ms"]["median"].as_f64()?, case["errors"]["all"]["rmse"].as_f64()?))
                })
                .collect();
            assert!(costs.contains(&(ms, rmse)), "{member}");
            assert!(!costs.iter().any(|&(t, e)| t < ms && e < rmse), "{member}");
        }
        let at = line["at"].as_array().unwrap();
        assert_eq!(at.iter().filter(|at| at["rmse"] == 1e-2).count(), 1, "{line}");
    }
    let svg = std::fs::read_to_string(folder.path("out/fronts-scene-perspective.svg")).unwrap();
    assert!(
        ["slices-2d", "slices-3d", "slabs", "shear-warp", "raycast"].iter().all(|name| svg.contains(name)),
        "{svg}"
    );
}

#[test]
#[ignore = "make test-all"]
fn bench_reports_what_low_precision_loses_without_failing() {
    let folder = empty();
    // Five times as bright as what a normalised format holds, without an outline that coarse texels blur.
    let bright = r#"{"volume": {"field": "blobs", "dims": [8, 8, 8], "type": "f32"},
        "transfer": [[0, 5, 5, 5, 2], [1, 5, 5, 5, 2]],
        "camera": {"eye": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0], "half_height": 0.5}}"#;
    folder.write("bright.json", bright);
    let run = folder.run("bench bright.json -o out --size 8x8").done();
    let cases = bench_cases(&folder);
    let drawn: Vec<&Value> = cases.iter().filter(|case| case.get("skipped").is_none()).collect();
    for case in &drawn {
        let normalised = ["rgba8", "rgba16"].iter().any(|&target| case["options"]["target"] == target);
        assert_eq!(case.get("wrong").is_some(), normalised, "{case}");
        assert!(case["frames"].as_u64().unwrap() >= 9, "{case}");
    }
    assert!(drawn.iter().any(|case| case.get("wrong").is_some()));
    assert!(run.out.contains("wrong"), "{}", run.out);
    let fronts = std::fs::read_to_string(folder.path("out/fronts.json")).unwrap();
    assert!(fronts.contains("slices-3d") && !fronts.contains("\"rgba8\""), "{fronts}");
}

#[test]
#[ignore = "make test-all"]
fn bench_takes_the_volumes_of_a_folder_and_says_what_it_passes_over() {
    let folder = with_scene();
    std::fs::create_dir_all(folder.path("data/sub")).unwrap();
    let header =
        |sizes: &str| format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: {sizes}\nencoding: raw\n\n");
    let ramp: Vec<u8> = (0..125).map(|i| i * 2).collect();
    let volume = [header("5 5 5").into_bytes(), ramp].concat();
    folder.write("data/sub/ramp.nrrd", volume);
    folder.write("data/notes.txt", "no volume");
    // A byte for each sample, none of them written.
    let large = header("1024 1024 513");
    folder.write("data/large.nrrd", &large);
    let file = std::fs::OpenOptions::new().write(true).open(folder.path("data/large.nrrd")).unwrap();
    file.set_len(large.len() as u64 + (513 << 20)).unwrap();

    let run = folder.run("bench scene.json -o out --size 16x12 --frames 2 --data data");
    assert_eq!(run.code, 0, "{}", run.err);
    let said: Vec<&str> = run.err.lines().collect();
    assert_eq!(said.len(), 2, "{}", run.err);
    assert!(said.iter().all(|line| line.starts_with("volraster: skipped: ")), "{}", run.err);
    assert!(said[0].contains("large.nrrd") && said[0].contains("536870912"), "{}", said[0]);
    assert!(said[1].contains("notes.txt") && said[1].contains("unknown format"), "{}", said[1]);
    let cases = bench_cases(&folder);
    let found: Vec<&Value> = cases.iter().filter(|case| case["scene"] == "sub/ramp.nrrd").collect();
    assert!(!found.is_empty() && cases.iter().any(|case| case["scene"] == "scene"));
    assert!(found.iter().all(|case| case["route"] == "compute" && case["size"][0] == 16));
    assert!(folder.path("out/fronts-sub-ramp.nrrd-perspective.svg").is_file());
    assert_eq!(folder.json("out/fronts.json").as_array().unwrap().len(), 2);
    folder.run("bench scene.json -o out --data gone").fails(2, &["gone", "cannot list"]);
}

/// Mesa 22.3's software driver compiles a shader anew with each dispatch if it finds values that depend on uniforms alone: it then keeps
/// a megabyte a frame.
#[test]
fn memory_does_not_grow_with_frames() {
    let folder = Folder::new();
    folder.write("mesh.json", r#"{"mesh": {"field": "blobs", "cubes": 3}, "transfer": {"preset": "fog"}}"#);
    for technique in ["havs", "abuffer", "projected-tets:route=compute"] {
        let peak = |frames: u32| {
            let line = format!(
                "render mesh.json --technique {technique} -o a.exr --size 32x24 --frames {frames} --stats s.json"
            );
            folder.run_in(&line, &[("MESA_SHADER_CACHE_DISABLE", "true")]).done();
            folder.json("s.json")["peak_rss_bytes"].as_u64().unwrap()
        };
        let [few, many] = [2, 60].map(peak);
        // Threads that build pipelines side by side have peaks that differ by some 15 MiB. Compiling in each frame takes 100.
        assert!(many < few + (32 << 20), "{technique}: {few} bytes after 2 frames, {many} after 60");
    }
}

#[test]
fn pipelines_are_listed_with_constants_modules_and_statistics() {
    let folder = Folder::new();
    let pipelines = folder.run("pipelines --defaults --json --spirv modules").done().json();
    let pipelines = pipelines.as_array().unwrap();
    let march = pipelines.iter().find(|one| one["pipeline"] == "slabs.march").unwrap();
    assert_eq!(march["entries"], serde_json::json!(["SLABS_COMPUTE"]));
    assert!(march["constants"].as_object().unwrap().contains_key("SPEC_INTEGRATOR"), "{march}");
    assert!(march["build_ms"].as_f64().unwrap() > 0.0);
    for shader in march["shaders"].as_array().unwrap() {
        let statistics = shader["statistics"].as_object().unwrap();
        assert!(statistics.values().any(|value| value.as_f64().unwrap() > 0.0), "{shader}");
    }
    for file in pipelines.iter().flat_map(|one| one["spirv"].as_array().unwrap()) {
        let bytes = std::fs::read(folder.path("modules").join(file.as_str().unwrap())).unwrap();
        assert_eq!(&bytes[..4], &0x0723_0203_u32.to_le_bytes(), "{file} is no SPIR-V");
    }
    let table = folder.run("pipelines --defaults --columns entry,ms").done().out;
    assert!(table.lines().count() >= pipelines.len() + 2 && table.contains("| slabs.march | "), "{table}");
    folder.run("pipelines --defaults --columns gone").fails(2, &["--columns", "gone", "constants"]);
}

#[test]
fn devices_techniques_and_info_say_the_same_as_json() {
    let folder = with_scene();
    let devices = folder.run("devices --json").done().json();
    let chosen = &devices["chosen"];
    assert!(chosen["memory_budget"].as_u64().unwrap() > 0);
    assert!(chosen["filters_in_8_bit"].is_boolean() && chosen.get("loop_limit").is_some());
    let features = chosen["features"].as_array().unwrap();
    assert!(features.iter().any(|feature| feature["name"] == "linear-filter-r32f"), "{features:?}");
    let name = chosen["name"].as_str().unwrap();
    let taken =
        devices["devices"].as_array().unwrap().iter().find(|device| device["chosen"] == true).unwrap();
    assert_eq!(taken["name"], name);
    assert!(folder.run("devices").done().out.contains(name));

    let techniques = folder.run("techniques --json").done().json();
    let slices = techniques.as_array().unwrap().iter().find(|t| t["name"] == "slices-3d").unwrap();
    let options = slices["options"].as_array().unwrap();
    let text = folder.run("techniques").done().out;
    assert!(options.iter().any(|option| option["key"] == "step"));
    for option in options {
        assert!(text.contains(option["effect"].as_str().unwrap()), "{option}");
    }

    let scene = folder.run("info scene.json --json").done().json();
    assert_eq!(scene["dims"], serde_json::json!([16, 16, 16]));
    assert_eq!((&scene["type"], &scene["bytes"]), (&"f32".into(), &16384.into()));
    assert_eq!(scene["origin"], serde_json::json!([-1.0, -1.0, -1.0]));
    let spacing = scene["spacing"][2].as_f64().unwrap();
    assert!((spacing - 2.0 / 15.0).abs() < 1e-15);
    assert_eq!(scene["camera"]["automatic"], false);
    assert_eq!(scene["transfer"].as_array().unwrap().len(), 7);
    assert_eq!((&scene["technique"]["step"], &scene["mode"]), (&"0.5".into(), &"emission".into()));
    let counted: u64 =
        scene["histogram"]["counts"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(counted, 4096);

    assert_eq!((&scene["kind"], &scene["format"]), (&"grid".into(), &"analytic field".into()));
    assert_eq!((&scene["arrays"], &scene["shown"]), (&serde_json::json!([]), &Value::Null));
    // 2 x 2 x 2 bricks of 8 bytes, in 4 rows with two words of marks.
    let device = serde_json::json!({"volume": 16384, "stack": 16384, "stacks": 49152, "bricks": 96});
    assert_eq!(scene["device_bytes"], device);

    let head = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/head.nrrd");
    let data = folder.run(&format!("info {head} --json")).done().json();
    assert_eq!((&data["kind"], &data["format"]), (&"grid".into(), &"NRRD".into()));
    assert_eq!(data["file_bytes"], std::fs::metadata(head).unwrap().len());
    assert_eq!(data["bounds"], serde_json::json!([[-41.5, -63.5, -63.5], [41.5, 63.5, 63.5]]));
    assert_eq!(data["camera"]["automatic"], true);
    assert!(data.get("technique").is_none());
    assert_eq!(data["anatomy"], "right-anterior-superior");
    let text = folder.run(&format!("info {head}")).done().out;
    for part in ["128 x 128 x 84", "u8", "(automatic)", "transfer function", "█", "on device  1376256 bytes"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    folder.run(&format!("info {head} --array a")).fails(2, &["head.nrrd", "array \"a\"", "no such array"]);
    folder
        .run(&format!("info {head} --radius r"))
        .fails(2, &["head.nrrd", "array \"r\"", "a grid has no radius"]);
}

/// What `info` foretells is what a technique takes.
#[test]
fn samples_take_as_much_of_the_device_as_is_told() {
    let folder = with_scene();
    let told = folder.run("info scene.json --json").done().json()["device_bytes"].clone();
    let bytes = |technique: &str, object: &str| {
        let line =
            format!("render scene.json -o out.exr --size 8x6 --stats stats.json --technique {technique}");
        folder.run(&line).done();
        folder.json("stats.json")["device_bytes"][object].as_u64().unwrap()
    };
    // Devices pad images.
    let fits =
        |took: u64, told: &Value| (told.as_u64().unwrap()..=told.as_u64().unwrap() * 2).contains(&took);
    assert!(fits(bytes("raycast", "volume"), &told["volume"]), "{told}");
    assert!(fits(bytes("slices-2d:route=raster", "stack.z"), &told["stack"]), "{told}");
    let all = ["stack.x", "stack.y", "stack.z"].map(|stack| bytes("slices-2d:stacks=all", stack));
    assert!(fits(all.iter().sum(), &told["stacks"]), "{told}");
    assert!(fits(bytes("shear-warp", "stack.z"), &told["stack"]), "{told}");
}

#[test]
fn grids_are_converted_to_nrrd() {
    let folder = with_scene();
    let run = folder.run("convert scene.json out.nrrd").done();
    for part in ["analytic field", "16 x 16 x 16 points, point:scalar (f32)", "out.nrrd", " bytes"] {
        assert!(run.out.contains(part), "{part}: {}", run.out);
    }
    assert_eq!(run.out.lines().count(), 1, "{}", run.out);
    let made = folder.run("info out.nrrd --json").done().json();
    let scene = folder.run("info scene.json --json").done().json();
    for key in ["dims", "type", "spacing", "origin", "axes", "range", "histogram", "anatomy"] {
        assert_eq!(made[key], scene[key], "{key}");
    }
    let head = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/head.nrrd");
    assert_eq!(folder.run(&format!("convert {head} head.NRRD --quiet")).done().out, "");
    let (made, head) = (
        folder.run("info head.NRRD --json").done().json(),
        folder.run(&format!("info {head} --json")).done().json(),
    );
    for key in ["dims", "type", "spacing", "origin", "axes", "range", "histogram", "anatomy"] {
        assert_eq!(made[key], head[key], "{key}");
    }
    // Written over, since that is no input.
    folder.run("convert scene.json head.NRRD").done();
    assert_eq!(folder.run("info head.NRRD --json").done().json()["dims"][0], 16);
    assert_eq!(folder.names(""), ["head.NRRD", "out.nrrd", "scene.json"]);
}

#[test]
fn what_cannot_be_converted_is_one_line_and_leaves_nothing() {
    let folder = with_scene();
    folder.run("convert scene.json in.nrrd").done();
    let raw = r#"{"volume": {"file": "raw.nrrd", "dims": [2, 2, 2], "type": "u8"}}"#;
    folder.write("raw.json", raw);
    folder.write("raw.nrrd", [1, 2, 3, 4, 5, 6, 7, 8]);
    std::fs::create_dir(folder.path("folder.nrrd")).unwrap();
    let before = folder.names("");
    for name in ["out.vtk", "out", "nrrd", "out.gz"] {
        folder.run(&format!("convert gone.nrrd {name}")).fails(2, &[name, ".nii.gz (grids)", ".vtu (meshes"]);
    }
    for name in ["out.vtu", "out.vtr"] {
        let says = [name, "must end in .vti, .nrrd, .nii or .nii.gz", "a grid of 16 x 16 x 16"];
        folder.run(&format!("convert in.nrrd {name}")).fails(2, &says);
    }
    folder.run("convert in.nrrd in.nrrd").fails(2, &["output", "in.nrrd", "is also the input"]);
    folder.run("convert in.nrrd ./../convert-wrong/in.nrrd").fails(2, &["cannot write"]);
    folder.run("convert ./in.nrrd in.nrrd").fails(2, &["output", "is also the input"]);
    folder.run("convert raw.json raw.nrrd").fails(2, &["output", "raw.nrrd", "is also the input"]);
    folder.run("convert gone.nrrd out.nrrd").fails(2, &["gone.nrrd", "cannot open"]);
    folder.run("convert in.nrrd folder.nrrd").fails(2, &["folder.nrrd", "folder"]);
    folder.run("convert in.nrrd gone/out.nrrd").fails(2, &["gone/out.nrrd", "cannot write"]);
    folder.run("convert in.nrrd out.nrrd --only a").fails(2, &["in.nrrd", "\"a\"", "no such array"]);
    folder.run("convert scene.json out.nrrd --only a").fails(2, &["scene.json", "\"a\""]);
    folder.run("convert in.nrrd").fails(2, &["<OUT>"]);
    assert_eq!(folder.names(""), before);
}

/// Two tetrahedra and three points, written by the library.
fn write_cells(folder: &Folder) {
    let corners = |n: usize| {
        let all = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -2.0]];
        all.iter().take(n).map(|&corner| corner.into()).collect::<Vec<_>>()
    };
    let scalars = TetScalars::Point(vec![0.0, 1.0, 2.0, 3.0, f32::NAN]);
    let (mesh, _) = Tets::new(corners(5), vec![[0, 1, 2, 3], [0, 2, 1, 4]], scalars).unwrap();
    write_vtu(folder.path("mesh.vtu"), &Data::Mesh(mesh), "p").unwrap();
    let points = Points::new(corners(3)).unwrap().with_scalars(vec![5.0, 7.0, 9.0]).unwrap();
    let points = points.with_weights(vec![1.0, 2.0, 4.0]).unwrap();
    let points = points.with_size(KernelSize::Radii(vec![0.5, 0.25, 1.0])).unwrap();
    write_vtu(folder.path("points.vtu"), &Data::Points(points), "s").unwrap();
}

#[test]
fn meshes_and_points_are_described_and_converted() {
    if !known_formats().contains(".vtu") {
        eprintln!("skipped: no reader of .vtu");
        return;
    }
    let folder = empty();
    write_cells(&folder);
    let before = folder.names("");
    // Before a device is opened.
    folder.run("render mesh.vtu -o out.exr --technique slabs").fails(2, &["technique", "mesh"]);
    folder.run("compare mesh.vtu -o out --techniques slabs --device none").fails(2, &["technique", "mesh"]);
    folder.run("render points.vtu -o out.exr --technique slabs").fails(2, &["technique", "points"]);
    for command in ["render", "reference", "compare", "bench"] {
        let says = ["points.vtu", "\"q\"", "no such array"];
        folder.run(&format!("{command} points.vtu -o out.exr --radius q")).fails(2, &says);
    }
    folder.run("bench -o out --weight q").fails(2, &["--weight", "\"q\"", "standard"]);
    for (name, what) in [("mesh.vtu", "a mesh"), ("points.vtu", "3 points")] {
        let says = |what| ["out.nrrd", "must end in .vtu", what];
        folder.run(&format!("convert {name} out.nrrd")).fails(2, &says(what));
        folder.run(&format!("convert {name} {name}")).fails(2, &["output", "is also the input"]);
        folder.run(&format!("info {name} --array q")).fails(2, &[name, "\"q\"", "no such array"]);
    }
    folder.run("info mesh.vtu --weight p").fails(2, &["mesh.vtu", "a mesh has no weight"]);
    assert_eq!(folder.names(""), before);

    let mesh = folder.run("info mesh.vtu --json").done().json();
    assert_eq!((&mesh["kind"], &mesh["points"]), (&"mesh".into(), &5.into()));
    assert_eq!((&mesh["tetrahedra"], &mesh["vacuum"], &mesh["nan"]), (&2.into(), &1.into(), &1.into()));
    assert_eq!((&mesh["scalars"], &mesh["shown"]), (&"point".into(), &"point:p".into()));
    assert_eq!(mesh["bounds"], serde_json::json!([[0.0, 0.0, -2.0], [1.0, 1.0, 1.0]]));
    assert_eq!(mesh["range"], serde_json::json!([0.0, 3.0]));
    assert_eq!((&mesh["bytes"], &mesh["device_bytes"]["geometry"]), (&172.into(), &112.into()));
    let array = serde_json::json!({
        "name": "p", "association": "point", "type": "f32", "components": 1, "shown": true,
    });
    assert_eq!(mesh["arrays"], serde_json::json!([array]));
    let counts = mesh["histogram"]["counts"].as_array().unwrap();
    assert_eq!(counts.iter().map(|n| n.as_u64().unwrap()).sum::<u64>(), 4);
    assert_eq!(mesh["camera"]["automatic"], true);
    assert!(mesh["transfer"].as_array().unwrap().len() > 1);
    let text = folder.run("info mesh.vtu").done().out;
    for part in
        ["5, 2 tetrahedra", "point:p (f32), shown as point:p", "0 to 3", "note ", "█", "112 bytes at least"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }

    let points = folder.run("info points.vtu --json --array s --radius radius --weight weight").done().json();
    assert_eq!((&points["kind"], &points["points"]), (&"points".into(), &3.into()));
    assert_eq!(points["kernel"], serde_json::json!({"kind": "radii", "range": [0.25, 1.0]}));
    assert_eq!(
        (&points["weights"], &points["range"]),
        (&serde_json::json!([1.0, 4.0]), &serde_json::json!([5.0, 9.0]))
    );
    assert_eq!((&points["bytes"], &points["device_bytes"]["geometry"]), (&108.into(), &72.into()));
    assert_eq!(points["arrays"].as_array().unwrap().len(), 3);
    let text = folder.run("info points.vtu").done().out;
    // Distances 1, 1 and 1.
    for part in ["kernels", "radius 3", "spacing", "1 each", "point:weight (f32)", "5 to 9", "automatic"] {
        assert!(text.contains(part), "{part}: {text}");
    }

    let run = folder.run("convert mesh.vtu again.vtu").done();
    for part in ["mesh of 5 points and 2 cells", "point:p (f32)", "again.vtu"] {
        assert!(run.out.contains(part), "{part}: {}", run.out);
    }
    let same = |a: &str, b: &str| {
        assert_eq!(std::fs::read(folder.path(a)).unwrap(), std::fs::read(folder.path(b)).unwrap())
    };
    same("mesh.vtu", "again.vtu");
    // All arrays are kept.
    let run = folder.run("convert points.vtu other.vtu").done();
    let part = "3 points, point:s (f32), point:weight (f32), point:radius (f32): other.vtu";
    assert!(run.out.contains(part), "{}", run.out);
    same("points.vtu", "other.vtu");
    folder.run("convert points.vtu weight.vtu --only weight").done();
    let weight = folder.run("info weight.vtu --json").done().json();
    assert_eq!(weight["arrays"].as_array().unwrap().len(), 1);
    assert_eq!(weight["range"], serde_json::json!([1.0, 4.0]));
}

/// A file of several arrays: all of them, the chosen one, or a line that names them.
#[test]
fn convert_keeps_all_arrays_or_asks_for_one() {
    let folder = empty();
    let file = |x: &str| {
        format!(
            "<VTKFile type=\"RectilinearGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><RectilinearGrid \
             WholeExtent=\"0 2 0 1 0 1\"><Piece Extent=\"0 2 0 1 0 1\"><PointData><DataArray type=\"Float64\" Name=\"t\" \
             format=\"ascii\">0 1 2 3 4 5 6 7 8 9 10 0.1</DataArray></PointData><CellData><DataArray type=\"Int64\" \
             Name=\"n\" NumberOfComponents=\"2\" format=\"ascii\">1 2 3 4</DataArray></CellData><Coordinates>\
             <DataArray type=\"Float64\" format=\"ascii\">{x}</DataArray><DataArray type=\"Float64\" \
             format=\"ascii\">0 1</DataArray><DataArray type=\"Float64\" format=\"ascii\">0 1</DataArray></Coordinates>\
             </Piece></RectilinearGrid></VTKFile>"
        )
    };
    folder.write("even.vtr", file("0 1 2"));
    folder.write("uneven.vtr", file("0 1 3"));
    let before = folder.names("");
    let names = "a grid of 3 x 2 x 2 points, point:t (f64), cell:n (i64 x 2)";
    for name in ["out.nrrd", "out.nii", "out.nii.gz"] {
        let says = ["even.vtr", "--only NAME", "there are point:t (f64), cell:n (i64 x 2)"];
        folder.run(&format!("convert even.vtr {name}")).fails(2, &says);
    }
    folder.run("convert uneven.vtr out.vti").fails(2, &["out.vti", "must end in .vtr", "--only NAME"]);
    folder
        .run("convert even.vtr out.nii --only n")
        .fails(2, &["out.nii", "a voxel holds one number", "--only n:0"]);
    folder
        .run("convert even.vtr out.vti --only q")
        .fails(2, &["even.vtr", "\"q\"", "no such array", "point:t (f64)"]);
    folder.run("convert even.vtr out.vti --array t").fails(2, &["--array"]);
    assert_eq!(folder.names(""), before);
    for (input, name) in [("even.vtr", "out.vti"), ("even.vtr", "out.vtr"), ("uneven.vtr", "out.vtr")] {
        let run = folder.run(&format!("convert {input} {name}")).done();
        assert!(run.out.contains(names) && run.err.is_empty(), "{input}, {name}: {}{}", run.out, run.err);
    }
    let run = folder.run("convert even.vtr out.nii.gz --only t").done();
    for part in ["point:t (f64)", "the unknown world axes are written as RAS"] {
        assert!(run.out.contains(part), "{}", run.out);
    }
    assert_eq!(folder.run("info out.nii.gz --json").done().json()["range"], serde_json::json!([0.0, 10.0]));
    // Samples on uneven coordinates are resampled, which is said.
    let run = folder.run("convert uneven.vtr out.vti --only t");
    assert!(run.code == 0 && run.out.contains("a grid of 4 x 2 x 2 points, point:t (f32)"), "{}", run.out);
    assert!(run.err.contains("x: gaps from 1 to 2, resampled linearly from 3 to 4 samples"), "{}", run.err);
}

/// A mesh alone, and through a scene file, in the reference and in what `info` tells.
#[test]
fn the_reference_draws_meshes() {
    if !known_formats().contains(".vtu") {
        eprintln!("skipped: no reader of .vtu");
        return;
    }
    let folder = empty();
    write_cells(&folder);
    let write = |name: &str, json: &str| folder.write(name, json);
    let run = folder.run("reference mesh.vtu -o alone.exr --size 24x18").done();
    assert!(run.out.contains("24 x 18"), "{}", run.out);
    let seen = |name: &str| folder.exr(name).pixels().iter().filter(|pixel| pixel[3] > 0.05).count();
    assert!(seen("alone.exr") > 8, "{} pixels", seen("alone.exr"));
    write(
        "mesh.json",
        r#"{"mesh": {"file": "mesh.vtu", "array": "p"}, "transfer": {"preset": "fog"},
            "camera": {"eye": [3, 2, 4], "target": [0.3, 0.3, 0.3], "up": [0, 1, 0], "half_height": 1},
            "image": {"width": 20, "height": 10}}"#,
    );
    folder.run("reference mesh.json -o scene.exr --samples 2").done();
    assert!(seen("scene.exr") > 10, "{} pixels", seen("scene.exr"));
    let info = folder.run("info mesh.json --json").done().json();
    assert_eq!((&info["kind"], &info["tetrahedra"]), (&"mesh".into(), &2.into()));
    assert_eq!((&info["camera"]["automatic"], &info["image"]), (&false.into(), &serde_json::json!([20, 10])));
    // The preset over the data's range, with extinction for a longest side of 3.
    assert_eq!(info["transfer"][4], serde_json::json!([3.0, 1.0, 0.25, 0.1, 8.0 * 2.0 / 3.0]));
    write("field.json", r#"{"mesh": {"field": "blobs", "cubes": 4}}"#);
    folder.run("reference field.json -o field.exr --size 16x16").done();
    assert!(seen("field.exr") > 60, "{} pixels", seen("field.exr"));
    let text = folder.run("info field.json").done().out;
    for part in ["analytic field (mesh)", "125, 320 tetrahedra", "(automatic)", "transfer function of"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    write("both.json", r#"{"mesh": {"field": "blobs"}}"#);
    folder.run("info both.json").fails(2, &["both.json", "mesh.cubes", "missing"]);
}

const CUBES: &str = r#"{"mesh": {"field": "blobs", "cubes": 4}, "transfer": {"preset": "fog", "range": [0, 1]},
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42},
  "image": {"width": 24, "height": 18}}"#;

/// A long cell aslant, and another before its far end: the centroids of the long one's faces are nearer.
const CROSSED: &str = "# vtk DataFile Version 3.0\ntwo\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 float\n\
    -9 -1 -8  -9 1 -8  9 0 8  -9 0 -9\n 4 -1 0  6 -1 0  5 1 0  5 0 0.5\n\
    CELLS 2 10\n4 0 1 2 3\n4 4 5 6 7\nCELL_TYPES 2\n10 10\nPOINT_DATA 8\nSCALARS s float\nLOOKUP_TABLE default\n\
    1 1 1 1 1 1 1 1\n";

#[test]
fn a_mesh_is_rendered_with_counters_and_a_map_of_its_overflow() {
    let folder = empty();
    folder.write("cubes.json", CUBES);
    folder.write("crossed.vtk", CROSSED);
    let run = folder.run("render cubes.json -o plain.exr --stats stats.json --validate").done();
    assert!(run.out.contains("havs (compute)"), "{}", run.out);
    let counters = folder.json("stats.json")["counters"].clone();
    // Known before the frame, and counted on the device.
    for key in ["tiles", "bands", "chunks", "primitives", "fragments", "bin_entries"] {
        assert!(counters[key].as_u64().unwrap() > 0, "{key}: {counters}");
    }
    assert_eq!((&counters["kbuffer_overflow_pixels"], &counters["nan_keys"]), (&0.into(), &0.into()));

    std::fs::write(
        folder.path("crossed.json"),
        r#"{"mesh": {"file": "crossed.vtk"}, "transfer": [[0, 1, 1, 1, 1], [2, 1, 1, 1, 1]],
            "camera": {"eye": [5, 0, -30], "target": [5, 0, 0], "up": [0, 1, 0], "half_height": 1},
            "image": {"width": 21, "height": 17}}"#,
    )
    .unwrap();
    let line = "render crossed.json -o out.exr --technique havs:k=1 --overflow-map map.exr --stats stats.json --validate";
    folder.run(line).done();
    let map = folder.exr("map.exr");
    assert_eq!([map.width(), map.height()], [21, 17]);
    let white = map.pixels().iter().filter(|pixel| **pixel == [1.0; 4]).count() as u64;
    assert!(map.pixels().iter().all(|pixel| *pixel == [1.0; 4] || *pixel == [0.0, 0.0, 0.0, 1.0]));
    assert_eq!(folder.json("stats.json")["counters"]["kbuffer_overflow_pixels"].as_u64(), Some(white));
    assert!(white > 3, "{white}");
    folder.run(&line.replace("k=1", "k=4").replace("map.exr", "map.png")).done();
    assert_eq!(folder.json("stats.json")["counters"]["kbuffer_overflow_pixels"], 0);
    assert_eq!(std::fs::read(folder.path("map.png")).unwrap()[1..4], *b"PNG");

    let before = folder.names("");
    folder.write("scene.json", SCENE);
    let grid = "render scene.json -o grid.exr --size 8x8 --technique slabs --overflow-map grid.png";
    folder.run(grid).fails(2, &["--overflow-map", "slabs", "k-buffer"]);
    folder.run("render cubes.json -o a.exr --overflow-map a.exr").fails(2, &["--overflow-map", "image"]);
    folder.run("render cubes.json -o a.exr --overflow-map m.jpg").fails(2, &["m.jpg", ".exr or .png"]);
    folder
        .run("render cubes.json -o a.exr --overflow-map m.png --stats m.png")
        .fails(2, &["--overflow-map", "--stats"]);
    std::fs::remove_file(folder.path("scene.json")).unwrap();
    assert_eq!(folder.names(""), before);
}

#[test]
#[ignore = "make test-all"]
fn techniques_for_meshes_are_compared_and_benched() {
    let folder = empty();
    folder.write("cubes.json", CUBES);
    let run = folder.run("compare cubes.json -o all --validate").done();
    let errors = folder.json("all/errors.json");
    let errors = errors.as_array().unwrap();
    for name in ["havs", "abuffer"] {
        let of: Vec<&Value> = errors.iter().filter(|e| e["technique"] == name).collect();
        assert!(!of.is_empty(), "{name}: {}", run.out);
        assert!(of.iter().all(|e| e["rmse"].as_f64().unwrap() < 1e-6), "{name}: {errors:?}");
    }
    folder.run("compare cubes.json -o one --techniques havs:k=2,chunk=4;abuffer --validate").done();
    assert_eq!(folder.json("one/errors.json")[0]["options"]["chunk"], 4);

    let run = folder.run("bench cubes.json -o out --size 16x12 --frames 2").done();
    let cases = bench_cases(&folder);
    assert!(cases.iter().all(|case| ["slices-2d", "slabs"].iter().all(|grid| case["technique"] != *grid)));
    let of = |name: &str| -> Vec<&Value> { cases.iter().filter(|case| case["technique"] == name).collect() };
    assert!(!of("havs").is_empty() && !of("abuffer").is_empty());
    for case in of("havs").into_iter().filter(|case| case["route"] == "compute") {
        assert!(case["counters"]["fragments"].as_u64().unwrap() > 0, "{case}");
        let required = &case["required_k"];
        let pixels = required["pixels"].as_array().unwrap();
        let sum: u64 = pixels.iter().map(|n| n.as_u64().unwrap()).sum();
        assert_eq!((pixels.len(), sum + required["more"].as_u64().unwrap()), (15, 192), "{required}");
    }
    assert!(of("abuffer").iter().all(|case| case.get("required_k").is_none()));
    assert!(run.out.contains("pixels by required k: 1: "), "{}", run.out);
    // Only what draws meshes has a front.
    let fronts = folder.json("out/fronts.json")[0]["fronts"].clone();
    let names: Vec<&str> =
        fronts.as_array().unwrap().iter().map(|front| front["technique"].as_str().unwrap()).collect();
    assert!(names.contains(&"havs") && names.contains(&"abuffer") && !names.contains(&"slabs"), "{names:?}");
}

/// Drawing says what may not be as it seems, in lines of its own, and not where it is told to be quiet.
#[test]
fn warnings_go_to_stderr() {
    if !known_formats().contains(".vti") {
        eprintln!("skipped: no reader of .vti");
        return;
    }
    let folder = empty();
    let file = "<VTKFile type=\"ImageData\" version=\"1.0\"><ImageData WholeExtent=\"0 1 0 1 0 1\" Origin=\"0 0 0\" \
        Spacing=\"1 1 1\"><Piece Extent=\"0 1 0 1 0 1\"><PointData><DataArray type=\"UInt8\" Name=\"a\" \
        format=\"ascii\">1 2 3 4 5 6 7 8</DataArray></PointData></Piece></ImageData></VTKFile>";
    folder.write("a.vti", file);
    let warned = |line: &str| {
        let run = folder.run(line);
        assert_eq!(run.code, 0, "{line}: {}", run.err);
        assert_eq!(run.err.lines().count(), 1, "{line}: {}", run.err);
        for part in ["volraster: warning: ", "a.vti: ", "no byte_order"] {
            assert!(run.err.contains(part), "{line}: {}", run.err);
        }
    };
    warned("render a.vti -o out.exr --size 8x8");
    warned("reference a.vti -o out.exr --size 8x8");
    warned("compare a.vti -o out --size 8x8 --techniques raycast");
    warned("convert a.vti out.nrrd");
    folder.run("render a.vti -o out.exr --size 8x8 --quiet").done();
    folder.run("convert a.vti out.nrrd --quiet").done();
    // What is asked for is not said twice.
    let info = folder.run("info a.vti --json").done().json();
    assert_eq!(info["warnings"].as_array().unwrap().len(), 1, "{info}");
    assert!(folder.run("info a.vti").done().out.contains("warning "));
}

/// A reader that goes away is no error and no panic.
#[cfg(unix)]
#[test]
fn a_closed_pipe_is_no_error() {
    use std::process::Stdio;
    let mut command = Command::new(env!("CARGO_BIN_EXE_volraster"));
    command.args(["techniques", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // Closed before the program has started up; whatever it writes, it writes into a closed pipe.
    drop(child.stdout.take());
    let run = Run::of(child.wait_with_output().unwrap(), "techniques");
    run.done();
}

#[test]
fn help_and_version_are_exit_code_0() {
    let folder = empty();
    let version = folder.run("--version").done().out;
    assert_eq!(version.trim(), format!("volraster {}", env!("CARGO_PKG_VERSION")));
    let help = folder.run("--help").done().out;
    for command in ["render", "reference", "compare", "bench", "devices", "techniques", "info", "convert"] {
        assert!(help.contains(command), "{command}");
        assert!(folder.run(&format!("{command} --help")).done().out.contains("Usage"));
    }
}
