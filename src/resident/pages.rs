//! A grid in pages (`glsl/grid/pages.glsl`): the pool on the device that holds the pages which rays need, and the page tables that say
//! where. Rays name the pages that they miss; the host loads them between frames.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::gpu::shader::{BRICK_ROW, PAGE, PAGE_BRICKS, PAGE_HELD, PAGE_HIDDEN, PAGE_TEXELS};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, BufferUse, Commands, Gpu, Recorder};
use crate::num;
use crate::resident::bricks::{Bricks, Codes, FindAround, Telling, bricks_of, page_ranges};
use crate::resident::volume::{Form, Volume};
use crate::scene::{Grid, Samples, View};

/// Slots along an axis that a page's word can name.
const MOST_SLOTS: u32 = 256;

/// Returns the number of pages along each axis of a grid.
fn pages_of(dims: [u32; 3]) -> [u32; 3] {
    dims.map(|n| n.saturating_sub(1).div_ceil(PAGE).max(1))
}

/// Returns whether a grid is one page, which needs no less memory in a pool.
pub(crate) fn is_one_page(grid: &Grid) -> bool {
    product(pages_of(grid.dims())) == 1
}

/// Returns the product of extents.
fn product(extents: [u32; 3]) -> u32 {
    extents.iter().fold(1, |n, &extent| n.saturating_mul(extent))
}

/// Returns the place of a number in a box that is x fastest.
fn place_of(number: u32, [across, rows, _]: [u32; 3]) -> [u32; 3] {
    [number % across, number / across % rows, number / across / rows]
}

/// The page table of a transfer function on the device.
#[derive(Debug)]
pub(crate) struct PageTable {
    telling: Telling,
    /// First and last scalar of the transfer function, which infinite samples become.
    ends: [f64; 2],
    /// The word of each page.
    pub(crate) words: Arc<Buffer>,
    /// The bricks of the whole grid. One shows something until it is known that it does not: its page has been read since the table was made, or
    /// was held then, or shows nothing at all.
    pub(crate) bricks: Bricks,
    around: Option<FindAround>,
    codes: Mutex<Codes>,
}

impl PageTable {
    fn codes(&self) -> MutexGuard<'_, Codes> {
        self.codes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The pages of a grid that the device holds.
#[derive(Debug)]
pub(crate) struct PagePool {
    gpu: Gpu,
    grid: Grid,
    form: Form,
    /// The image of the slots.
    pub(crate) volume: Arc<Volume>,
    slots: [u32; 3],
    /// Pages along each axis. Number them x fastest; the copies of all pages (`Form::copies`) follow each other.
    pages: [u32; 3],
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// For each page of each copy 1 and its slot; 0 where it is not held.
    slot_of: Vec<u32>,
    /// The page in each slot.
    page_in: Vec<Option<u32>>,
    /// Ranges of the bricks in each slot.
    bricks_in: Vec<Vec<[f32; 2]>>,
    /// The scalars that infinite samples became in each slot, where there are any: for other transfer functions the page is not held.
    ends_in: Vec<Option<[f64; 2]>>,
    /// The range of scalars of each page that has been read.
    ranges: Vec<Option<[f32; 2]>>,
    tables: Vec<Weak<PageTable>>,
    /// Pages whose words in the tables are not those of this state yet.
    changed: Vec<u32>,
    staging: Arc<Buffer>,
    /// Bytes of samples and number of pages read so far.
    read: [u64; 2],
    // Last, because dropping it waits for the submission that reads the fields above.
    commands: Commands,
}

impl State {
    /// Returns the slot that holds a page for a transfer function with these ends.
    fn slot_with(&self, ends: [f64; 2], page: u32) -> Option<u32> {
        let slot = self.slot_of[num::index(page)].checked_sub(1)?;
        self.ends_in[num::index(slot)].is_none_or(|others| others == ends).then_some(slot)
    }

