//! The raster routes of `havs` against the route `compute`: the same faces in the same order through the same k-buffer.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::*;
use glam::DVec3;
use volraster::GpuScene;
use volraster::gpu::OptionalFeature;
use volraster::scene::{Camera, Field, Projection, Scene, TetScalars, Tets, TransferFunction, View};
use volraster::technique::{Method, Renderer};
use volraster::{Error, Image};

/// The raster routes that this device offers.
fn raster_routes(gpu: &volraster::Gpu) -> Vec<&'static str> {
    routes_of(gpu, Method::Havs).into_iter().filter(|route| *route != "compute").collect()
}

/// Cubes of tetrahedra with their inner points moved, so that nothing is in line and centroids mislead.
fn shaken(cubes: u32) -> Tets {
    let mesh = Field::Blobs.tets(cubes).unwrap();
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    };
    let reach = 0.4 / f64::from(cubes);
    let points = mesh
        .points()
        .iter()
        .map(|&point| {
            let by = DVec3::new(random(), random(), random()) * reach;
            if point.abs().max_element() < 0.999 { point + by } else { point }
        })
        .collect();
    Tets::new(points, mesh.cells().to_vec(), mesh.scalars().clone()).unwrap().0
}

/// The same, small in the middle and large outside: centroids mislead more.
fn graded(cubes: u32) -> Tets {
    let mesh = shaken(cubes);
    let points = mesh.points().iter().map(|&point| point * point * point).collect();
    Tets::new(points, mesh.cells().to_vec(), mesh.scalars().clone()).unwrap().0
}

/// A scalar for each cell.
fn of_cells(mesh: &Tets) -> Vec<f32> {
    let values = mesh.scalars().values();
    let at = |i: u32| values[usize::try_from(i).unwrap()];
    mesh.cells().iter().map(|cell| cell.iter().map(|&i| at(i)).sum::<f32>() / 4.0).collect()
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let scene = |mesh| Scene::new(mesh, TransferFunction::from_rows(&FOG).unwrap());
    let mesh = shaken(6);
    let cells = of_cells(&mesh);
    let with = |scalars| mesh.clone().with_scalars(scalars).unwrap();
    // Every seventh cell is vacuum: a mesh full of holes.
    let holes = |values: &[f32]| {
        let value = |(i, &value): (usize, &f32)| if i % 7 == 0 { f32::NAN } else { value };
        values.iter().enumerate().map(value).collect()
    };
    vec![
        ("points", scene(mesh.clone())),
        ("cells", scene(with(TetScalars::Cell(cells.clone())))),
        ("holes", scene(with(TetScalars::Cell(holes(&cells))))),
        ("points with holes", scene(with(TetScalars::Point(holes(mesh.scalars().values()))))),
    ]
}

/// From outside, by parallel lines, from the middle, from just inside and with the mesh half behind the eye.
fn views() -> Vec<(&'static str, View)> {
    let eye = |eye, target| {
        let camera = Camera { eye, target, up: DVec3::Y, projection: perspective() };
        View::new(camera, 93, 77).unwrap()
    };
    vec![
        ("outside", view(perspective(), 1.0, 93, 77)),
        ("parallel", view(orthographic(), 1.0, 93, 77)),
        ("inside", view(perspective(), 0.1, 93, 77)),
        ("behind a face", eye(DVec3::new(0.31, 0.97, 0.43), DVec3::new(-0.2, -0.3, 0.1))),
        ("beside", eye(DVec3::new(1.15, 0.2, 0.1), DVec3::new(0.6, 0.3, -2.0))),
    ]
}

fn drawn(scene: &Arc<GpuScene>, view: &View, options: &str) -> (Image, BTreeMap<&'static str, u64>) {
    let mut frames = Renderer::new(scene, technique(&format!("havs:{options}"))).frames(view).unwrap();
    let time = frames.draw(view).unwrap();
    (frames.read_back().unwrap(), time.counters.into_iter().collect())
}

