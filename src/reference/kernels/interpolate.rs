//! The interpolation model: the scalar is a quotient of sums, approximated by cubics.

use super::super::march::{Classes, March};
use super::super::polynomial::{self, Cubic};
use super::values::{Medium, Sums, parts};

/// Largest error of a cubic at which its two halves are used, as a share of the scalars' range. The error of
/// the halves is sixteen times smaller.
const ERROR: f64 = 1e-9;

/// Largest error of the cubic of the weight, as a share of the threshold.
const WEIGHT_ERROR: f64 = 1e-10;

/// Rounding error of a quotient of sums, as a share of the scalars.
const ROUNDING: f64 = 1e-13;

/// Largest number of bisections of a segment.
const BISECTIONS: u32 = 20;

/// The state of a ray, front to back.
pub(super) struct Interpolate<'a> {
    classes: &'a Classes,
    march: March,
    least: f64,
    tolerance: f64,
}

/// A part of a ray: its ends, and the sums at its ends and thirds.
#[derive(Clone, Copy)]
struct Part {
    from: f64,
    to: f64,
    sums: [Sums; 4],
}

impl Part {
    fn new(from: f64, to: f64, sums: &impl Fn(f64) -> Sums) -> Self {
        let third = (to - from) / 3.0;
        Self { from, to, sums: [sums(from), sums(from + third), sums(to - third), sums(to)] }
    }
}

impl<'a> Interpolate<'a> {
    pub(super) fn new(classes: &'a Classes, least: f64, range: [f64; 2]) -> Self {
        let size = range[0].abs().max(range[1].abs());
        let tolerance = ERROR * (range[1] - range[0]) + ROUNDING * size;
        Self { classes, march: March::new(classes.most.to_array()), least, tolerance }
    }

    /// Integrates a part of the ray. `shows` means that the weight is known to be above the threshold.
    fn follow(&mut self, part: Part, shows: bool, bisections: u32, sums: &impl Fn(f64) -> Sums) {
        let Part { from, to, sums: [a, b, c, d] } = part;
        let length = to - from;
        if self.march.is_opaque() || length <= 0.0 {
            return;
        }
        let [ab, bc, cd] = CHECKS.map(|x| sums(from + length * x));
        let halves = || {
            let middle = from + 0.5 * length;
            [Part { from, to: middle, sums: [a, ab, b, bc] }, Part { from: middle, to, sums: [bc, c, cd, d] }]
        };

        if !shows {
            let weight = through([a, b, c, d].map(|sums| sums[0]));
            let error = deviation(&weight, [ab, bc, cd].map(|sums| sums[0]));
            let [low, high] = extremes(&weight);
            if high + 2.0 * error < self.least {
                return;
            }
            if low - 2.0 * error < self.least {
                let largest = low.abs().max(high.abs());
                let exact = error <= WEIGHT_ERROR * self.least + 1e-15 * largest;
                if !exact && bisections > 0 {
                    for half in halves() {
                        self.follow(half, false, bisections - 1, sums);
                    }
                    return;
                }
                self.cut(part, &weight, bisections, sums);
                return;
            }
        }

        let scalar = |sums: Sums| sums[1] / sums[0];
        let whole = through([a, b, c, d].map(scalar));
        let error = deviation(&whole, [ab, bc, cd].map(scalar));
        let [low, high] = extremes(&whole);
        let interval = |s: f64| self.classes.interval(s);
        if self.classes.are_vacuum(interval(low - 4.0 * error), interval(high + 4.0 * error)) {
            return;
        }
        let rough = error > self.tolerance && bisections > 0;
        for half in halves() {
            if rough {
                self.follow(half, true, bisections - 1, sums);
            } else {
                let cubic = through(half.sums.map(scalar));
                self.march.add_cubic(self.classes, &cubic, half.to - half.from, None);
            }
        }
    }