    /// Frees the slot of a page.
    fn free(&mut self, page: u32) {
        let slot = std::mem::take(&mut self.slot_of[num::index(page)]);
        if let Some(slot) = slot.checked_sub(1) {
            self.page_in[num::index(slot)] = None;
            self.changed.push(page);
        }
    }
}

/// A page that has been read.
struct Page {
    number: u32,
    texels: Vec<u8>,
    bricks: Vec<[f32; 2]>,
    ends: Option<[f64; 2]>,
}

impl Page {
    /// Returns the range of all bricks.
    fn range(&self) -> [f32; 2] {
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        self.bricks.iter().fold(none, |all, brick| [all[0].min(brick[0]), all[1].max(brick[1])])
    }
}

/// The order in which rays of a view meet pages: from page to page, the layer of a ray grows by 1.
///
/// Along each axis a ray only departs from the page of the eye, so the sum of distances along the axes grows.
#[derive(Clone, Debug)]
pub(crate) struct PageOrder {
    /// The page of the eye.
    eye: Option<[i64; 3]>,
    /// Signs of the direction of parallel rays.
    signs: [i64; 3],
    /// The first layer that has pages, and the number of pages in it and those behind.
    first: i64,
    sizes: Vec<u64>,
}

impl PageOrder {
    /// Derives the order from a view of a grid.
    pub(crate) fn new(grid: &Grid, view: &View) -> Self {
        let to_index = grid.index_to_world().inverse();
        let pages = pages_of(grid.dims());
        let at = (to_index * (view.camera().eye - grid.origin()) / f64::from(PAGE)).floor().to_array();
        // From anywhere outside, pages are met in the same order as from beside them.
        let beside =
            |axis: usize| i64::from(num::u32_of(at[axis].clamp(-1.0, f64::from(pages[axis])) + 1.0)) - 1;
        let eye = view.is_perspective().then(|| [0, 1, 2].map(beside));
        let signs = (to_index * view.ahead()).to_array().map(|x| i64::from(x > 0.0) - i64::from(x < 0.0));
        let mut order = Self { eye, signs, first: 0, sizes: vec![1] };
        for (axis, count) in pages.into_iter().enumerate() {
            order.widen(axis, count);
        }
        order
    }

    /// Extends the sizes of layers from a box that is one page wide along an axis to one of so many: each layer of the one becomes a layer for
    /// every page along the axis.
    fn widen(&mut self, axis: usize, count: u32) {
        let along: Vec<i64> = (0..count).map(|place| self.along(axis, i64::from(place))).collect();
        let (Some(&low), Some(&high)) = (along.iter().min(), along.iter().max()) else { return };
        let mut sizes = vec![0; self.sizes.len() + steps(low, high)];
        for &distance in &along {
            let from = steps(low, distance);
            sizes[from..].iter_mut().zip(&self.sizes).for_each(|(sum, size)| *sum += size);
        }
        (self.first, self.sizes) = (self.first + low, sizes);
    }

    fn along(&self, axis: usize, place: i64) -> i64 {
        self.eye.map_or(self.signs[axis] * place, |eye| (place - eye[axis]).abs())
    }

    /// Returns the layer of a page.
    fn layer(&self, place: [u32; 3]) -> i64 {
        (0..3).map(|axis| self.along(axis, i64::from(place[axis]))).sum()
    }

