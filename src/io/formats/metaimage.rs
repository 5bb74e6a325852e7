//! MetaImage: `.mha` with its data attached, `.mhd` with its data in one or several other files.
//!
//! Row i of `TransformMatrix` is the direction of index axis i, so the rows are the columns of the index-to-world map. A
//! negative spacing reverses its axis.
//!
//! `AnatomicalOrientation` names the sides from which the *index* axes come, in LPS coordinates (x to the left, y to the
//! back, z up); `RAI` belongs to the identity. A grid with such a name lies in LPS coordinates. If the name does not fit
//! the matrix, the matrix decides, with a warning. `???`, or no such key, means unknown.
//!
//! `ElementDataFile` ends the header. Unknown keys are ignored, as the format allows; keys that differ from a known one
//! only in capitals are refused. `CenterOfRotation` belongs to a transform and does not move the image.

mod data;
mod header;
mod placement;

use std::cell::Cell;

use crate::error::Result;
use crate::io::build::file_names::Files;
use crate::io::build::volume::Chosen;
use crate::io::file::decode::Layout;
use crate::io::file::samples;
use crate::io::file::source::Source;
use crate::io::formats::metaimage::header::{Header, SLOPE, keys, pair};
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;

pub(crate) struct MetaImage;

impl Reader for MetaImage {
    fn name(&self) -> &'static str {
        "MetaImage"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["mhd", "mha"]
    }

    fn recognises(&self, source: &Source) -> bool {
        // The format has no magic number: the first key must be one of its own, and the rank must be among the first
        // keys.
        let text = String::from_utf8_lossy(source.head());
        let mut own = text.lines().map_while(|line| pair(line).map(|(key, _)| key));
        let first = own.next();
        !source.is_gzip()
            && first.is_some_and(|key| keys().any(|name| name == key) || key == "Comment")
            && (first == Some("NDims") || own.any(|key| key == "NDims"))
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let header = Header::read(source)?;
        let fields = &header.fields;
        let sizes = header.sizes()?;
        let dims = [sizes[0], sizes[1], sizes[2]];
        let kind = header.sample_type()?;
        let endian = header.endian()?;
        let place = "ElementNumberOfChannels";
        let components = match fields.get(place) {
            None => 1,
            Some(_) => usize::try_from(fields.whole_number(place, 1)?).unwrap_or(usize::MAX),
        };
        let mut chosen = Chosen::new(source, place, Layout::scalar(dims, kind, endian), components, request)?;
        let rescale = header.rescale(&chosen)?;
        let placement = header.placement()?;

        let data = header.data(&sizes)?;
        let packed = fields.whole_number("CompressedDataSize", 0)?;
        let parts = usize::try_from(data.files.as_ref().map_or(1, Files::count)).unwrap_or(usize::MAX);
        let stored = Cell::new(0_u64);
        let part = |index, share| {
            if index == 0 {
                stored.set(0);
            }
            let part = header.part(&data, index, share, request)?;
            let bytes = part.source.len().saturating_sub(part.offset);
            stored.set(stored.get().saturating_add(bytes));
            Ok(part)
        };
        let samples = samples::read(source, "DimSize", &chosen.layout, parts, &part, request)?;

        let located = |name, error| fields.located(name, error);
        let grid = chosen.grid(samples).map_err(|error| error.in_file(source.path()))?;
        let grid = grid.with_rescale(rescale).map_err(|error| located(SLOPE, error))?;
        let mut loaded = chosen.placed(self.name(), grid, placement, &located)?;
        // Only a warning: the stream has its own checksum, and the number is stale in many files.
        if data.compressed
            && let size @ 1.. = packed
            && size.unsigned_abs() != stored.get()
        {
            let there = stored.get();
            loaded.report.warnings.push(format!(
                "CompressedDataSize {size}: {there} bytes are there, and decompress to the announced size"
            ));
        }
        Ok(loaded)
    }
}
