//! The march through a grid in pages (`glsl/grid/paging.glsl`): a ray stops where it misses a page, which the host loads between recordings,
//! and goes on in the next one. The image is that of the whole grid once every ray has ended, whatever the pool holds at a time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};
use crate::frame::prepared::{ErrorBound, Outcome};
use crate::gpu::shader::{
    self, MARCH_RESUMES, MARCH_SAME_PAGES, WANTED_COUNT, WANTED_FIRST, WANTED_GREATEST, WANTED_MOST,
    WANTED_SQUARES, WANTED_UNFINISHED,
};
use crate::gpu::{Buffer, Recorder};
use crate::interface::RayState;
use crate::num;
use crate::primitives::dispatch::{buffer, download, words};
use crate::resident::GpuScene;
use crate::resident::bricks::Bricks;
use crate::resident::pages::{PageOrder, PagePool, PageTable};
use crate::resident::volume::Form;
use crate::scene::View;

/// The words that the host reads after a recording.
const READ_BYTES: u64 = 4 * (WANTED_FIRST + WANTED_MOST) as u64;

/// The pages of a frame.
#[derive(Debug)]
pub(crate) struct Paging {
    pool: Arc<PagePool>,
    table: Arc<PageTable>,
    /// The pages that rays have missed, on the device.
    wanted: Arc<Buffer>,
    /// How far each ray has come.
    rays: Arc<Buffer>,
    missed: Arc<Missed>,
    view: View,
    order: PageOrder,
    /// Whether the next recording goes on with the image of the last one.
    resumes: AtomicBool,
    /// Whether the view has changed since the last recording.
    turned: AtomicBool,
}

/// The pages that the rays of a recording have missed, for the host.
#[derive(Debug)]
struct Missed {
    read: Arc<Buffer>,
    pool: Arc<PagePool>,
    rays: u64,
    /// Whether the rays are those of pixels, and not of an image from which they are interpolated.
    of_pixels: bool,
    /// The greatest component of colour and opacity that a pixel may still get where the transmittance of rays is 1.
    most: f64,
}

impl Paging {
    /// Makes the buffers of a frame with so many rays, `of_pixels` or of an image from which pixels are interpolated. Bricks tell their greatest
    /// scalars without a margin.
    pub(crate) fn new(
        scene: &GpuScene,
        name: &str,
        form: Form,
        margin: Option<f32>,
        view: &View,
        rays: u64,
        of_pixels: bool,
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let pool = scene.page_pool(form)?;
        let table = scene.page_table(form, margin)?;
        let words = u64::from(WANTED_FIRST + WANTED_MOST) + u64::from(pool.pages());
        let wanted = buffer(gpu, &format!("{name}.wanted"), words)?;
        let states = buffer(gpu, &format!("{name}.rays"), num::wide(size_of::<RayState>()) / 4 * rays)?;
        let read = download(gpu, &format!("{name}.missed"), READ_BYTES)?;
        // The positive weights of a bicubic interpolation have a sum of 1.282 at most.
        let most = scene.max_colour() * if of_pixels { 1.0 } else { 1.29 };
        let missed = Arc::new(Missed { read, pool: Arc::clone(&pool), rays, of_pixels, most });
        let order = PageOrder::new(scene.grid()?, view);
        Ok(Self {
            pool,
            table,
            wanted,
            rays: states,
            missed,
            view: *view,
            order,
            resumes: AtomicBool::new(false),
            turned: AtomicBool::new(false),
        })
    }

    /// Returns the bricks of the grid.
    pub(crate) fn bricks(&self) -> &Bricks {
        &self.table.bricks
    }

    /// Returns the inputs of look-ups; `unread` stands in where the grid is whole.
    pub(crate) fn pages(paging: Option<&Self>, unread: &Arc<Buffer>) -> shader::Pages {
        let words = paging.map_or(unread, |paging| &paging.table.words);
        shader::Pages { pages: words.read(), paged: paging.is_some() }
    }

    /// Refuses what does not draw a grid in pages, and names what does.
    pub(crate) fn refused(name: &str, what: &str, instead: &str) -> Error {
        let why = format!("device memory for the whole grid; {instead} draws grids in pages");
        Error::unsupported(format!("{name} {what}"), why)
    }

    /// Returns the inputs of a march; `unwritten` stands in where the grid is whole.
    pub(crate) fn march(paging: Option<&Self>, unwritten: &Arc<Buffer>) -> shader::Paging {
        let [wanted, rays] = paging.map_or([unwritten; 2], |paging| [&paging.wanted, &paging.rays]);
        shader::Paging { wanted: wanted.write(), rays: rays.write() }
    }

