//! How far an image is from the truth.

mod errors;
mod heat;

pub use errors::{ErrorStatistics, ImageErrors};
pub use heat::{HEAT_KNOTS, HEAT_NON_FINITE, heat_map, heat_map_f64};
