//! The capacities that a view needs, measured before its first frame.

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::frame::lists::fragments::{Band, Lists, cut_into_bands, entry_words};
use crate::frame::lists::ranking::Ranking;
use crate::gpu::shader::{TILE, TILE_PIXELS};
use crate::gpu::{Commands, Gpu, Recorder};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::{Bins, Fill, MOST_ENTRIES, with_margin};
use crate::primitives::dispatch::{download, words};
use crate::resident::mesh::Needs;

/// Returns an entry count as 32 bits.
///
/// # Errors
///
/// [`Error::Unsupported`] where it does not fit.
fn in_one_frame(name: &str, what: &str, n: u64) -> Result<u32> {
    u32::try_from(n)
        .map_err(|_| Error::unsupported(format!("{name} of this view"), format!("{n} {what} in one frame")))
}

/// The capacities of a view, with its bins.
#[derive(Debug)]
pub(crate) struct Measured {
    pub(crate) needs: Needs,
    pub(crate) bins: Arc<Bins>,
    /// Tiles whose bins or lists fit a buffer together.
    pub(crate) bands: Vec<Band>,
}

/// Largest number of tiles of a band: prefix sums over their pixels take no more words.
const MOST_TILES: u32 = 1 << 21;

/// Entries of the lists of flagged pixels before a frame has told how many there are.
const FLAGGED_ENTRIES: u32 = 1 << 14;

/// Largest number of entries of the lists of a band. A fifth of the buffer and 64 entries stay free for the margin of nearby views.
fn most_entries(gpu: &Gpu, ranking: &Ranking) -> u64 {
    let most = u64::from(gpu.limits().max_storage_buffer_range) / 4 / entry_words(ranking.kind);
    (most - most / 5).saturating_sub(64)
}

/// Counts the bins of a view on the device. `known` holds what earlier frames needed; capacities do not go below it.
fn measure_bins(
    gpu: &Gpu,
    ranking: &Ranking,
    known: &Mutex<Needs>,
    push: &MeshPush,
    tiles: [u32; 2],
) -> Result<(Needs, Fill)> {
    let name = ranking.name;
    let fill = Fill::measure(gpu, name, &ranking.ranked(), tiles, |recorder| {
        ranking.record(recorder, push);
    })?;
    let known = *known.lock().unwrap_or_else(PoisonError::into_inner);
    let needs = Needs {
        bins: known.bins,
        longest_bin: with_margin(fill.longest().max(known.longest_bin)),
        lists: known.lists,
        listed_per_pair: known.listed_per_pair,
        rounds: known.rounds.max(1),
        overlaps: known.overlaps,
    };
    Ok((needs, fill))
}

/// Measures what a view needs whose pixels are all drawn from lists: capacities of bins and lists, and bands. Bins and lists are counted
/// once on the device.
///
/// # Errors
///
/// [`Error::Unsupported`] where bins or lists exceed 32 bits, or the lists of one tile exceed a buffer.
pub(crate) fn measure(
    gpu: &Gpu,
    ranking: &Ranking,
    known: &Mutex<Needs>,
    push: &MeshPush,
    [tiles, across]: [u32; 2],
) -> Result<Measured> {
    let (mut needs, fill) = measure_bins(gpu, ranking, known, push, [tiles, across])?;
    let entries = in_one_frame(ranking.name, "entries of bins", fill.entries())?;
    needs.bins = with_margin(entries.max(needs.bins.min(MOST_ENTRIES)));
    let bins = ranking.bins(gpu, tiles, needs.bins, false)?;
    measure_lists(gpu, ranking, push, needs, bins)
}

