//! Radial kernels on one ray.

use crate::num;

use super::values::{Medium, Sums, parts};

/// Selects a radial kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// Distances in standard deviations.
    Gaussian,
    /// Distances in halves of the radius.
    BSpline,
}

impl Shape {
    /// Evaluates the kernel at a squared distance inside its support; the peak is 1.
    fn at(self, square: f64) -> f64 {
        if self == Self::Gaussian {
            return (-0.5 * square).exp();
        }
        let q = square.sqrt();
        if q <= 1.0 { 1.0 + square * (0.75 * q - 1.5) } else { 0.25 * (2.0 - q).max(0.0).powi(3) }
    }

    /// Returns the standard deviation of a Gaussian that is at most as smooth, in units of the distance.
    ///
    /// Chosen so that panels keep their accuracy.
    fn scale(self) -> f64 {
        if self == Self::Gaussian { 1.0 } else { 0.25 }
    }
}

/// A kernel on a ray.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct Hit {
    /// Parameter of the point nearest to the centre, and the squared distance there.
    middle: f64,
    nearest: f64,
    /// Change of distance along the ray per unit of the parameter.
    speed: f64,
    /// Half of the parameter's range inside the kernel.
    half: f64,
    value: Sums,
}

impl Hit {
    /// Makes a hit if the ray comes nearer than `support`. `speed` is the distance along the ray per unit of
    /// the parameter.
    pub(in crate::reference) fn new(
        middle: f64,
        nearest: f64,
        speed: f64,
        support: f64,
        value: Sums,
    ) -> Option<Self> {
        let square = support * support - nearest;
        let hit = Self { middle, nearest, speed, half: square.sqrt() / speed, value };
        (square > 0.0 && hit.half > 0.0 && hit.half.is_finite()).then_some(hit)
    }
}

/// An event on a ray.
#[derive(Clone, Copy)]
enum Event {
    Enter(usize),
    Leave(usize),
    /// The formula of a kernel changes.
    Change,
}

/// Follows the ray through the kernels, in the order of events.
pub(super) fn sweep(hits: &[Hit], shape: Shape, range: [f64; 2], medium: &mut impl Medium) {
    if range[0] >= range[1] {
        return;
    }
    let mut events: Vec<(f64, Event)> = Vec::with_capacity(2 * hits.len());
    for (i, hit) in hits.iter().enumerate() {
        let (begin, end) = (hit.middle - hit.half, hit.middle + hit.half);
        if begin < range[1] && end > range[0] {
            events.extend([(begin, Event::Enter(i)), (end, Event::Leave(i))]);
            if shape == Shape::BSpline {
                // The cube of the distance has a kink where the ray meets the centre.
                let knot = (1.0 - hit.nearest).max(0.0).sqrt() / hit.speed;
                events.extend([-knot, 0.0, knot].map(|t| (hit.middle + t, Event::Change)));
            }
        }
    }
    events.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut here = range[0];
    let mut inside: Vec<(usize, Hit)> = Vec::new();
    for (t, event) in events {
        let t = t.clamp(range[0], range[1]);
        if t > here {
            if !inside.is_empty() {
                stretch(&inside, shape, [here, t], medium);
                if medium.is_opaque() {
                    return;
                }
            }
            here = t;
        }
        match event {
            Event::Enter(i) => inside.push((i, hits[i])),
            Event::Leave(i) => inside.retain(|(j, _)| *j != i),
            Event::Change => {}
        }
    }
}

/// Adds a segment of the ray inside a fixed set of kernels.
fn stretch(inside: &[(usize, Hit)], shape: Shape, [from, to]: [f64; 2], medium: &mut impl Medium) {
    if medium.is_vacuum(inside.iter().map(|(_, hit)| hit.value)) {
        return;
    }
    let fastest = inside.iter().map(|(_, hit)| hit.speed).fold(0.0, f64::max);
    let scale = shape.scale() / fastest;
    if shape == Shape::BSpline {
        medium.add(from, to, scale, &|t| sums(inside, shape, t));
        return;
    }
    let count = ((to - from) / (2.0 * Series::LONGEST * scale)).ceil().max(1.0);
    for [here, end] in parts([from, to], count) {
        if medium.is_opaque() {
            return;
        }
        let series = Series::new(inside, here, end, fastest);
        medium.add(here, end, scale, &|t| series.at(t));
    }
}

