//! How many pairs a k-buffer needs, pixel by pixel.

use std::sync::Arc;

use serde_json::{Value, json};
use volraster::scene::View;
use volraster::technique::Method;
use volraster::{GpuScene, Renderer, Result};

use crate::cli::input;

/// Most pairs that are tried.
const MOST: usize = 15;

/// Number of pixels by the least number of pairs that sorts their faces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RequiredK {
    /// Pixels that 1 to 15 pairs sort and fewer do not; the first are those without faces, too.
    sorted: [u64; MOST],
    more: u64,
}

impl RequiredK {
    /// Draws a view with every number of pairs, unrepaired. A pixel is counted as overflowing if and only if it is not
    /// sorted, so that the differences are exact. `None` where the scene has no faces.
    ///
    /// # Errors
    ///
    /// As [`Renderer::frames`] and [`Frames::draw`](volraster::technique::Frames::draw).
    pub(crate) fn measure(scene: &Arc<GpuScene>, view: &View) -> Result<Option<Self>> {
        if !Method::Havs.draws_scene(scene.scene()) {
            return Ok(None);
        }
        let [width, height] = view.extent();
        let mut unsorted = u64::from(width) * u64::from(height);
        let mut sorted = [0; MOST];
        for (k, place) in (1..).zip(&mut sorted) {
            let k: u32 = k;
            let technique =
                input::with_options(Method::Havs, &[], &[("k", &k.to_string()), ("repair", "none")])?;
            let counters = Renderer::new(scene, technique).frames(view)?.draw(view)?.counters;
            let overflow = counters.iter().find(|(name, _)| *name == "kbuffer_overflow_pixels");
            let overflow = overflow.map_or(0, |&(_, n)| n);
            *place = unsorted.saturating_sub(overflow);
            unsorted = overflow;
            if unsorted == 0 {
                break;
            }
        }
        Ok(Some(Self { sorted, more: unsorted }))
    }

    /// `pixels`: with 1, 2, ... pairs; `more`: with more than 15.
    pub(crate) fn json(&self) -> Value {
        json!({"pixels": self.sorted, "more": self.more})
    }

    /// One line.
    pub(crate) fn text(&self) -> String {
        let counts =
            (1..).zip(self.sorted).filter(|&(_, n)| n > 0).map(|(k, n): (u32, _)| format!("{k}: {n}"));
        let more = (self.more > 0).then(|| format!("more: {}", self.more));
        let counts: Vec<String> = counts.chain(more).collect();
        format!("pixels by the pairs that sort their faces: {}", counts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_empty_is_not_told() {
        let mut some = RequiredK { sorted: [0; MOST], more: 0 };
        some.sorted[0] = 90;
        some.sorted[2] = 10;
        assert_eq!(some.text(), "pixels by the pairs that sort their faces: 1: 90, 3: 10");
        some.more = 7;
        assert!(some.text().ends_with("3: 10, more: 7"));
        assert_eq!(some.json()["pixels"][2], 10);
        assert_eq!(some.json()["more"], 7);
    }
}
