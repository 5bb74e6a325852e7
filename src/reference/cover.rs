//! Images of meshes: finds the pixels that each tetrahedron may cover, then draws a few rows at a time.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec2;
use rayon::prelude::*;

use crate::num;
use crate::scene::View;

use super::tets::{LocalRay, Piece, TetRays};
use super::view_ray::{ViewRay, ViewRays};

/// Rows and columns of a block; the pieces of one block are in memory at a time.
const ROWS: usize = 8;
const COLUMNS: u32 = 64;

/// Safety margin of a tetrahedron's box of pixels, in pixels.
const MARGIN: f64 = 1.0 / 64.0;

/// A callback that receives the number of finished rows and of all rows.
pub(super) type Progress<'a> = dyn Fn(u32, u32) + Sync + 'a;

/// A tetrahedron, with the first and the last column and row of pixels that it may cover.
#[derive(Clone, Copy, Debug)]
struct Cover {
    cell: u32,
    columns: [u32; 2],
    rows: [u32; 2],
}

/// Draws a mesh with `samples` x `samples` rays in each pixel.
///
/// Needs memory for the covers, 20 bytes for each tetrahedron, and on each thread for the covers of a few
/// rows.
pub(super) fn render(
    rays: &TetRays,
    view_rays: &ViewRays,
    view: &View,
    samples: u32,
    pixels: &mut [[f64; 4]],
    progress: Option<&Progress>,
) {
    let [width, height] = view.extent();
    let covers = covers(rays, view);
    let done = AtomicU32::new(0);
    pixels.par_chunks_mut(num::index(width) * ROWS).enumerate().for_each(|(band, pixels)| {
        let first = num::count(band * ROWS);
        let last = (first + num::count(ROWS)).min(height) - 1;
        let band: Vec<Cover> =
            covers.iter().filter(|c| c.rows[0] <= last && c.rows[1] >= first).copied().collect();
        for left in (0..width).step_by(num::index(COLUMNS)) {
            let right = (left + COLUMNS).min(width) - 1;
            let block: Vec<Cover> =
                band.iter().filter(|c| c.columns[0] <= right && c.columns[1] >= left).copied().collect();
            for (row, y) in pixels.chunks_mut(num::index(width)).zip(first..) {
                let row = &mut row[num::index(left)..=num::index(right)];
                draw_run(rays, view_rays, &block, [left, y], samples, row);
            }
        }
        if let Some(progress) = progress {
            for _ in first..=last {
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, height);
            }
        }
    });
}

/// Draws some pixels, each by the ray through its centre.
///
/// Needs memory for one index per tetrahedron and pixel that it may cover.
pub(super) fn some(rays: &TetRays, view_rays: &ViewRays, view: &View, pixels: &[[u32; 2]]) -> Vec<[f64; 4]> {
    // The pixels of each row, from left to right.
    let mut rows: Vec<Vec<(u32, usize)>> = vec![Vec::new(); num::index(view.extent()[1])];
    for (place, &[x, y]) in pixels.iter().enumerate() {
        rows[num::index(y)].push((x, place));
    }
    rows.par_iter_mut().for_each(|row| row.sort_unstable());
    let mut cells: Vec<Vec<u32>> = vec![Vec::new(); pixels.len()];
    for cover in &covers(rays, view) {
        for row in &rows[num::index(cover.rows[0])..=num::index(cover.rows[1])] {
            let begin = row.partition_point(|&(x, _)| x < cover.columns[0]);
            for &(_, place) in row[begin..].iter().take_while(|&&(x, _)| x <= cover.columns[1]) {
                cells[place].push(cover.cell);
            }
        }
    }
    let draw = |(&[x, y], cells): (&[u32; 2], &Vec<u32>)| {
        let mut pixel = Pixel::new(rays, view_rays.at(DVec2::new(f64::from(x), f64::from(y)) + 0.5));
        let cells = cells.iter().filter_map(|&cell| rays.cell(cell));
        pixel.pieces.extend(cells.filter_map(|cell| cell.piece(&pixel.ray)));
        pixel.draw(rays)
    };
    pixels.par_iter().zip(&cells).map(draw).collect()
}

/// A ray, and the pieces found on it so far.
struct Pixel {
    view_ray: ViewRay,
    ray: LocalRay,
    pieces: Vec<Piece>,
}

impl Pixel {
    fn new(rays: &TetRays, view_ray: ViewRay) -> Self {
        Self {
            ray: rays.ray(view_ray.origin, view_ray.direction, view_ray.range),
            view_ray,
            pieces: Vec::new(),
        }
    }

    fn draw(&mut self, rays: &TetRays) -> [f64; 4] {
        let Self { view_ray, ray, pieces } = self;
        view_ray.composite(|range| {
            if range == view_ray.range {
                return rays.integrate(pieces);
            }
            // Surfaces split the pieces.
            let range = range.map(|t| t - ray.nearest);
            let mut part: Vec<Piece> = pieces.iter().filter_map(|piece| piece.within(range)).collect();
            rays.integrate(&mut part)
        })
    }
}

