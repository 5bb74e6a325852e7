//! Knots at quantiles of the data's values.

use glam::DVec3;

use super::statistics::quantile;
use crate::error::Result;
use crate::scene::{Knot, TransferFunction};

/// Optical depth of the densest tenth of the rays through the data.
pub(super) const DEPTH: f64 = 5.0;
/// For each knot: the share of the foreground's samples below it, and its relative extinction.
pub(super) const RAMP: [(f64, f64); 7] =
    [(0.0, 0.0), (0.25, 0.025), (0.50, 0.08), (0.70, 0.20), (0.85, 0.45), (0.95, 0.80), (0.995, 1.0)];

/// Linear colours of the knots, warm and neutral: from brown for thin and frequent values to white for dense
/// and rare ones.
pub(super) const WARM: [[f64; 3]; RAMP.len()] = [
    [0.24, 0.06, 0.03],
    [0.34, 0.09, 0.04],
    [0.50, 0.17, 0.07],
    [0.68, 0.31, 0.14],
    [0.84, 0.54, 0.30],
    [0.95, 0.82, 0.60],
    [1.0, 0.98, 0.92],
];

pub(super) fn knot(s: f64, tau: f64, [r, g, b]: [f64; 3]) -> Knot {
    Knot { s, colour: DVec3::new(r, g, b), tau }
}

/// Returns a transfer function of knots with their extinction scaled, and at least `haze`.
pub(super) fn hazy(knots: Vec<Knot>, scale: f64, haze: f64) -> Result<TransferFunction> {
    let scaled = |knot: Knot| Knot { tau: (knot.tau * scale).max(haze), ..knot };
    TransferFunction::new(knots.into_iter().map(scaled).collect())
}

/// Returns knots from the foot of the background upwards, at quantiles of the ascending values above it.
///
/// Extinction is relative to its largest value.
pub(super) fn ramp(foot: f64, above: &[f64], colours: &[[f64; 3]; RAMP.len()]) -> Vec<Knot> {
    let mut knots = vec![knot(foot, RAMP[0].1, colours[0])];
    let mut group = 0;
    for (i, &(rank, tau)) in RAMP.iter().enumerate().skip(1) {
        let s = quantile(above, rank);
        if knots.len() > 1 && s <= knots[knots.len() - 1].s {
            // Quantiles that coincide share one knot, the middle one of them.
            group += 1;
            let middle = i - group / 2;
            let last = knots.len() - 1;
            knots[last] = knot(s, RAMP[middle].1, colours[middle]);
        } else {
            group = 0;
            knots.push(knot(s, tau, colours[i]));
        }
    }
    knots
}

/// Returns knots from the foot downwards, at quantiles of the ascending values below it.
pub(super) fn ramp_down(foot: f64, below: &[f64], colours: &[[f64; 3]; RAMP.len()]) -> Vec<Knot> {
    let mirrored: Vec<f64> = below.iter().rev().map(|s| -s).collect();
    let mut knots = ramp(-foot, &mirrored, colours);
    for knot in &mut knots {
        knot.s = -knot.s;
    }
    knots.reverse();
    knots
}