    /// Returns the last layer of those that a pool with so many slots has room for, from a first one on, which it includes in any case.
    fn last(&self, first: i64, slots: u32) -> i64 {
        let mut left = u64::from(slots);
        let sizes = self.sizes.iter().skip(steps(self.first, first));
        let fit = sizes.take_while(|&&size| {
            left.checked_sub(size).is_some_and(|rest| {
                left = rest;
                true
            })
        });
        first + i64::try_from(fit.count().max(1)).unwrap_or(1) - 1
    }
}

/// Returns how many layers after another one a layer is.
fn steps(from: i64, to: i64) -> usize {
    usize::try_from(to - from).unwrap_or(0)
}

impl PagePool {
    /// Makes a pool of at most `bytes`, but at least one page, for a grid, which holds nothing yet.
    pub(crate) fn new(gpu: &Gpu, grid: &Grid, form: Form, bytes: u64) -> Result<Arc<Self>> {
        let pages = pages_of(grid.dims());
        let [across, rows, planes] = bricks_of(grid.dims()).map(u64::from);
        let row = across.next_multiple_of(u64::from(BRICK_ROW));
        if row.saturating_mul(rows).saturating_mul(planes) >= 1 << 31 {
            return Err(Error::unsupported("pages", "grids of less than 2^31 bricks of 8 x 8 x 8 cells"));
        }
        let page_bytes = num::wide(form.page_bytes().next_multiple_of(4));
        let volume_of = |bytes: u64| {
            let most = u32::try_from(bytes / page_bytes).unwrap_or(u32::MAX).max(1);
            let sides = form.pool_sides(gpu).map(|side| side / PAGE_TEXELS);
            let slots = slots_of(product(pages).saturating_mul(form.copies()), most, sides)
                .ok_or_else(|| Error::unsupported("pages", "images are too small for one page"))?;
            Ok((slots, Volume::pool(gpu, grid, form, slots)?))
        };
        // Drivers pad images, and may refuse one allocation of as many bytes as the budget has.
        let least = bytes.min(gpu.promised_bytes()) / 4 * 3;
        let mut room = bytes;
        let (slots, volume) = loop {
            match volume_of(room) {
                Err(Error::Unsupported { .. } | Error::Allocation { .. } | Error::Memory { .. })
                    if room > least =>
                {
                    room = (room / 4 * 3).max(least);
                }
                made => break made?,
            }
        };
        let batch = ((room / 8).min(gpu.staging_bytes()) / page_bytes).max(form.copies().into());
        let staging = Buffer::new(gpu, "pages (staging)", batch * page_bytes, BufferUse::Upload)?;
        let count = num::index(product(pages));
        let state = State {
            slot_of: vec![0; count * num::index(form.copies())],
            page_in: vec![None; num::index(product(slots))],
            bricks_in: vec![Vec::new(); num::index(product(slots))],
            ends_in: vec![None; num::index(product(slots))],
            ranges: vec![None; count],
            tables: Vec::new(),
            changed: Vec::new(),
            staging: Arc::new(staging),
            read: [0; 2],
            commands: Commands::new(gpu)?,
        };
        let (gpu, grid) = (gpu.clone(), grid.clone());
        Ok(Arc::new(Self { gpu, grid, form, volume, slots, pages, state: Mutex::new(state) }))
    }

    /// Returns the number of pages of all copies.
    pub(crate) fn pages(&self) -> u32 {
        product(self.pages) * self.form.copies()
    }

    /// Returns the number that a page has in the first copy.
    fn in_first(&self, page: u32) -> u32 {
        page % product(self.pages)
    }

    /// Returns the copy that a page belongs to.
    fn copy_of(&self, page: u32) -> u32 {
        page / product(self.pages)
    }

    /// Returns the place of a page in the grid.
    fn place(&self, page: u32) -> [u32; 3] {
        place_of(self.in_first(page), self.pages)
    }

    /// Makes the page table of a transfer function, of which these are the first and the last scalar.
    pub(crate) fn table(&self, telling: Telling, ends: [f64; 2]) -> Result<Arc<PageTable>> {
        let mut state = self.state();
        let mut codes = Codes::new(&self.grid, &telling);
        for page in 0..self.pages() {
            self.tell(&state, &telling, &mut codes, page);
        }
        let words: Vec<u32> = (0..self.pages()).map(|page| self.word(&state, &telling, ends, page)).collect();
        let words = Buffer::with_data(&self.gpu, "pages", bytemuck::cast_slice(&words))?;
        let on_device = Buffer::with_data(&self.gpu, "bricks", bytemuck::cast_slice(&codes.words))?;
        let around = match telling {
            Telling::Visible { .. } => {
                Some(FindAround::new(&self.gpu, &on_device, bricks_of(self.grid.dims()))?)
            }
            Telling::Greatest => None,
        };
        if let Some(around) = &around {
            state.commands.run("bricks.around", |recorder| around.record(recorder))?;
        }
        let bricks =
            Bricks { codes: on_device, around: around.as_ref().map(|around| Arc::clone(&around.bits)) };
        let table = Arc::new(PageTable { telling, ends, words, bricks, around, codes: Mutex::new(codes) });
        state.tables.retain(|table| table.strong_count() > 0);
        state.tables.push(Arc::downgrade(&table));
        Ok(table)
    }

    /// Tells the bricks of a page that is held, or in which nothing is visible.
    fn tell(&self, state: &State, telling: &Telling, codes: &mut Codes, page: u32) {
        let first = self.place(page).map(|place| place * PAGE_BRICKS);
        let at = num::index(page);
        if let Some(slot) = state.slot_of[at].checked_sub(1) {
            let ranges = &state.bricks_in[num::index(slot)];
            codes.set(first, [PAGE_BRICKS; 3], |brick| telling.code(ranges[brick]));
        } else if self.hides(state, telling, page) {
            codes.set(first, [PAGE_BRICKS; 3], |_| 0);
        }
    }

