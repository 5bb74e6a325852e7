//! The renderer: prepares plans of a scene by one technique, or draws frame after frame.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::plan::{Plan, Recorded};
use crate::frame::prepared::ErrorBound;
use crate::frame::read_back::pixels;
use crate::frame::target::{TargetDesc, TargetMode};
use crate::gpu::shader::{FLAG_REPAIRED, FLAG_UNSORTED, TILE, TILE_PIXELS};
use crate::gpu::{Buffer, BufferUse, Commands, Gpu, PassTime, Recorder};
use crate::image::{Colours, Image as Picture};
use crate::num;
use crate::resident::GpuScene;
use crate::scene::{Data, Mode, Scene, View};
use crate::technique::registry::Technique;

/// Draws a scene on a device by one technique. `Send` and `Sync`: several threads may prepare plans with one renderer.
#[derive(Clone, Debug)]
pub struct Renderer {
    scene: Arc<GpuScene>,
    technique: Technique,
}

impl Renderer {
    /// Takes scene and technique. Uploads and builds nothing yet.
    #[must_use]
    pub fn new(scene: &Arc<GpuScene>, technique: Technique) -> Self {
        Self { scene: Arc::clone(scene), technique }
    }

    /// The technique.
    #[must_use]
    pub fn technique(&self) -> &Technique {
        &self.technique
    }

    /// Builds the plan of a view: everything that a frame needs. May allocate, compile, upload, submit and wait.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for options that do not fit the scene, [`Error::Unsupported`] for features and [`Error::Memory`]
    /// for memory that the device lacks, [`Error::Vulkan`] when a call fails.
    pub fn prepare(&self, view: &View, target: &TargetDesc) -> Result<Plan> {
        let gpu = self.scene.gpu();
        gpu.alive()?;
        if let Some(format) = target.format() {
            check_format(gpu, "target", format, target.mode() == TargetMode::Over)?;
        }
        if let Some((format, bits)) = target.hit_depths {
            check_format(gpu, "image of hit depths", format, false)?;
            self.check_stop(f32::from_bits(bits))?;
        }
        if view.owned().is_some() {
            self.check_owned()?;
        }
        let surfaces = self.scene.surfaces()?;
        if let Some(surfaces) = &surfaces {
            self.technique.method().check_surfaces(surfaces, &self.scene.scene().data)?;
        }
        Plan::new(gpu, surfaces.as_ref(), view, target, self.technique.drawn(), |view, canvas| {
            self.technique.prepare(&self.scene, view, canvas)
        })
    }

    /// Refuses what draws a rectangle of the image otherwise than in the whole one.
    pub(crate) fn check_rectangle(&self) -> Result<()> {
        self.why_whole_only().map_or(Ok(()), |why| Err(Error::invalid("rectangle of an image", why)))
    }

    /// Refuses what does not draw the pieces of rays that a box owns.
    fn check_owned(&self) -> Result<()> {
        let Scene { data, kernels, surfaces, mode, .. } = self.scene.scene();
        let overlap =
            self.technique.method().overlaps() || matches!(data, Data::Points(_) | Data::Gaussians(_));
        let why = if overlap || kernels.is_some() {
            "kernels overlap, so that no box owns them".to_string()
        } else if !surfaces.is_empty() {
            "scenes with surfaces have none".to_string()
        } else if *mode == Mode::Maximum {
            "of maximum intensity projection the parts of a ray do not add up".to_string()
        } else if let Some(why) = self.why_whole_only() {
            why
        } else {
            return Ok(());
        };
        Err(Error::invalid("owned box", why))
    }

