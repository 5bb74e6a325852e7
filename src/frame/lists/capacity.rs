//! The capacities that a view needs, measured before its first frame.

use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::frame::lists::fragments::{Band, Lists, cut_into_bands, entry_words};
use crate::frame::lists::ranking::Ranking;
use crate::gpu::shader::{TILE, TILE_PIXELS};
use crate::gpu::{Commands, Gpu, Recorder};
use crate::interface::MeshPush;
use crate::num;
use crate::primitives::bins::Fill;
use crate::primitives::dispatch::{download, words};
use crate::resident::mesh::Needs;

/// Adds a quarter and 64 entries, so that nearby views need no larger buffers.
fn with_margin(need: u32) -> u32 {
    need.saturating_add(need / 4).saturating_add(64)
}

/// Returns an entry count as 32 bits.
///
/// # Errors
///
/// [`Error::Unsupported`] where it does not fit.
fn in_one_frame(name: &str, what: &str, n: u64) -> Result<u32> {
    u32::try_from(n)
        .map_err(|_| Error::unsupported(format!("{name} of this view"), format!("{n} {what} in one frame")))
}

/// Measures what a view needs: runs of ranks, capacities of bins and lists, and bands.
///
/// Bins and lists are counted once on the device, and not kept. `known` holds what earlier frames needed; capacities
/// do not go below it.
///
/// # Errors
///
/// [`Error::Unsupported`] where bins or lists exceed 32 bits, or the lists of one tile exceed a buffer.
pub(crate) fn measure(
    gpu: &Gpu,
    ranking: &Ranking,
    known: &Mutex<Needs>,
    push: &MeshPush,
    tiles: u32,
    across: u32,
) -> Result<(u32, Needs, Vec<Band>)> {
    let Ranking { name, order, boxed, count, .. } = ranking;
    let fill = Fill::measure(gpu, name, [order, boxed], *count, [tiles, across], |recorder| {
        ranking.record(recorder, push);
    })?;
    let known = *known.lock().unwrap_or_else(PoisonError::into_inner);
    let mut needs = Needs {
        bins: with_margin(in_one_frame(name, "entries of bins", fill.entries())?.max(known.bins)),
        longest_bin: with_margin(fill.longest().max(known.longest_bin)),
        lists: 1,
        rounds: known.rounds.max(1),
        overlaps: known.overlaps,
    };

    let most_words = u64::from(gpu.limits().max_storage_buffer_range) / 4;
    let widest = u32::try_from(most_words / u64::from(TILE_PIXELS)).unwrap_or(u32::MAX).min(tiles);
    let trial: Vec<Band> = (0..tiles)
        .step_by(num::index(widest))
        .map(|first| Band { first, tiles: widest.min(tiles - first) })
        .collect();
    let lists = Lists::new(gpu, ranking, tiles, fill.runs, trial, needs, None)?;
    let fragments = count_fragments(gpu, ranking, &lists, push)?;

    // A fifth of the buffer and 64 entries stay free for the margin of nearby views.
    let most = most_words / entry_words(ranking.kind);
    let most = most - most / 5 - 64;
    let (bands, fullest) = cut_into_bands(fragments, most, widest).map_err(|count| {
        Error::unsupported(
            format!("{name} of this view"),
            format!("{count} fragments in one tile of {TILE} pixels; {most} fit a buffer"),
        )
    })?;
    needs.lists = with_margin(in_one_frame(name, "fragments", fullest)?);
    if bands.len() == 1 {
        needs.lists = needs.lists.max(known.lists.min(num::u32_of(num::f64_of_u64(most))));
    }
    Ok((fill.runs, needs, bands))
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
            lists.bin(&mut recorder, push, ranking.count);
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
