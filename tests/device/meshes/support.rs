//! What the tests of meshes share: small meshes, cameras, comparisons with the reference.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use volraster::GpuScene;
use volraster::Image;
use volraster::reference::{self, ReferenceImage};
use volraster::scene::{Camera, Field, Projection, Scene, TetScalars, Tets, TransferFunction, View};
use volraster::technique::Renderer;

use crate::common::*;

/// The techniques, with the integrator that has no table.
pub const EXACT: [&str; 2] = ["havs", "abuffer"];

/// Visible everywhere: no cell is left out.
pub const HAZE: [[f64; 5]; 3] =
    [[0.0, 0.1, 0.4, 0.9, 0.3], [0.4, 0.9, 0.3, 0.2, 1.5], [1.0, 0.3, 0.8, 0.4, 0.6]];

pub fn transfer(rows: &[[f64; 5]]) -> TransferFunction {
    TransferFunction::from_rows(rows).unwrap()
}

pub fn cubes(field: Field, n: u32, rows: &[[f64; 5]]) -> Scene {
    Scene::new(field.tets(n).unwrap(), transfer(rows))
}

/// A mesh of points and cells with a scalar at each point.
pub fn mesh(points: &[[f64; 3]], cells: &[[u32; 4]], scalars: &[f32]) -> Tets {
    let points = points.iter().map(|&p| DVec3::from_array(p)).collect();
    Tets::new(points, cells.to_vec(), TetScalars::Point(scalars.to_vec())).unwrap().0
}

/// The same mesh elsewhere.
pub fn moved(mesh: &Tets, to: impl Fn(DVec3) -> DVec3) -> Tets {
    let points = mesh.points().iter().map(|&p| to(p)).collect();
    Tets::new(points, mesh.cells().to_vec(), mesh.scalars().clone()).unwrap().0
}

/// One mesh of two, which share no points.
pub fn both(a: &Tets, b: &Tets) -> Tets {
    let points = [a.points(), b.points()].concat();
    let first = a.points().len() as u32;
    let other = b.cells().iter().map(|cell| cell.map(|i| i + first));
    let cells = a.cells().iter().copied().chain(other).collect();
    let scalars = match (a.scalars(), b.scalars()) {
        (TetScalars::Point(a), TetScalars::Point(b)) => TetScalars::Point([&a[..], b].concat()),
        (TetScalars::Cell(a), TetScalars::Cell(b)) => TetScalars::Cell([&a[..], b].concat()),
        _ => panic!("two kinds of scalars"),
    };
    Tets::new(points, cells, scalars).unwrap().0
}

/// Blobs on cubes drawn out along an oblique line, twenty times as long as wide: centroids of faces say little about
/// the order in which lines meet them.
pub fn needles(n: u32) -> Tets {
    let axis = DVec3::new(0.6, 0.2, -0.77).normalize();
    moved(&Field::Blobs.tets(n).unwrap(), |p| p + axis * (p.dot(axis) * 19.0))
}

/// The whole of [`needles`], from the side.
pub fn needles_view(width: u32, height: u32) -> View {
    let camera = Camera {
        eye: DVec3::new(24.0, 12.0, 26.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 42.0 },
    };
    View::new(camera, width, height).unwrap()
}

/// Ray parameters that a view sees.
pub fn range_of(view: &View) -> [f64; 2] {
    [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY]
}

/// Whether the truth changes within 1/4096 pixel, more than float32 can be off by, as much as the image is wrong.
pub fn is_edge(scene: &Scene, view: &View, pixel: DVec2, error: f64) -> bool {
    let at = |pixel: DVec2| {
        let (origin, direction) = view.ray(pixel);
        reference::ray(scene, origin, direction, range_of(view)).unwrap()
    };
    let here = at(pixel);
    (0..16).any(|i| {
        let angle = f64::from(i) / 16.0 * std::f64::consts::TAU;
        let there = at(pixel + DVec2::new(angle.cos(), angle.sin()) / 4096.0);
        (0..4).any(|c| (there[c] - here[c]).abs() > error)
    })
}

pub fn difference(a: [f32; 4], b: [f64; 4]) -> f64 {
    (0..4).map(|c| (f64::from(a[c]) - b[c]).abs()).fold(0.0, f64::max)
}

/// The largest difference of two images.
pub fn apart(a: &Image, b: &Image) -> f64 {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    let pairs = a.pixels().iter().zip(b.pixels());
    pairs.map(|(a, b)| difference(*a, b.map(f64::from))).fold(0.0, f64::max)
}

/// Every pixel is the truth within `bound`, but for those whose truth changes as much next to it: at most one in a thousand,
/// or `excused`. The largest error of the others.
#[track_caller]
pub fn assert_true(
    what: &str,
    image: &Image,
    truth: &ReferenceImage,
    scene: &Scene,
    view: &View,
    bound: f64,
    excused: usize,
) -> f64 {
    let mut worst = 0.0_f64;
    let mut edges = 0;
    for (i, pixel) in pixels(view) {
        let error = difference(image.pixels()[i], truth.pixels()[i]);
        if error <= bound {
            worst = worst.max(error);
        } else if is_edge(scene, view, pixel, error / 2.0) {
            edges += 1;
        } else {
            panic!("{what}: pixel {pixel}: {:?} is not {:?}", image.pixels()[i], truth.pixels()[i]);
        }
    }
    let most = excused.max(image.pixels().len() / 1000);
    assert!(edges <= most, "{what}: {edges} pixels at edges");
    worst
}

/// What [`assert_true`] takes for the exact integrator: each composited piece rounds by 1.2e-7, and scalars near 1 that are
/// interpolated in float32 by as much, over the steepest of the transfer functions here.
pub const ROUNDING: f64 = 1e-5;

/// Draws with each technique and compares with the reference; something must be there to see.
#[track_caller]
pub fn assert_drawn(gpu: &volraster::Gpu, what: &str, scene: &Scene, view: &View, bound: f64) {
    let truth = truth(scene, view);
    assert!(truth.pixels().iter().any(|p| p[3] > 1e-3), "{what}: nothing to see");
    let on_gpu = GpuScene::new(gpu, scene.clone());
    for spec in EXACT {
        let image = draw_on(&on_gpu, view, spec);
        assert_true(&format!("{what}, {spec}"), &image, &truth, scene, view, bound, 1);
    }
}

/// The image, the overflow map and the counters of a frame.
pub struct Drawn {
    pub image: Image,
    pub overflow: Vec<bool>,
    pub counters: Vec<(&'static str, u64)>,
}

impl Drawn {
    pub fn new(scene: &Arc<GpuScene>, view: &View, spec: &str) -> Self {
        let mut frames = Renderer::new(scene, technique(spec)).frames(view).unwrap();
        let time = frames.draw(view).unwrap();
        let counters = frames.plan().counters().into_iter().chain(time.counters).collect();
        let overflow = frames.overflow_map().unwrap().unwrap_or_default();
        Self { image: frames.read_back().unwrap(), overflow, counters }
    }

    pub fn counter(&self, name: &str) -> u64 {
        self.counters.iter().find(|(key, _)| *key == name).unwrap().1
    }

    pub fn overflows(&self) -> u64 {
        self.overflow.iter().filter(|&&set| set).count() as u64
    }
}