    /// Returns why pixels depend on others of the whole image, if they do.
    fn why_whole_only(&self) -> Option<String> {
        let Scene { data, kernels, .. } = self.scene.scene();
        let drawn = self.technique.drawn();
        let options = self.technique.option_pairs();
        if drawn.side > 1 {
            return Some("resolution=full is the only one: others blur across its sides".to_string());
        }
        if options.iter().any(|(key, value)| *key == "tolerance" && *value != "off") {
            return Some("tolerance chooses steps for tiles of the image: set step".to_string());
        }
        let shares = matches!(data, Data::Grid(_)) && kernels.is_none() && !drawn.pieces;
        let name = self.technique.method().name();
        shares.then(|| format!("{name} shares rays between pixels: slices-2d draws the same slabs"))
    }

    /// Refuses hit depths of an opacity at which rays may have ended.
    fn check_stop(&self, transmittance: f32) -> Result<()> {
        let options = self.technique.option_pairs();
        let stop = options.iter().find(|(key, _)| *key == "stop").and_then(|(_, stop)| stop.parse().ok());
        let end: f64 = stop.unwrap_or(0.0) / self.scene.max_colour();
        if f64::from(transmittance) > end {
            return Ok(());
        }
        let why =
            format!("rays end at a transmittance of {end:e}, before that of the opacity: set a smaller stop");
        Err(Error::invalid("hit depths", why))
    }

    /// Draws one frame and waits for it: prepare, record, submit, wait, read back.
    ///
    /// # Errors
    ///
    /// Those of [`Renderer::prepare`] and [`Plan::record`].
    pub fn render(&self, view: &View) -> Result<Picture> {
        let mut frames = self.frames(view)?;
        frames.draw(view)?;
        frames.read_back()
    }

    /// Draws frame after frame with one plan. Compiles and allocates here; [`Frames::draw`] does so only when a view exceeds a
    /// capacity of the plan.
    ///
    /// # Errors
    ///
    /// Those of [`Renderer::prepare`].
    pub fn frames(&self, view: &View) -> Result<Frames> {
        self.frames_with(view, TargetDesc::own())
    }

    /// Draws one frame that counts what it samples ([`TargetDesc::with_counts`]), and returns its counters.
    ///
    /// # Errors
    ///
    /// Those of [`Renderer::render`].
    pub fn count(&self, view: &View) -> Result<Vec<(&'static str, u64)>> {
        Ok(self.frames_with(view, TargetDesc::own().with_counts())?.draw(view)?.counters)
    }

    fn frames_with(&self, view: &View, target: TargetDesc) -> Result<Frames> {
        let plan = self.prepare(view, &target)?;
        let commands = Commands::new(self.scene.gpu())?;
        let renderer = self.clone();
        Ok(Frames {
            commands,
            renderer,
            target,
            plan,
            drawn: false,
            started: None,
            next: None,
            passes: vec![],
            tries: 0,
            within: 0.0,
            bound: None,
        })
    }
}

/// Checks that the device can draw into images of a format.
fn check_format(gpu: &Gpu, what: &str, format: vk::Format, blends: bool) -> Result<()> {
    use vk::FormatFeatureFlags as F;
    let (needed, blending) =
        if blends { (F::COLOR_ATTACHMENT_BLEND, " with blending") } else { (F::COLOR_ATTACHMENT, "") };
    let name = format!("{format:?}");
    let integer = name.ends_with("_UINT") || name.ends_with("_SINT");
    if !integer && gpu.image_features(format).contains(needed) {
        return Ok(());
    }
    let missing = format!(
        "a colour attachment{blending} that holds fractions: R8G8B8A8_UNORM, B8G8R8A8_SRGB and R16G16B16A16_SFLOAT are ones on every device"
    );
    Err(Error::unsupported(format!("{what} of format {name}"), missing))
}

