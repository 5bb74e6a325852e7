//! OME-Zarr: images in chunks, with coarser levels (NGFF 0.1 to 0.5), and plain arrays, of Zarr 2 and 3.
//!
//! This module parses what NGFF says of an image, and checks the sizes that Zarr announces. The crate `zarrs` decodes chunks, several at once.
//! A large image stays in its file: boxes of it are read when they are needed, and its coarser levels are the overview.

mod array;
pub(crate) mod metadata;

use std::path::Path;

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::io::build::data_file::Unit;
use crate::io::build::volume::{Chosen, Placement};
use crate::io::file::decode::{Layout, Values};
use crate::io::file::sample_type::{Endian, Pick};
use crate::io::file::samples::{data_size, stays_in_file};
use crate::io::file::source::Source;
use crate::io::formats::zarr::array::{Array, InChunks};
use crate::io::formats::zarr::metadata::{Axis, FILES, Image, Kind, Level};
use crate::io::options::{ReadOptions, Request};
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Anatomy, OnDemand, Samples};

pub(crate) struct Zarr;

impl Reader for Zarr {
    fn name(&self) -> &'static str {
        "OME-Zarr"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["zarr"]
    }

    fn recognises(&self, source: &Source) -> bool {
        source.path().file_name().is_some_and(|name| FILES.iter().any(|file| name == *file))
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        if !source.is_on_disk() {
            return Err(source.error("file", "OME-Zarr is a folder of files: it is not read from memory"));
        }
        let image = Image::find(source.path().parent().unwrap_or(Path::new("")), request)?;
        let level = image.level();
        let array = Array::open(&level.within(&image.folder), request)?;
        let axes = image.axes_of(array.shape().len(), array.names())?;
        let lead = Lead::new(&image, &array, &axes, request.step)?;

        let source = &image.source;
        let layout = Layout::scalar(array.dims()?, array.kind(), Endian::NATIVE);
        let mut chosen = Chosen::new(source, "channels", layout, lead.channels(), request)?;
        let first_alone = lead.channels() > 1 && request.array.is_none() && chosen.layout.pick != Pick::Whole;
        let mut warnings = Vec::new();
        if first_alone {
            chosen.layout.pick = Pick::Component(0);
            let labels = image.channels().join(", ");
            let labels = if labels.is_empty() { labels } else { format!(" ({labels})") };
            let count = lead.channels();
            warnings.push(format!(
                "the first of {count} channels{labels} is shown: name values:1 and so on for others"
            ));
        }
        chosen.unit = unit_of(&axes, &mut warnings);

        let levels = image.coarser();
        let chunks = InChunks::new(array, lead.first, lead.channel, chosen.layout);
        let samples = samples(source, &chosen.layout, chunks, levels, &image.folder, request)?;
        let grid = chosen.grid(samples).map_err(|error| error.in_file(source.path()))?;
        let [origin, spacing] = placement(level);
        let mut notes = lead.notes;
        if image.levels.len() > 1 {
            notes.push(format!("level {} of {}: {}", image.number, image.levels.len(), level.path));
        }
        let placement = Placement {
            place: "scale",
            spacing,
            origin,
            direction: DMat3::IDENTITY,
            anatomy: Anatomy::default(),
            notes,
            warnings,
        };
        chosen.placed(self.name(), grid, placement, &|place, error| match error {
            Error::Invalid { why, .. } => source.error(place, why),
            other => other,
        })
    }
}

/// The indices on the axes before those of space.
struct Lead {
    first: Vec<u64>,
    /// The axis of channels, and their number.
    channel: Option<(usize, u64)>,
    notes: Vec<String>,
}

impl Lead {
    /// Finds the axes: the last three are those of space, one of the others may be time, one channels.
    fn new(image: &Image, array: &Array, axes: &[Axis], step: Option<u32>) -> Result<Self> {
        let (lead, shape) = (&axes[..axes.len() - 3], array.shape());
        let (mut channel, mut notes) = (None, Vec::new());
        let mut first = vec![0; lead.len()];
        let mut timed = false;
        for (i, axis) in lead.iter().enumerate() {
            let count = shape[i];
            let named = format!("axis \"{}\"", axis.name);
            match axis.kind() {
                Kind::Time if !timed => {
                    timed = true;
                    let wanted = u64::from(step.unwrap_or(0));
                    if wanted >= count {
                        let rule = format!("step {wanted}: there are {count} steps of time, counted from 0");
                        return Err(image.source.error(named, rule));
                    }
                    first[i] = wanted;
                    if count > 1 {
                        notes.push(format!("step {wanted} of {count}"));
                    }
                }
                Kind::Channel if channel.is_none() => channel = Some((i, count)),
                _ if count == 1 => {}
                _ => {
                    let rule = format!(
                        "has {count} entries: only one axis of time and one of channels may have several"
                    );
                    return Err(image.source.error(named, rule));
                }
            }
        }
        if let (Some(step), false) = (step, timed) {
            return Err(image.source.error(format!("step {step}"), "this is no series of time steps"));
        }
        Ok(Self { first, channel, notes })
    }

    fn channels(&self) -> usize {
        self.channel.map_or(1, |(_, count)| num::usize_of_u64(count))
    }
}

/// Returns the position of the first sample and the distances, x first.
fn placement(level: &Level) -> [DVec3; 2] {
    let last = |list: &[f64], missing: f64| {
        let [x, y, z] = [1, 2, 3].map(|back| list.len().checked_sub(back).map_or(missing, |at| list[at]));
        DVec3::new(x, y, z)
    };
    [last(&level.translation, 0.0), last(&level.scale, 1.0)]
}

/// Returns the unit of lengths, with a warning where there are several.
fn unit_of(axes: &[Axis], warnings: &mut Vec<String>) -> Unit {
    let space = &axes[axes.len() - 3..];
    let units: Vec<&str> = space.iter().map(|axis| axis.unit.as_deref().unwrap_or_default()).collect();
    if units.iter().any(|unit| *unit != units[0]) {
        warnings.push(format!("axes have several units ({}): all are taken as one", units.join(", ")));
        return Unit::Unknown;
    }
    match units[0] {
        "meter" => Unit::Metre,
        "millimeter" => Unit::Millimetre,
        "micrometer" => Unit::Micrometre,
        _ => Unit::Unknown,
    }
}

/// Reads the samples, or has them read when they are needed, where they are as many as the options say.
fn samples(
    source: &Source,
    layout: &Layout,
    mut chunks: InChunks,
    levels: &[Level],
    folder: &Path,
    options: &ReadOptions,
) -> Result<Values> {
    if stays_in_file(source, "shape", layout, options)?.2 {
        chunks.on_demand(levels, folder, options)?;
        return Ok(Samples::OnDemand(OnDemand::new(layout.dims, chunks)?).into());
    }
    let (count, _) = data_size(source, "shape", layout, options)?;
    let mut values = Values::none(layout.kind, layout.components, layout.pick);
    let full = |_| source.error("shape", format!("{count} samples: memory is full"));
    values.reserve(count).map_err(full)?;
    chunks.append_all(&mut values)?;
    Ok(values)
}
