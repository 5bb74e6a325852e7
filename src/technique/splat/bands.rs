//! Bands of tiles whose bins fit a buffer, and passes over them that may take several dispatches.

use crate::error::{Error, Result};
use crate::frame::lists::{Band, cut_into_bands};
use crate::gpu::shader::TILE;
use crate::gpu::{Bound, Gpu, Groups, Recorder};
use crate::interface::SplatPush;
use crate::primitives::bins::{Fill, MOST_ENTRIES, with_margin};
use crate::primitives::dispatch::{Dispatch, pass};
use crate::technique::splat::options::TileOptions;

/// A pass that may take several dispatches.
#[derive(Debug)]
pub(super) struct Rounds {
    /// Draws from the beginning.
    first: Dispatch,
    /// Draws from where the dispatch before ended, where that takes another pipeline.
    resume: Option<Dispatch>,
}

impl Rounds {
    pub(super) fn new(gpu: &Gpu, name: &str, rounds: u32, bind: impl Fn(bool) -> Bound) -> Result<Self> {
        let first = pass(gpu, name, &bind(false))?;
        let resume = if rounds > 1 { Some(pass(gpu, &format!("{name}.resume"), &bind(true))?) } else { None };
        Ok(Self { first, resume })
    }

    /// Records the dispatches; only the last counts what is unfinished.
    pub(super) fn record(&self, recorder: &mut Recorder<'_>, push: SplatPush, rounds: u32, groups: &Groups) {
        for round in 0..rounds {
            let pass = self.resume.as_ref().filter(|_| round > 0).unwrap_or(&self.first);
            let marks = u32::from(round + 1 == rounds) << 31 | u32::from(round > 0) << 30;
            let push = SplatPush { turns: push.turns | marks, ..push };
            pass.record(recorder, &push, groups.clone());
        }
    }
}

/// Returns the bands whose bins fit a buffer, and the capacity that the fullest needs.
pub(super) fn bands_of(
    gpu: &Gpu,
    name: &str,
    options: &TileOptions,
    fill: &Fill,
    known: u32,
) -> Result<(Vec<Band>, u32)> {
    // A fifth of the buffer and 192 entries stay free for the margin of nearby views.
    let room = |bytes: u64| (bytes / 4 - bytes / 20).saturating_sub(192);
    let given = options.pairs.unwrap_or(u32::MAX).min(MOST_ENTRIES);
    // Bands fit what a descriptor shows; one tile may need more.
    let [most, in_tile] = [gpu.limits().max_storage_buffer_range.into(), gpu.most_buffer_bytes()]
        .map(|bytes| room(bytes).min(given.into()));
    let entries = fill.tiles.iter().map(|&entries| u64::from(entries));
    let (bands, fullest) = cut_into_bands(entries, [most, in_tile], u32::MAX).map_err(|entries| {
        Error::unsupported(
            format!("{name} of this view"),
            format!("{entries} splats in one tile of {TILE} pixels; {in_tile} fit"),
        )
    })?;
    let fullest = u32::try_from(fullest).unwrap_or(u32::MAX);
    let known = if bands.len() == 1 { known.min(u32::try_from(most).unwrap_or(u32::MAX)) } else { 0 };
    let capacity = with_margin(fullest.max(known));
    Ok((bands, capacity))
}
