//! The common part of all fuzz targets.

#[path = "../../tests/host/formats/container.rs"]
mod container;

use volraster::io::{ReadOptions, read_arrays_memory, read_memory};

/// Reads bytes as a file of the given name and the files beside it: scene data, then arrays.
///
/// # Panics
///
/// When an error is not one of wrong input, or its message is longer than one line.
pub fn read(name: &str, bytes: &[u8]) {
    let files = container::unpack(name, bytes);
    let options = ReadOptions::within(1 << 24);
    let scene = read_memory(&files, &options).map(drop);
    let arrays = read_arrays_memory(&files, &options, false).map(drop);
    for error in [scene, arrays].into_iter().filter_map(Result::err) {
        let text = error.to_string();
        assert!(error.exit_code() == 2 && !text.contains('\n'), "{text}");
    }
}
