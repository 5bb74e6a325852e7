//! Grids in pages: images are those of the whole grid, whatever the pool holds at a time.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use crate::common::*;
use volraster::GpuScene;
use volraster::gpu::GpuOptions;
use volraster::measure::ImageErrors;
use volraster::scene::{Field, Grid, Scene, TransferFunction};
use volraster::technique::Renderer;

/// A grid of 3 x 2 x 3 pages, the last of which are cut.
fn grid(kind: &str) -> Grid {
    let grid = Field::Blobs.sample([160, 80, 131], kind).unwrap();
    let [low, high] = grid.range();
    assert!(high > low);
    grid
}

fn fog() -> TransferFunction {
    TransferFunction::from_rows(&[
        [0.0, 0.1, 0.2, 0.9, 0.0],
        [0.3, 0.1, 0.2, 0.9, 0.0],
        [0.6, 0.9, 0.5, 0.1, 3.0],
        [1.0, 1.0, 1.0, 0.3, 40.0],
    ])
    .unwrap()
}

/// Bytes of so many pages of samples with `sample` bytes.
fn pool(pages: u64, sample: u64) -> GpuOptions {
    GpuOptions { page_pool: Some(pages * (67 * 67 * 67 * sample + 4)), ..GpuOptions::default() }
}

/// Every technique with a march draws the image of the whole grid, from a pool for all pages and from pools that hold a few of eighteen.
#[test]
fn images_are_those_of_the_whole_grid() {
    let whole = gpu();
    let views = [view(perspective(), 1.0, 70, 60), view(orthographic(), 1.0, 64, 61), view(perspective(), 0.2, 50, 40)];
    for (kind, bytes) in taken(1, [("f32", 4), ("u8", 1)]) {
        let scene = Scene::new(grid(kind), fog());
        let all = GpuScene::new(&whole, scene.clone());
        for pages in [1, 3, 18] {
            let paged = gpu_with(pool(pages, bytes));
            let few = GpuScene::new(&paged, scene.clone());
            for spec in [
                "slices-3d:step=0.5",
                "slices-3d:step=0.7,empty-space=march",
                "slabs:step=1",
                "slabs:integrator=exact,filter=exact",
                "raycast:step=0.5",
                "raycast:integrator=integral",
                "slices-2d:between=true",
                "slices-2d",
            ] {
                for view in &views {
                    let want = draw_on(&all, view, spec);
                    let mut frames = Renderer::new(&few, technique(spec)).frames(view).unwrap();
                    let time = frames.draw(view).unwrap();
                    let image = frames.read_back().unwrap();
                    let errors = ImageErrors::between(&image, &want).unwrap();
                    println!("{kind} {pages:2} {spec}: rmse {:.2e} max {:.2e} {:?}", errors.all.rmse, errors.all.max_abs, time.counters);
                    assert!(errors.all.rmse < 2e-6, "{kind}, {pages} pages, {spec}: {errors:?}");
                }
            }
        }
    }
}
