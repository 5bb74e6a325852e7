//! The k-buffer: what it flags, what repair makes of it, chunks, directions.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use volraster::GpuScene;
use volraster::scene::{Scene, Surface, Tets, View};
use volraster::technique::Renderer;

use crate::common::*;
use crate::meshes::support::*;

/// The unique faces of a mesh.
fn faces(mesh: &Tets) -> Vec<[DVec3; 3]> {
    let mut faces = HashMap::new();
    for cell in mesh.cells() {
        for skip in 0..4 {
            let mut face: Vec<u32> = (0..4).filter(|&i| i != skip).map(|i| cell[i]).collect();
            face.sort_unstable();
            faces.entry(face.clone()).or_insert_with(|| {
                let corner = |i: usize| mesh.points()[face[i] as usize];
                [corner(0), corner(1), corner(2)]
            });
        }
    }
    faces.into_values().collect()
}

/// Where a ray meets a face, and how far from the face's outline, in barycentric coordinates (Möller and Trumbore 1997).
fn meet(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64)> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let scale = 1.0 / ab.dot(p);
    let v = (origin - a).dot(p) * scale;
    let q = (origin - a).cross(ab);
    let w = direction.dot(q) * scale;
    let least = v.min(w).min(1.0 - v - w);
    (least > -1e-5).then(|| (ac.dot(q) * scale, least))
}

/// The least window that sorts a pixel's faces: the most faces that come before one although they lie beyond it. `None`
/// where float32 may see it otherwise: at outlines of faces, and where two ranks or two distances are nearly the same.
fn needed(faces: &[[DVec3; 3]], view: &View, pixel: DVec2, size: f64) -> Option<usize> {
    let (origin, direction) = view.ray(pixel);
    let mut met = Vec::new();
    for &face in faces {
        let Some((t, least)) = meet(origin, direction, face) else { continue };
        if least < 1e-5 {
            return None;
        }
        let middle = (face[0] + face[1] + face[2]) / 3.0;
        let from_eye = middle - view.camera().eye;
        met.push((if view.is_perspective() { from_eye.length() } else { from_eye.dot(view.forward()) }, t));
    }
    let near = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.windows(2).any(|pair| pair[1] - pair[0] < 1e-6 * size)
    };
    if near(met.iter().map(|m| m.0).collect()) || near(met.iter().map(|m| m.1).collect()) {
        return None;
    }
    met.sort_by(|a, b| a.0.total_cmp(&b.0));
    let beyond = |(i, m): (usize, &(f64, f64))| met[..i].iter().filter(|before| before.1 > m.1).count();
    Some(met.iter().enumerate().map(beyond).max().unwrap_or(0))
}

/// A pixel is flagged if and only if some face comes after more than k that lie beyond it: against sequences that are made
/// from the mesh in float64, for every k. What is flagged at one k is at every smaller one.
#[test]
fn a_pixel_is_flagged_if_and_only_if_its_faces_are_not_sorted() {
    let gpu = gpu();
    let scene = Scene::new(needles(4), transfer(&HAZE));
    let faces = faces(scene.mesh().unwrap());
    let on_gpu = GpuScene::new(&gpu, scene);
    let across = View::new(
        volraster::scene::Camera {
            projection: volraster::scene::Projection::Orthographic { half_height: 14.0 },
            ..*needles_view(1, 1).camera()
        },
        40,
        32,
    );
    for view in [needles_view(40, 32), across.unwrap()] {
        let wanted: Vec<Option<usize>> =
            pixels(&view).map(|(_, pixel)| needed(&faces, &view, pixel, 20.0)).collect();
        let unsure = wanted.iter().filter(|needed| needed.is_none()).count();
        assert!(unsure * 20 < wanted.len(), "{unsure} of {} pixels are not compared", wanted.len());
        let mut last: Option<Vec<bool>> = None;
        for k in 1..=15 {
            let drawn = Drawn::new(&on_gpu, &view, &format!("havs:repair=none,empty-space=march,k={k}"));
            assert_eq!(drawn.overflows(), drawn.counter("kbuffer_overflow_pixels"));
            for (i, needed) in wanted.iter().enumerate() {
                if let Some(needed) = needed {
                    assert_eq!(drawn.overflow[i], *needed > k, "k {k}, pixel {i} needs {needed}");
                }
            }
            if let Some(last) = &last {
                assert!(last.iter().zip(&drawn.overflow).all(|(last, now)| *last || !now), "k {k}");
            }
            // The map knows what was repaired, too.
            let repaired = Drawn::new(&on_gpu, &view, &format!("havs:empty-space=march,k={k}"));
            assert_eq!(repaired.overflow, drawn.overflow, "k {k}");
            last = Some(drawn.overflow);
        }
        let least = |k: usize| wanted.iter().filter(|needed| needed.is_some_and(|needed| needed > k)).count();
        println!("more than 1: {}, 2: {}, 7: {} of {}", least(1), least(2), least(7), wanted.len());
        assert!(least(1) > 50 && least(2) > 20 && least(2) < wanted.len() / 2);
    }
}

