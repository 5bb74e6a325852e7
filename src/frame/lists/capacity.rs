//! The capacities that a view needs, measured before its first frame.

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::frame::lists::bands::{Band, cut_into_bands};
use crate::frame::lists::fragments::{Lists, entry_words};
use crate::frame::lists::hits::Hits;
use crate::frame::lists::ranking::Ranking;
use crate::gpu::shader::{TILE, TILE_PIXELS};
use crate::gpu::{Commands, Gpu};
use crate::interface::MeshPush;
use crate::primitives::bins::{Bins, Fill, MOST_ENTRIES, with_margin};
use crate::primitives::dispatch::{download, total};
use crate::resident::mesh::Needs;

/// The capacities of a view, with its bins.
#[derive(Debug)]
pub(crate) struct Measured<B = Vec<Band>> {
    pub(crate) needs: Needs,
    pub(crate) bins: Arc<Bins>,
    /// Tiles whose bins fit a buffer together.
    pub(crate) bands: B,
}

/// Largest number of tiles of a band: prefix sums over their pixels take no more words.
const MOST_TILES: u32 = 1 << 21;

/// Entries of the lists of flagged pixels before a frame has told how many there are.
const FLAGGED_ENTRIES: u32 = 1 << 14;

/// Largest number of entries of the lists of a band. A fifth of the buffer and 192 entries stay free for the margin of nearby views.
fn most_entries(gpu: &Gpu, ranking: &Ranking) -> u64 {
    let most = u64::from(gpu.limits().max_storage_buffer_range) / 4 / entry_words(ranking.kind);
    (most - most / 5).saturating_sub(192)
}

/// Measures what a view needs: bins are made band by band. How many fragments of flagged pixels are listed is known from earlier frames:
/// `known` holds what they needed. With `flagged` the bins are for the lists alone.
///
/// # Errors
///
/// [`Error::Unsupported`] where the primitives of one tile exceed a buffer.
pub(crate) fn measure(
    gpu: &Gpu,
    ranking: &Ranking,
    known: &Mutex<Needs>,
    push: &MeshPush,
    [tiles, across]: [u32; 2],
    flagged: bool,
) -> Result<Measured> {
    let fill = Fill::measure(gpu, ranking.name, &ranking.ranked(), [tiles, across], |recorder| {
        ranking.record(recorder, push);
    })?;
    let Measured { needs, bins, mut bands } = measured(gpu, ranking, known, &[fill], tiles, flagged)?;
    Ok(Measured { needs, bins, bands: bands.pop().unwrap_or_default() })
}

/// Finds the bands of each of several sets of primitives that are drawn one after the other, from the entries of their bins, and makes bins
/// that hold any of the sets.
///
/// # Errors
///
/// As [`measure`].
pub(crate) fn measured(
    gpu: &Gpu,
    ranking: &Ranking,
    known: &Mutex<Needs>,
    fills: &[Fill],
    tiles: u32,
    flagged: bool,
) -> Result<Measured<Vec<Vec<Band>>>> {
    let mut needs = *known.lock().unwrap_or_else(PoisonError::into_inner);
    let longest = fills.iter().map(Fill::longest).max().unwrap_or(0);
    needs.longest_bin = with_margin(longest.max(needs.longest_bin));
    needs.rounds = needs.rounds.max(1);
    let bytes = u64::from(gpu.limits().max_storage_buffer_range);
    // Masks and hits take 8 bytes a pair. Bands fit what a descriptor shows; one tile may need more.
    let room = |bytes: u64| (bytes / 8 - bytes / 40).saturating_sub(192).min(MOST_ENTRIES.into());
    let (bound, hard) = (room(bytes), room(gpu.most_buffer_bytes()));
    let most_listed = most_entries(gpu, ranking);
    // Bands are as large as bins allow, until a frame has had more fragments to list than fit a buffer.
    let too_many = u64::from(needs.lists) > most_listed;
    let soft =
        if too_many { bound.min(most_listed / u64::from(needs.listed_per_pair.max(1))) } else { bound };
    let widest =
        u32::try_from(bytes / 4 / u64::from(TILE_PIXELS)).unwrap_or(u32::MAX).min(MOST_TILES).min(tiles);
    let bands_of = |fill: &Fill| {
        let entries = fill.tiles.iter().map(|&entries| u64::from(entries));
        cut_into_bands(entries, [soft, hard], widest).map_err(|count| {
            Error::unsupported(
                format!("{} of this view", ranking.name),
                format!("{count} primitives in one tile of {TILE} pixels; {hard} fit a buffer"),
            )
        })
    };
    let found = fills.iter().map(bands_of).collect::<Result<Vec<_>>>()?;
    let fullest = found.iter().map(|(_, fullest)| *fullest).max().unwrap_or(0);
    let bands: Vec<Vec<Band>> = found.into_iter().map(|(bands, _)| bands).collect();
    let in_32_bits = |entries: u64| u32::try_from(entries).unwrap_or(u32::MAX);
    let known = if bands.iter().all(|bands| bands.len() == 1) { needs.bins.min(in_32_bits(soft)) } else { 0 };
    needs.bins = with_margin(in_32_bits(fullest).max(known));
    needs.lists = with_margin(needs.lists).max(FLAGGED_ENTRIES).min(in_32_bits(most_listed));
    let widest = bands.iter().flatten().map(|band| band.tiles).max().unwrap_or(1);
    let bins = ranking.bins(gpu, widest, needs.bins, flagged)?;
    Ok(Measured { needs, bins, bands })
}

/// Counts the fragments of all pixels of a view that is one band, and returns the capacity of lists of them.
///
/// # Errors
///
/// [`Error::Unsupported`] where they exceed a buffer.
pub(crate) fn measure_lists(
    gpu: &Gpu,
    ranking: &Ranking,
    hits: &Hits,
    push: &MeshPush,
    band: Band,
    known: u32,
) -> Result<u32> {
    let lists = Lists::new(gpu, ranking, hits, vec![band], 1, None)?;
    let host = download(gpu, "lists.total", 8)?;
    Commands::new(gpu)?.run(ranking.name, |recorder| {
        ranking.record(recorder, push);
        hits.record(recorder, push, band, None);
        lists.record_count(recorder, push, band, false);
        lists.record_places(recorder, 0, Some(&host));
    })?;
    let (count, most) = (total(&host)?, most_entries(gpu, ranking));
    match u32::try_from(count) {
        Ok(entries) if count <= most => {
            let most = u32::try_from(most).unwrap_or(u32::MAX);
            Ok(with_margin(entries).max(known.min(most)))
        }
        _ => Err(Error::unsupported(
            format!("{} of this view", ranking.name),
            format!("{count} fragments; {most} fit a buffer"),
        )),
    }
}