/// Measures what a view needs of which only flagged pixels are drawn from lists: bins are made band by band. How many fragments are listed is
/// known from earlier frames. With `flagged` the bins are for the lists alone.
///
/// # Errors
///
/// [`Error::Unsupported`] where the primitives of one tile exceed a buffer.
pub(crate) fn measure_flagged(
    gpu: &Gpu,
    ranking: &Ranking,
    known: &Mutex<Needs>,
    push: &MeshPush,
    [tiles, across]: [u32; 2],
    flagged: bool,
) -> Result<Measured> {
    let (mut needs, fill) = measure_bins(gpu, ranking, known, push, [tiles, across])?;
    let bytes = u64::from(gpu.limits().max_storage_buffer_range);
    // Masks and hits take 8 bytes a pair.
    let hard = (bytes / 8 - bytes / 40).saturating_sub(96).min(MOST_ENTRIES.into());
    let most_listed = most_entries(gpu, ranking);
    let soft = hard.min(most_listed / u64::from(needs.listed_per_pair.max(1)));
    let widest =
        u32::try_from(bytes / 4 / u64::from(TILE_PIXELS)).unwrap_or(u32::MAX).min(MOST_TILES).min(tiles);
    let entries = fill.tiles.iter().map(|&entries| u64::from(entries));
    let (bands, fullest) = cut_into_bands(entries, [soft, hard], widest).map_err(|count| {
        Error::unsupported(
            format!("{} of this view", ranking.name),
            format!("{count} primitives in one tile of {TILE} pixels; {hard} fit a buffer"),
        )
    })?;
    let in_32_bits = |entries: u64| u32::try_from(entries).unwrap_or(u32::MAX);
    let known = if bands.len() == 1 { needs.bins.min(in_32_bits(soft)) } else { 0 };
    needs.bins = with_margin(in_32_bits(fullest).max(known));
    needs.lists = with_margin(needs.lists).max(FLAGGED_ENTRIES).min(in_32_bits(most_listed));
    let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
    let bins = ranking.bins(gpu, widest, needs.bins, flagged)?;
    Ok(Measured { needs, bins, bands })
}

/// Counts the fragments of a view's bins, and cuts it into bands.
fn measure_lists(
    gpu: &Gpu,
    ranking: &Ranking,
    push: &MeshPush,
    mut needs: Needs,
    bins: Arc<Bins>,
) -> Result<Measured> {
    let (name, tiles, known) = (ranking.name, bins.tiles, needs.lists);
    needs.lists = 1;
    let most_words = u64::from(gpu.limits().max_storage_buffer_range) / 4;
    let widest =
        u32::try_from(most_words / u64::from(TILE_PIXELS)).unwrap_or(u32::MAX).min(MOST_TILES).min(tiles);
    let trial: Vec<Band> = (0..tiles)
        .step_by(num::index(widest))
        .map(|first| Band { first, tiles: widest.min(tiles - first) })
        .collect();
    let lists = Lists::new(gpu, ranking, Arc::clone(&bins), trial, needs, None)?;
    let fragments = count_fragments(gpu, ranking, &lists, push)?;
    let most = most_entries(gpu, ranking);
    let (bands, fullest) = cut_into_bands(fragments, [most; 2], widest).map_err(|count| {
        Error::unsupported(
            format!("{name} of this view"),
            format!("{count} fragments in one tile of {TILE} pixels; {most} fit a buffer"),
        )
    })?;
    needs.lists = with_margin(in_one_frame(name, "fragments", fullest)?);
    if bands.len() == 1 {
        needs.lists = needs.lists.max(known.min(num::u32_of(num::f64_of_u64(most))));
    }
    Ok(Measured { needs, bins, bands })
}

/// Counts the fragments of each tile on the device, band by band.
fn count_fragments(gpu: &Gpu, ranking: &Ranking, lists: &Lists, push: &MeshPush) -> Result<Vec<u64>> {
    let mut commands = Commands::new(gpu)?;
    let mut fragments = Vec::with_capacity(num::index(lists.bins.tiles));
    for (i, band) in lists.bands.iter().enumerate() {
        let bytes = 4 * u64::from(band.tiles) * u64::from(TILE_PIXELS);
        let host = download(gpu, "fragments", bytes)?;
        let keep = {
            let mut recorder = Recorder::new(gpu, commands.begin()?, None);
            ranking.record(&mut recorder, push);
            lists.bin(&mut recorder, push);
            recorder.clear_buffer("lists.clear", &lists.cursors);
            lists.list(&mut recorder, push, i, false);
            recorder.copy_buffer("fragments", &lists.cursors, &host, bytes);
            recorder.release_to_host(&host);
            recorder.finish()?.1
        };
        commands.submit(keep, ranking.name)?;
        let counts = words(&host.host_copy()?);
        let tiles = counts.chunks_exact(num::index(TILE_PIXELS));
        fragments.extend(tiles.map(|tile| tile.iter().map(|&n| u64::from(n)).sum::<u64>()));
    }
    Ok(fragments)
}
