//! What the writers of Gaussian splats share: whole numbers of steps, quaternions, comments.

use std::fmt;

use crate::num;
use crate::scene::{Gaussians, TrainedMode};

/// Numbers of values that a format clips, by what they are.
#[derive(Debug, Default)]
pub(super) struct Clipped(Vec<(&'static str, usize)>);

impl Clipped {
    /// Returns the nearest of the whole numbers from 0 to `most`, and counts what lies more than half a step outside.
    pub(super) fn code(&mut self, what: &'static str, value: f64, most: u32) -> u32 {
        let nearest = value.round();
        if !(0.0..=f64::from(most)).contains(&nearest) {
            self.count(what);
        }
        num::u32_of(nearest).min(most)
    }

    pub(super) fn count(&mut self, what: &'static str) {
        match self.0.iter_mut().find(|(name, _)| *name == what) {
            Some((_, count)) => *count += 1,
            None => self.0.push((what, 1)),
        }
    }

    /// Returns a note, if anything was clipped.
    pub(super) fn note(&self) -> Option<String> {
        (!self.0.is_empty()).then(|| format!("clipped to the range of the format: {self}"))
    }
}

impl fmt::Display for Clipped {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let all: Vec<String> = self.0.iter().map(|(what, count)| format!("{count} {what}")).collect();
        f.write_str(&all.join(", "))
    }
}

/// Returns the comments of a PLY file, each on its line.
pub(super) fn comments(splats: &Gaussians, texts: &[String]) -> String {
    let mode = match splats.mode() {
        TrainedMode::Unknown => None,
        TrainedMode::Default => Some("SplatRenderMode: default"),
        TrainedMode::Antialiased => Some("SplatRenderMode: mip"),
        TrainedMode::Flat => Some("SplatRenderMode: 2dgs"),
        TrainedMode::Khronos => Some("SplatRenderMode: khr"),
    };
    let line = |text: &str| {
        let plain: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        format!("comment {plain}\n")
    };
    mode.into_iter().chain(texts.iter().map(String::as_str)).map(line).collect()
}

/// Returns the coefficients of a splat, with three numbers for each function.
pub(super) fn harmonics_of(splats: &Gaussians, i: usize) -> &[f32] {
    let width = splats.harmonics().len() / splats.len();
    &splats.harmonics()[width * i..width * (i + 1)]
}

/// Returns the splats without the harmonics of degree 4, and a note if there were any: PLY files have degrees up to 3.
pub(super) fn up_to_third(splats: &Gaussians) -> (u32, Option<String>) {
    match splats.degree() {
        4 => (3, Some("harmonics of degree 4 left out: the format has degrees 0 to 3".to_owned())),
        degree => (degree, None),
    }
}

/// Returns the place of the largest part of a quaternion, and the three others in order, with the sign that makes the largest
/// positive.
pub(super) fn smallest_three(parts: [f32; 4]) -> (u32, [f64; 3]) {
    let parts = parts.map(f64::from);
    let (mut largest, mut place) = (0, 0);
    for (i, part) in (0..).zip(parts) {
        if part.abs() > parts[largest].abs() {
            (largest, place) = (num::index(i), i);
        }
    }
    let sign = if parts[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut others = (0..4).filter(|i| *i != largest).map(|i| sign * parts[i]);
    let mut next = || others.next().unwrap_or_default();
    (place, [next(), next(), next()])
}