/// A sum of Gaussians on a short segment, as a polynomial of the position from -1 to 1.
///
/// Each Gaussian is `exp(-(u + v)² / 2) = exp(-u² / 2) Σ He_k(u) (-v)^k / k!` with Hermite's polynomials.
/// This takes one exponential for each kernel, however often the sum is evaluated.
struct Series {
    middle: f64,
    half: f64,
    terms: [Sums; Self::TERMS],
    count: usize,
}

impl Series {
    /// Terms that are exact to rounding on the longest segment.
    const TERMS: usize = 15;

    /// Kernels that are added at a time.
    const LANES: usize = 4;

    /// Half of the longest segment, in standard deviations.
    const LONGEST: f64 = 0.2;

    fn new(inside: &[(usize, Hit)], from: f64, to: f64, fastest: f64) -> Self {
        let (middle, half) = (from + 0.5 * (to - from), 0.5 * (to - from));
        // Term k is at most v^k / sqrt(k!) of a Gaussian of twice the variance.
        let (mut count, mut size, mut k) = (1, 1.0, 1.0);
        while count < Self::TERMS && size > 1e-17 {
            size *= half * fastest / f64::sqrt(k);
            k += 1.0;
            count += 1;
        }
        let inverses: [f64; Self::TERMS] = std::array::from_fn(|k| 1.0 / (num::f64_of(k) + 1.0));
        let mut terms = [[0.0; 4]; Self::TERMS];
        // Several kernels at a time, because each term waits for the one before. Their sums are added in order.
        for hits in inside.chunks(Self::LANES) {
            let [mut u, mut v, mut before, mut term] = [[0.0; Self::LANES]; 4];
            let mut values = [[0.0; 4]; Self::LANES];
            for (lane, (_, hit)) in hits.iter().enumerate() {
                u[lane] = (middle - hit.middle) * hit.speed;
                v[lane] = -half * hit.speed;
                term[lane] = Shape::Gaussian.at(hit.nearest + u[lane] * u[lane]);
                values[lane] = hit.value;
            }
            for (sums, inverse) in terms[..count].iter_mut().zip(inverses) {
                for (term, value) in term.iter().zip(&values) {
                    for (sum, value) in sums.iter_mut().zip(value) {
                        *sum += term * value;
                    }
                }
                // He_k+1 = u He_k - k He_k-1.
                for lane in 0..Self::LANES {
                    let (u, v, now) = (u[lane], v[lane], term[lane]);
                    term[lane] = v * inverse * (u * now - v * before[lane]);
                    before[lane] = now;
                }
            }
        }
        Self { middle, half, terms, count }
    }

    fn at(&self, t: f64) -> Sums {
        let x = ((t - self.middle) / self.half).clamp(-1.0, 1.0);
        let mut sums = [0.0; 4];
        for terms in self.terms[..self.count].iter().rev() {
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum = *sum * x + term;
            }
        }
        sums
    }
}

fn sums(inside: &[(usize, Hit)], shape: Shape, t: f64) -> Sums {
    let mut sums = [0.0; 4];
    for (_, hit) in inside {
        let u = (t - hit.middle) * hit.speed;
        let k = shape.at(hit.nearest + u * u);
        for (sum, value) in sums.iter_mut().zip(hit.value) {
            *sum += k * value;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Series of the longest and of shorter segments, anywhere in a kernel, equal the sums of the kernels.
    #[test]
    fn series_are_the_sums() {
        for half in [Series::LONGEST, 0.1, 0.02, 1e-3, 1e-9] {
            for place in -12..=12 {
                let hit = |offset: f64, speed: f64, nearest: f64| Hit {
                    middle: offset,
                    nearest,
                    speed,
                    half: 9.0,
                    value: [1.0, 0.3, 0.0, 2.0],
                };
                let all = [
                    (0, hit(0.0, 1.0, 0.2)),
                    (1, hit(0.4, 0.7, 0.0)),
                    (2, hit(-0.3, 0.2, 3.0)),
                    (3, hit(0.1, 0.9, 1.0)),
                    (4, hit(-0.2, 0.5, 0.1)),
                    (5, hit(0.7, 0.8, 0.4)),
                ];
                let middle = 0.5 * f64::from(place);
                let series = Series::new(&all, middle - half, middle + half, 1.0);
                for i in 0..=10 {
                    let t = middle + half * (0.2 * f64::from(i) - 1.0);
                    for (got, want) in series.at(t).into_iter().zip(sums(&all, Shape::Gaussian, t)) {
                        assert!((got - want).abs() < 6e-15, "{half} at {t}: {:e}", got - want);
                    }
                }
            }
        }
    }
}