/// Greatest difference of any channel.
fn difference(a: &Image, b: &Image) -> f32 {
    let of = |(a, b): (&[f32; 4], &[f32; 4])| (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
    let all = a.pixels().iter().zip(b.pixels()).map(of);
    all.inspect(|d| assert!(d.is_finite())).fold(0.0, f32::max)
}

/// Whether there is something to compare.
fn shows(image: &Image) -> bool {
    image.pixels().iter().filter(|pixel| pixel[3] > 0.01).count() > 30
}

const OVERFLOW: &str = "kbuffer_overflow_pixels";

/// A line meets the same faces, at depths that are rounded otherwise: relative to its tile there, to itself here. That is a few units in
/// the last place of a depth of at most 1, along lines of at most 3.5 units with an extinction of at most 8.
const ROUNDING: f32 = 1e-5;

#[test]
fn raster_routes_draw_what_compute_draws() {
    let gpu = gpu();
    let routes = raster_routes(&gpu);
    let mut flagged = 0;
    for (scene_name, scene) in scenes() {
        let scene = GpuScene::new(&gpu, scene);
        for (view_name, view) in taken(2, views()) {
            for order in ["front-to-back", "back-to-front"] {
                for k in [1, 2, 7] {
                    let options = format!("k={k},order={order},repair=none");
                    let (compute, expected) = drawn(&scene, &view, &options);
                    assert!(shows(&compute), "{scene_name}, {view_name}");
                    for route in &routes {
                        let (image, found) = drawn(&scene, &view, &format!("{options},route={route}"));
                        let most = difference(&image, &compute);
                        let what = format!("{scene_name}, {view_name}, {options}, {route}");
                        assert!(most < ROUNDING, "{what}: {most:.1e}");
                        // What is behind an eye outside of the mesh is not drawn, so not found unsorted either.
                        if view_name != "beside" {
                            assert_eq!(found[OVERFLOW], expected[OVERFLOW], "{what}");
                        }
                        flagged += found[OVERFLOW];
                    }
                }
            }
        }
    }
    assert!(routes.is_empty() || flagged > if exhaustive() { 100 } else { 20 }, "{flagged}");
}

/// Integrators, a line's end, and what leaves nothing to the rasteriser: lines through edges and corners, faces seen edge on, faces
/// smaller than a pixel, a far eye.
#[test]
fn raster_routes_draw_what_compute_draws_at_extremes() {
    let gpu = gpu();
    let scene = |mesh| GpuScene::new(&gpu, Scene::new(mesh, TransferFunction::from_rows(&FOG).unwrap()));
    let shaken_6 = scene(shaken(6));
    let straight = scene(Field::Blobs.tets(4).unwrap());
    let fine = scene(shaken(24));
    let outside = view(perspective(), 1.0, 61, 45);
    let along = |projection, eye| {
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection };
        View::new(camera, 64, 64).unwrap()
    };
    // A pixel is 1/16: every other line passes through corners and edges, and half of the faces are edge on.
    let axis = along(
        Projection::Orthographic { half_height: 2.0 },
        DVec3::Z * 4.0 + DVec3::new(1.0, 1.0, 0.0) / 32.0,
    );
    let axis = View::new(Camera { target: axis.camera().eye - DVec3::Z, ..*axis.camera() }, 64, 64).unwrap();
    let cases = [
        ("exact", &shaken_6, outside, "integrator=exact"),
        ("full", &shaken_6, outside, "integrator=full,table=128"),
        ("smoke", &shaken_6, outside, "integrator=smoke,smoke=3"),
        ("stop", &shaken_6, outside, "stop=0.3"),
        ("edge on", &straight, axis, "k=7"),
        ("one point", &straight, along(perspective(), DVec3::Z * 4.0), "k=7"),
        ("small", &fine, view(perspective(), 3.0, 40, 33), "k=7"),
        ("far", &shaken_6, view(Projection::Perspective { fov_y_deg: 1e-3 }, 3e4, 61, 45), "k=7"),
        ("on a face", &straight, along(perspective(), DVec3::new(0.25, 0.1, 1.0)), "k=7"),
    ];
    for (name, scene, view, options) in &cases {
        let options = format!("{options},repair=none");
        let (compute, expected) = drawn(scene, view, &options);
        assert!(shows(&compute), "{name}");
        for route in raster_routes(&gpu) {
            let (image, found) = drawn(scene, view, &format!("{options},route={route}"));
            let most = difference(&image, &compute);
            assert!(most < ROUNDING, "{name}, {route}: {most:.1e}");
            assert_eq!(found[OVERFLOW], expected[OVERFLOW], "{name}, {route}");
        }
    }
}

