//! Numbered images and films: turns, series of time steps, and what stands in their way.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;

use crate::folder::Folder;
use volraster::gpu::{Gpu, GpuOptions};
use volraster::io::to_srgb8;
use volraster::scene::View;
use volraster::technique::{Renderer, Technique};
use volraster::{GpuScene, Image};

const SCENE: &str = r#"{
  "volume": {"field": "marschner-lobb", "dims": [16, 16, 16], "type": "f32"},
  "transfer": {"preset": "shells", "range": [0, 1]},
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42},
  "image": {"width": 48, "height": 32},
  "technique": {"name": "slices-3d", "step": 0.5}
}"#;

fn with_scene() -> Folder {
    let folder = Folder::with_cache(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("films-cache"));
    folder.write("scene.json", SCENE);
    folder
}

/// Five grids of several sizes, `step1`, `step2`, `step9`, `step10`, `step11`, in the order of time.
fn with_series() -> Folder {
    let folder = with_scene();
    for (n, dims) in [(1, 16), (2, 16), (9, 12), (10, 14), (11, 16)] {
        let field = if n % 2 == 0 { "marschner-lobb" } else { "blobs" };
        let scene =
            format!(r#"{{"volume": {{"field": "{field}", "dims": [{dims}, 16, 12], "type": "f32"}}}}"#);
        folder.write("step.json", scene);
        folder.run(&format!("-q convert step.json step{n}.nrrd")).done();
    }
    folder
}

const STEPS: [u32; 5] = [1, 2, 9, 10, 11];

/// A turn of the scene as the library draws it.
fn turn(folder: &Folder, degrees: f64, count: u32) -> Vec<Image> {
    let loaded = folder.scene(SCENE).unwrap();
    let scene = GpuScene::new(&Gpu::new(&GpuOptions::default()).unwrap(), loaded.scene);
    let renderer = Renderer::new(&scene, Technique::parse("slices-3d:step=0.5").unwrap());
    let view = |i| View::new(loaded.camera.orbit(degrees * f64::from(i)).unwrap(), 48, 32).unwrap();
    (0..count).map(|i| renderer.render(&view(i)).unwrap()).collect()
}

#[test]
fn a_turn_of_120_frames_is_drawn_by_name() {
    let folder = with_scene();
    let run = folder
        .run("render scene.json -o out/turn-%04d.exr --orbit 3 --frames 120 --stats s.json --validate")
        .done();
    assert!(run.out.contains("median of 120"), "{}", run.out);
    assert!(run.out.ends_with(": out/turn-0000.exr to out/turn-0119.exr\n"), "{}", run.out);
    assert_eq!(folder.names("out").len(), 120);
    for (i, image) in turn(&folder, 3.0, 120).into_iter().enumerate().skip(1) {
        // The angle 0 has no rotation at all.
        let own = folder.exr(&format!("out/turn-{i:04}.exr"));
        assert_eq!(own, image, "{i}");
    }
    folder.run("-q render scene.json -o still.exr").done();
    assert_eq!(folder.exr("out/turn-0000.exr"), folder.exr("still.exr"));
    assert_ne!(folder.exr("out/turn-0119.exr"), folder.exr("still.exr"));
    assert_eq!(folder.json("s.json")["frames"].as_array().unwrap().len(), 120);
}

/// Every step is drawn with the look and the camera of the first, whatever names it.
#[test]
fn a_series_of_five_steps_is_drawn_by_name() {
    let folder = with_series();
    // The look of the first step, for each of the others.
    let mut scene: serde_json::Value =
        serde_json::from_str(&folder.run("info step1.nrrd --scene").done().out).unwrap();
    scene["image"] = serde_json::json!({"width": 48, "height": 48});
    let mut want = Vec::new();
    for n in STEPS {
        scene["volume"]["file"] = format!("step{n}.nrrd").into();
        folder.write("look.json", scene.to_string());
        folder.run("-q render look.json -o want.exr").done();
        want.push(folder.exr("want.exr"));
    }
    assert!(want.windows(2).all(|pair| pair[0] != pair[1]));
    let sets = STEPS.map(|n| format!(r#"<DataSet timestep="{n}" file="step{n}.nrrd"/>"#));
    let sets = sets.into_iter().rev().collect::<String>();
    folder.write("a.pvd", format!(r#"<VTKFile type="Collection"><Collection>{sets}</Collection></VTKFile>"#));
    scene["volume"]["file"] = "step*.nrrd".into();
    folder.write("look.json", scene.to_string());
    for (input, options) in [
        ("step10.nrrd step1.nrrd step2.nrrd step11.nrrd step9.nrrd", "--size 48x48 --validate"),
        ("step*.nrrd", "--size 48x48"),
        ("a.pvd", "--size 48x48"),
        ("look.json", "--validate"),
    ] {
        let run = folder.run(&format!("-q render {input} -o out/s-%d.exr {options}")).done();
        assert_eq!(run.out, "");
        for (i, want) in want.iter().enumerate() {
            assert_eq!(folder.exr(&format!("out/s-{i}.exr")), *want, "{input} {i}");
        }
    }
    // One step, and a note that there are others where none is chosen.
    folder.run("-q render a.pvd -o one.exr --size 48x48 --step 0").done();
    assert_eq!(folder.exr("one.exr"), want[0]);
    folder
        .run("render a.pvd -o one.exr --size 48x48")
        .complains(0, &["a.pvd", "the first of 5 time steps; --step"]);
    assert!(folder.run("info a.pvd --step 3").done().out.contains("step 3 of 5: step10.nrrd"));
    folder.run("-q convert a.pvd three.nrrd --step 3").done();
    assert_eq!(
        std::fs::read(folder.path("three.nrrd")).unwrap(),
        std::fs::read(folder.path("step10.nrrd")).unwrap()
    );
}

#[test]
fn steps_beyond_the_range_of_the_first_are_warned_of() {
    let folder = with_scene();
    for (n, top) in [(1, 10), (2, 40), (3, 30)] {
        let mut bytes = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n".to_vec();
        bytes.extend([0, 0, 0, 0, 0, 0, 0, top]);
        folder.write(&format!("b{n}.nrrd"), bytes);
    }
    let parts = ["warning: time step 1 ranges from 0 to 40, beyond the 0 to 10 of step 0", "--range"];
    folder.run("render b*.nrrd -o b-%d.png --size 8x8").complains(0, &parts);
    folder.run("render b*.nrrd -o b-%d.png --size 8x8 --range 0..40").done();
}

/// `ffmpeg` stands in for itself: a script that keeps its arguments and what it gets.
#[cfg(unix)]
#[test]
fn a_film_is_passed_to_ffmpeg() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = with_scene();
    let ffmpeg = |text: &str| {
        let path = folder.write("bin/ffmpeg", format!("#!/bin/sh\n{text}\n"));
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    let path = format!("{}:{}", folder.path("bin").display(), std::env::var("PATH").unwrap());
    let run = |options: &str| {
        folder.run_in(
            &format!("render scene.json -o turn.mp4 --orbit 30 --frames 4 {options}"),
            &[("PATH", &path)],
        )
    };
    ffmpeg("[ \"$1\" = -version ] && exit 0\necho \"$@\" > arguments\nfor last; do :; done\ncat > \"$last\"");
    let out = run("--fps 12.5").done().out;
    assert!(out.contains("median of 4") && out.ends_with(": turn.mp4\n"), "{out}");
    let want: Vec<u8> =
        turn(&folder, 30.0, 4).iter().flat_map(|image| to_srgb8(image, [0.0, 0.0, 0.0, 1.0])).collect();
    assert!(std::fs::read(folder.path("turn.mp4")).unwrap() == want);
    let arguments = folder.text("arguments");
    for part in ["-video_size 48x32", "-framerate 12.5", "-pixel_format rgb24", "-f mp4 "] {
        assert!(arguments.contains(part), "{part}: {arguments}");
    }
    // What fails leaves the old film, and nothing else.
    let names = folder.names("");
    ffmpeg("[ \"$1\" = -version ] && exit 0\ncat > /dev/null\necho Unknown encoder >&2\nexit 1");
    run("--fps 25").fails(2, &["turn.mp4: ffmpeg: Unknown encoder"]);
    ffmpeg("[ \"$1\" = -version ] && exit 0\necho no space >&2\nexit 1");
    run("--fps 25").fails(2, &["turn.mp4: ffmpeg: no space"]);
    run("--background transparent").fails(2, &["turn.mp4: background", "opaque"]);
    assert!(std::fs::read(folder.path("turn.mp4")).unwrap() == want);
    assert_eq!(folder.names(""), names);
    let none = folder.run_in("render scene.json -o none.mp4 --frames 2", &[("PATH", "")]);
    none.fails(2, &["none.mp4: encoder", "needs the program ffmpeg", "-o none-%04d.png"]);
    assert_eq!(folder.names(""), names);
}

#[test]
fn what_is_no_film_is_refused_before_work() {
    let folder = with_series();
    let names = folder.names("");
    for (line, parts) in [
        ("scene.json -o a-%d.png", vec!["--frames: missing", "numbered images"]),
        ("scene.json -o a-%d.tif --frames 2", vec!["a-%d.tif", "must end in .exr or .png"]),
        ("step*.nrrd -o a-%d.png --frames 2", vec!["--frames", "one frame for each time step"]),
        ("step1.nrrd step2.nrrd -o a.png", vec!["--output", "several time steps", "%04d"]),
        ("scene.json -o a.png --orbit 3", vec!["--orbit", "needs --frames"]),
        ("scene.json -o a-%d.png --frames 2 --in-flight 2", vec!["--in-flight"]),
        ("scene.json -o a-%d.png --frames 2 --overflow-map b.png", vec!["--overflow-map"]),
        ("scene.json -o scene.json/a-%d.png --frames 2", vec!["scene.json", "cannot write"]),
        ("step1.nrrd -o a-%d.png --step 0", vec!["step1.nrrd: step 0", "no series"]),
        ("step*.nrrd -o a-%d.png --step 0", vec!["--frames: missing"]),
        ("step1.nrrd gone.nrrd -o a-%d.png", vec!["gone.nrrd: cannot open"]),
    ] {
        folder.run(&format!("render {line}")).fails(2, &parts);
        let made: Vec<String> = folder.names("").into_iter().filter(|name| !names.contains(name)).collect();
        assert!(made.iter().all(|name| name == "a-0.png"), "{line}: {made:?}");
    }
}