/// The time of one frame.
#[derive(Clone, Debug)]
pub struct FrameTime {
    /// Milliseconds from the start of recording to the fence.
    pub wall_ms: f64,
    /// Passes on the device; their sum is the frame's time there.
    pub passes: Vec<PassTime>,
    /// Counts of work that only the device knows.
    pub counters: Vec<(&'static str, u64)>,
    /// How far the image is from the complete one at most, where [`Frames::stop_within`] has ended the frame early.
    pub bound: Option<ErrorBound>,
}

/// Attempts per frame; each retry allocates the capacity that the previous one lacked.
const MOST_TRIES: u32 = 12;

/// Draws frame after frame of one size into an image that can be read back. `Send` and `Sync`.
#[derive(Debug)]
pub struct Frames {
    renderer: Renderer,
    target: TargetDesc,
    plan: Plan,
    commands: Commands,
    /// Whether the plan's image holds a frame.
    drawn: bool,
    started: Option<Started>,
    /// View and begin of a frame whose next part is to be submitted.
    next: Option<(View, Instant)>,
    /// Times of the parts of the frame so far.
    passes: Vec<PassTime>,
    tries: u32,
    /// The error with which a frame may end early.
    within: f64,
    /// The bound of the last part.
    bound: Option<ErrorBound>,
}

/// A frame that was submitted, and not waited for.
#[derive(Debug)]
struct Started {
    recorded: Recorded,
    view: View,
    begin: Instant,
}

impl Drop for Frames {
    fn drop(&mut self) {
        // `commands` keeps the resources of the frame until the submission has ended.
        if let Some(started) = self.started.take() {
            started.recorded.discarded();
        }
    }
}

impl Frames {
    /// Draws a frame and waits for it.
    ///
    /// # Errors
    ///
    /// Those of [`Plan::record`] and [`Renderer::prepare`]; [`Error::Timeout`] when the device does not finish in time.
    pub fn draw(&mut self, view: &View) -> Result<FrameTime> {
        self.start(view)?;
        self.finish()
    }

    /// Lets frames of a grid in pages end early: as soon as their images are bound to differ from the complete ones by at most this RMSE over
    /// the pixels. 0, the default, completes them.
    pub fn stop_within(&mut self, rmse: f64) {
        self.within = rmse;
    }

    /// Returns how far the last part of a frame of a grid in pages is from the complete image at most; `None` where it is complete, or no
    /// bound is known.
    #[must_use]
    pub fn bound(&self) -> Option<ErrorBound> {
        self.bound
    }

    /// Submits a frame without waiting for it; [`Frames::finish`] waits. Two `Frames` of one renderer that take turns keep two frames in
    /// flight: the host records one while the device draws the other.
    ///
    /// # Errors
    ///
    /// Those of [`Frames::draw`]; [`Error::Invalid`] while a started frame is not finished.
    pub fn start(&mut self, view: &View) -> Result<()> {
        if self.started.is_some() {
            return Err(Error::invalid("frames", "a frame was started: finish it first"));
        }
        (self.drawn, self.bound) = (false, None);
        // After an error the last frame may still run, and it reads buffers that a new view changes.
        self.commands.settle()?;
        // Pages that the last part has missed may serve this view, too.
        let suffices = self.next.take().is_none() || self.plan.load()?;
        if !suffices || !self.plan.set_view(view)? {
            self.plan = self.renderer.prepare(view, &self.target)?;
        }
        (self.tries, self.passes) = (0, Vec::new());
        self.submit(view, Instant::now())
    }

    /// Waits for the frame that was started. A frame that lacked a capacity is drawn again.
    ///
    /// # Errors
    ///
    /// Those of [`Frames::draw`]; [`Error::Invalid`] when no frame was started.
    pub fn finish(&mut self) -> Result<FrameTime> {
        loop {
            if let Some(time) = self.finish_part()? {
                return Ok(time);
            }
            self.submit_next()?;
        }
    }

