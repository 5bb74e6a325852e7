//! Images of meshes: which tetrahedra may cover which pixels, and the pixels, a few rows at a time.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::num;
use crate::scene::View;

use super::tets::{MeshRay, Piece, TetRays};
use super::{Progress, samples_of, view_range};

/// Rows that are drawn together, and columns: their pieces are in memory at a time.
const ROWS: usize = 8;
const COLUMNS: u32 = 64;

/// Pixels by which boxes are larger than they need be.
const MARGIN: f64 = 1.0 / 64.0;

/// A tetrahedron, and the first and the last column and row of pixels that it may cover.
#[derive(Clone, Copy, Debug)]
struct Cover {
    cell: u32,
    columns: [u32; 2],
    rows: [u32; 2],
}

/// Draws a mesh: `samples` x `samples` rays in each pixel.
///
/// Memory is that of the covers, 20 bytes for each tetrahedron, and a few rows' share of them on each thread.
pub(super) fn render(
    rays: &TetRays,
    view: &View,
    samples: u32,
    pixels: &mut [[f64; 4]],
    progress: Option<&Progress>,
) {
    let [width, height] = view.extent();
    let covers: Vec<Cover> = rays
        .all()
        .into_par_iter()
        .filter(|&cell| rays.shows(cell))
        .filter_map(|c| cover(rays, view, c))
        .collect();
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
            let mut stretch = Stretch::new(rays, view, left, right);
            for (row, y) in pixels.chunks_mut(num::index(width)).zip(first..) {
                let row = &mut row[num::index(left)..=num::index(right)];
                stretch.draw(&block, y, samples, row);
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
/// Memory is an index for each tetrahedron and pixel that it may cover.
pub(super) fn some(rays: &TetRays, view: &View, pixels: &[[u32; 2]]) -> Vec<[f64; 4]> {
    // In each row its pixels from left to right.
    let mut rows: Vec<Vec<(u32, usize)>> = vec![Vec::new(); num::index(view.extent()[1])];
    for (place, &[x, y]) in pixels.iter().enumerate() {
        rows[num::index(y)].push((x, place));
    }
    rows.par_iter_mut().for_each(|row| row.sort_unstable());
    let covers: Vec<Cover> = rays
        .all()
        .into_par_iter()
        .filter(|&cell| rays.shows(cell))
        .filter_map(|c| cover(rays, view, c))
        .collect();
    let mut cells: Vec<Vec<u32>> = vec![Vec::new(); pixels.len()];
    for cover in &covers {
        for row in &rows[num::index(cover.rows[0])..=num::index(cover.rows[1])] {
            let begin = row.partition_point(|&(x, _)| x < cover.columns[0]);
            for &(_, place) in row[begin..].iter().take_while(|&&(x, _)| x <= cover.columns[1]) {
                cells[place].push(cover.cell);
            }
        }
    }
    let range = view_range(view);
    let draw = |(&[x, y], cells): (&[u32; 2], &Vec<u32>)| {
        let (origin, direction) = view.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5);
        let ray = rays.ray(origin, direction, range);
        let mut pieces: Vec<Piece> = cells.iter().filter_map(|&cell| rays.piece(cell, &ray)).collect();
        rays.integrate(&mut pieces)
    };
    pixels.par_iter().zip(&cells).map(draw).collect()
}

/// A few pixels of one row.
struct Stretch<'a> {
    rays: &'a TetRays<'a>,
    view: &'a View,
    left: u32,
    right: u32,
    /// For each pixel its ray, and the pieces of it found so far.
    pieces: Vec<(MeshRay, Vec<Piece>)>,
}

impl<'a> Stretch<'a> {
    fn new(rays: &'a TetRays, view: &'a View, left: u32, right: u32) -> Self {
        let ray = rays.ray(DVec3::ZERO, DVec3::Z, [0.0; 2]);
        let pieces = vec![(ray, Vec::new()); num::index(right - left) + 1];
        Self { rays, view, left, right, pieces }
    }

    fn draw(&mut self, block: &[Cover], y: u32, samples: u32, row: &mut [[f64; 4]]) {
        let range = view_range(self.view);
        for offset in samples_of(samples) {
            for ((ray, pieces), x) in self.pieces.iter_mut().zip(self.left..) {
                let (origin, direction) = self.view.ray(DVec2::new(f64::from(x), f64::from(y)) + offset);
                *ray = self.rays.ray(origin, direction, range);
                pieces.clear();
            }
            for cover in block.iter().filter(|c| c.rows[0] <= y && c.rows[1] >= y) {
                let (first, last) = (cover.columns[0].max(self.left), cover.columns[1].min(self.right));
                let places = num::index(first - self.left)..=num::index(last - self.left);
                for (ray, pieces) in &mut self.pieces[places] {
                    pieces.extend(self.rays.piece(cover.cell, ray));
                }
            }
            for (pixel, (_, pieces)) in row.iter_mut().zip(&mut self.pieces) {
                for (sum, value) in pixel.iter_mut().zip(self.rays.integrate(pieces)) {
                    *sum += value;
                }
            }
        }
        let n = f64::from(samples);
        for pixel in row {
            *pixel = pixel.map(|sum| sum / (n * n));
        }
    }
}

/// Which pixels a tetrahedron may cover, if any.
fn cover(rays: &TetRays, view: &View, cell: u32) -> Option<Cover> {
    let corners = rays.mesh.cells()[num::index(cell)].map(|i| rays.mesh.points()[num::index(i)]);
    let [width, height] = view.extent();
    let eye = view.camera().eye;
    // To the right, down and ahead of the eye.
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
    // Of places well in front of the eye the projection of a hull is the hull of the projections.
    let ahead = |(at, _): &([f64; 3], f64)| at[2] > 1e-3 * (at[0].abs() + at[1].abs());
    let (columns, rows) = if !view.is_perspective() || seen.iter().all(ahead) {
        (hull(0, width)?, hull(1, height)?)
    } else {
        (wedges(view, &seen, 0, width)?, wedges(view, &seen, 1, height)?)
    };
    Some(Cover { cell, columns, rows })
}

/// The first and the last row or column whose wedge, between two planes through the eye, may meet a tetrahedron
/// that lies about the eye's plane: those for which not all corners lie on the outer side of one plane.
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