    /// Returns whether it is known that nothing is visible in a page.
    fn hides(&self, state: &State, telling: &Telling, page: u32) -> bool {
        state.ranges[num::index(self.in_first(page))].is_some_and(|range| telling.hides(range))
    }

    /// Returns the word of a page.
    fn word(&self, state: &State, telling: &Telling, ends: [f64; 2], page: u32) -> u32 {
        let hidden = if self.hides(state, telling, page) { PAGE_HIDDEN } else { 0 };
        let held = state.slot_with(ends, page).map_or(0, |slot| {
            let [x, y, z] = place_of(slot, self.slots);
            PAGE_HELD | x | y << 8 | z << 16
        });
        hidden | held
    }

    /// Returns the bytes of samples and the number of pages that have been read so far.
    pub(crate) fn read(&self) -> [u64; 2] {
        self.state().read
    }

    /// Loads pages that rays miss, in the order in which rays meet them, as far as there are slots; those that rays have passed, and then
    /// those beyond what there is room for, make room; before them those of copies that are not `drawn`. Returns whether a page is held now that
    /// a ray has missed; another scene may have loaded it. Submits and waits.
    ///
    /// Frames in flight are not disturbed: each submission waits for those before it on the queue.
    pub(crate) fn load(
        &self,
        table: &PageTable,
        wanted: &[u32],
        order: &PageOrder,
        drawn: &[u32],
    ) -> Result<bool> {
        let mut state = self.state();
        let state = &mut *state;
        let layer = |page: u32| order.layer(self.place(page));
        let is_missed = |&page: &u32| page < self.pages() && state.slot_with(table.ends, page).is_none();
        let has_missed = !wanted.is_empty();
        let mut wanted: Vec<u32> = wanted.iter().copied().filter(is_missed).collect();
        wanted.sort_by_key(|&page| (layer(page), self.in_first(page), page));
        wanted.dedup();
        let Some(&first) = wanted.first() else { return Ok(has_missed) };
        let first = layer(first);
        // Only as many layers as there is room for: then no page leaves that a ray of this frame still needs, and each is read once, but for those
        // that other scenes take.
        let last = order.last(first, product(self.slots) / num::count(drawn.len()).max(1));
        wanted.retain(|&page| layer(page) <= last);
        // Those whose infinite samples became other scalars are read anew.
        wanted.iter().for_each(|&page| state.free(page));

        // Slots in the order in which they are given up: free ones, those of copies that are not drawn, those of pages that all rays have passed,
        // hidden ones before others, those behind, the farthest first.
        let tables: Vec<_> = state.tables.iter().filter_map(Weak::upgrade).collect();
        let rank = |page: u32| match layer(page) {
            _ if !drawn.contains(&self.copy_of(page)) => Some((0, 1)),
            at if at > last => Some((3, -at)),
            at if at > first => None,
            at => {
                let hides = |table: &Arc<PageTable>| self.hides(state, &table.telling, page);
                Some((if tables.iter().all(hides) { 1 } else { 2 }, at))
            }
        };
        let mut slots: Vec<(u32, (u32, i64))> = (0..product(self.slots))
            .filter_map(|slot| Some((slot, state.page_in[num::index(slot)].map_or(Some((0, 0)), rank)?)))
            .collect();
        slots.sort_by_key(|&(_, rank)| rank);
        wanted.truncate(slots.len());
        // Where it can, a page takes the slot of its number: pages that follow each other along a row do so in the pool, as in the whole grid.
        let mut open = vec![false; num::index(product(self.slots))];
        for (at, &(slot, rank)) in slots.iter().enumerate() {
            open[num::index(slot)] = at < wanted.len() || rank == (0, 0);
        }
        let mut take = |slot: u32| std::mem::take(&mut open[num::index(slot)]).then_some(slot);
        let places: Vec<_> = wanted.iter().map(|&page| take(self.slot_in_row(page))).collect();
        let mut others = slots.iter().filter_map(|&(slot, _)| take(slot));
        let slots = places.into_iter().filter_map(|slot| slot.or_else(|| others.next()));
        let pairs: Vec<(u32, u32)> = wanted.into_iter().zip(slots).collect();

        let batch = num::usize_of_u64(state.staging.size()) / self.page_bytes();
        let of_one_page: Vec<_> = pairs.chunk_by(|a, b| self.in_first(a.0) == self.in_first(b.0)).collect();
        let most = batch / num::index(self.form.copies());
        for of_one_page in of_one_page.chunks(most.max(1)) {
            let read = |pairs: &&[(u32, u32)]| self.read_copies(pairs, table.ends);
            let pages = of_one_page.par_iter().map(read).collect::<Result<Vec<_>>>()?;
            for (page, _) in pages.iter().filter_map(|copies| copies.first()) {
                state.read[0] += num::wide(page.texels.len());
                state.read[1] += 1;
                state.ranges[num::index(self.in_first(page.number))] = Some(page.range());
            }
            self.upload(state, pages.into_iter().flatten().collect())?;
        }
        Ok(!pairs.is_empty())
    }

