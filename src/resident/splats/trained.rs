//! Trained splats on the device, packed: 32 bytes each, and two for each coefficient of harmonics beyond the constant.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::shader::TRAINED_WORDS;
use crate::gpu::{Buffer, Gpu};
use crate::num;
use crate::scene::{Gaussians, harmonics};
use glam::DVec3;

/// Trained splats as `gaussians-project.glsl` reads them.
///
/// Places stay float32. Logarithms of lengths have 16 bits of their range in the scene, opacities 16 bits, and the three lesser
/// parts of quaternions 15 bits. Colours are half floats.
///
/// # Accuracy
///
/// Lengths to 1.2e-5 of their range in e-folds, 3e-4 at most; rotations to 5e-5 radians; opacities to 8e-6; colours to 5e-4 of
/// each coefficient.
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

/// Codes of lengths; 0 is flat.
const CODES: f64 = 65_534.0;

impl TrainedSet {
    /// Packs and uploads splats.
    pub(crate) fn new(gpu: &Gpu, splats: &Gaussians) -> Result<Self> {
        let (count, rest) = (splats.len(), harmonics::count(splats.degree()) - 1);
        let stride = (3 * rest).div_ceil(2);
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
        for own in splats.harmonics().chunks_exact(3 * (rest + 1)) {
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
        Self { low, step: (high - low) / (CODES - 1.0) }
    }

    fn code(&self, log: f32) -> u32 {
        if log == f32::NEG_INFINITY {
            return 0;
        }
        let steps = (f64::from(log) * std::f64::consts::LOG2_E - self.low) / self.step;
        1 + if steps.is_finite() { num::u32_of(steps.round().clamp(0.0, CODES - 1.0)) } else { 0 }
    }
}

/// Packs a splat: its place and two lengths, then a length and its opacity, its rotation in 47 bits, the constant of its colours.
fn packed(splats: &Gaussians, i: usize, scales: &Scales) -> [u32; TRAINED_WORDS as usize] {
    let place = splats.centres()[i].map(f32::to_bits);
    let lengths = splats.log_scales()[i].map(|log| scales.code(log));
    let opacity = num::u32_of((f64::from(splats.opacities()[i]) * 65_535.0).round());
    let [low, high] = rotation(splats.rotations()[i]);
    let functions = harmonics::count(splats.degree());
    let dc = &splats.harmonics()[3 * functions * i..][..3];
    [
        place[0],
        place[1],
        place[2],
        lengths[0] | lengths[1] << 16,
        lengths[2] | opacity << 16,
        low,
        high | halves(0.0, dc[0]),
        halves(dc[1], dc[2]),
    ]
}

/// Packs a unit quaternion w, x, y, z: all but its greatest part in 15 bits each, then the place of that.
fn rotation(parts: [f32; 4]) -> [u32; 2] {
    let greatest = (0..4).fold(0, |best, i| if parts[i].abs() > parts[best].abs() { i } else { best });
    // The same rotation with a positive greatest part.
    let sign = if parts[greatest] < 0.0 { -1.0 } else { 1.0 };
    let code = |part: f32| {
        let share = f64::from(sign * part) * std::f64::consts::SQRT_2;
        num::u32_of(((share + 1.0) * 0.5 * 32_767.0).round().clamp(0.0, 32_767.0))
    };
    let mut others = (0..4).filter(|&i| i != greatest).map(|i| code(parts[i]));
    let mut next = || others.next().unwrap_or(0);
    let (a, b, c) = (next(), next(), next());
    [a | b << 15 | c << 30, c >> 2 | num::count(greatest) << 13]
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
