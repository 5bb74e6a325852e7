//! Frame times and their quantiles.

use serde_json::{Value, json};
use volraster::technique::FrameTime;

/// The frame's time on the device, in milliseconds; `None` where the device has no timestamps.
pub(crate) fn gpu_ms(frame: &FrameTime) -> Option<f64> {
    (!frame.passes.is_empty()).then(|| frame.passes.iter().map(|pass| pass.ms).sum())
}

/// Times of one quantity over several frames, ascending.
#[derive(Clone, Debug)]
pub(crate) struct Times {
    sorted: Vec<f64>,
}

impl Times {
    /// Keeps the times, unless there are none.
    pub(crate) fn new(mut times: Vec<f64>) -> Option<Self> {
        times.sort_by(f64::total_cmp);
        (!times.is_empty()).then_some(Self { sorted: times })
    }

    /// Wall times of frames.
    pub(crate) fn wall(frames: &[FrameTime]) -> Option<Self> {
        Self::new(frames.iter().map(|frame| frame.wall_ms).collect())
    }

    /// Times on the device, if every frame has one.
    pub(crate) fn gpu(frames: &[FrameTime]) -> Option<Self> {
        Self::new(frames.iter().map(gpu_ms).collect::<Option<Vec<_>>>()?)
    }

    /// A quantile, linear between the times beside it.
    pub(crate) fn quantile(&self, per_cent: u32) -> f64 {
        let position = f64::from(per_cent) / 100.0 * (self.sorted.len() - 1) as f64;
        let below = self.sorted.len().saturating_sub(1) * usize::try_from(per_cent).unwrap_or(100) / 100;
        let low = self.sorted[below];
        let high = self.sorted.get(below + 1).copied().unwrap_or(low);
        low + (high - low) * (position - below as f64).clamp(0.0, 1.0)
    }

    /// The middle.
    pub(crate) fn median(&self) -> f64 {
        self.quantile(50)
    }

    /// Median and spread.
    pub(crate) fn json(&self) -> Value {
        json!({"median": self.median(), "p10": self.quantile(10), "p90": self.quantile(90)})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_linear_between_times() {
        let times = Times::new(vec![3.0, 1.0, 2.0, 5.0, 4.0]).unwrap();
        assert_eq!([times.median(), times.quantile(0), times.quantile(100)], [3.0, 1.0, 5.0]);
        assert!((times.quantile(10) - 1.4).abs() < 1e-12);
        assert_eq!(Times::new(vec![1.0, 2.0]).unwrap().median(), 1.5);
        assert_eq!(Times::new(vec![7.0]).unwrap().quantile(90), 7.0);
        assert!(Times::new(Vec::new()).is_none());
    }
}
