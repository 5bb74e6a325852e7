//! Kernels of the distance that one ray meets.

use super::{Medium, Sums};

/// Kernels of the distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// Distance in standard deviations.
    Gaussian,
    /// Distance in halves of the radius.
    BSpline,
}

impl Shape {
    /// The kernel of the square of the distance, inside of its support; peak 1.
    fn at(self, square: f64) -> f64 {
        if self == Self::Gaussian {
            return (-0.5 * square).exp();
        }
        let q = square.sqrt();
        if q <= 1.0 { 1.0 + square * (0.75 * q - 1.5) } else { 0.25 * (2.0 - q).max(0.0).powi(3) }
    }

    /// The standard deviation of a Gaussian that is not smoother, in units of the distance. Chosen so that panels keep
    /// their accuracy.
    fn scale(self) -> f64 {
        if self == Self::Gaussian { 1.0 } else { 0.25 }
    }
}

/// A kernel on a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Parameter of the place that is nearest to the centre, and square of the distance there.
    middle: f64,
    nearest: f64,
    /// Distance along the ray for each unit of the parameter.
    speed: f64,
    /// Half of the length of the ray inside the kernel.
    half: f64,
    value: Sums,
}

impl Hit {
    /// A kernel whose distances along the ray change by `speed` for each unit of the parameter, if the ray comes nearer
    /// than `support`.
    pub(super) fn new(middle: f64, nearest: f64, speed: f64, support: f64, value: Sums) -> Option<Self> {
        let square = support * support - nearest;
        let hit = Self { middle, nearest, speed, half: square.sqrt() / speed, value };
        (square > 0.0 && hit.half > 0.0 && hit.half.is_finite()).then_some(hit)
    }
}

/// What happens to a ray at a place.
#[derive(Clone, Copy)]
enum Event {
    Enter(usize),
    Leave(usize),
    /// A kernel's formula changes.
    Change,
}

/// Follows the ray through the kernels.
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
                // The cube of the distance has a kink in the middle, where the ray meets the centre.
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
                let fastest = inside.iter().map(|(_, hit)| hit.speed).fold(0.0, f64::max);
                medium.add(here, t, shape.scale() / fastest, &|t| sums(&inside, shape, t));
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
