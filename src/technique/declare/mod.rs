//! Declarations: the options of techniques with everything that follows from them, and the interface of a technique.
//!
//! `options` has the macros and rules, `shared` the options that several families share, `draw` the facts of a technique and how it
//! prepares frames.

pub(crate) mod draw;
mod options;
#[cfg(feature = "io")]
mod schema;
mod shared;

pub(crate) use options::{
    Declare, Entry, GROUP, Group, OptionBits, OptionSet, Rule, Text, Value, check, infos, option_set, pairs,
    refused, set, words,
};
pub use options::{Numbers, OptionInfo};
#[cfg(feature = "io")]
pub(crate) use schema::option_schemas;
pub(crate) use shared::Segments;
pub use shared::{BlendOrder, EmptySpace, Resolution, Route};
