//! Techniques for tetrahedral meshes that list faces or cells for each pixel: `havs` and `abuffer`.

#![allow(clippy::unwrap_used, clippy::panic, unreachable_pub, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

mod forms;
mod frames;
mod odd;
mod order;
mod parts;
mod real;
mod support;
