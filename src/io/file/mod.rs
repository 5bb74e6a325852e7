//! Files as readers see them: bytes on disk or in memory, compressed streams, text, samples.
//!
//! These modules know no format. They use `num`, `error` and the sample lists of `scene`;
//! `build`, `formats` and `scene_file` use them.

pub(crate) mod budget;
pub(crate) mod decode;
pub(crate) mod fields;
pub(crate) mod half;
pub(crate) mod json;
pub(crate) mod on_demand;
pub(crate) mod sample_type;
pub(crate) mod samples;
pub(crate) mod scanner;
pub(crate) mod source;
pub(crate) mod text;
