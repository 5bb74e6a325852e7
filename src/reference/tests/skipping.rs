//! Blocks that a ray passes over, and the ends of rays: the bits of a ray do not depend on them.

use crate::reference::cells::{BLOCK, Cells};
use crate::reference::grid::GridRays;
use crate::reference::index_space::IndexSpace;
use crate::reference::walk::Walk;
use crate::scene::field::random;
use crate::scene::{Lighting, Mode};

use super::*;

const DIMS: [u32; 3] = [37, 18, 25];

/// Rays through points of a grid: any ones, and those along axes, diagonals, faces, edges and corners of cells.
fn rays() -> Vec<(DVec3, DVec3)> {
    let mut state = 7;
    let mut rays = Vec::new();
    for i in 0..2000 {
        let mut any = |scale: [f64; 3]| DVec3::from_array(scale.map(|scale| scale * random(&mut state)));
        let mut through = any(DIMS.map(|extent| f64::from(extent - 1)));
        let mut direction = any([2.0; 3]) - 1.0;
        if i % 2 == 1 {
            through = (2.0 * through).round() / 2.0;
            direction = (2.5 * direction).round();
        }
        if let Some(direction) = direction.try_normalize() {
            rays.push((through - 50.0 * direction, direction));
        }
    }
    rays
}

#[test]
fn a_walk_passes_over_blocks_as_cell_by_cell() {
    // Eight blocks of nine are empty; a sample is the number of its block.
    let of = |[x, y, z]: [u32; 3]| x / BLOCK + 7 * (y / BLOCK) + 5 * (z / BLOCK);
    let shown = |cell: [u32; 3]| of(cell).is_multiple_of(9);
    // NaN at the sides: blocks share these samples.
    let side = |x: u32| x.is_multiple_of(BLOCK);
    let grid = grid(DIMS, |x, y, z| {
        if side(x) || side(y) || side(z) { f32::NAN } else { num::f32_of(f64::from(of([x, y, z]))) }
    });
    let (cells, space) = (Cells::new(&grid, [0.0, 1.0]), IndexSpace::new(&grid));
    let mut found = 0;
    for (origin, direction) in rays() {
        let Some(ray) = space.ray(origin, direction, [20.0, 70.0], 0.0) else { continue };
        let all = |empty: &dyn Fn([f64; 2]) -> bool| {
            let mut walk = Walk::new(&cells, &ray);
            std::iter::from_fn(|| walk.next(empty))
                .map(|s| (s.cell, s.t.map(f64::to_bits)))
                .collect::<Vec<_>>()
        };
        let want: Vec<_> = all(&|_| false).into_iter().filter(|(cell, _)| shown(*cell)).collect();
        let got = all(&|[low, high]| low > high || low % 9.0 != 0.0);
        assert_eq!(got, want, "{origin} {direction}");
        found += want.len();
    }
    assert!(found > 2000, "{found}");
}

/// NaN, infinities, scalars outside the knots, jumps: rays that skip have the bits of rays that do not.
#[test]
fn skipped_blocks_change_no_bit() {
    let jumps = [
        [0.2, 1.0, 0.0, 0.0, 0.0],
        [0.5, 1.0, 0.0, 0.2, 0.0],
        [0.5, 0.0, 1.0, 0.5, 0.8],
        [0.6, 0.3, 1.0, 0.5, 0.8],
        [0.6, 0.0, 0.0, 0.0, 0.0],
        [0.8, 0.0, 0.0, 1.0, 0.0],
        [0.9, 1.0, 1.0, 0.0, 0.5],
        [0.9, 1.0, 0.3, 0.0, 0.0],
    ];
    let mut state = 3;
    let mut rare = || random(&mut state);
    let mut samples = Vec::new();
    for i in 0..DIMS.iter().product::<u32>() {
        let at = [i % DIMS[0], i / DIMS[0] % DIMS[1], i / DIMS[0] / DIMS[1]].map(f64::from);
        let s = DVec3::from_array(at).distance(DVec3::new(9.0, 9.0, 9.0)) / 20.0 + 0.01 * rare();
        samples.push(match rare() {
            share if share < 0.002 => f32::NAN,
            share if share < 0.003 => f32::INFINITY,
            share if share < 0.004 => f32::NEG_INFINITY,
            _ if at[0] > 30.0 => f32::NAN,
            _ => num::f32_of(s),
        });
    }
    let grid = Grid::new(DIMS, Samples::F32(samples)).unwrap();
    for mode in [Mode::Emission, Mode::Lit(Lighting::default()), Mode::Maximum] {
        let transfer = TransferFunction::from_rows(&jumps).unwrap();
        let rays_of = || GridRays::new(&grid, &transfer, mode);
        let (skips, whole) = (rays_of(), rays_of());
        whole.cells().skip_nothing();
        let mut shown = 0;
        let step = if matches!(mode, Mode::Lit(_)) { 20 } else { 1 };
        for (origin, direction) in rays().into_iter().step_by(step) {
            // Ranges as clip planes leave them.
            for range in [[f64::NEG_INFINITY, f64::INFINITY], [45.0, 52.5]] {
                let [got, want] = [&skips, &whole].map(|rays| rays.trace(origin, direction, range));
                assert_eq!(got.map(f64::to_bits), want.map(f64::to_bits), "{mode:?} {origin} {direction}");
                shown += usize::from(got[3] > 0.0);
            }
        }
        assert!(shown > 40, "{mode:?}: {shown}");
    }
}
