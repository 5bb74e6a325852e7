//! stub
use crate::catalogue::{Family, Results};
pub fn check(_all: &[(&Family, &Results)]) {}
