//! Annotations of pictures: where they are drawn, and that nothing else changes.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    reason = "a test fails by panicking"
)]

use std::path::Path;

use crate::folder::Folder;
use volraster::Image;
use volraster::glam::{DVec2, DVec3};
use volraster::scene::{Camera, Projection, View};

/// A cube that nothing shines through.
const SCENE: &str = r#"{
  "volume": {"field": "ramp", "dims": [4, 4, 4]},
  "transfer": [[-1, 0, 0.2, 0.8, 900], [1, 0.1, 0.2, 0.3, 900]],
  "camera": {"eye": [3, -5, 2.5], "target": [0, 0, 0], "up": [0, 0, 1], "fov_y_deg": 32},
  "image": {"width": 240, "height": 200}
}"#;

fn folder() -> Folder {
    let folder = Folder::with_cache(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("annotations-cache"));
    folder.write("scene.json", SCENE);
    folder
}

fn view() -> View {
    let projection = Projection::Perspective { fov_y_deg: 32.0 };
    let camera = Camera { eye: DVec3::new(3.0, -5.0, 2.5), target: DVec3::ZERO, up: DVec3::Z, projection };
    View::new(camera, 240, 200).unwrap()
}

/// Centres of the pixels that differ.
fn changed(image: &Image, plain: &Image) -> Vec<DVec2> {
    let place = |i: usize| DVec2::new((i % 240) as f64 + 0.5, (i / 240) as f64 + 0.5);
    let pairs = image.pixels().iter().zip(plain.pixels()).enumerate();
    pairs.filter(|(_, (own, other))| own != other).map(|(i, _)| place(i)).collect()
}

fn draw(folder: &Folder, options: &str) -> Image {
    folder.run(&format!("-q render scene.json -o out.exr {options}")).done();
    folder.exr("out.exr")
}

/// Edges at the corner that is furthest from the eye are behind the cube; all others are seen in full.
#[test]
fn the_box_is_drawn_before_and_behind_the_data() {
    let folder = folder();
    let plain = draw(&folder, "--quiet");
    let lines = changed(&draw(&folder, "--box"), &plain);
    let hidden_corner = DVec3::new(-1.0, 1.0, -1.0);
    let mut seen = 0;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for corner in 0..8_u8 {
            let start = DVec3::select(
                volraster::glam::BVec3::new(corner & 1 != 0, corner & 2 != 0, corner & 4 != 0),
                DVec3::ONE,
                DVec3::NEG_ONE,
            );
            let end = start - 2.0 * axis * start.dot(axis);
            if start.dot(axis) > 0.0 {
                continue;
            }
            let is_hidden = start == hidden_corner || end == hidden_corner;
            // Near the middle no other edge is near.
            let (middle, _) = view().project(start.lerp(end, 0.45)).unwrap();
            let is_drawn = lines.iter().any(|pixel| (*pixel - middle).length() < 0.9);
            assert_eq!(is_drawn, !is_hidden, "{start} to {end}");
            seen += usize::from(is_drawn);
        }
    }
    assert_eq!(seen, 9);
    // Behind what lets light through, all twelve are seen, and the data changes their colour.
    let clear = draw(&folder, "--scale 1e-6");
    assert!(changed(&draw(&folder, "--scale 1e-6 --box"), &clear).len() > lines.len() * 5 / 4);
    // A film has the same.
    folder.run("-q render scene.json -o film-%d.exr --frames 1 --box").done();
    assert_eq!(folder.exr("film-0.exr"), draw(&folder, "--box"));
}

#[test]
fn bar_axes_and_caption_have_their_places() {
    let folder = folder();
    let plain = draw(&folder, "--quiet");
    // The bar, from bottom to top, has the colours of the transfer function from -1 to 1.
    let bar = draw(&folder, "--bar=Speed");
    let column =
        (150..240).find(|x| bar.pixel(*x, 100) != plain.pixel(*x, 100) && bar.pixel(*x + 2, 100)[2] < 0.7);
    let x = column.unwrap() + 3;
    for y in [60, 100, 140] {
        let share = 1.0 - (f64::from(y) + 0.5 - 50.0) / 100.0;
        let want = [0.1 * share, 0.2, 0.8 - 0.5 * share, 1.0];
        for (own, want) in bar.pixel(x, y).into_iter().zip(want) {
            assert!((f64::from(own) - want).abs() < 1e-6, "{y}: {:?}, {want:?}", bar.pixel(x, y));
        }
    }
    let all = changed(&bar, &plain);
    assert!(all.iter().all(|p| p.x > 180.0 && (30.0..170.0).contains(&p.y)));
    assert_ne!(bar, draw(&folder, "--bar=Pressure"), "the title is written");
    let axes = changed(&draw(&folder, "--axes"), &plain);
    assert!(!axes.is_empty() && axes.iter().all(|p| p.x < 80.0 && p.y > 120.0));
    let caption = changed(&draw(&folder, "--caption Ramp"), &plain);
    assert!(!caption.is_empty() && caption.iter().all(|p| (p.x - 120.0).abs() < 40.0 && p.y > 180.0));
    // A long one is written smaller.
    let long = changed(&draw(&folder, &format!("--caption {}", "W".repeat(100))), &plain);
    assert!(long.iter().any(|p| p.x < 20.0) && long.iter().any(|p| p.x > 220.0));
    assert!(long.iter().all(|p| (2.0..238.0).contains(&p.x)));
    // The float64 reference has the same, and the statistics are those of the picture without.
    folder.run("-q reference scene.json -o plain.exr").done();
    folder.run("-q reference scene.json -o axes.exr --axes").done();
    let drawn = changed(&folder.exr("axes.exr"), &folder.exr("plain.exr"));
    assert_eq!(drawn, axes);
    folder.run("-q render scene.json -o out.exr --bar --box --stats s.json").done();
    let picture = &folder.json("s.json")["picture"];
    let opacity = plain.pixels().iter().map(|pixel| f64::from(pixel[3])).sum::<f64>() / 48000.0;
    assert!((picture["mean_opacity"].as_f64().unwrap() - opacity).abs() < 1e-6, "{picture}");
    let covered = plain.pixels().iter().filter(|pixel| pixel[3] > 0.002).count() as f64 / 48000.0;
    assert!((picture["covered"].as_f64().unwrap() - covered).abs() < 1e-4, "{picture}");
}
