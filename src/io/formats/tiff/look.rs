//! The part of the pages that is read: volume, channels, component.

use crate::error::Result;
use crate::io::build::arrays::{self, ArrayInfo, Association, Choice};
use crate::io::file::decode::Layout;
use crate::io::file::sample_type::{Endian, Pick};
use crate::io::file::source::Source;
use crate::io::formats::tiff::calibration::Volume;
use crate::io::formats::tiff::page::Page;
use crate::io::formats::tiff::stack::MAX_PAGES;
use crate::io::options::{Request, Wanted};
use crate::num;

/// The selected part of the pages.
#[derive(Debug)]
pub(crate) struct Look {
    pub(crate) arrays: Vec<ArrayInfo>,
    pub(crate) shown: String,
    /// A warning that there are other volumes.
    pub(crate) others: Option<String>,
    pub(crate) volume: usize,
    /// The first sample of a pixel, and their number.
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) pick: Pick,
    /// The index and the part of an array that is kept as it is.
    pub(crate) kept: Option<(usize, Pick)>,
}

impl Look {
    /// Chooses the array of a scene, or those that are kept as they are.
    pub(crate) fn choose(
        source: &Source,
        shape: &Page,
        volumes: &[Volume],
        request: &Request,
    ) -> Result<Vec<Self>> {
        if volumes.len() > MAX_PAGES {
            let rule = format!("{} volumes of channels and frames: at most {MAX_PAGES}", volumes.len());
            return Err(source.error("ImageDescription", rule));
        }
        let parts = shape.parts();
        let mut arrays = Vec::new();
        for volume in volumes {
            for &(name, _, components) in &parts {
                let name = match (volume.name.as_str(), parts.len()) {
                    ("", _) => name.to_owned(),
                    (volume, 1) => volume.to_owned(),
                    (volume, _) => format!("{volume} {name}"),
                };
                let (kind, association) = (shape.kind, Association::Point);
                // The first array is the default: colours before their opacity.
                arrays.push(ArrayInfo { name, association, kind, components, active: arrays.is_empty() });
            }
        }
        let is_scene = request.wanted == Wanted::Scene;
        let chosen = if is_scene {
            arrays::choose(source, &arrays, request.array.as_deref())?.into_iter().collect()
        } else {
            arrays::select(source, &arrays, &(0..0), request)?
        };
        if chosen.is_empty() {
            return Err(source.error("pages", "none"));
        }
        let look = |Choice { index, pick }: Choice| {
            let (_, first, count) = parts[index % parts.len()];
            let shown = arrays::describe(&arrays[index], pick);
            let others = (is_scene && volumes.len() > 1 && request.array.is_none()).then(|| {
                format!("{} volumes, {shown} is shown: name another array to see it", volumes.len())
            });
            let (kept, pick) = if is_scene { (None, pick) } else { (Some((index, pick)), Pick::Whole) };
            let (arrays, volume) = (arrays.clone(), index / parts.len());
            Self { arrays, shown, others, volume, first, count, pick, kept }
        };
        Ok(chosen.into_iter().map(look).collect())
    }
}

impl Page {
    pub(crate) fn layout(&self, look: &Look, slices: usize) -> Layout {
        Layout {
            dims: [self.width, self.height, num::count(slices)],
            kind: self.kind,
            endian: Endian::NATIVE,
            components: look.count,
            pick: look.pick,
        }
    }
}
