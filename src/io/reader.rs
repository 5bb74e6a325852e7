//! The interface that every format implements.

use crate::error::Result;
use crate::io::file::source::Source;
use crate::io::options::Request;
use crate::io::report::Found;

/// A file format.
pub(crate) trait Reader: Sync {
    /// The format's name, for messages.
    fn name(&self) -> &'static str;
    /// The usual file name extensions, without the leading dot.
    fn extensions(&self) -> &'static [&'static str];
    /// Whether the first bytes of the file belong to this format.
    fn recognises(&self, source: &Source) -> bool;
    /// Reads the file.
    fn read(&self, source: &Source, request: &Request) -> Result<Found>;
}
