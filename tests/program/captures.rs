//! A capture by gfxreconstruct has the frames of the program, and shows its pictures again.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;
use std::process::Command;

use crate::folder::Folder;
use volraster::io::to_srgb8;

const SCENE: &str = r#"{
  "volume": {"field": "marschner-lobb", "dims": [16, 16, 16], "type": "f32"},
  "transfer": {"preset": "shells", "range": [0, 1]},
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42},
  "image": {"width": 48, "height": 32},
  "background": [0, 0, 0, 1],
  "technique": {"name": "slabs"}
}"#;

const DRAW: &str = "-q render scene.json --frames 2 --orbit 40 -o";

/// A variable of an environment.
type Variable = (&'static str, String);

/// Returns the environment of the default driver, else that of the second one, whichever has surfaces that nothing shows.
fn driver(folder: &Folder) -> Option<Vec<Variable>> {
    let line = format!("{DRAW} out/%d.png --present headless");
    let run = folder.run(&line);
    if run.code == 0 {
        return Some(Vec::new());
    }
    run.fails(3, &["VK_EXT_headless_surface"]);
    let icd = Path::new(env!("CARGO_MANIFEST_DIR")).join(".deps/lavapipe25/lvp_icd.json");
    let text = std::fs::read_to_string(&icd).ok()?;
    let library = text.split('"').find(|part| part.ends_with(".so"))?;
    let libraries = Path::new(library).parent()?.display().to_string();
    Some(vec![("VK_DRIVER_FILES", icd.display().to_string()), ("LD_LIBRARY_PATH", libraries)])
}

/// Runs a tool in the folder; returns what it prints. `None` without the tool.
fn tool(folder: &Folder, environment: &[Variable], line: &str) -> Option<String> {
    let mut words = line.split(' ');
    let mut command = Command::new(words.next()?);
    command.args(words).current_dir(folder.root()).envs(environment.iter().cloned());
    let output = command.output().ok()?;
    assert!(output.status.success(), "{line}: {output:?}");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Reads the pixels of a bitmap of 32 bits for each, row by row from the top: red, green and blue.
fn pixels(folder: &Folder, name: &str) -> Vec<u8> {
    let bytes = std::fs::read(folder.path(name)).unwrap();
    let number = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let (start, width, height) = (number(10), number(18), number(22));
    assert_eq!((width, height.abs(), bytes[28]), (48, 32, 32), "{name}");
    let mut rows: Vec<&[u8]> = bytes[usize::try_from(start).unwrap()..].chunks_exact(4 * 48).collect();
    if height > 0 {
        rows.reverse();
    }
    rows.concat().chunks_exact(4).flat_map(|bgra| [bgra[2], bgra[1], bgra[0]]).collect()
}

#[test]
fn a_capture_shows_the_frames_of_the_program_again() {
    let folder = Folder::new();
    folder.write("scene.json", SCENE);
    if tool(&folder, &[], "gfxrecon-info --version").is_none() {
        eprintln!("skipped: gfxreconstruct is not installed");
        return;
    }
    let Some(environment) = driver(&folder) else {
        eprintln!("skipped: no driver has VK_EXT_headless_surface (tools/lavapipe25.sh fetches one)");
        return;
    };
    let variables: Vec<_> = environment.iter().map(|(name, value)| (*name, value.as_str())).collect();
    folder.run_in(&format!("{DRAW} plain-%d.exr"), &variables).done();
    let file = folder.path("a.gfxr").display().to_string();
    let layer = [
        ("VK_INSTANCE_LAYERS", "VK_LAYER_LUNARG_gfxreconstruct"),
        ("GFXRECON_CAPTURE_FILE", file.as_str()),
        ("GFXRECON_CAPTURE_FILE_TIMESTAMP", "false"),
        ("GFXRECON_PAGE_GUARD_ALIGN_BUFFER_SIZES", "true"),
        ("GFXRECON_LOG_LEVEL", "fatal"),
    ];
    let captured: Vec<_> = variables.iter().copied().chain(layer).collect();
    folder.run_in(&format!("{DRAW} drawn-%d.exr --present headless"), &captured).done();
    let info = tool(&folder, &environment, "gfxrecon-info a.gfxr").unwrap();
    assert!(info.contains("Total frames: 2"), "{info}");
    let replay = |prefix: &str| {
        let line = format!("gfxrecon-replay --screenshot-all --screenshot-prefix {prefix} a.gfxr");
        tool(&folder, &environment, &line).unwrap();
        [1, 2].map(|frame| pixels(&folder, &format!("{prefix}_frame_{frame}.bmp")))
    };
    let frames = replay("one");
    assert!(frames == replay("two"), "two replays differ");
    assert!(frames[0] != frames[1], "the camera moves");
    for (frame, shown) in frames.iter().enumerate() {
        let picture = to_srgb8(&folder.exr(&format!("plain-{frame}.exr")), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(shown.len(), picture.len());
        let most = shown.iter().zip(&picture).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(most <= Some(1), "frame {frame} differs by {most:?}");
    }
}

#[test]
fn frames_in_flight_are_not_presented() {
    let folder = Folder::new();
    folder.write("scene.json", SCENE);
    folder
        .run("render scene.json -o a.png --frames 2 --in-flight 2 --present headless")
        .fails(2, &["--in-flight", "one by one"]);
}
