//! Rows of equal size, read block by block.

use std::io::Read;

use crate::error::Result;
use crate::io::file::scanner::Scanner;
use crate::io::file::text;

/// The number of bytes read at once.
const BLOCK: usize = 1 << 16;

/// Reads rows and passes each to `sink`, with its index.
pub(super) fn rows(
    scanner: &mut Scanner,
    count: usize,
    width: usize,
    sink: &mut dyn FnMut(usize, &[u8]),
) -> Result<()> {
    if width == 0 {
        return Ok(());
    }
    let most = (BLOCK / width).clamp(1, count.max(1));
    let mut block = vec![0; most * width];
    let mut done = 0;
    while done < count {
        let block = &mut block[..most.min(count - done) * width];
        scanner.read_exact(block).map_err(|error| text::stream_error(scanner.source(), error))?;
        for row in block.chunks_exact(width) {
            sink(done, row);
            done += 1;
        }
    }
    Ok(())
}
