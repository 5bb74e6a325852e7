//! How far an image is from the truth, and in what time.

mod errors;
mod front;
mod heat;

pub use errors::{ErrorStatistics, ImageErrors};
pub use front::{Cost, Front, TimeAt};
pub use heat::{HEAT_KNOTS, HEAT_NON_FINITE, heat_map, heat_map_f64};