/// Draws a run of pixels in one row, from the column and row `[left, y]` on.
fn draw_run(
    rays: &TetRays,
    view_rays: &ViewRays,
    block: &[Cover],
    [left, y]: [u32; 2],
    samples: u32,
    row: &mut [[f64; 4]],
) {
    let right = left + num::count(row.len()) - 1;
    for offset in samples_of(samples) {
        let at = |x: u32| view_rays.at(DVec2::new(f64::from(x), f64::from(y)) + offset);
        let mut pixels: Vec<Pixel> = (left..=right).map(|x| Pixel::new(rays, at(x))).collect();
        for cover in block.iter().filter(|c| c.rows[0] <= y && c.rows[1] >= y) {
            let Some(cell) = rays.cell(cover.cell) else { continue };
            let [first, last] = [cover.columns[0].max(left), cover.columns[1].min(right)];
            for pixel in &mut pixels[num::index(first - left)..=num::index(last - left)] {
                pixel.pieces.extend(cell.piece(&pixel.ray));
            }
        }
        for (sum, pixel) in row.iter_mut().zip(&mut pixels) {
            for (sum, value) in sum.iter_mut().zip(pixel.draw(rays)) {
                *sum += value;
            }
        }
    }
    let n = f64::from(samples);
    for pixel in row {
        *pixel = pixel.map(|sum| sum / (n * n));
    }
}

/// Returns the pixels that each visible tetrahedron may cover.
fn covers(rays: &TetRays, view: &View) -> Vec<Cover> {
    let shown = rays.all().into_par_iter().filter(|&cell| rays.shows(cell));
    shown.filter_map(|cell| cover(rays, view, cell)).collect()
}

/// Returns the pixels that a tetrahedron may cover, if any.
fn cover(rays: &TetRays, view: &View, cell: u32) -> Option<Cover> {
    let corners = rays.mesh.cells()[num::index(cell)].map(|i| rays.mesh.points()[num::index(i)]);
    let [width, height] = view.extent();
    let eye = view.camera().eye;
    // Coordinates to the right of, below and ahead of the eye, with a bound of their rounding.
    let seen = corners.map(|p| {
        let relative = p - eye;
        let coordinates = [view.right(), -view.up(), view.forward()].map(|axis| relative.dot(axis));
        (coordinates, f64::EPSILON * (16.0 * relative.length() + 4.0 * p.length()))
    });
    let hull = |axis: usize, side: u32| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (at, rounding) in &seen {
            let size = view.pixel_size() * if view.is_perspective() { at[2] } else { 1.0 };
            let (place, margin) = (0.5 * f64::from(side) + at[axis] / size, MARGIN + rounding / size);
            (low, high) = (low.min(place - margin), high.max(place + margin));
        }
        let inside = high >= 0.0 && low <= f64::from(side);
        inside.then(|| [num::u32_of(low).min(side - 1), num::u32_of(high).min(side - 1)])
    };
    // Well in front of the eye, the projection of a convex hull is the hull of the projections.
    let ahead = |(at, _): &([f64; 3], f64)| at[2] > 1e-3 * (at[0].abs() + at[1].abs());
    let (columns, rows) = if !view.is_perspective() || seen.iter().all(ahead) {
        (hull(0, width)?, hull(1, height)?)
    } else {
        (wedges(view, &seen, 0, width)?, wedges(view, &seen, 1, height)?)
    };
    Some(Cover { cell, columns, rows })
}

/// Returns the first and the last row or column that may meet a tetrahedron near the eye's plane.
///
/// A row or column is a wedge between two planes through the eye. It may meet the tetrahedron unless all
/// corners lie behind the eye or on the outer side of one of the planes.
fn wedges(view: &View, seen: &[([f64; 3], f64); 4], axis: usize, side: u32) -> Option<[u32; 2]> {
    let half = 0.5 * f64::from(side);
    let slope = |place: f64| (place - half) * view.pixel_size();
    let meets = |i: &u32| {
        let (first, last) = (slope(f64::from(*i) - MARGIN), slope(f64::from(*i) + 1.0 + MARGIN));
        let room = |rounding: f64, slope: f64| rounding * (1.0 + slope.abs());
        !seen.iter().all(|(at, rounding)| at[2] < -rounding)
            && !seen.iter().all(|(at, rounding)| at[axis] < first * at[2] - room(*rounding, first))
            && !seen.iter().all(|(at, rounding)| at[axis] > last * at[2] + room(*rounding, last))
    };
    Some([(0..side).find(meets)?, (0..side).rev().find(meets)?])
}

/// Returns the centres of a pixel's equal squares, row by row.
pub(super) fn samples_of(samples: u32) -> impl Iterator<Item = DVec2> {
    let centre = move |i: u32| (f64::from(i) + 0.5) / f64::from(samples);
    (0..samples).flat_map(move |j| (0..samples).map(move |i| DVec2::new(centre(i), centre(j))))
}
