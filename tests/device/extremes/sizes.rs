//! Grids and images of one voxel and one pixel, prime sides, very long sides, very large and very small pixels.

use glam::{DVec2, DVec3};
use volraster::scene::{Camera, Projection, Scene, View};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("sizes", CASES);

const EXACT: &[(&str, &str)] = &[("step", "0.5"), ("filter", "exact")];

/// The affine cube sampled in other numbers along the axes. Steps are in units of the smallest spacing, so pieces are
/// at most twice the largest side, and twice that in oblique directions.
fn dims(run: &mut Run<'_>, dims: [u32; 3]) {
    let grid = grid(dims, DVec3::NEG_ONE, DVec3::ONE, affine);
    let mesh = blocks([&planes(dims[0] - 1), &planes(dims[1] - 1), &planes(dims[2] - 1)], Cut::Five, affine);
    let view = through(6, 6);
    let mut scenes = vec![Scene::new(grid, ramp(ENDS[0], ENDS[1]))];
    if dims.iter().product::<u32>() < 3000 {
        scenes.push(Scene::new(mesh, ramp(ENDS[0], ENDS[1])));
    }
    let pieces = 4.0 * f64::from(dims.into_iter().max().unwrap());
    for scene in scenes {
        run.each(&scene, &view, EXACT, |_, frame| {
            // Scalars between samples: 2^-24 of the index, along a row of n voxels n/2 units of 2^-24 of a voxel.
            assert_depths(&frame.image, &view, |_| t32(pieces) + 1e-6, |pixel| affine_depth(&view, pixel))
        });
    }
}

/// Bricks of 8 cells whose number does not divide the grid's: passed over or not, the same to the bit.
fn bricks(run: &mut Run<'_>) {
    let rows = [[0.55, 0.9, 0.4, 0.1, 0.0], [0.7, 1.0, 0.8, 0.3, 20.0], [0.8, 0.2, 0.6, 0.9, 0.0]];
    let view = view(perspective(), 1.0, 14, 14);
    for sides in [[7, 8, 9], [17, 2, 31], [13, 19, 11]] {
        let scene = Scene::new(grid(sides, DVec3::NEG_ONE, DVec3::ONE, affine), transfer(&rows));
        let options: [&[(&str, &str)]; 2] = [&[("empty-space", "skip")], &[("empty-space", "march")]];
        run.pairs([&scene; 2], [&view; 2], options, |_, a, b| equal("bricks", a, b));
    }
}

/// The affine cube in an image of any shape. Long images see it through a long window: pixels at both ends too.
fn image(run: &mut Run<'_>, [width, height]: [u32; 2]) {
    // The cube is as wide as the longer side, whichever it is.
    let half_height = 1.1 * (f64::from(height) / f64::from(width)).min(1.0);
    let eye = DVec3::new(0.013, 0.0271, 5.0);
    let camera = Camera {
        eye,
        target: eye - DVec3::Z,
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height },
    };
    let view = View::new(camera, width, height).unwrap();
    for scene in scenes(2, &ramp(ENDS[0], ENDS[1]), affine) {
        run.each(&scene, &view, EXACT, |_, frame| {
            assert_depths(&frame.image, &view, |_| t32(20.0) + 1e-6, |pixel| affine_depth(&view, pixel))
        });
    }
}

/// Values 0 and 1 in turn: in the middle of cells, seen from the side, 1/2 everywhere.
fn checkerboard(run: &mut Run<'_>) {
    let n = 8;
    let odd = |p: DVec3| ((p + 1.0) * 4.0).round().element_sum().rem_euclid(2.0);
    let scene = Scene::new(grid([n + 1; 3], DVec3::NEG_ONE, DVec3::ONE, odd), ramp(0.0, 2.0));
    // A pixel for each of 6 x 6 cells.
    let projection = Projection::Orthographic { half_height: 0.75 };
    let camera = Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 6, 6).unwrap();
    run.each(&scene, &view, EXACT, |_, frame| {
        let pixels = frame.image.pixels();
        pixels.iter().try_for_each(|p| near("opacity", p[3].into(), opacity(2.0), 1e-5))
    });
}

/// A pixel that covers many voxels: from mip levels their mean. Of a warp's levels the inner pixels alone: two texels of 8
/// voxels on either side of a pixel's centre reach over the outline from the others.
fn minified(run: &mut Run<'_>) {
    let odd = |p: DVec3| ((p + 1.0) * 15.5).round().element_sum().rem_euclid(2.0);
    let scene = Scene::new(grid([32; 3], DVec3::NEG_ONE, DVec3::ONE, odd), ramp(0.0, 1.0));
    let projection = Projection::Orthographic { half_height: 1.0 };
    let camera = Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 4, 4).unwrap();
    let options: &[(&str, &str)] =
        &[("prefilter", "mip"), ("warp", "mip"), ("intermediate", "voxel"), ("step", "0.5")];
    run.only(
        |spec| spec.has("prefilter") || spec.warps(),
        &scene,
        &view,
        options,
        |spec, frame| {
            let inner = |pixel: &DVec2| (*pixel - 2.0).abs().max_element() < 1.0;
            let told = pixels(&view).filter(|(_, pixel)| !spec.warps() || inner(pixel));
            told.map(|(i, _)| frame.image.pixels()[i])
                .try_for_each(|p| near("opacity", p[3].into(), opacity(1.0), 1e-2))
        },
    );
}

