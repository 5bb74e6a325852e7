//! Trained splats, by each of the rules that scenes are trained or shown under.
//!
//! With M = R(q) diag(s) a splat is the image of the unit Gaussian under M. Rules of the image (`khr`, `inria`, `antialiased`) project M
//! by the affine approximation A of the view at the centre, and evaluate the ellipse A Aᵀ at a pixel. Rules of rays (`ray`, `overlap`,
//! `integral`) measure the ray itself: in units of M it is `p + t w`, is nearest to the centre at `t = -p·w/w²`, at the distance
//! `|p × w|/|w|`, and the Gaussian along it has the standard deviation `1/|w|`.
//!
//! Sources: Kerbl et al. 2023 with the constants of its program, which are float32; Yu et al. 2024; the glTF extension
//! `KHR_gaussian_splatting`; Celarek et al. 2025. Where the extension leaves the near plane open, it is that of the first paper.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::cover::{Progress, samples_of};
use super::kernels::{Hit, Overlapping};
use super::view_ray::{ViewRay, ViewRays};
use crate::error::Result;
use crate::num;
use crate::scene::{Gaussians, Scene, SplatRule, View, harmonics};

/// Squared distance at which splats end, in standard deviations, except by the rules of `inria`.
const CUT: f64 = 9.0;

/// Distance along a ray at which the integral of a Gaussian is complete, in standard deviations.
const COMPLETE: f64 = 8.5;

/// Shortest standard deviation of a splat as a share of its longest, so that flat ones have an inverse.
const FLAT: f64 = 1e-9;

/// Splats nearer than this are not drawn by rules of the image.
const NEAR: f32 = 0.2;

/// Variance of the pixel's filter, in pixels².
const LOWPASS: f32 = 0.3;

/// Greatest and least opacity of a splat at a pixel, and transmittance at which a pixel ends, by the rules of `inria`.
const MOST: f32 = 0.99;
const LEAST: f32 = 1.0 / 255.0;
const END: f32 = 1e-4;

/// Limit of slopes in the affine approximation, in tangents of half the angle of view.
const SLOPES: f32 = 1.3;

/// Least squared factor of opacities by the rule `antialiased`.
const LEAST_FACTOR: f32 = 2.5e-5;

/// Side of the tiles of `inria`, in pixels.
const TILE: f64 = 16.0;

/// Greatest optical depth of a splat by the rule `overlap`: that of an opacity which float32 does not tell from 1.
const MOST_DEPTH: f64 = 24.0 * std::f64::consts::LN_2;

/// Splats and a rule, prepared for views.
pub(super) struct GaussianRays<'a> {
    splats: &'a Gaussians,
    rule: SplatRule,
    overlapping: Overlapping,
}

/// A splat as a view sees it.
struct Seen {
    /// The least and greatest place of the image that it covers, in pixels from the top left corner.
    low: DVec2,
    high: DVec2,
    opacity: f64,
    colour: [f64; 3],
    shape: Shape,
}

enum Shape {
    /// An ellipse: its middle, and its inverse covariance xx, xy, yy.
    Ellipse(DVec2, [f64; 3]),
    /// An ellipsoid: its centre, and the inverse of M.
    Ellipsoid(DVec3, DMat3),
}

/// A splat on a ray: where it is nearest to the ray, the squared distance there, and the inverse standard deviation along the ray.
struct Met {
    t: f64,
    square: f64,
    speed: f64,
}

fn meet(centre: DVec3, inverse: &DMat3, origin: DVec3, direction: DVec3) -> Met {
    let (p, w) = (*inverse * (origin - centre), *inverse * direction);
    let square = w.length_squared();
    Met { t: -p.dot(w) / square, square: p.cross(w).length_squared() / square, speed: square.sqrt() }
}

impl<'a> GaussianRays<'a> {
    /// Prepares a scene that holds splats.
    pub(super) fn of(scene: &'a Scene) -> Result<Option<Self>> {
        let (Some(splats), Some(rule)) = (scene.gaussians(), scene.splat_rule()) else { return Ok(None) };
        if !scene.surfaces.is_empty() {
            rule.check_depth("surfaces")?;
        }
        Ok(Some(Self { splats, rule, overlapping: Overlapping::new() }))
    }