    /// Changes to another view.
    pub(crate) fn set_view(&mut self, scene: &GpuScene, view: &View) -> Result<()> {
        if self.view != *view {
            self.order = PageOrder::new(scene.grid()?, view);
            self.view = *view;
            (self.resumes, self.turned) = (AtomicBool::new(false), AtomicBool::new(true));
        }
        Ok(())
    }

    /// Returns whether the next recording goes on with the image of the last one.
    pub(crate) fn resumes(&self) -> bool {
        self.resumes.load(Ordering::Relaxed)
    }

    /// Records what comes before the march. Returns whether that goes on with the image of the last recording.
    pub(crate) fn record_begin(&self, recorder: &mut Recorder<'_>, name: &str) -> bool {
        recorder.clear_buffer(&format!("{name}.wanted.clear"), &self.wanted);
        if !recorder.records() {
            return false;
        }
        self.turned.store(false, Ordering::Relaxed);
        self.resumes.swap(false, Ordering::Relaxed)
    }

    /// Returns the bits of the order of a march's dispatch: the first, or one of the parts behind it.
    pub(crate) fn march_order(resumes: bool, part: u32) -> u32 {
        match (resumes, part) {
            (false, 0) => 0,
            (true, 0) => MARCH_RESUMES,
            _ => MARCH_RESUMES | MARCH_SAME_PAGES,
        }
    }

    /// Records what comes before each dispatch of the march: rays that have not ended by then note themselves anew.
    pub(crate) fn record_dispatch(&self, recorder: &mut Recorder<'_>, name: &str) {
        recorder.clear_start(&format!("{name}.unfinished.clear"), &self.wanted, 4 * u64::from(WANTED_COUNT));
    }

    /// Records what comes after the march.
    pub(crate) fn record_end(&self, recorder: &mut Recorder<'_>, name: &str) {
        recorder.copy_buffer(&format!("{name}.missed"), &self.wanted, &self.missed.read, READ_BYTES);
        recorder.release_to_host(&self.missed.read);
    }

    pub(crate) fn outcome(&self) -> Arc<dyn Outcome> {
        Arc::clone(&self.missed) as _
    }

    /// Loads the pages that the last recording has missed, of which it has drawn some copies. Returns whether the next one goes on with the image.
    pub(crate) fn load(&self, drawn: &[u32]) -> Result<bool> {
        let words = self.missed.words()?;
        let missed = num::index(words[num::index(WANTED_COUNT)].min(WANTED_MOST));
        let more = words[num::index(WANTED_UNFINISHED)] != 0;
        let wanted = &words[num::index(WANTED_FIRST)..][..missed];
        // A ray may also wait because its dispatch has walked as many slabs as it may.
        let goes_on = more && (self.pool.load(&self.table, wanted, &self.order, drawn)? || wanted.is_empty());
        let resumes = goes_on && !self.turned.load(Ordering::Relaxed);
        self.resumes.store(resumes, Ordering::Relaxed);
        Ok(resumes)
    }
}

impl Missed {
    fn words(&self) -> Result<Vec<u32>> {
        let mut words = words(&self.read.host_copy()?);
        words.resize(num::index(WANTED_FIRST + WANTED_MOST), 0);
        Ok(words)
    }
}

impl Outcome for Missed {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let words = self.words()?;
        let [bytes, pages] = self.pool.read();
        let missed = u64::from(words[num::index(WANTED_COUNT)]);
        let counters = vec![("pages_missed", missed), ("pages_read", pages), ("bytes_read", bytes)];
        Ok((words[num::index(WANTED_UNFINISHED)] == 0, counters))
    }

    fn bound(&self) -> Result<Option<ErrorBound>> {
        let words = self.words()?;
        let at = |word: u32| words[num::index(word)];
        let squares = u64::from(at(WANTED_SQUARES + 1)) << 32 | u64::from(at(WANTED_SQUARES));
        let mean = num::f64_of_u64(squares) / 65536.0 / num::f64_of_u64(self.rays.max(1));
        let greatest = self.most * f64::from(f32::from_bits(at(WANTED_GREATEST)));
        let rmse = if self.of_pixels { (self.most * mean.sqrt()).min(greatest) } else { greatest };
        Ok(Some(ErrorBound { rmse, greatest }))
    }
}
