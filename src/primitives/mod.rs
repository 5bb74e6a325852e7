//! Parallel primitives on the device: dispatches, prefix sums, radix sort, bins of tiles.

pub(crate) mod bins;
pub(crate) mod dispatch;
pub(crate) mod radix_sort;
pub(crate) mod scan;
