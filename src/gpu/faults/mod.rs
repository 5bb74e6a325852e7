//! Deliberate faults: mistakes that volume renderers make, each with the message that a validation layer should give. They show what a
//! layer hears, and that it listens.

mod commands;
mod descriptors;
mod fault;
mod ground;
mod list;
mod objects;
mod synchronization;

pub use fault::Fault;
