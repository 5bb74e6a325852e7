//! Parallel algorithms on the device, independent of techniques: dispatches, prefix sums, a radix sort, and binning of
//! primitives to tiles.
//!
//! May use `gpu`, `interface`, `error` and `num`. Used by `resident`, `frame` and `technique`.

pub(crate) mod bins;
pub(crate) mod dispatch;
pub(crate) mod radix_sort;
pub(crate) mod scan;
