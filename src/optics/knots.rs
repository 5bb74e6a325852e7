//! The transfer function as the device evaluates it.

use crate::interface::Knot;
use crate::num::{count, f32_of};
use crate::scene::{self, TransferFunction};

/// Largest number of knots in the uniform block, which the device scans linearly. Longer lists are searched
/// in a storage block.
const UNIFORM_KNOTS: usize = crate::num::index(crate::interface::constants::UNIFORM_KNOTS);

/// Largest extinction on the device: opaque over any length that float32 distinguishes from zero, and small
/// enough that its product with zero is zero.
pub(super) const MAX_TAU: f64 = 1e30;

/// Bound of the scalars, so that their differences and products fit in float32.
pub(super) const MAX_SCALAR: f64 = 1e37;

/// The knots of a transfer function in the device's form.
#[derive(Clone, Debug)]
pub(crate) struct DeviceKnots {
    /// At least as many knots as the uniform block holds; those beyond `count` repeat the last, which has no
    /// effect.
    pub(crate) knots: Vec<Knot>,
    /// Number of knots.
    pub(crate) count: u32,
    /// Number of knots to scan: a multiple of 4, so that few transfer functions need a pipeline of their own;
    /// 0 where the knots are searched.
    pub(crate) walk: u32,
}

impl DeviceKnots {
    /// Rounds the knots to float32. Knots whose scalars become equal make a jump.
    pub(crate) fn new(transfer: &TransferFunction) -> Self {
        let scalar = |s: f64| f32_of(s.clamp(-MAX_SCALAR, MAX_SCALAR));
        let value = |k: &scene::Knot| k.colour.extend(k.tau).to_array().map(|v| f32_of(v.min(MAX_TAU)));
        let rows: Vec<_> = transfer.knots().iter().map(|k| (scalar(k.s), value(k))).collect();
        let mut knots: Vec<Knot> = rows
            .iter()
            .enumerate()
            .map(|(i, &(s, value))| {
                let next = rows.get(i + 1).filter(|next| (1.0 / (next.0 - s)).is_finite());
                let (rise, inverse_ds) = next.map_or(([0.0; 4], 0.0), |next| {
                    (std::array::from_fn(|c| next.1[c] - value[c]), 1.0 / (next.0 - s))
                });
                let end = rows.get(i + 1).map_or(3e38, |next| next.0);
                Knot { value, rise, s, inverse_ds, end, pad: 0.0 }
            })
            .collect();
        let number = knots.len();
        let last = knots.last().copied().unwrap_or_default();
        knots.resize(number.max(UNIFORM_KNOTS), last);
        let walk = if number > UNIFORM_KNOTS { 0 } else { count(number.next_multiple_of(4)) };
        Self { knots, count: count(number), walk }
    }

    /// Returns the largest number of loop iterations of one evaluation.
    pub(crate) fn iterations(&self) -> u32 {
        if self.walk == 0 { self.count.ilog2() + 1 } else { self.walk }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::TransferFunction;

    /// Evaluates the function as the shader does.
    fn evaluate(device: &DeviceKnots, s: f32) -> [f32; 4] {
        let knots = &device.knots[..crate::num::index(device.walk)];
        let on = |k: &Knot| {
            let w = ((s - k.s) * k.inverse_ds).min(1.0);
            std::array::from_fn(|c| k.value[c] + k.rise[c] * w)
        };
        knots.iter().fold(knots[0].value, |value, k| if s >= k.s { on(k) } else { value })
    }

    #[test]
    fn device_knots_reproduce_the_function_to_rounding() {
        let rows: Vec<[f64; 5]> = vec![
            [0.0, 0.1, 0.2, 0.6, 0.0],
            [0.42, 0.9, 0.4, 0.1, 0.0],
            [0.5, 1.0, 0.8, 0.3, 30.0],
            [0.5, 0.0, 0.0, 1.0, 1e6],
            [0.58, 0.2, 0.6, 0.9, 0.0],
        ];
        let tf = TransferFunction::from_rows(&rows).unwrap();
        let device = DeviceKnots::new(&tf);
        assert_eq!(device.walk, 8);
        assert_eq!(device.count, 5);
        for i in -10..=1010 {
            let s = f32_of(f64::from(i) / 1000.0 + 1e-4);
            let (colour, tau) = tf.at(f64::from(s));
            let [r, g, b, a] = evaluate(&device, s).map(f64::from);
            assert!((colour - glam::DVec3::new(r, g, b)).abs().max_element() < 1e-6, "{s}");
            // Relative to the piece's largest extinction: the knots' scalars are rounded to 6e-8 of 0.58, and
            // the pieces are 0.08 wide.
            let largest = if s >= 0.5 { 1e6 } else { 30.0 };
            assert!((tau - a).abs() <= 1e-6 * largest, "{s}: {tau} {a}");
        }
    }

    #[test]
    fn many_knots_are_searched_and_tiny_gaps_are_jumps() {
        let rows: Vec<[f64; 5]> = (0..100).map(|i| [f64::from(i), 0.0, 0.0, 0.0, 1.0]).collect();
        let device = DeviceKnots::new(&TransferFunction::from_rows(&rows).unwrap());
        assert_eq!(device.walk, 0);
        assert_eq!(device.iterations(), 7);
        let rows = [[1.0, 0.0, 0.0, 0.0, 1.0], [1.0 + 1e-12, 0.0, 0.0, 0.0, 1e300]];
        let device = DeviceKnots::new(&TransferFunction::from_rows(&rows).unwrap());
        assert_eq!(device.knots[0].inverse_ds, 0.0);
        assert!(device.knots[1].value[3].is_finite());
    }
}