/// What is not flagged is right without repair, and some of what is flagged is wrong. With repair everything is right,
/// whatever k.
#[test]
fn what_is_not_flagged_is_right_and_repair_rights_the_rest() {
    let gpu = gpu();
    let scene = Scene::new(needles(5), transfer(&FOG));
    let view = needles_view(56, 44);
    let truth = truth(&scene, &view);
    let on_gpu = GpuScene::new(&gpu, scene.clone());
    let exact = draw_on(&on_gpu, &view, "abuffer");
    assert_true("abuffer", &exact, &truth, &scene, &view, 2e-5, 2);
    let mut first: Option<volraster::Image> = None;
    for k in 1..=15 {
        let drawn = Drawn::new(&on_gpu, &view, &format!("havs:repair=none,k={k}"));
        let wrong = |i: usize| difference(drawn.image.pixels()[i], exact.pixels()[i].map(f64::from)) > 2e-5;
        let (mut flagged, mut unsorted) = (0, 0);
        for (i, &overflows) in drawn.overflow.iter().enumerate() {
            assert!(overflows || !wrong(i), "k {k}: pixel {i} is wrong and not flagged");
            flagged += usize::from(overflows && wrong(i));
            unsorted += usize::from(overflows);
        }
        // Two faces that come in the wrong order show unless what is between them is not to be seen.
        assert!(
            unsorted < 20 || flagged * 3 >= unsorted,
            "k {k}: {flagged} of {unsorted} flagged pixels are wrong"
        );
        assert!(k > 2 || unsorted > 50, "k {k}: {unsorted}");
        let repaired = draw_on(&on_gpu, &view, &format!("havs:k={k}"));
        assert_true("repaired", &repaired, &truth, &scene, &view, 2e-5, 2);
        match &first {
            None => first = Some(repaired),
            Some(first) => assert_same_but_for_rounding(first, &repaired, &format!("k {k}")),
        }
    }
}

/// The k-buffer in storage images between dispatches is the one in registers, bit for bit.
#[test]
fn chunks_change_nothing() {
    let gpu = gpu();
    let on_gpu = GpuScene::new(&gpu, Scene::new(needles(4), transfer(&FOG)));
    let inside = view(perspective(), 0.1, 26, 19);
    for view in [needles_view(26, 19), inside] {
        for k in taken(2, [1, 7, 8, 15]) {
            for more in taken(2, ["repair=none", "repair=exact", "repair=none,order=back-to-front"]) {
                let whole = Drawn::new(&on_gpu, &view, &format!("havs:k={k},{more}"));
                for chunk in [1, 5, 64] {
                    let parts = Drawn::new(&on_gpu, &view, &format!("havs:k={k},{more},chunk={chunk}"));
                    let what = format!("k {k}, {more}, chunk {chunk}");
                    assert!(parts.counter("chunks") > 1 || chunk == 64, "{what}");
                    assert_eq!(parts.image, whole.image, "{what}");
                    assert_eq!(parts.overflow, whole.overflow, "{what}");
                }
            }
        }
    }
}

