//! Images of meshes: finds the pixels that each tetrahedron may cover, then draws a few rows at a time.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec2;
use rayon::prelude::*;

use crate::num;
use crate::scene::View;

use super::tets::{Cell, LocalRay, Piece, TetRays};
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
            let covers = band.iter().filter(|c| c.columns[0] <= right && c.columns[1] >= left);
            let candidate = |&cover: &Cover| {
                let (cell, outline) =
                    (rays.cell(cover.cell)?, Seen::of(rays, view, cover.cell).outline(view));
                Some(Candidate { cover, cell, outline })
            };
            let block: Vec<Candidate> = covers.filter_map(candidate).collect();
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

/// A tetrahedron that may cover pixels of a block.
struct Candidate {
    cover: Cover,
    cell: Cell,
    /// Its outline in the image; `None` near the eye's plane.
    outline: Option<Outline>,
}

/// The places of a tetrahedron's corners in the image, in pixels, and a bound of their errors.
#[derive(Clone, Copy)]
struct Outline {
    places: [DVec2; 4],
    margin: f64,
}

impl Outline {
    /// Returns the first and the last place that the projection of the tetrahedron may have on a horizontal line.
    fn span(&self, y: f64) -> [f64; 2] {
        /// Rounding of larger places is no small part of the margin.
        const LARGE: f64 = 1e9;
        if !self.places.iter().all(|place| place.abs().max_element() < LARGE) {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut add = |x: f64| (low, high) = (low.min(x), high.max(x));
        let band = [y - self.margin, y + self.margin];
        let [a, b, c, d] = self.places.map(|place| place.y);
        if a.max(b).max(c.max(d)) < band[0] || a.min(b).min(c.min(d)) > band[1] {
            return [low, high];
        }
        for (i, a) in self.places.iter().enumerate() {
            if (band[0]..=band[1]).contains(&a.y) {
                add(a.x);
            }
            for b in &self.places[i + 1..] {
                for edge in band {
                    if (a.y < edge) != (b.y < edge) {
                        add(a.x + (b.x - a.x) * ((edge - a.y) / (b.y - a.y)));
                    }
                }
            }
        }
        [low - self.margin, high + self.margin]
    }
}

/// Draws a run of pixels in one row, from the column and row `[left, y]` on.
fn draw_run(
    rays: &TetRays,
    view_rays: &ViewRays,
    block: &[Candidate],
    [left, y]: [u32; 2],
    samples: u32,
    row: &mut [[f64; 4]],
) {
    let right = left + num::count(row.len()) - 1;
    let cells: Vec<&Candidate> =
        block.iter().filter(|c| c.cover.rows[0] <= y && c.cover.rows[1] >= y).collect();
    let mut spans: Vec<[f64; 2]> = Vec::new();
    let mut line = f64::NAN;
    for offset in samples_of(samples) {
        // Lines of samples follow each other.
        if line != offset.y {
            line = offset.y;
            let all = [f64::NEG_INFINITY, f64::INFINITY];
            let span = |c: &&Candidate| c.outline.map_or(all, |outline| outline.span(f64::from(y) + line));
            spans.clear();
            spans.extend(cells.iter().map(span));
        }
        let at = |x: u32| view_rays.at(DVec2::new(f64::from(x), f64::from(y)) + offset);
        let mut pixels: Vec<Pixel> = (left..=right).map(|x| Pixel::new(rays, at(x))).collect();
        for (Candidate { cover, cell, .. }, span) in cells.iter().zip(&spans) {
            let [first, last] = [cover.columns[0].max(left), cover.columns[1].min(right)];
            // Columns whose sample lies in the span.
            let first = first.max(num::u32_of((span[0] - offset.x).ceil().max(0.0)));
            let last = f64::from(last).min((span[1] - offset.x).floor());
            if last < f64::from(first) {
                continue;
            }
            for pixel in &mut pixels[num::index(first - left)..=num::index(num::u32_of(last) - left)] {
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

/// A tetrahedron's corners as the camera sees them: coordinates to the right of, below and ahead of the eye, with a bound of
/// their rounding.
struct Seen([([f64; 3], f64); 4]);

impl Seen {
    fn of(rays: &TetRays, view: &View, cell: u32) -> Self {
        let corners = rays.mesh.cells()[num::index(cell)].map(|i| rays.mesh.points()[num::index(i)]);
        let (eye, [right, up, forward]) = (view.camera().eye, view.rows());
        let longest = right.length().max(up.length());
        Self(corners.map(|p| {
            let relative = p - eye;
            let coordinates = [right, -up, forward].map(|axis| relative.dot(axis));
            (coordinates, longest * f64::EPSILON * (16.0 * relative.length() + 4.0 * p.length()))
        }))
    }

    /// Returns the places of the corners in the image, if all lie well in front of the eye: the projection of the
    /// tetrahedron is then their hull.
    fn outline(&self, view: &View) -> Option<Outline> {
        let ahead = |(at, _): &([f64; 3], f64)| at[2] > 1e-3 * (at[0].abs() + at[1].abs());
        if view.is_perspective() && !self.0.iter().all(ahead) {
            return None;
        }
        let half = view.extent().map(|side| 0.5 * f64::from(side));
        let mut margin = 0.0_f64;
        let places = self.0.map(|(at, rounding)| {
            let size = view.pixel_size() * if view.is_perspective() { at[2] } else { 1.0 };
            margin = margin.max(MARGIN + rounding / size);
            DVec2::new(half[0] + at[0] / size, half[1] + at[1] / size)
        });
        Some(Outline { places, margin })
    }
}

/// Returns the pixels that a tetrahedron may cover, if any.
fn cover(rays: &TetRays, view: &View, cell: u32) -> Option<Cover> {
    let seen = Seen::of(rays, view, cell);
    let [width, height] = view.extent();
    let Some(Outline { places, margin }) = seen.outline(view) else {
        let (columns, rows) = (wedges(view, &seen.0, 0, width)?, wedges(view, &seen.0, 1, height)?);
        return Some(Cover { cell, columns, rows });
    };
    let reach = |axis: usize, side: u32| {
        let places = places.map(|place| place[axis]);
        let low = places.into_iter().fold(f64::INFINITY, f64::min) - margin;
        let high = places.into_iter().fold(f64::NEG_INFINITY, f64::max) + margin;
        let inside = high >= 0.0 && low <= f64::from(side);
        inside.then(|| [num::u32_of(low).min(side - 1), num::u32_of(high).min(side - 1)])
    };
    Some(Cover { cell, columns: reach(0, width)?, rows: reach(1, height)? })
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