    /// Draws an image with `samples` x `samples` rays in each pixel.
    pub(super) fn render(
        &self,
        view_rays: &ViewRays,
        view: &View,
        samples: u32,
        pixels: &mut [[f64; 4]],
        progress: Option<&Progress>,
    ) -> Result<()> {
        let seen = self.seen(view)?;
        let [width, height] = view.extent();
        let done = AtomicU32::new(0);
        pixels.par_chunks_mut(num::index(width)).zip(0..height).for_each(|(row, y)| {
            let on_row = on_row(&seen, y);
            for (pixel, x) in row.iter_mut().zip(0..width) {
                let corner = DVec2::new(f64::from(x), f64::from(y));
                for offset in samples_of(samples) {
                    let value = self.at(&on_row, view_rays, corner + offset);
                    *pixel = std::array::from_fn(|i| pixel[i] + value[i]);
                }
                *pixel = pixel.map(|sum| sum / f64::from(samples).powi(2));
            }
            if let Some(progress) = progress {
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, height);
            }
        });
        Ok(())
    }

    /// Draws some pixels, each by the ray through its centre.
    pub(super) fn some(
        &self,
        view_rays: &ViewRays,
        view: &View,
        pixels: &[[u32; 2]],
    ) -> Result<Vec<[f64; 4]>> {
        let seen = self.seen(view)?;
        let draw = |&[x, y]: &[u32; 2]| {
            self.at(&on_row(&seen, y), view_rays, DVec2::new(f64::from(x), f64::from(y)) + 0.5)
        };
        Ok(pixels.par_iter().map(draw).collect())
    }

    /// Draws one ray, by a rule of rays.
    pub(super) fn trace(&self, ray: &ViewRay) -> Result<[f64; 4]> {
        self.rule.check_depth("single rays")?;
        // A ray without a beginning is one of a parallel view.
        let parallel = ray.range[0] == f64::NEG_INFINITY;
        let seen_along = |centre: DVec3| {
            if parallel { ray.direction } else { (centre - ray.origin).normalize_or_zero() }
        };
        let all: Vec<Seen> = (0..self.splats.len()).map(|i| self.ellipsoid(i, seen_along)).collect();
        Ok(self.along(all.iter(), ray))
    }

    /// Returns the colour of a splat in a direction of view.
    fn colour(&self, i: usize, direction: DVec3) -> [f64; 3] {
        let basis = harmonics::basis(self.splats.degree(), direction);
        let count = harmonics::count(self.splats.degree());
        let own = &self.splats.harmonics()[3 * count * i..][..3 * count];
        let mut colour = [0.5; 3];
        for (coefficients, value) in own.chunks_exact(3).zip(basis) {
            for (sum, coefficient) in colour.iter_mut().zip(coefficients) {
                *sum += f64::from(*coefficient) * value;
            }
        }
        colour.map(|c| c.max(0.0))
    }

    /// Returns the splats that a view may see. By rules of the image they are in the order of blending.
    fn seen(&self, view: &View) -> Result<Vec<Seen>> {
        if self.rule.has_depth() {
            let all = (0..self.splats.len()).into_par_iter();
            return Ok(all.filter_map(|i| self.seen_ellipsoid(i, view)).collect());
        }
        if !view.clip().is_none() {
            self.rule.check_depth("clip regions")?;
        }
        let all = (0..self.splats.len()).into_par_iter();
        let mut seen: Vec<(f64, Seen)> = all.filter_map(|i| self.seen_ellipse(i, view)).collect();
        // Stable: of equals the first comes first.
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(seen.into_iter().map(|(_, seen)| seen).collect())
    }

    /// Returns a splat for rules of the image, with its key in the order of blending.
    fn seen_ellipse(&self, i: usize, view: &View) -> Option<(f64, Seen)> {
        let relative = self.splats.centre(i) - view.camera().eye;
        let [right, up, forward] = view.rows();
        let axes = [right, -up, forward];
        let [x, y, z] = axes.map(|axis| relative.dot(axis));
        let focal = 1.0 / view.pixel_size();
        let half = view.extent().map(|side| 0.5 * f64::from(side));
        let perspective = view.is_perspective();
        if perspective && z <= f64::from(NEAR) {
            return None;
        }
        let root = self.splats.rotation(i) * DMat3::from_diagonal(self.splats.scales(i));
        let [right, down, ahead] = axes.map(|axis| root.transpose() * axis);
        let slopes = if perspective { [x / z, y / z] } else { [0.0; 2] };
        let scale = if perspective { focal / z } else { focal };
        let place = if perspective { slopes.map(|slope| slope * focal) } else { [x * focal, y * focal] };
        let place = DVec2::new(place[0] + half[0], place[1] + half[1]);
        let khr = self.rule == SplatRule::Khr;
        let (sides, from) = view.whole();
        let slope = |axis: usize| {
            let (most, aside) =
                (f64::from(SLOPES) * 0.5 * f64::from(sides[axis]) / focal, from[axis] / focal);
            if khr || !perspective { slopes[axis] } else { (slopes[axis] + aside).clamp(-most, most) - aside }
        };
        let (a, b) = (scale * (right - slope(0) * ahead), scale * (down - slope(1) * ahead));
        let lowpass = if khr { 0.0 } else { f64::from(LOWPASS) };
        let (xx, xy, yy) = (a.length_squared() + lowpass, a.dot(b), b.length_squared() + lowpass);
        // As a sum of squares, which does not cancel.
        let bare = a.cross(b).length_squared();
        let det = bare + lowpass * (a.length_squared() + b.length_squared() + lowpass);
        if !(det > 0.0 && det.is_finite()) {
            return None;
        }
        let mut opacity = f64::from(self.splats.opacities()[i]);
        if self.rule == SplatRule::Antialiased {
            opacity *= (bare / det).max(f64::from(LEAST_FACTOR)).sqrt();
        }
        let (low, high) = if khr {
            let reach = CUT.sqrt() * DVec2::new(xx.sqrt(), yy.sqrt());
            (place - reach, place + reach)
        } else {
            let mid = 0.5 * (xx + yy);
            let longest = mid + (mid * mid - det).max(0.1).sqrt();
            let reach = (3.0 * longest.sqrt()).ceil();
            // The program's own places are half a pixel less.
            let tile = |place: f64| (place / TILE).trunc() * TILE;
            let corner = from + 0.5 * DVec2::from_array(sides.map(f64::from)) - DVec2::from_array(half);
            let ends = place + corner - 0.5;
            (
                DVec2::new(tile(ends.x - reach), tile(ends.y - reach)) - corner,
                DVec2::new(tile(ends.x + reach + TILE - 1.0), tile(ends.y + reach + TILE - 1.0)) - corner,
            )
        };
        let direction = if perspective { relative.normalize() } else { view.forward() };
        let key = if khr && perspective { relative.length() } else { z };
        let shape = Shape::Ellipse(place, [yy / det, -xy / det, xx / det]);
        Some((key, Seen { low, high, opacity, colour: self.colour(i, direction), shape }))
    }

    /// Returns a splat for rules of rays, which covers the whole image.
    fn ellipsoid(&self, i: usize, direction: impl Fn(DVec3) -> DVec3) -> Seen {
        let scales = self.splats.scales(i);
        let scales = scales.max(DVec3::splat((FLAT * scales.max_element()).max(1e-150)));
        let centre = self.splats.centre(i);
        let inverse = DMat3::from_diagonal(scales.recip()) * self.splats.rotation(i).transpose();
        Seen {
            low: DVec2::NEG_INFINITY,
            high: DVec2::INFINITY,
            opacity: f64::from(self.splats.opacities()[i]),
            colour: self.colour(i, direction(centre)),
            shape: Shape::Ellipsoid(centre, inverse),
        }
    }

    /// Returns a splat for rules of rays, and bounds what it covers.
    fn seen_ellipsoid(&self, i: usize, view: &View) -> Option<Seen> {
        let eye = view.camera().eye;
        let [right, up, forward] = view.rows();
        let axes = [right, -up, forward];
        let [x, y, z] = axes.map(|axis| (self.splats.centre(i) - eye).dot(axis));
        let root = self.splats.rotation(i) * DMat3::from_diagonal(self.splats.scales(i) * CUT.sqrt());
        let [right, down, ahead] = axes.map(|axis| root.transpose() * axis);
        let half = view.extent().map(|side| 0.5 * f64::from(side));
        let perspective = view.is_perspective();
        let seen =
            self.ellipsoid(
                i,
                |centre| {
                    if perspective { (centre - eye).normalize_or_zero() } else { view.forward() }
                },
            );
        let (depth, reach) = (z * z - ahead.length_squared(), ahead.length());
        if perspective && z + reach < 0.0 {
            return None;
        }
        if perspective && !(z > 0.0 && depth > 1e-9 * z * z) {
            return Some(seen);
        }
        // The planes x = s z through the eye that touch the ellipsoid: depth s² - 2 middle s + end = 0.
        let ends = |place: f64, row: DVec3, half: f64| {
            let [low, high] = if perspective {
                let (middle, end) = (place * z - row.dot(ahead), place * place - row.length_squared());
                let root = (middle * middle - depth * end).max(0.0).sqrt();
                [(middle - root) / depth, (middle + root) / depth]
            } else {
                [place - row.length(), place + row.length()]
            };
            // A pixel more than rounding needs.
            [low / view.pixel_size() + half - 1.0, high / view.pixel_size() + half + 1.0]
        };
        let ([left, right], [top, bottom]) = (ends(x, right, half[0]), ends(y, down, half[1]));
        Some(Seen { low: DVec2::new(left, top), high: DVec2::new(right, bottom), ..seen })
    }

    /// Draws a place of the image.
    fn at(&self, on_row: &[&Seen], view_rays: &ViewRays, place: DVec2) -> [f64; 4] {
        let covers = |seen: &&&Seen| place.cmpge(seen.low).all() && place.cmplt(seen.high).all();
        let here = on_row.iter().filter(covers).copied();
        if self.rule.has_depth() { self.along(here, &view_rays.at(place)) } else { self.blended(here, place) }
    }

    /// Blends ellipses at a place of the image.
    fn blended<'s>(&self, seen: impl Iterator<Item = &'s Seen>, place: DVec2) -> [f64; 4] {
        let mut sum = Blend::default();
        let khr = self.rule == SplatRule::Khr;
        for Seen { opacity, colour, shape, .. } in seen {
            let Shape::Ellipse(middle, [xx, xy, yy]) = shape else { continue };
            let d = place - *middle;
            let square = xx * d.x * d.x + 2.0 * xy * d.x * d.y + yy * d.y * d.y;
            let mut alpha = opacity * (-0.5 * square).exp();
            if khr && square > CUT || square < 0.0 {
                continue;
            }
            if !khr {
                alpha = alpha.min(f64::from(MOST));
                if alpha < f64::from(LEAST) {
                    continue;
                }
                if sum.transmittance * (1.0 - alpha) < f64::from(END) {
                    break;
                }
            }
            sum.add(*colour, alpha);
        }
        sum.pixel()
    }

    /// Draws ellipsoids along a ray, with the surfaces on it.
    fn along<'s>(&self, seen: impl Iterator<Item = &'s Seen>, ray: &ViewRay) -> [f64; 4] {
        let met = seen.filter_map(|seen| {
            let Shape::Ellipsoid(centre, inverse) = &seen.shape else { return None };
            let met = meet(*centre, inverse, ray.origin, ray.direction);
            (met.square <= CUT).then_some((met, seen))
        });
        if self.rule != SplatRule::Ray {
            let hits: Vec<Hit> = met.filter_map(|(met, seen)| self.hit(&met, seen)).collect();
            return ray.composite(|range| self.overlapping.trace(&hits, range));
        }
        let mut met: Vec<(Met, &Seen)> = met.collect();
        met.sort_by(|a, b| a.0.t.total_cmp(&b.0.t));
        ray.composite(|[begin, end]| {
            let mut sum = Blend::default();
            for (Met { square, .. }, seen) in met.iter().filter(|(met, _)| begin < met.t && met.t < end) {
                sum.add(seen.colour, seen.opacity * (-0.5 * square).exp());
            }
            sum.pixel()
        })
    }

    /// Returns a splat as extinction on a ray.
    fn hit(&self, met: &Met, seen: &Seen) -> Option<Hit> {
        let profile = (-0.5 * met.square).exp();
        let depth = if self.rule == SplatRule::Overlap {
            (-(-seen.opacity * profile).ln_1p()).min(MOST_DEPTH)
        } else {
            -(-seen.opacity.min(f64::from(MOST))).ln_1p() * profile
        };
        let peak = depth * met.speed / std::f64::consts::TAU.sqrt();
        let [r, g, b] = seen.colour.map(|c| c * peak);
        Hit::new(met.t, 0.0, met.speed, COMPLETE, [peak, r, g, b]).filter(|_| peak > 0.0)
    }
}

/// Returns the splats that may cover a row of pixels.
fn on_row(seen: &[Seen], y: u32) -> Vec<&Seen> {
    let [top, bottom] = [f64::from(y), f64::from(y) + 1.0];
    seen.iter().filter(|seen| seen.low.y <= bottom && seen.high.y >= top).collect()
}

/// Colour and transmittance, front to back.
struct Blend {
    colour: [f64; 3],
    transmittance: f64,
}

impl Default for Blend {
    fn default() -> Self {
        Self { colour: [0.0; 3], transmittance: 1.0 }
    }
}

impl Blend {
    fn add(&mut self, colour: [f64; 3], alpha: f64) {
        for (sum, c) in self.colour.iter_mut().zip(colour) {
            *sum += self.transmittance * alpha * c;
        }
        self.transmittance *= 1.0 - alpha;
    }

    fn pixel(&self) -> [f64; 4] {
        let [r, g, b] = self.colour;
        [r, g, b, 1.0 - self.transmittance]
    }
}