    /// Cuts a part where the weight, a cubic, crosses the threshold.
    fn cut(&mut self, part: Part, weight: &Cubic, bisections: u32, sums: &impl Fn(f64) -> Sums) {
        let Part { from, to, .. } = part;
        let over = |x: f64| polynomial::value(weight, x) - self.least;
        let mut places = vec![0.0];
        let mut here = 0.0;
        for there in polynomial::turning_points(weight).into_iter().filter(|x| !x.is_nan()).chain([1.0]) {
            if (over(here) < 0.0) != (over(there) < 0.0) {
                places.push(polynomial::crossing(weight, self.least, here, there));
            }
            here = there;
        }
        places.push(1.0);
        let at = |x: f64| if x < 1.0 { from + (to - from) * x } else { to };
        let shown: Vec<[f64; 2]> = places
            .windows(2)
            .filter(|ends| ends[1] > ends[0] && over(0.5 * (ends[0] + ends[1])) >= 0.0)
            .map(|ends| [at(ends[0]), at(ends[1])])
            .collect();
        for [from, to] in shown {
            self.follow(Part::new(from, to, sums), true, bisections, sums);
        }
    }
}

impl Medium for Interpolate<'_> {
    fn add(&mut self, from: f64, to: f64, scale: f64, sums: &impl Fn(f64) -> Sums) {
        for [here, end] in parts([from, to], ((to - from) / scale).ceil().max(1.0)) {
            self.follow(Part::new(here, end, sums), false, BISECTIONS, sums);
        }
    }

    fn is_vacuum(&self, values: impl Iterator<Item = Sums>) -> bool {
        // Where no weight is negative, the scalar is a mean of the samples' scalars, up to rounding.
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for [weight, weighted, ..] in values {
            if weight < 0.0 {
                return false;
            }
            if weight > 0.0 {
                (low, high) = (low.min(weighted / weight), high.max(weighted / weight));
            }
        }
        low > high || self.classes.is_vacuum([low - self.tolerance, high + self.tolerance])
    }

    fn is_opaque(&self) -> bool {
        self.march.is_opaque()
    }

    fn pixel(&self) -> [f64; 4] {
        self.march.pixel()
    }
}

/// Places where a cubic through the thirds is checked: ends and thirds of its halves that it does not
/// interpolate.
const CHECKS: [f64; 3] = [1.0 / 6.0, 0.5, 5.0 / 6.0];

/// Returns the cubic through values at 0, 1/3, 2/3 and 1 (Newton's forward differences). It is exactly
/// constant for equal values.
fn through([a, b, c, d]: [f64; 4]) -> Cubic {
    let (ab, bc, cd) = (b - a, c - b, d - c);
    let (first, second) = (bc - ab, cd - bc);
    let third = second - first;
    [a, 3.0 * (ab - first / 2.0 + third / 3.0), 4.5 * (first - third), 4.5 * third]
}

/// Returns the largest error of a cubic at the checked places.
fn deviation(cubic: &Cubic, values: [f64; 3]) -> f64 {
    let errors = CHECKS.into_iter().zip(values).map(|(x, value)| (polynomial::value(cubic, x) - value).abs());
    errors.fold(0.0, f64::max)
}

/// Returns the smallest and the largest value on the unit interval.
fn extremes(cubic: &Cubic) -> [f64; 2] {
    let turns = polynomial::turning_points(cubic).into_iter().filter(|x| !x.is_nan());
    turns
        .chain([0.0, 1.0])
        .map(|x| polynomial::value(cubic, x))
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_goes_through_its_values() {
        let c = [0.25, -1.5, 2.0, 0.75];
        let found = through([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|x| polynomial::value(&c, x)));
        for (a, b) in found.into_iter().zip(c) {
            assert!((a - b).abs() < 1e-14, "{found:?}");
        }
        assert_eq!(through([0.1; 4]), [0.1, 0.0, 0.0, 0.0]);
        // 1 + x (1 - x) has its maximum inside.
        assert_eq!(extremes(&[1.0, 1.0, -1.0, 0.0]), [1.0, 1.25]);
    }
}