    /// Returns the bytes of a page in a staging buffer.
    fn page_bytes(&self) -> usize {
        self.form.page_bytes().next_multiple_of(4)
    }

    /// Reads a page once for all of its copies that come to slots.
    fn read_copies(&self, copies: &[(u32, u32)], ends: [f64; 2]) -> Result<Vec<(Page, u32)>> {
        let Some(&(number, _)) = copies.first() else { return Ok(Vec::new()) };
        let first = self.place(number).map(|place| i64::from(place) * i64::from(PAGE) - 1);
        let samples = self.grid.cube(first, PAGE_TEXELS)?;
        let bricks = page_ranges(&self.grid, &samples);
        let has_infinite =
            matches!(&samples, Samples::F32(all) if all.iter().any(|sample| sample.is_infinite()));
        let copy = |&(number, slot): &(u32, u32)| {
            let samples = self.form.turned_page(&samples, self.copy_of(number));
            let mut texels = vec![0; self.form.page_bytes()];
            self.form.encode(&self.grid, ends, &samples, &mut texels);
            (Page { number, texels, bricks: bricks.clone(), ends: has_infinite.then_some(ends) }, slot)
        };
        Ok(copies.iter().map(copy).collect())
    }

    /// Returns the slot after that of the page before along a row.
    fn slot_in_row(&self, page: u32) -> u32 {
        let copy = self.copy_of(page);
        let [x, y, z] = self.form.turned_place(self.place(page), copy);
        let [across, rows, _] = self.form.turned_place(self.pages, copy);
        (x + across * (y + rows * z) + copy * product(self.pages)) % product(self.slots)
    }

    /// Returns the numbers of all copies of a page.
    fn copies(&self, page: u32) -> impl Iterator<Item = u32> + use<> {
        let (first, all) = (self.in_first(page), product(self.pages));
        (0..self.form.copies()).map(move |copy| first + copy * all)
    }

    /// Puts pages into slots, and changes the tables.
    fn upload(&self, state: &mut State, pages: Vec<(Page, u32)>) -> Result<()> {
        let memory = Arc::get_mut(&mut state.staging).and_then(Buffer::bytes_mut);
        let Some(memory) = memory else {
            return Err(Error::invalid("pages", "staging memory is not visible to the host"));
        };
        let mut places = memory.chunks_exact_mut(self.page_bytes());
        let (mut cubes, mut filled) = (Vec::new(), Vec::new());
        for (page, slot) in pages {
            // What one of them tells to be hidden, all do.
            state.changed.extend(self.copies(page.number));
            let Some(place) = places.next() else { break };
            place[..page.texels.len()].copy_from_slice(&page.texels);
            let corner = place_of(slot, self.slots).map(|place| place * PAGE_TEXELS);
            cubes.push((num::wide(cubes.len() * self.page_bytes()), corner));
            if let Some(old) = state.page_in[num::index(slot)].replace(page.number) {
                state.slot_of[num::index(old)] = 0;
                state.changed.push(old);
            }
            state.slot_of[num::index(page.number)] = slot + 1;
            state.bricks_in[num::index(slot)] = page.bricks;
            state.ends_in[num::index(slot)] = page.ends;
            filled.push(slot);
        }
        let sent = self.send(state, cubes);
        if sent.is_err() {
            // The contents of the slots are unknown then, and the tables of the device are as they were: `changed` stays.
            for slot in filled {
                let page = state.page_in[num::index(slot)].take();
                page.into_iter().for_each(|page| state.slot_of[num::index(page)] = 0);
            }
            return sent;
        }
        state.changed.clear();
        Ok(())
    }

