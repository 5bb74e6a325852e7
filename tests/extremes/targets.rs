//! stub
use crate::catalogue::Family;
pub static FAMILY: Family = Family::new("targets", &[]);
