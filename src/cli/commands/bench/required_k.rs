//! The size of the k-buffer that each pixel of a view needs.

use std::sync::Arc;

use serde::Serialize;
use volraster::scene::View;
use volraster::technique::Method;
use volraster::{GpuScene, Renderer, Result};

use crate::cli::input;

/// Largest k that is tried.
const MAX_K: usize = 15;

/// Number of pixels by the smallest k that sorts their faces.
#[derive(Debug, Serialize)]
pub(super) struct RequiredK {
    /// Pixels for k = 1 to 15; the first includes pixels without faces.
    pixels: [u64; MAX_K],
    /// Pixels for larger k.
    more: u64,
}

impl RequiredK {
    /// Draws a view with every k, without repair. Exactly the unsorted pixels count as overflowing, so that
    /// differences are exact. `None` for scenes without faces.
    pub(super) fn measure(scene: &Arc<GpuScene>, view: &View) -> Result<Option<Self>> {
        if !Method::Havs.draws_scene(scene.scene()) {
            return Ok(None);
        }
        let [width, height] = view.extent();
        let mut unsorted = u64::from(width) * u64::from(height);
        let mut pixels = [0; MAX_K];
        for (k, place) in (1_u32..).zip(&mut pixels) {
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
        Ok(Some(Self { pixels, more: unsorted }))
    }

    /// Returns the counts as one line.
    pub(super) fn text(&self) -> String {
        let counts =
            (1..).zip(self.pixels).filter(|&(_, n)| n > 0).map(|(k, n): (u32, _)| format!("{k}: {n}"));
        let more = (self.more > 0).then(|| format!("more: {}", self.more));
        let counts: Vec<String> = counts.chain(more).collect();
        format!("pixels by required k: {}", counts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_counts_are_omitted() {
        let mut some = RequiredK { pixels: [0; MAX_K], more: 0 };
        some.pixels[0] = 90;
        some.pixels[2] = 10;
        assert_eq!(some.text(), "pixels by required k: 1: 90, 3: 10");
        some.more = 7;
        assert!(some.text().ends_with("3: 10, more: 7"));
        assert_eq!(serde_json::json!(some)["pixels"][2], 10);
        assert_eq!(serde_json::json!(some)["more"], 7);
    }
}