    /// Draws one part of a frame and waits for it: all of it, unless a grid is kept in pages, a mesh or points are drawn in parts, or the plan
    /// lacked a capacity. Then the next call loads the pages that the part has missed, or the next part, and goes on if the view is the same;
    /// another view begins anew. Returns `None` until the frame is complete; [`Frames::bound`] says how far it has come.
    ///
    /// # Errors
    ///
    /// Those of [`Frames::draw`].
    pub fn draw_part(&mut self, view: &View) -> Result<Option<FrameTime>> {
        if self.next.is_some_and(|(begun, _)| begun == *view) {
            self.submit_next()?;
        } else {
            self.start(view)?;
        }
        self.finish_part()
    }

    /// Waits for the part that was submitted. Returns `None` where another has to follow.
    fn finish_part(&mut self) -> Result<Option<FrameTime>> {
        let Some(Started { recorded, view, begin }) = self.started.take() else {
            return Err(Error::invalid("frames", "no frame was started"));
        };
        if let Err(error) = self.commands.wait(recorded.last_pass()) {
            recorded.discarded();
            return Err(error);
        }
        let wall_ms = begin.elapsed().as_secs_f64() * 1e3;
        let status = recorded.completed()?;
        self.passes.extend(status.passes);
        self.bound = status.bound;
        let suffices = |bound: ErrorBound| self.within > 0.0 && bound.rmse <= self.within;
        if status.complete || status.bound.is_some_and(suffices) {
            self.drawn = true;
            let passes = std::mem::take(&mut self.passes);
            return Ok(Some(FrameTime { wall_ms, passes, counters: status.counters, bound: status.bound }));
        }
        self.next = Some((view, begin));
        Ok(None)
    }

    /// Loads the next part, or plans anew where a capacity was lacking, and submits. Nothing comes in between: another scene that draws from the
    /// same pool would take the pages that were loaded.
    fn submit_next(&mut self) -> Result<()> {
        let Some((view, mut begin)) = self.next.take() else {
            return Err(Error::invalid("frames", "no frame was started"));
        };
        if !self.plan.load()? {
            self.tries += 1;
            if self.tries == MOST_TRIES {
                return Err(Error::unsupported(
                    format!("{} of this view", self.renderer.technique.method().name()),
                    format!("a capacity that suffices: {MOST_TRIES} frames found none"),
                ));
            }
            self.passes.clear();
            self.plan = self.renderer.prepare(&view, &self.target)?;
            begin = Instant::now();
        }
        self.submit(&view, begin)
    }

    /// Records and submits the plan's view, which was begun at a time.
    fn submit(&mut self, view: &View, begin: Instant) -> Result<()> {
        let recorded = self.plan.record(self.commands.begin()?, None, None)?;
        // `commands` keeps the resources of the frame for as long as the submission may run.
        let image = self.plan.image().map(|(image, _)| &**image);
        if let Err(error) = self.commands.send_frame(recorded.keep(), image) {
            recorded.discarded();
            return Err(error);
        }
        self.started = Some(Started { recorded, view: *view, begin });
        Ok(())
    }

    /// The plan in use.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Copies the image of the last frame to the host.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when nothing has been drawn; else those of [`Frames::draw`].
    pub fn read_back(&mut self) -> Result<Picture> {
        let gpu = &self.plan.gpu;
        let Some((image, last)) = self.plan.image().filter(|_| self.drawn) else {
            return Err(Error::invalid("frames", "nothing has been drawn: there is no image to read back"));
        };
        let format = image.desc().format;
        let host = Arc::new(Buffer::new(gpu, "read back", image.desc().texel_bytes(), BufferUse::Download)?);
        let mut recorder = Recorder::new(gpu, self.commands.begin()?, None);
        recorder.assume_after(image, last);
        recorder.copy_image_to_buffer("read back", image, &host);
        recorder.leave(image, last);
        let (_, keep) = recorder.finish()?;
        self.commands.submit(keep, "read back")?;
        let [width, height] = self.plan.extent;
        let picture = Picture::new(width, height, pixels(&host.host_copy()?, format))?;
        Ok(picture.with_colours(self.colours()))
    }

