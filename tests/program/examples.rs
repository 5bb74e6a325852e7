//! The examples, as programs: they run, the layer is silent, and what they draw is what it should be.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use volraster::glam::DVec3;
use volraster::gpu::GpuOptions;
use volraster::io::GaussiansOutput;
use volraster::scene::{Axes, Camera, Field, Projection, Scene, SplatRule, TransferFunction, View};
use volraster::{Gpu, GpuScene, Renderer, Technique};

/// The folder of the examples, which are built; by a run of all tests they are already.
fn examples() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let root = env!("CARGO_MANIFEST_DIR");
        let mut build = Command::new(env!("CARGO"));
        let status = build
            .args(["build", "--examples"])
            .args(cfg!(feature = "mpi").then_some("--features=mpi"))
            .env_remove("RUSTC_BOOTSTRAP")
            .current_dir(root)
            .status()
            .unwrap();
        assert!(status.success());
        // target/PROFILE/deps/this
        let this = std::env::current_exe().unwrap();
        this.parent().unwrap().parent().unwrap().join("examples")
    })
}

/// A fresh folder.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Width, height and RGBA codes of a PNG.
fn read(path: &Path) -> (u32, u32, Vec<[u8; 4]>) {
    let image = image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).into_rgba8();
    (image.width(), image.height(), image.pixels().map(|pixel| pixel.0).collect())
}

const SIZE: [u32; 2] = [160, 120];

/// Returns the last two of `frames` frames of `embed` with a technique.
fn embed(technique: &str, frames: u32) -> [Vec<[u8; 4]>; 2] {
    embed_with(&["--technique", technique], frames)
}

/// Returns the same frames without a volume: drawn once, for tests that run at the same time.
fn opaque() -> &'static [Vec<[u8; 4]>; 2] {
    static FRAMES: OnceLock<[Vec<[u8; 4]>; 2]> = OnceLock::new();
    FRAMES.get_or_init(|| embed("none", 3))
}

/// Draws the same with other arguments.
fn embed_with(arguments: &[&str], frames: u32) -> [Vec<[u8; 4]>; 2] {
    let technique = arguments.join(" ");
    let folder = folder(&format!("embed-{}", technique.replace([':', '=', ',', '/', ' '], "-")));
    let mut program = Command::new(examples().join("embed"));
    let output = program
        .arg(&folder)
        .args([&frames.to_string(), "--size", "160x120"])
        .args(arguments)
        .output()
        .unwrap();
    let said = text(&output);
    assert!(output.status.success(), "{technique}: {said}");
    assert!(said.contains("validation: on"), "{technique}: {said}");
    assert!(output.stderr.is_empty(), "{technique}: {said}");
    let mut names: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let want = [frames - 2, frames - 1].map(|frame| format!("frame-{frame:04}.png"));
    assert_eq!(names, want);
    want.map(|name| {
        let (width, height, pixels) = read(&folder.join(name));
        assert_eq!([width, height], SIZE);
        pixels
    })
}

fn count(pixels: impl IntoIterator<Item = bool>) -> usize {
    pixels.into_iter().filter(|&is| is).count()
}

/// The volume is drawn over the program's picture, behind what is nearer; every technique draws the same.
#[test]
fn the_volume_stands_among_the_program_s_own_boxes() {
    let opaque = opaque();
    // Of the box before the volume, and of nothing else.
    let nearest = |p: &[u8; 4]| p[0] / 2 > p[1] && p[2] / 2 > p[1];
    // Of the box in the volume.
    let inside = |p: &[u8; 4]| p[0] / 3 > p[2] / 2 && p[1] > p[2];
    // sRGB codes of (0.02, 0.025, 0.04).
    let background = opaque[0][0];
    assert_eq!(background, [39, 44, 56, 255]);
    let mut first: Option<[Vec<[u8; 4]>; 2]> = None;
    for technique in ["slices-3d", "slices-3d:route=raster", "slabs", "raycast:step=0.5", "shear-warp"] {
        let drawn = embed(technique, 3);
        assert!(drawn[0] != drawn[1], "the camera moves");
        for (drawn, opaque) in drawn.iter().zip(opaque) {
            let all = drawn.len();
            assert!(drawn.iter().all(|p| p[3] == 255), "{technique}");
            let pairs = || drawn.iter().zip(opaque);
            let changed = count(pairs().map(|(a, b)| a != b));
            assert!((all / 8..all / 2).contains(&changed), "{technique}: {changed} of {all} changed");
            let shades: std::collections::HashSet<_> = drawn.iter().collect();
            assert!(shades.len() > 500, "{technique}: {} colours", shades.len());
            // What is nearer than the volume is as it was, to the bit.
            let kept = count(opaque.iter().map(nearest));
            assert!(kept > 50, "{kept} pixels of the nearest box");
            let disturbed = count(pairs().map(|(a, b)| nearest(b) && a != b));
            assert_eq!(disturbed, 0, "{technique}: of {kept}");
            // What stands in the volume is seen through what of it is before, and hides the rest.
            let boxed = count(opaque.iter().map(inside));
            let tinted = count(pairs().map(|(a, b)| inside(b) && a != b));
            let recognised = count(pairs().map(|(a, b)| inside(b) && a[0] > a[2]));
            assert!(boxed > 50 && tinted > boxed / 8, "{technique}: {tinted} of {boxed} tinted");
            assert!(recognised > boxed / 2, "{technique}: {recognised} of {boxed} recognised");
        }
        if let Some(first) = &first {
            for (a, b) in first.iter().zip(&drawn) {
                let difference: u32 =
                    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
                let mean = f64::from(difference) / f64::from(4 * SIZE[0] * SIZE[1]);
                assert!(mean < 0.35, "{technique}: {mean} codes from the first technique");
            }
        } else {
            first = Some(drawn);
        }
    }
}

