//! Trained splats on the device, packed: 40 bytes each, and two for each coefficient of harmonics beyond the constant.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::shader::TRAINED_WORDS;
use crate::gpu::{Buffer, Gpu};
use crate::num;
use crate::scene::{Gaussians, harmonics};
use glam::DVec3;

/// Trained splats as `gaussians-project.glsl` reads them.
///
/// Places stay float32. Logarithms of lengths have 21 bits of their range in the scene, opacities 18 bits, the three lesser
/// parts of quaternions 20 bits, and the constants of colours 26 bits of a float32. Their other coefficients are half floats.
///
/// # Accuracy
///
/// Lengths to 2.4e-7 of their range in e-folds, 1e-5 at most; rotations to 5e-6 radians; opacities to 2e-6; the constants of colours
/// to 4e-6, other coefficients to 5e-4.
#[derive(Debug)]
pub(crate) struct TrainedSet {
    pub(crate) count: u32,
    pub(crate) degree: u32,
    pub(crate) splats: Arc<Buffer>,
    pub(crate) harmonics: Arc<Buffer>,
    /// Logarithm to base 2 of the shortest length that is not flat, and of a step of codes.
    pub(crate) scales: [f64; 2],
    /// The middle of the centres, from which depths are measured: numbers that float32 holds.
    pub(crate) centre: DVec3,
    /// Half the diagonal of their box.
    pub(crate) radius: f64,
    /// Three standard deviations of all but the largest splats.
    pub(crate) reach: f64,
    /// A bound of all colours.
    pub(crate) max_colour: f64,
}

/// Bits of a length, of a part of a quaternion, and of an opacity.
const LENGTH_BITS: u32 = 21;
const PART_BITS: u32 = 20;
const OPACITY_BITS: u32 = 18;

/// Returns the greatest code of a number of bits.
fn greatest(bits: u32) -> f64 {
    f64::from((1_u32 << bits) - 1)
}

/// Returns the number of codes of lengths but that of flat splats, which is 0.
fn codes() -> f64 {
    greatest(LENGTH_BITS) - 1.0
}

/// Returns the words of the coefficients of a splat's colours but the first: half floats.
fn harmonics_words(degree: u32) -> usize {
    (3 * (harmonics::count(degree) - 1)).div_ceil(2)
}

impl TrainedSet {
    /// Returns the bytes that a splat has on the device.
    pub(crate) fn bytes_each(&self) -> u64 {
        4 * (u64::from(TRAINED_WORDS) + num::wide(harmonics_words(self.degree)))
    }

    /// Packs and uploads splats.
    pub(crate) fn new(gpu: &Gpu, splats: &Gaussians) -> Result<Self> {
        let (count, stride) = (splats.len(), harmonics_words(splats.degree()));
        let bytes = 4 * num::wide(count) * num::wide(stride).max(TRAINED_WORDS.into());
        if bytes > gpu.most_buffer_bytes() || count >= 1 << 27 {
            let most = gpu.most_buffer_bytes() / (bytes / num::wide(count));
            return Err(Error::unsupported(
                "splats of this scene",
                format!("{count} splats; {most} fit a buffer"),
            ));
        }
        let scales = Scales::of(splats);
        let words: Vec<[u32; TRAINED_WORDS as usize]> =
            (0..count).map(|i| packed(splats, i, &scales)).collect();
        let mut beyond = Vec::with_capacity(count * stride + 1);
        for own in splats.harmonics().chunks_exact(3 * harmonics::count(splats.degree())) {
            beyond
                .extend(own[3..].chunks(2).map(|pair| halves(pair[0], pair.get(1).copied().unwrap_or(0.0))));
        }
        // A binding must hold something.
        beyond.push(0);
        let [low, high] = splats.bounds();
        Ok(Self {
            count: num::count(count),
            degree: splats.degree(),
            splats: Buffer::with_data(gpu, "trained.splats", bytemuck::cast_slice(&words))?,
            harmonics: Buffer::with_data(gpu, "trained.harmonics", bytemuck::cast_slice(&beyond))?,
            scales: [scales.low, scales.step],
            centre: (0.5 * low + 0.5 * high).as_vec3().as_dvec3(),
            radius: (0.5 * high - 0.5 * low).length(),
            reach: reach(splats),
            max_colour: max_colour(splats),
        })
    }
}

/// The range of lengths: logarithms to base 2.
struct Scales {
    low: f64,
    step: f64,
}

