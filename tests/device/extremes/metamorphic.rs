//! Changes that change nothing.

use glam::{DMat3, DQuat, DVec3};
use volraster::scene::{Camera, Data, Field, Grid, Projection, Samples, Scene, TetScalars, Tets, View};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("metamorphic", CASES);

/// Where nothing rounds in another way the image is the same but for rounding: each of 100 pieces, and scalars that
/// are interpolated to 2^-23 under extinction that rises by 17 per unit of scalar over 3.5 of length.
const BOUND: f64 = 1.2e-5 + 7.1e-6;

const OPTIONS: &[(&str, &str)] = &[("step", "0.5"), ("filter", "exact")];

fn blobs() -> [Data; 2] {
    [Field::Blobs.sample([9, 10, 11], "f32").unwrap().into(), Field::Blobs.tets(5).unwrap().into()]
}

/// Extinction times k and lengths by k.
fn rescaled(run: &mut Run<'_>, k: f64) {
    let before = view(perspective(), 1.0, 14, 12);
    let eye = before.camera().eye / k;
    let after = View::new(Camera { eye, ..*before.camera() }, 14, 12).unwrap();
    let thicker = FOG.map(|[s, r, g, b, tau]| [s, r, g, b, tau * k]);
    for data in blobs() {
        let small: Data = match &data {
            Data::Grid(grid) => grid
                .clone()
                .with_placement(grid.spacing() / k, grid.origin() / k, DMat3::IDENTITY)
                .unwrap()
                .into(),
            Data::Mesh(mesh) => moved(mesh, |p| p / k).into(),
            _ => continue,
        };
        let scenes = [Scene::new(data, transfer(&FOG)), Scene::new(small, transfer(&thicker))];
        run.every_pair([&scenes[0], &scenes[1]], [&before, &after], [OPTIONS; 2], |_, a, b| {
            near("apart", apart(a, b), 0.0, BOUND)
        });
    }
}

fn moved(mesh: &Tets, to: impl Fn(DVec3) -> DVec3) -> Tets {
    let points = mesh.points().iter().map(|&p| to(p)).collect();
    Tets::new(points, mesh.cells().to_vec(), mesh.scalars().clone()).unwrap().0
}

/// Data and camera turned together, and moved.
fn turned(run: &mut Run<'_>, turn: DQuat, by: DVec3) {
    let before = view(perspective(), 1.0, 14, 12);
    let camera = *before.camera();
    let place = |p: DVec3| turn * p + by;
    let after =
        Camera { eye: place(camera.eye), target: place(camera.target), up: turn * camera.up, ..camera };
    let after = View::new(after, 14, 12).unwrap();
    for data in blobs() {
        let other: Data = match &data {
            Data::Grid(grid) => grid
                .clone()
                .with_placement(grid.spacing(), place(grid.origin()), DMat3::from_quat(turn))
                .unwrap()
                .into(),
            Data::Mesh(mesh) => moved(mesh, place).into(),
            _ => continue,
        };
        let scenes = [data, other].map(|data| Scene::new(data, transfer(&FOG)));
        run.every_pair([&scenes[0], &scenes[1]], [&before, &after], [OPTIONS; 2], |_, a, b| {
            // A pixel at the outline may see a grazing piece of it or not: 1e-6 of length at an angle of 1e-3.
            near("apart", apart(a, b), 0.0, BOUND + 1e-4)
        });
    }
}

/// Axes in another order, with the data: the same field of the place. Points and cells of a mesh in another order.
fn permuted(run: &mut Run<'_>) {
    let view = view(perspective(), 1.0, 14, 12);
    let [grid, mesh] = blobs();
    let (Data::Grid(grid), Data::Mesh(mesh)) = (grid, mesh) else { return };
    let [nx, ny, nz] = grid.dims();
    // Index (i, j, k) of the other is (k, i, j) of the first.
    let mut values = Vec::new();
    for k in 0..nx {
        for j in 0..nz {
            for i in 0..ny {
                values.push(grid.value(k, i, j) as f32);
            }
        }
    }
    let spacing = grid.spacing();
    let direction = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
    let other = Grid::new([ny, nz, nx], Samples::F32(values)).unwrap();
    let other =
        other.with_placement(DVec3::new(spacing.y, spacing.z, spacing.x), grid.origin(), direction).unwrap();
    let count = mesh.points().len();
    let points: Vec<DVec3> = mesh.points().iter().rev().copied().collect();
    let scalars: Vec<f32> = mesh.scalars().values().iter().rev().copied().collect();
    let cells = mesh.cells().iter().rev().map(|cell| cell.map(|i| count as u32 - 1 - i)).collect();
    let reversed = Tets::new(points, cells, TetScalars::Point(scalars)).unwrap().0;
    for [a, b] in [[Data::Grid(grid), Data::Grid(other)], [Data::Mesh(mesh), Data::Mesh(reversed)]] {
        let scenes = [a, b].map(|data| Scene::new(data, transfer(&FOG)));
        run.every_pair([&scenes[0], &scenes[1]], [&view; 2], [OPTIONS; 2], |_, a, b| {
            near("apart", apart(a, b), 0.0, BOUND + 1e-4)
        });
    }
}

