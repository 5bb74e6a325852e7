//! What every fuzz target does.

#[path = "../../tests/host/formats/container.rs"]
mod container;

use volraster::io::{ReadOptions, read_memory};

/// Reads bytes as the file of some name, and files beside it.
///
/// # Panics
///
/// When a message is no message of wrong input, or more than a line.
pub fn read(name: &str, bytes: &[u8]) {
    let files = container::unpack(name, bytes);
    if let Err(error) = read_memory(&files, &ReadOptions::within(1 << 24)) {
        let text = error.to_string();
        assert!(error.exit_code() == 2 && !text.contains('\n'), "{text}");
    }
}
