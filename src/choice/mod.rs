//! Chooses a technique and its options for a wanted error or frame time, and verifies the choice.
//!
//! A [`Profile`] holds time and error of a fixed table of settings on scenes of its own. The search tries the
//! setting with the best prediction on the scene itself, compares its image with the reference at random
//! pixels, and corrects the predictions of similar settings. It ends when no setting promises an improvement.
//!
//! This room uses scenes, the reference, `resident` and the techniques. The program uses it.

mod decide;
mod goal;
mod probes;
mod profile;
mod search;
mod table;
mod trial;

pub use decide::{Choice, choose, estimate, try_all};
pub use goal::Goal;
pub use probes::Estimate;
pub use profile::{Profile, Source};
pub use trial::{Trial, TrialOutcome};
