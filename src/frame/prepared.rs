//! The interface between a plan and the technique that it draws with.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, Image, Recorder, TargetImage};
use crate::scene::View;

/// What a technique has fixed for frames of one size.
pub(crate) trait Prepared: std::fmt::Debug + Send + Sync {
    /// Changes to another view of the same image size. Returns `false`, and changes nothing, where the view exceeds a capacity of the
    /// plan or has more than `most_passes` passes.
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool>;
    /// How it measures depth.
    fn measure(&self) -> DepthMeasure;
    /// The image that the technique draws into, when that is not the caller's.
    fn image(&self) -> Option<&Arc<Image>>;
    /// A word for each pixel, tile by tile, that a frame leaves 0 where the list of the pixel was sorted as it came;
    /// `None` where nothing is sorted.
    fn overflow(&self) -> Option<&Arc<Buffer>> {
        None
    }
    /// How a frame leaves image and words.
    fn last_use(&self) -> Use;
    /// How it draws.
    fn route(&self) -> &'static str;
    /// Work of a frame that is known before it is drawn.
    fn counters(&self) -> Vec<(&'static str, u64)>;
    /// Records a frame into the own image, or into `target` where there is none. `clear` begins with
    /// transparent black.
    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool);
    /// Records the frame with the most passes that [`Prepared::set_view`] may lead to, for a dry run; changes nothing.
    fn record_most(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        self.record(recorder, Some(target), true);
    }
    /// Where a frame's status can be read when it has ended.
    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        None
    }
}

/// What a frame tells of itself when it has ended.
pub(crate) trait Outcome: std::fmt::Debug + Send + Sync {
    /// Whether everything was drawn, and work counted on the device.
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)>;
}