/// Pixels that a window of one pair leaves unsorted are drawn again from lists of them alone; also when a view needs more room than the
/// one that was prepared for.
#[test]
fn flagged_pixels_are_repaired() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, Scene::new(graded(8), TransferFunction::from_rows(&FOG).unwrap()));
    let [near, far] = [0.7, 3.0].map(|distance| view(perspective(), distance, 93, 77));
    let (sorted, all) = drawn(&scene, &near, "k=15");
    assert_eq!(all[OVERFLOW], 0);
    assert!(shows(&sorted));
    // Most pixels of the image, and some.
    let mut of_most = None;
    for (k, least) in [(1, 2000), (5, 20)] {
        for route in raster_routes(&gpu) {
            let (unsorted, left) = drawn(&scene, &near, &format!("k={k},route={route},repair=none"));
            assert!(left[OVERFLOW] > least, "{}", left[OVERFLOW]);
            let (_, by_compute) = drawn(&scene, &near, &format!("k={k},repair=none"));
            assert_eq!(left[OVERFLOW], by_compute[OVERFLOW]);
            let wrong = difference(&unsorted, &sorted);
            assert!(wrong > 100.0 * ROUNDING, "{wrong:.1e}");

            let spec = technique(&format!("havs:k={k},route={route}"));
            let mut frames = Renderer::new(&scene, spec).frames(&far).unwrap();
            for (view, is_near) in [(&far, false), (&near, true), (&far, false), (&near, true)] {
                let counters: BTreeMap<_, _> = frames.draw(view).unwrap().counters.into_iter().collect();
                if is_near {
                    let most = difference(&frames.read_back().unwrap(), &sorted);
                    assert!(most < ROUNDING, "{most:.1e}");
                    assert_eq!(counters[OVERFLOW], left[OVERFLOW]);
                    let repaired = counters["repaired_fragments"];
                    let of_most = *of_most.get_or_insert(repaired);
                    assert!(k == 1 || 10 * repaired < 3 * of_most, "{repaired} of {of_most}");
                    assert!(repaired > left[OVERFLOW]);
                }
            }
        }
    }
}

