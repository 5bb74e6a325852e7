//! Bands of tiles whose bins fit a buffer, and passes over them that may take several dispatches.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::lists::{Band, cut_into_bands};
use crate::gpu::shader::TILE;
use crate::gpu::{Bound, Buffer, Gpu, Groups, Recorder};
use crate::interface::SplatPush;
use crate::num;
use crate::primitives::bins::{Bins, Fill, MOST_ENTRIES, with_margin};
use crate::primitives::dispatch::{Dispatch, groups_of, pass};
use crate::resident::GpuScene;
use crate::technique::splat::options::TileOptions;
use crate::technique::splat::outcome::SplatOutcome;

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

/// A step of drawing a band's bins.
#[derive(Debug)]
pub(super) enum Step {
    /// A pass over them.
    Bins(Arc<Rounds>),
    /// A pass over the pixels' own state, in one dispatch.
    Pixels(Dispatch),
}

/// Returns the bands of at most `widest` tiles whose bins fit a buffer, and the capacity that the fullest needs.
pub(super) fn bands_of(
    gpu: &Gpu,
    name: &str,
    options: &TileOptions,
    fill: &Fill,
    known: u32,
    widest: u32,
) -> Result<(Vec<Band>, u32)> {
    // A fifth of the buffer and 192 entries stay free for the margin of nearby views.
    let room = |bytes: u64| (bytes / 4 - bytes / 20).saturating_sub(192);
    let given = options.pairs.unwrap_or(u32::MAX).min(MOST_ENTRIES);
    // Bands fit what a descriptor shows; one tile may need more.
    let [most, in_tile] = [gpu.limits().max_storage_buffer_range.into(), gpu.most_buffer_bytes()]
        .map(|bytes| room(bytes).min(given.into()));
    let entries = fill.tiles.iter().map(|&entries| u64::from(entries));
    let (bands, fullest) = cut_into_bands(entries, [most, in_tile], widest).map_err(|entries| {
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

/// The pixels of a band whose splats did not come nearly in order, and the pass that draws them again.
#[derive(Debug)]
pub(super) struct Repair {
    /// Workgroups, number and places; then where each goes on.
    pub(super) pixels: Arc<Buffer>,
    pub(super) draw: Rounds,
}

/// The passes that bin splats and draw the bins, for one band of tiles after the other.
#[derive(Debug)]
pub(super) struct BandedDraw {
    pub(super) bins: Bins,
    pub(super) bands: Vec<Band>,
    /// Tiles in a row.
    pub(super) across: u32,
    /// The steps that draw a band's bins, one after the other.
    pub(super) steps: Vec<Step>,
    /// Draws again the pixels that are listed.
    pub(super) repair: Option<Repair>,
    /// Dispatches for each band.
    pub(super) rounds: u32,
}

impl BandedDraw {
    /// Makes the buffers of the outcome of a frame with at most so many bands.
    pub(super) fn outcome(
        &self,
        scene: &Arc<GpuScene>,
        name: &'static str,
        splats: u32,
        bands: usize,
    ) -> Result<Arc<SplatOutcome>> {
        let counts = [self.bins.capacity, self.rounds, splats];
        SplatOutcome::new(scene, name, bands, counts, self.repair.is_some()).map(Arc::new)
    }

    /// Returns counts of work that are known before a frame is drawn.
    pub(super) fn counters(&self) -> Vec<(&'static str, u64)> {
        self.counters_of(&self.bands)
    }

    /// Returns the same for a frame with other bands.
    pub(super) fn counters_of<'b>(
        &self,
        bands: impl IntoIterator<Item = &'b Band>,
    ) -> Vec<(&'static str, u64)> {
        let tiles: Vec<u64> = bands.into_iter().map(|band| band.tiles.into()).collect();
        vec![("tiles", tiles.iter().sum()), ("bands", num::wide(tiles.len())), ("rounds", self.rounds.into())]
    }

    /// Records passes that make the pixels of some bands transparent: those that draw bins, which are empty.
    pub(super) fn record_empty(&self, recorder: &mut Recorder<'_>, push: SplatPush, bands: &[Band]) {
        recorder.clear_buffer("bins.ends.clear", &self.bins.ends);
        for band in bands {
            let push = SplatPush { band: band.first, tiles: band.tiles, ..push };
            for step in &self.steps {
                if let Step::Bins(rounds) = step {
                    rounds.record(recorder, push, 1, &Groups::Fixed(groups_of(band.tiles, 1)));
                }
            }
        }
    }

    /// Records a frame: `stage`, which ranks splats, then all passes, and copies of what they count.
    pub(super) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        push: SplatPush,
        status: &Arc<Buffer>,
        outcome: &SplatOutcome,
        stage: impl FnOnce(&mut Recorder<'_>),
    ) {
        recorder.clear_buffer("status.clear", status);
        stage(recorder);
        self.record_bands(recorder, push, (&self.bands, 0), outcome);
        outcome.record_status(recorder, status);
    }

    /// Records the passes over some bands, of which the first has a number among those of the outcome.
    pub(super) fn record_bands(
        &self,
        recorder: &mut Recorder<'_>,
        push: SplatPush,
        (bands, first): (&[Band], usize),
        outcome: &SplatOutcome,
    ) {
        for (i, (band, total)) in (first..).zip(bands.iter().zip(&outcome.bins[first..])) {
            self.bins.record(recorder, self.across, [band.first, band.tiles]);
            recorder.copy_buffer("bins.total", self.bins.total(), total, 8);
            recorder.release_to_host(total);
            let push = SplatPush { band: band.first, tiles: band.tiles, ..push };
            let tiles = Groups::Fixed(groups_of(band.tiles, 1));
            let draw = |recorder: &mut Recorder<'_>| {
                for step in &self.steps {
                    match step {
                        Step::Bins(rounds) => rounds.record(recorder, push, self.rounds, &tiles),
                        Step::Pixels(pass) => pass.record(recorder, &push, tiles.clone()),
                    }
                }
            };
            if let Some((repair, count)) = self.repair.as_ref().zip(outcome.repaired.get(i)) {
                recorder.clear_start("pixels.clear", &repair.pixels, count.size());
                draw(recorder);
                recorder.copy_buffer("pixels.count", &repair.pixels, count, count.size());
                recorder.release_to_host(count);
                let listed = Groups::Counted(Arc::clone(&repair.pixels));
                repair.draw.record(recorder, push, self.rounds, &listed);
            } else {
                draw(recorder);
            }
        }
    }
}
