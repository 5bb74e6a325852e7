//! The interface between a plan and the technique that it draws with.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::gpu::{Buffer, Image, Recorder, TargetImage};
use crate::scene::View;

/// A technique, ready to draw frames of one size.
pub(crate) trait Prepared: std::fmt::Debug + Send + Sync {
    /// Changes to another view of the same image size. Returns `false`, and changes nothing, where the view exceeds a capacity of the
    /// plan or has more than `most_passes` passes.
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool>;
    /// Returns whether [`Prepared::set_view`] would return `true`. Of techniques without the option `refine` nobody asks.
    fn suits(&self, _view: &View, _most_passes: u32) -> Result<bool> {
        Ok(true)
    }
    /// The measure of depth that the bounds of rays take.
    fn measure(&self) -> DepthMeasure;
    /// The image that the technique draws into; `None` where it draws into the caller's.
    fn image(&self) -> Option<&Arc<Image>>;
    /// One word per pixel, tile by tile, which a frame leaves 0 where the fragments of the pixel arrived in order. `None` where
    /// nothing is sorted.
    fn overflow(&self) -> Option<&Arc<Buffer>> {
        None
    }
    /// The route by name.
    fn route(&self) -> &'static str;
    /// Counts of work that are known before a frame is drawn.
    fn counters(&self) -> Vec<(&'static str, u64)>;
    /// Whether its shaders count what they sample ([`Counts`](crate::frame::counts::Counts)).
    fn counts(&self) -> bool {
        false
    }
    /// Whether its shaders note where rays become opaque ([`HitDepthFrame`](crate::frame::hit_depths::HitDepthFrame)); the reason if not.
    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        Err("this technique does not tell them")
    }
    /// Records a frame into its own image, or into `target` where it has none. `clear` replaces the contents of `target`.
    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool);
    /// Records the frame with the most passes that [`Prepared::set_view`] may lead to, for a dry run; changes nothing.
    fn record_most(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        self.record(recorder, Some(target), true);
    }
    /// Loads data that the last recording lacked. Returns whether another recording of the same view goes on with the image.
    fn load(&mut self) -> Result<bool> {
        Ok(false)
    }
    /// Whether the next recording goes on with the image of the last one.
    fn resumes(&self) -> bool {
        false
    }
    /// The images, beside buffers, that such a recording goes on with.
    fn kept(&self) -> Vec<Arc<Image>> {
        self.image().cloned().into_iter().collect()
    }
    /// The status of a frame, to be read when it has ended.
    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        None
    }
}

/// The status of a frame that has ended.
pub(crate) trait Outcome: std::fmt::Debug + Send + Sync {
    /// Returns whether everything was drawn, and the counts of work from the device.
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)>;
    /// Returns a bound of what a frame that is not complete lacks, where one is known.
    fn bound(&self) -> Result<Option<ErrorBound>> {
        Ok(None)
    }
}

/// How far the image of an incomplete frame is from the complete one at most, in each component of its premultiplied linear colour and opacity.
///
/// Rays that wait for data get no more than what they still let through: their transmittance times the largest component of a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBound {
    /// Root of the mean square over pixels.
    pub rmse: f64,
    /// At any pixel.
    pub greatest: f64,
}

impl ErrorBound {
    /// Returns a bound of the errors of two images side by side.
    pub(crate) fn larger(self, other: Self) -> Self {
        Self { rmse: self.rmse.max(other.rmse), greatest: self.greatest.max(other.greatest) }
    }
}