impl Scales {
    fn of(splats: &Gaussians) -> Self {
        let logs = splats.log_scales().iter().flatten().copied().filter(|log| log.is_finite());
        let [low, high] =
            logs.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], log| [low.min(log), high.max(log)]);
        let [low, high] = if low <= high { [low, high] } else { [0.0; 2] };
        let [low, high] = [low, high].map(|log| f64::from(log) * std::f64::consts::LOG2_E);
        Self { low, step: (high - low) / (codes() - 1.0) }
    }

    fn code(&self, log: f32) -> u32 {
        if log == f32::NEG_INFINITY {
            return 0;
        }
        let steps = (f64::from(log) * std::f64::consts::LOG2_E - self.low) / self.step;
        1 + if steps.is_finite() { num::u32_of(steps.round().clamp(0.0, codes() - 1.0)) } else { 0 }
    }
}

/// Packs a splat: its place; its lengths; its rotation; the constants of its colours, with a third of its opacity each.
fn packed(splats: &Gaussians, i: usize, scales: &Scales) -> [u32; TRAINED_WORDS as usize] {
    let place = splats.centres()[i].map(f32::to_bits);
    let lengths = joined(splats.log_scales()[i].map(|log| scales.code(log)), LENGTH_BITS);
    let rotation = rotation(splats.rotations()[i]);
    let opacity = num::u32_of((f64::from(splats.opacities()[i]) * greatest(OPACITY_BITS)).round());
    let functions = harmonics::count(splats.degree());
    let own = &splats.harmonics()[3 * functions * i..][..3];
    // Six bits of an opacity take the place of a number's last, which is rounded to those before.
    let colour = |k: usize| {
        let bits = own[k].to_bits();
        // The greatest numbers are not rounded up: they would be infinite.
        let rounded = if own[k].abs() < f32::MAX / 2.0 { bits + 32 } else { bits };
        rounded & !63 | opacity >> (6 * k) & 63
    };
    let [l0, l1, r0, r1]: [u32; 4] = bytemuck::cast([lengths, rotation].map(u64::to_le));
    [place[0], place[1], place[2], l0, l1, r0, r1, colour(0), colour(1), colour(2)]
}

/// Joins three codes, the first in the lowest bits.
fn joined([a, b, c]: [u32; 3], bits: u32) -> u64 {
    u64::from(a) | u64::from(b) << bits | u64::from(c) << (2 * bits)
}

/// Packs a unit quaternion w, x, y, z: all but its greatest part, then the place of that.
fn rotation(parts: [f32; 4]) -> u64 {
    let place = (0..4).fold(0, |best, i| if parts[i].abs() > parts[best].abs() { i } else { best });
    // The same rotation with a positive greatest part.
    let sign = if parts[place] < 0.0 { -1.0 } else { 1.0 };
    let most = greatest(PART_BITS);
    let code = |part: f32| {
        let share = f64::from(sign * part) * std::f64::consts::SQRT_2;
        num::u32_of(((share + 1.0) * 0.5 * most).round().clamp(0.0, most))
    };
    let mut others = (0..4).filter(|&i| i != place).map(|i| code(parts[i]));
    let codes = std::array::from_fn(|_| others.next().unwrap_or(0));
    joined(codes, PART_BITS) | num::wide(place) << (3 * PART_BITS)
}

/// Packs two half floats, the first in the lower word.
fn halves(low: f32, high: f32) -> u32 {
    u32::from(num::half_of(low)) | u32::from(num::half_of(high)) << 16
}

/// Returns three of the longest standard deviations of a splat that few exceed.
fn reach(splats: &Gaussians) -> f64 {
    /// The share of splats that do.
    const LARGE: f64 = 0.02;
    let mut longest: Vec<f32> = splats.log_scales().iter().map(|[x, y, z]| x.max(*y).max(*z)).collect();
    let place = num::usize_of((1.0 - LARGE) * num::f64_of(longest.len() - 1));
    3.0 * f64::from(*longest.select_nth_unstable_by(place, f32::total_cmp).1).exp()
}

/// Returns a bound of all colours: of a band of degree l the squares of the functions sum to (2 l + 1) / 4π.
fn max_colour(splats: &Gaussians) -> f64 {
    let functions = harmonics::count(splats.degree());
    let mut most = 1.0_f64;
    for own in splats.harmonics().chunks_exact(3 * functions) {
        for channel in 0..3 {
            let mut sum = 0.5;
            for l in 0..=splats.degree() {
                let begin = if l == 0 { 0 } else { harmonics::count(l - 1) };
                let squares = (begin..harmonics::count(l))
                    .map(|i| f64::from(own[3 * i + channel]).powi(2))
                    .sum::<f64>();
                sum += (squares * f64::from(2 * l + 1) / (4.0 * std::f64::consts::PI)).sqrt();
            }
            most = most.max(sum);
        }
    }
    most
}