/// Trained splats stand among the boxes, blended in the codes that are displayed.
#[test]
fn trained_splats_stand_among_the_program_s_own_boxes() {
    let path = folder("embed-input").with_extension("ply");
    let splats = Field::Blobs.splats(3000).unwrap().with_axes(Axes::Rub);
    volraster::io::write_gaussians(&path, &splats, &GaussiansOutput::default()).unwrap();
    let opaque = opaque();
    let drawn = embed_with(&["--splats", path.to_str().unwrap()], 3);
    let gpu = Gpu::new(&GpuOptions::default()).unwrap();
    let transfer = TransferFunction::from_rows(&[[0.0; 5]]).unwrap();
    let scene = GpuScene::new(&gpu, Scene::new(splats, transfer).with_rule(SplatRule::Ray));
    let camera = Camera {
        eye: DVec3::new(2.6, 1.4, 4.0),
        target: DVec3::new(0.0, -0.1, 0.0),
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 40.0 },
    };
    for (frame, (drawn, opaque)) in (1_u8..).zip(drawn.iter().zip(opaque)) {
        let view = View::new(camera.orbit(frame.into()).unwrap(), SIZE[0], SIZE[1]).unwrap();
        let alone = Renderer::new(&scene, Technique::parse("gaussians").unwrap()).render(&view).unwrap();
        let background = opaque[0];
        let (mut covered, mut worst) = (0, 0.0_f32);
        for ((drawn, opaque), alone) in drawn.iter().zip(opaque).zip(alone.pixels()) {
            // Of the box before the splats.
            assert!(opaque[0] / 2 <= opaque[1] || opaque[2] / 2 <= opaque[1] || drawn == opaque);
            if *opaque == background {
                let over = |k: usize| {
                    (255.0 * alone[k] + (1.0 - alone[3]) * f32::from(background[k])).clamp(0.0, 255.0)
                };
                worst = (0..3).map(|k| (f32::from(drawn[k]) - over(k)).abs()).fold(worst, f32::max);
                covered += usize::from(alone[3] > 0.5);
            }
        }
        assert!(covered > 300 && worst < 1.5, "frame {frame}: {covered} pixels, {worst} codes");
    }
}

/// What is wrong on the command line ends the program with a word about it.
#[test]
fn embed_says_what_is_wrong() {
    for (arguments, what) in [
        (vec![], "usage"),
        (vec!["out", "--technique", "slices-4d"], "slices-4d"),
        (vec!["out", "x"], "usage"),
    ] {
        let output = Command::new(examples().join("embed")).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(text(&output).contains(what), "{}", text(&output));
    }
}

#[test]
fn the_turntable_turns() {
    let folder = folder("turntable");
    let scan = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/head.json");
    let mut program = Command::new(examples().join("turntable"));
    let output = program.arg(scan).arg(&folder).args(["2", "slices-3d:step=4"]).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    let [front, back] = ["000", "001"].map(|n| read(&folder.join(format!("turntable-{n}.png"))).2);
    let differing = count(front.iter().zip(&back).map(|(a, b)| a != b));
    assert!(differing > front.len() / 10, "{differing} of {}", front.len());
    let lit = count(front.iter().map(|p| p[0] > 60));
    assert!(lit > front.len() / 10, "{lit} of {}", front.len());
}

/// Both eyes are drawn whole and beside each other, and show the head from different places.
#[test]
fn a_stereo_pair_stands_side_by_side() {
    let folder = folder("stereo");
    let scan = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/head.json");
    std::fs::create_dir_all(&folder).unwrap();
    let picture = folder.join("stereo.png");
    let mut program = Command::new(examples().join("stereo"));
    let output = program.arg(&scan).arg(&picture).args(["slices-3d:step=4"]).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    assert!(text(&output).contains("times one eye"), "{}", text(&output));
    let (width, _, pixels) = read(&picture);
    let half = width as usize / 2;
    let eye = |from: usize| -> Vec<_> {
        pixels.chunks(2 * half).flat_map(|row| row[from..from + half].to_vec()).collect()
    };
    let (left, right) = (eye(0), eye(half));
    let lit = |eye: &[[u8; 4]]| count(eye.iter().map(|p| p[0] > 60));
    assert!(lit(&left) > left.len() / 10 && lit(&right) > right.len() / 10);
    let differing = count(left.iter().zip(&right).map(|(a, b)| a != b));
    assert!(differing > left.len() / 20, "{differing} of {}", left.len());
}