/// Ten thousand pixels a voxel: no stairs. Neighbouring pixels differ by less than rounding, and all are right.
fn magnified(run: &mut Run<'_>, filter: &'static str, bound: f64) {
    let projection = Projection::Orthographic { half_height: 16.0 * 0.5e-4 };
    let eye = DVec3::new(0.1037, 0.2071, 5.0);
    let camera = Camera { eye, target: eye - DVec3::Z, up: DVec3::Y, projection };
    let view = View::new(camera, 32, 32).unwrap();
    for scene in scenes(2, &ramp(ENDS[0], ENDS[1]), affine) {
        run.each(&scene, &view, &[("step", "0.5"), ("filter", filter)], |_, frame| {
            assert_depths(&frame.image, &view, |_| bound, |pixel| affine_depth(&view, pixel))
        });
    }
}

const CASES: &[Case] = &[
    Case {
        number: "20a",
        name: "grid of 2 x 2 x 2, one cell",
        expect: "closed form",
        tolerance: "t32 + 1e-6",
        run: |run| dims(run, [2, 2, 2]),
    },
    Case {
        number: "20b",
        name: "grids of one voxel's thickness: 2 x 9 x 9, 9 x 2 x 9, 9 x 9 x 2",
        expect: "closed form",
        tolerance: "t32 + 1e-6",
        run: |run| {
            for sides in [[2, 9, 9], [9, 2, 9], [9, 9, 2]] {
                dims(run, sides);
            }
        },
    },
    Case {
        number: "20c",
        name: "grids of one voxel but for one axis: 2 x 2 x 301 and turned",
        expect: "closed form",
        tolerance: "t32 + 1e-6",
        run: |run| {
            for sides in [[2, 2, 301], [2, 301, 2], [301, 2, 2]] {
                dims(run, sides);
            }
        },
    },
    Case {
        number: "21a",
        name: "sides 7, 8, 9 and 17",
        expect: "closed form",
        tolerance: "t32 + 1e-6",
        run: |run| {
            for sides in [[7, 8, 9], [9, 17, 8], [17, 17, 17]] {
                dims(run, sides);
            }
        },
    },
    Case {
        number: "21b",
        name: "prime sides",
        expect: "closed form",
        tolerance: "t32 + 1e-6",
        run: |run| {
            for sides in [[11, 13, 7], [5, 31, 3], [23, 19, 29]] {
                dims(run, sides);
            }
        },
    },
    Case {
        number: "21c",
        name: "bricks that the sides do not divide into, with empty ones",
        expect: "as without bricks",
        tolerance: "exact",
        run: bricks,
    },
    Case {
        number: "44a",
        name: "image of 1 x 1",
        expect: "closed form",
        tolerance: "t32(20) + 1e-6",
        run: |run| image(run, [1, 1]),
    },
    Case {
        number: "44b",
        name: "images of 1 x 64 and 64 x 1",
        expect: "closed form",
        tolerance: "t32(20) + 1e-6",
        run: |run| {
            image(run, [1, 64]);
            image(run, [64, 1]);
        },
    },
    Case {
        number: "44c",
        name: "images of 17 x 13, 9 x 31 and 33 x 7",
        expect: "closed form, also in the last row and column",
        tolerance: "t32(20) + 1e-6",
        run: |run| {
            for size in [[17, 13], [9, 31], [33, 7]] {
                image(run, size);
            }
        },
    },
    Case {
        number: "44d",
        name: "image of 16384 x 1",
        expect: "closed form",
        tolerance: "t32(20) + 1e-6",
        run: |run| image(run, [16384, 1]),
    },
    Case {
        number: "44e",
        name: "image of 1 x 16384",
        expect: "closed form",
        tolerance: "t32(20) + 1e-6",
        run: |run| image(run, [1, 16384]),
    },
    Case {
        number: "60",
        name: "0 and 1 alternating, in the middle of cells",
        expect: "1/2",
        tolerance: "1e-5",
        run: checkerboard,
    },
    Case {
        number: "61",
        name: "0 and 1 alternating, 8 x 8 voxels per pixel, from mip levels",
        expect: "the mean, 1/2",
        tolerance: "1e-2",
        run: minified,
    },
    Case {
        number: "62a",
        name: "10,000 pixels a voxel, weights of float32",
        expect: "closed form, no stairs",
        tolerance: "t32(8) + 1e-6",
        run: |run| magnified(run, "exact", t32(8.0) + 1e-6),
    },
    Case {
        number: "62b",
        name: "10,000 pixels a voxel, the sampler's weights",
        expect: "closed form, stairs of a 512th of the contrast",
        tolerance: "2e-3",
        // Weights off by a 512th on each axis, of differences of 0.54, 0.26 and 0.18; extinction rises by 2 over 2 units.
        run: |run| magnified(run, "hardware", 2e-3 * 4.0 * 0.98 * 0.5),
    },
];