/// Each translucent surface is passed once, also where pairs leave the k-buffer out of order and another dispatch goes on.
#[test]
fn chunks_pass_surfaces_once() {
    let gpu = gpu();
    let shell = |i: u8| Surface::sphere(DVec3::ZERO, f64::from(i) * 0.7, [0.9, 0.5, 0.2, 0.04], 2).unwrap();
    let scene = Scene::new(needles(4), transfer(&FOG)).with_surfaces((1..=20).map(shell).collect());
    let on_gpu = GpuScene::new(&gpu, scene);
    let view = needles_view(26, 19);
    for (k, repair) in [(1, "none"), (2, "none"), (1, "exact")] {
        let whole = Drawn::new(&on_gpu, &view, &format!("havs:k={k},repair={repair}"));
        let unsorted = whole.overflow.iter().filter(|overflow| **overflow).count();
        assert!(unsorted > 20 / k, "k {k}: {unsorted}");
        for chunk in [1, 5, 17] {
            let parts = Drawn::new(&on_gpu, &view, &format!("havs:k={k},repair={repair},chunk={chunk}"));
            assert!(parts.counter("chunks") > 1);
            assert_eq!(parts.image, whole.image, "k {k}, repair {repair}, chunk {chunk}");
        }
    }
}

/// Back to front is front to back, but for rounding: 1.2e-7 for each of at most sixty pieces of a line.
#[test]
fn both_directions_give_one_image() {
    let gpu = gpu();
    for (scene, view) in [
        (Scene::new(needles(5), transfer(&FOG)), needles_view(48, 40)),
        (cubes(volraster::scene::Field::Blobs, 6, &SHELLS), view(perspective(), 0.1, 48, 40)),
        (cubes(volraster::scene::Field::Blobs, 6, &FOG), view(orthographic(), 1.0, 48, 40)),
    ] {
        let on_gpu = GpuScene::new(&gpu, scene);
        for spec in
            ["havs", "havs:k=1", "havs:integrator=integral", "havs:integrator=full,table=64", "abuffer"]
        {
            let join = if spec.contains(':') { "," } else { ":" };
            let front = draw_on(&on_gpu, &view, spec);
            let back = draw_on(&on_gpu, &view, &format!("{spec}{join}order=back-to-front"));
            let difference = apart(&front, &back);
            println!("{spec}: {difference:.1e}");
            assert!(difference <= 7e-6, "{spec}: {difference:e}");
            assert_ne!(front, back, "{spec}: the other direction is the same to the bit");
        }
    }
}

/// A line ends where what is behind cannot add more than `stop`, and not before.
#[test]
fn stop_bounds_the_error() {
    let gpu = gpu();
    let rows = HAZE.map(|[s, r, g, b, tau]| [s, r, g, b, 6.0 * tau]);
    let on_gpu = GpuScene::new(&gpu, cubes(volraster::scene::Field::Blobs, 6, &rows));
    let view = view(perspective(), 1.0, 40, 32);
    for spec in EXACT {
        let all = draw_on(&on_gpu, &view, spec);
        let mut last = 0.0;
        for stop in [1e-4, 1e-2, 0.3] {
            let ended = draw_on(&on_gpu, &view, &format!("{spec}:stop={stop}"));
            let error = apart(&all, &ended);
            assert!(error <= stop + 1e-6 && error > last, "{spec} {stop}: {error}");
            last = error;
        }
    }
    let why = technique_error("havs:stop=0.1,order=back-to-front");
    assert!(why.contains("stop") && why.contains("front-to-back"), "{why}");
}

fn technique_error(spec: &str) -> String {
    volraster::technique::Technique::parse(spec).unwrap_err().to_string()
}

/// Only what has a k-buffer has a map of its overflow.
#[test]
fn maps_are_of_what_sorts() {
    let gpu = gpu();
    let grid = GpuScene::new(&gpu, scene(volraster::scene::Field::Blobs, 8, "f32", &FOG));
    let view = view(perspective(), 1.0, 16, 16);
    let mut frames = Renderer::new(&grid, technique("slabs")).frames(&view).unwrap();
    frames.draw(&view).unwrap();
    assert!(frames.overflow_map().unwrap().is_none());
    let mesh = GpuScene::new(&gpu, cubes(volraster::scene::Field::Blobs, 2, &FOG));
    let mut frames = Renderer::new(&mesh, technique("havs")).frames(&view).unwrap();
    assert!(frames.overflow_map().unwrap_err().to_string().contains("nothing has been drawn"));
    frames.draw(&view).unwrap();
    assert_eq!(frames.overflow_map().unwrap().unwrap(), vec![false; 256]);
}
