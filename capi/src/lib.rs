//! The functions of `include/volraster.h`, which are those of `volraster::ffi`, as a library for C.

// Linked, and its functions exported.
extern crate rust as _;
