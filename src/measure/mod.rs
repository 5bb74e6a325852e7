//! Measures of results: image errors, heat maps, and fronts of time and error.
//!
//! This room uses `image` and the reference's image. The program's comparisons and benchmarks use it.

mod errors;
mod front;
mod heat;

pub use errors::{ErrorStatistics, ImageErrors};
pub use front::{Cost, Front, TimeAt};
pub use heat::{HEAT_KNOTS, HEAT_NON_FINITE, heat_map, heat_map_f64};