    /// Returns what the numbers of colours are.
    #[must_use]
    pub fn colours(&self) -> Colours {
        self.renderer.scene.scene().colours()
    }

    /// Returns for each pixel of the last frame whether the k-buffer failed to sort its fragments, repaired since or not, row by row
    /// from the top. `None` where the technique has no k-buffer.
    ///
    /// # Errors
    ///
    /// Those of [`Frames::read_back`].
    pub fn overflow_map(&mut self) -> Result<Option<Vec<bool>>> {
        let gpu = &self.plan.gpu;
        if self.plan.prepared.overflow().is_none() {
            return Ok(None);
        }
        let Some((words, last)) = self.plan.overflow().filter(|_| self.drawn) else {
            return Err(Error::invalid("frames", "nothing has been drawn: there is no map of its pixels"));
        };
        let host = Arc::new(Buffer::new(gpu, "overflow map", words.size(), BufferUse::Download)?);
        let mut recorder = Recorder::new(gpu, self.commands.begin()?, None);
        recorder.assume_buffer_after(words, last);
        recorder.copy_buffer("overflow map", words, &host, host.size());
        recorder.release_to_host(&host);
        let (_, keep) = recorder.finish()?;
        self.commands.submit(keep, "overflow map")?;
        Ok(Some(pixels_of_tiles(&host.host_copy()?, self.plan.extent, self.plan.drawn)))
    }
}

/// Converts words, tile by tile of an image of the size `drawn`, to flags of pixels of an image that shows the same height, row by row:
/// whether fragments left the k-buffer out of order, repaired or not.
fn pixels_of_tiles(words: &[u8], [width, height]: [u32; 2], drawn: [u32; 2]) -> Vec<bool> {
    let across = drawn[0].div_ceil(TILE);
    // As in upsampling.glsl.
    let nearest = |at: u32, side: u32, drawn_side: u32| {
        let from_centre = f64::from(at) + 0.5 - 0.5 * f64::from(side);
        let place = from_centre * f64::from(drawn[1]) / f64::from(height) + 0.5 * f64::from(drawn_side);
        num::u32_of(place.max(0.0)).min(drawn_side - 1)
    };
    let place = |x: u32, y: u32| {
        let [x, y] = [nearest(x, width, drawn[0]), nearest(y, height, drawn[1])];
        (y / TILE * across + x / TILE) * TILE_PIXELS + y % TILE * TILE + x % TILE
    };
    let unsorted = |word: &[u8]| {
        u32::from_ne_bytes([word[0], word[1], word[2], word[3]]) & (FLAG_UNSORTED | FLAG_REPAIRED) != 0
    };
    let words: Vec<bool> = words.chunks_exact(4).map(unsorted).collect();
    let is_set = |(x, y)| words.get(num::index(place(x, y))).is_some_and(|&set| set);
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(is_set).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_become_rows() {
        // 10 x 9 pixels in four tiles.
        let mut words = vec![0_u8; 4 * 4 * 64];
        for place in [0, 7 * 8 + 1, 64 + 1, 3 * 64] {
            words[4 * place..4 * place + 4].copy_from_slice(&FLAG_UNSORTED.to_ne_bytes());
        }
        // A pixel outside of the image, and a flag of another kind.
        words[4 * (64 + 2)] = 1;
        words[4 * 5..4 * 6].copy_from_slice(&crate::gpu::shader::FLAG_OVERLAPS.to_ne_bytes());
        let map = pixels_of_tiles(&words, [10, 9], [10, 9]);
        let set: Vec<usize> = (0..90).filter(|&i| map[i]).collect();
        assert_eq!((map.len(), set), (90, vec![0, 9, 71, 88]));
        let larger = pixels_of_tiles(&words, [20, 18], [10, 9]);
        assert!((0..larger.len()).all(|i| larger[i] == map[i / 20 / 2 * 10 + i % 20 / 2]));
    }
}