    /// Copies cubes of the staging buffer into the pool, and the words that changed into the tables.
    fn send(&self, state: &mut State, cubes: Vec<(u64, [u32; 3])>) -> Result<()> {
        state.changed.sort_unstable();
        state.changed.dedup();
        let part_of_page = |(i, &page): (usize, &u32)| [4 * num::wide(i), 4 * u64::from(page), 4];
        let pages: Vec<_> = state.changed.iter().enumerate().map(part_of_page).collect();
        let mut changes = Vec::new();
        for table in state.tables.iter().filter_map(Weak::upgrade) {
            let mut codes = table.codes();
            let mut words: Vec<u32> = state
                .changed
                .iter()
                .map(|&page| self.word(state, &table.telling, table.ends, page))
                .collect();
            let mut bricks = Vec::new();
            // Pages that leave keep the codes of their bricks.
            for &page in state.changed.iter().filter(|&&page| state.slot_of[num::index(page)] != 0) {
                self.tell(state, &table.telling, &mut codes, page);
                for span in codes.words_of_page(self.place(page)) {
                    bricks.push([words.len(), span.start, span.len()].map(|n| 4 * num::wide(n)));
                    words.extend(&codes.words[span]);
                }
            }
            let staging = Buffer::staging(&self.gpu, "pages", bytemuck::cast_slice(&words))?;
            drop(codes);
            changes.push((staging, bricks, table));
        }
        let (staging, image) = (&state.staging, &self.volume.image);
        state.commands.run("pages", |recorder: &mut Recorder<'_>| {
            if !cubes.is_empty() {
                recorder.assume_after(image, Use::ComputeSample);
                recorder.copy_buffer_to_cubes("pages", staging, image, PAGE_TEXELS, cubes);
                recorder.release_image(image);
            }
            for (words, bricks, table) in changes {
                for (to, parts) in [(&table.words, pages.clone()), (&table.bricks.codes, bricks)] {
                    recorder.assume_buffer_after(to, Use::ComputeRead);
                    recorder.copy_parts("pages.words", &words, to, parts);
                    recorder.release_buffer(to);
                }
                if let Some(around) = &table.around {
                    recorder.assume_buffer_after(&around.bits, Use::ComputeRead);
                    around.record(recorder);
                }
            }
        })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the slots along each axis of a pool for `wanted` pages: at most `most` in all and so many along each axis, as near to a cube as they
/// can be; `None` where there is none.
fn slots_of(wanted: u32, most: u32, sides: [u32; 3]) -> Option<[u32; 3]> {
    let [across, rows, planes] = sides.map(|side| side.min(MOST_SLOTS));
    let all = wanted.min(most);
    let z = (1..=planes).take_while(|&n| n.saturating_pow(3) <= all).last()?;
    let y = (1..=rows).take_while(|&n| z.saturating_mul(n).saturating_mul(n) <= all).last()?;
    Some([all.div_ceil(z * y).min(most / (z * y)).min(across), y, z]).filter(|slots| slots[0] > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_fill_a_box_within_the_limits() {
        let all = u32::MAX;
        assert_eq!(slots_of(all, 1, [30; 3]), Some([1, 1, 1]));
        assert_eq!(slots_of(all, 3500, [30; 3]), Some([15, 15, 15]));
        assert_eq!(slots_of(all, 1 << 30, [30; 3]), Some([30; 3]));
        assert_eq!(slots_of(all, 5, [0; 3]), None);
        assert_eq!(slots_of(all, 5000, [90, 90, 7]), Some([27, 26, 7]));
        for most in 1..3000 {
            let slots = slots_of(all, most, [64; 3]).unwrap();
            let [x, _, z] = slots;
            let n = product(slots);
            assert!(n <= most && 4 * n >= 3 * most.min(8) && x <= 3 * z.max(2), "{most}: {slots:?}");
            // All that are wanted, where there is room.
            let slots = slots_of(most, 2 * most, [64; 3]).unwrap();
            assert!((most..=2 * most).contains(&product(slots)), "{most}: {slots:?}");
        }
    }
}
