//! Scenes with other data: they draw as if they were made anew, whatever they share with the first.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use crate::common::*;
use glam::{DMat3, DVec3};
use volraster::GpuScene;
use volraster::scene::{Data, Field, Grid, Mode, Scene, TetScalars, TransferFunction};

const SMOKE: [[f64; 5]; 3] =
    [[0.0, 0.2, 0.4, 1.0, 0.0], [0.5, 0.6, 0.7, 0.3, 2.0], [1.0, 1.0, 0.5, 0.2, 6.0]];

/// A grid of another size has longer segments, which tables of the first would not cover; a mesh of equal points and cells
/// shares its topology, and another does not.
#[test]
fn other_data_draws_as_a_scene_of_its_own() {
    let gpu = gpu();
    let view = view(perspective(), 4.0, 40, 32);
    let grid = |field: Field, dims: [u32; 3]| field.sample(dims, "f32").unwrap();
    let small = grid(Field::Blobs, [12, 10, 8]);
    let large = |grid: Grid| {
        let spacing = DVec3::splat(1.3) * grid.spacing();
        grid.with_placement(spacing, DVec3::splat(-1.3), DMat3::IDENTITY).unwrap()
    };
    let mesh = |field: Field, cubes: u32| field.tets(cubes).unwrap();
    let other_scalars = {
        let (own, other) = (mesh(Field::Blobs, 4), mesh(Field::Ramp, 4));
        assert!(own.points() == other.points() && own.cells() == other.cells());
        own.with_scalars(TetScalars::Point(other.scalars().values().to_vec())).unwrap()
    };
    let points = |field: Field, count: u32| field.points(count).unwrap().with_estimated_radius();
    let all: [(&str, &[&str], Vec<Data>); 3] = [
        (
            "grid",
            &["slabs:integrator=full,table=64,step=3", "slices-3d", "shear-warp"],
            vec![
                small.clone().into(),
                grid(Field::Ramp, [12, 10, 8]).into(),
                large(small).into(),
                grid(Field::Ramp, [5, 16, 9]).into(),
            ],
        ),
        (
            "mesh",
            &["havs", "projected-tets"],
            vec![mesh(Field::Blobs, 4).into(), other_scalars.into(), mesh(Field::Blobs, 3).into()],
        ),
        ("points", &["splat-ewa"], vec![points(Field::Blobs, 60).into(), points(Field::Ramp, 90).into()]),
    ];
    let smoke = || TransferFunction::from_rows(&SMOKE).unwrap();
    for (kind, specs, steps) in all {
        for spec in specs {
            let first = GpuScene::new(&gpu, Scene::new(steps[0].clone(), smoke()));
            let mut drawn = vec![draw_on(&first, &view, spec)];
            for data in &steps[1..] {
                let next = first.with_data(data.clone()).unwrap();
                let image = draw_on(&next, &view, spec);
                let alone = GpuScene::new(&gpu, Scene::new(data.clone(), smoke()));
                assert!(image == draw_on(&alone, &view, spec), "{kind} {spec} {}", drawn.len());
                assert!(!drawn.contains(&image), "{kind} {spec}: as a step before");
                drawn.push(image);
            }
        }
    }
    // What the scene shows must suit the data.
    let lit =
        Scene::new(grid(Field::Ramp, [3; 3]), smoke()).with_mode(Mode::from_name("lit").unwrap()).unwrap();
    let refused = GpuScene::new(&gpu, lit).with_data(mesh(Field::Ramp, 2)).unwrap_err().to_string();
    assert!(refused.contains("lit: requires a grid"), "{refused}");
}