/// Where cells overlap, faces do not say which scalars hold between them: those pixels are drawn again from lists of cells, as compute
/// does.
#[test]
fn overlapping_cells_are_drawn_from_lists_of_cells() {
    let gpu = gpu();
    let one = Field::Blobs.tets(3).unwrap();
    let TetScalars::Point(scalars) = one.scalars() else { panic!("scalars at points") };
    let count = u32::try_from(one.points().len()).unwrap();
    let moved = one.points().iter().map(|point| *point * 0.8 + DVec3::new(0.11, -0.07, 0.13));
    let points = one.points().iter().copied().chain(moved).collect();
    let cells = one.cells().iter().copied().chain(one.cells().iter().map(|cell| cell.map(|i| i + count)));
    let scalars = scalars.iter().copied().chain(scalars.iter().map(|s| 1.0 - s)).collect();
    let both = Tets::new(points, cells.collect(), TetScalars::Point(scalars)).unwrap().0;
    let scene = GpuScene::new(&gpu, Scene::new(both, TransferFunction::from_rows(&FOG).unwrap()));
    for view in [
        view(perspective(), 1.0, 60, 44),
        view(orthographic(), 1.0, 60, 44),
        view(perspective(), 0.1, 60, 44),
    ] {
        let mut frames = Renderer::new(&scene, technique("abuffer")).frames(&view).unwrap();
        frames.draw(&view).unwrap();
        let sorted = frames.read_back().unwrap();
        assert!(shows(&sorted));
        for route in raster_routes(&gpu) {
            for k in [2, 7] {
                let (image, found) = drawn(&scene, &view, &format!("k={k},route={route}"));
                assert!(found["overlap_pixels"] > 100, "{found:?}");
                let most = difference(&image, &sorted);
                assert!(most < ROUNDING, "{route}, k {k}: {most:.1e}");
                let (image, _) = drawn(&scene, &view, &format!("k={k},route={route},repair=none"));
                assert!(difference(&image, &sorted) > 100.0 * ROUNDING);
            }
        }
    }
}

#[test]
fn frames_repeat_to_the_bit() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, Scene::new(shaken(12), TransferFunction::from_rows(&FOG).unwrap()));
    for route in raster_routes(&gpu) {
        for distance in [1.0, 0.1] {
            let view = view(perspective(), distance, 93, 77);
            for options in ["k=1", "k=2,repair=none", "k=7"] {
                let (first, _) = drawn(&scene, &view, &format!("{options},route={route}"));
                for _ in 0..4 {
                    let (again, _) = drawn(&scene, &view, &format!("{options},route={route}"));
                    let bits = |image: &Image| {
                        image.pixels().iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>()
                    };
                    assert!(bits(&first) == bits(&again), "{options}, {distance}");
                }
            }
        }
    }
}

#[test]
fn a_route_that_the_device_lacks_is_refused_by_name() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, Scene::new(shaken(3), TransferFunction::from_rows(&FOG).unwrap()));
    let view = view(perspective(), 1.0, 16, 16);
    for (route, feature) in [
        ("interlock", OptionalFeature::FragmentInterlock),
        ("implementation-ordered", OptionalFeature::OrderedStores),
    ] {
        let drawn = Renderer::new(&scene, technique(&format!("havs:route={route}"))).render(&view);
        if gpu.has(feature) {
            drawn.unwrap();
        } else {
            let Err(Error::Unsupported { what, missing }) = drawn else { panic!("{route}: {drawn:?}") };
            assert!(what.contains(route) && missing.contains("route=compute works"), "{what}: {missing}");
        }
    }
    // Whatever the device offers, nobody gets them without asking.
    for spec in ["havs", "havs:route=auto", "havs:route=compute"] {
        let frames = Renderer::new(&scene, technique(spec)).frames(&view).unwrap();
        assert_eq!(frames.plan().route(), "compute");
    }
    assert_eq!(Method::Havs.routes(), ["compute", "interlock", "implementation-ordered"]);
}

#[test]
fn what_a_raster_route_cannot_do_is_refused() {
    let parse = |spec: &str| volraster::technique::Technique::parse(spec).unwrap_err().to_string();
    for route in ["interlock", "implementation-ordered"] {
        let error = parse(&format!("havs:k=8,route={route}"));
        assert!(error.contains("option k: 8: must be 1 to 7"), "{error}");
        let error = parse(&format!("havs:route={route},chunk=4"));
        assert!(error.contains("option chunk"), "{error}");
        let pairs = technique(&format!("havs:k=7,route={route}")).option_pairs();
        assert!(pairs.contains(&("route", route.to_string())), "{pairs:?}");
    }
    technique("havs:k=15,chunk=4,route=compute");
    assert!(parse("havs:route=raster").contains("implementation-ordered"));
}