/// From behind, mirrored: the optical depth of a ray is the same in either direction.
fn from_behind(run: &mut Run<'_>) {
    let one = Camera {
        eye: DVec3::new(0.02, 0.03, 5.0),
        target: DVec3::new(0.02, 0.03, 0.0),
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height: 1.3 },
    };
    let other = Camera { eye: DVec3::new(0.02, 0.03, -5.0), ..one };
    let views = [one, other].map(|camera| View::new(camera, 15, 15).unwrap());
    for data in blobs() {
        let scene = Scene::new(data, transfer(&FOG));
        let claims: &[(&str, &str)] = &[("step", "0.125"), ("filter", "exact")];
        run.pairs([&scene; 2], [&views[0], &views[1]], [claims; 2], |spec, a, b| {
            // Planes begin at the near end: other places, an error of second order in the step, of which a half and
            // less than 2e-3 of opacity is seen here at an eighth of a voxel.
            let rule = if spec.has("step") { 2e-3 } else { 0.0 };
            for y in 0..15 {
                for x in 0..15 {
                    let (a, b) = (a.pixel(x, y)[3], b.pixel(14 - x, y)[3]);
                    near(&format!("{x}, {y}"), a.into(), b.into(), BOUND + rule)?;
                }
            }
            Ok(())
        });
    }
}

/// Twice the size with an empty half around it: a grid in vacuum of zeros.
fn padded(run: &mut Run<'_>) {
    let value = |x: u32, y: u32, z: u32| {
        let inside = [x, y, z].iter().all(|&i| (4..=12).contains(&i));
        if inside { 0.3 + 0.05 * f64::from((x * 5 + y * 3 + z * 7) % 9) } else { 0.0 }
    };
    let block = |low: u32, n: u32| {
        let mut values = Vec::new();
        for z in low..low + n {
            for y in low..low + n {
                for x in low..low + n {
                    // The rim of the block is zero in both.
                    values.push(value(x, y, z) as f32);
                }
            }
        }
        let origin = DVec3::splat(f64::from(low) * 0.25 - 2.0);
        let grid = Grid::new([n; 3], Samples::F32(values)).unwrap();
        grid.with_placement(DVec3::splat(0.25), origin, DMat3::IDENTITY).unwrap()
    };
    let scenes = [block(3, 11), block(0, 17)].map(|grid| Scene::new(grid, transfer(&FOG)));
    // Along an axis planes of both lie at the same depths.
    run.pairs([&scenes[0], &scenes[1]], [&through(9, 9); 2], [OPTIONS; 2], |spec, a, b| {
        // The 2-D table has other lengths, halves of the diagonal, and goes linearly between two: of a piece of optical
        // depth up to 1 it is off by 1/4 / 8 / 120.
        let table = if spec.integrator == "full" { 2.7e-4 } else { 0.0 };
        near("apart", apart(a, b), 0.0, BOUND + table)
    });
}

const CASES: &[Case] = &[
    Case {
        number: "5.2a",
        name: "extinction times 3, lengths by 3",
        expect: "the same image",
        tolerance: "1.9e-5",
        run: |run| rescaled(run, 3.0),
    },
    Case {
        number: "5.2b",
        name: "extinction times 1e12, lengths by 1e12",
        expect: "the same image",
        tolerance: "1.9e-5",
        run: |run| rescaled(run, 1e12),
    },
    Case {
        number: "5.2c",
        name: "extinction times 1e-12, lengths by 1e-12",
        expect: "the same image",
        tolerance: "1.9e-5",
        run: |run| rescaled(run, 1e-12),
    },
    Case {
        number: "5.3a",
        name: "data and camera turned together",
        expect: "the same image",
        tolerance: "1.2e-4",
        run: |run| turned(run, DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.3), DVec3::ZERO),
    },
    Case {
        number: "5.3b",
        name: "data and camera moved by 1e6 sizes together",
        expect: "the same image",
        tolerance: "1.2e-4",
        run: |run| turned(run, DQuat::IDENTITY, DVec3::new(1e6, -2e6, 5e5)),
    },
    Case {
        number: "5.4",
        name: "axes permuted with the data; points and cells of a mesh in reverse",
        expect: "the same image",
        tolerance: "1.2e-4",
        run: permuted,
    },
    Case {
        number: "5.5",
        name: "seen from behind",
        expect: "the same opacities, mirrored",
        tolerance: "1.9e-5; 2e-3 where planes lie elsewhere",
        run: from_behind,
    },
    Case {
        number: "5.6",
        name: "zeros around the data",
        expect: "the same image",
        tolerance: "1.9e-5; 2-D table 2.7e-4 more",
        run: padded,
    },
];
