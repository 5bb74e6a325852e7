//! The common part of all fuzz targets.

#[path = "../../tests/host/formats/container.rs"]
mod container;

use volraster::io::{ReadOptions, read_memory};

/// Reads bytes as a file of the given name and the files beside it.
///
/// # Panics
///
/// When an error is not one of wrong input, or its message is longer than one line.
pub fn read(name: &str, bytes: &[u8]) {
    let files = container::unpack(name, bytes);
    if let Err(error) = read_memory(&files, &ReadOptions::within(1 << 24)) {
        let text = error.to_string();
        assert!(error.exit_code() == 2 && !text.contains('\n'), "{text}");
    }
}
