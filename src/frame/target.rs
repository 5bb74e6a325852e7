//! The target of a frame: who owns the image, how the result combines with its contents, and what bounds the rays. The
//! composite draws a technique's image into the caller's colour image, of any format (`glsl/frame/composite.glsl`).

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::hit_depths::transmittance_bits;
use crate::gpu::shader::{self, COMPOSITE_FRAGMENT, COMPOSITE_VERTEX, CompositeFragment, CompositeVertex};
use crate::gpu::{
    Attachment, Blend, Buffer, Descriptors, Gpu, GraphicsState, Image, ImageDesc, Pipeline, Recorder,
    TargetImage,
};
use crate::interface::CompositePush;
use crate::scene::View;

/// How the result combines with the existing contents of the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetMode {
    /// The result replaces them; the image is transparent black where nothing is drawn.
    Clear,
    /// The result is composited over them.
    Over,
}

/// The target of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TargetDesc {
    pub(crate) caller: Option<(vk::Format, TargetMode)>,
    pub(crate) depth: bool,
    pub(crate) untimed: bool,
    pub(crate) counted: bool,
    pub(crate) part: bool,
    /// Format of an image of depths, and the bits of the transmittance whose depths it gets.
    pub(crate) hit_depths: Option<(vk::Format, u32)>,
}

impl TargetDesc {
    /// An image of the plan's own, to be read back.
    #[must_use]
    pub fn own() -> Self {
        Self { caller: None, depth: false, untimed: false, counted: false, part: false, hit_depths: None }
    }

    /// A colour image of the caller, of the view's extent. Values are premultiplied linear RGBA; an sRGB format encodes them.
    #[must_use]
    pub fn caller(format: vk::Format, mode: TargetMode) -> Self {
        Self { caller: Some((format, mode)), ..Self::own() }
    }

    /// The same target with a depth image in each recording. Each pixel's ray ends at the depth that the image stores.
    #[must_use]
    pub fn with_depth(self) -> Self {
        Self { depth: true, ..self }
    }

    /// The same target without times of passes. A recording then has no timestamps, each of which waits for the pass before.
    #[must_use]
    pub fn without_times(self) -> Self {
        Self { untimed: true, ..self }
    }

    /// The same target with counts of samples and of the fetches that they took in [`Status::counters`](crate::frame::Status::counters),
    /// for grids by compute; other routes count none. The image is the same to the bit. Each ray adds to sums in memory, so that a frame
    /// takes longer than one without.
    #[must_use]
    pub fn with_counts(self) -> Self {
        Self { counted: true, ..self }
    }

    /// The same target as a rectangle of a larger image, which [`TargetImage::at`](crate::gpu::TargetImage::at) places in each recording. The
    /// technique then draws into an image of the plan's own, which is composited.
    #[must_use]
    pub fn in_part(self) -> Self {
        Self { part: true, ..self }
    }

    /// The same target with an image of depths in each recording, [`RecordInfo::hit_depths`](crate::frame::RecordInfo::hit_depths): where each pixel's
    /// ray reaches an opacity, for passes of yours that come later, such as depth of field, motion vectors and labels. An opacity
    /// of 1/255 is where the volume begins to show, one of 1/2 its apparent surface.
    ///
    /// Red gets the depth, and the other channels 0. A depth lies in the piece of the ray in which the opacity is reached, as if extinction
    /// were constant there: with slices, slabs and segments within a step, with cells within a cell. Splats that are blended whole are
    /// met where they are densest. Surfaces, `resolution` below `full`, `order=back-to-front`, raster routes, `shear-warp`,
    /// maximum intensity projection and rules of trained splats without a depth on the ray are refused.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless the opacity is above 6e-8 and below 1.
    pub fn with_hit_depths(self, format: vk::Format, opacity: f64) -> Result<Self> {
        Ok(Self { hit_depths: Some((format, transmittance_bits(opacity)?)), ..self })
    }

    pub(crate) fn format(&self) -> Option<vk::Format> {
        self.caller.map(|(format, _)| format)
    }

    pub(crate) fn mode(&self) -> TargetMode {
        self.caller.map_or(TargetMode::Clear, |(_, mode)| mode)
    }
}

/// The target as a technique sees it, with the buffers that bound the rays of pixels.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    pub(crate) target: TargetDesc,
    /// Two depths per pixel, where anything bounds rays.
    pub(crate) bounds: Option<Arc<Buffer>>,
    /// Two depths per pixel, where the view owns pieces of rays.
    pub(crate) owned: Option<Arc<Buffer>>,
    /// Translucent surfaces.
    pub(crate) layers: Option<Layers>,
    /// Whether another pass of the frame samples the result: it upsamples the image, or puts it in front of opaque surfaces.
    pub(crate) sampled: bool,
    /// The pixels to draw, and the image that shows the others already; `None`: all, into an image of the technique's own.
    pub(crate) redrawn: Option<Redrawn>,
    /// Sums of samples and fetches, where they are counted.
    pub(crate) counts: Option<Arc<Buffer>>,
    /// The depths at which rays become opaque enough, where anybody asks; else a word.
    pub(crate) hit_depths: Arc<Buffer>,
}

/// Pixels that are drawn once more.
#[derive(Clone, Debug)]
pub(crate) struct Redrawn {
    /// Workgroups, number and places (`glsl/frame/by-list.glsl`).
    pub(crate) pixels: Arc<Buffer>,
    pub(crate) image: Arc<Image>,
}

impl Canvas {
    pub(crate) fn format(&self) -> Option<vk::Format> {
        self.target.format()
    }

    pub(crate) fn mode(&self) -> TargetMode {
        self.target.mode()
    }

    /// The bounds of rays; `unread` stands in for variants that read none.
    pub(crate) fn bounded(&self, unread: &Arc<Buffer>) -> shader::Bounded {
        let line_bounds = self.bounds.as_ref().unwrap_or(unread).read();
        shader::Bounded { line_bounds, bounded: self.bounds.is_some() }
    }

    /// The pieces of rays that the view owns, with the same stand-in.
    pub(crate) fn owned(&self, unread: &Arc<Buffer>) -> shader::Owned {
        let line_owned = self.owned.as_ref().unwrap_or(unread).read();
        shader::Owned { line_owned, owned: self.owned.is_some() }
    }

    /// The translucent surfaces of pixels, with the same stand-in.
    pub(crate) fn layered(&self, unread: &Arc<Buffer>) -> shader::Layers {
        let read = |buffer: fn(&Layers) -> &Arc<Buffer>| self.layers.as_ref().map_or(unread, buffer).read();
        shader::Layers {
            layer_cursors: read(|layers| &layers.cursors),
            layer_ends: read(|layers| &layers.ends),
            layer_depths: read(|layers| &layers.depths),
            layers: read(|layers| &layers.colours),
            layered: self.layers.is_some(),
        }
    }

    /// The list of what is drawn: pixels that are drawn once more, else `tiles` where that is a list, else everything with the same
    /// stand-in.
    pub(crate) fn by_list(&self, tiles: Option<&Arc<Buffer>>, unread: &Arc<Buffer>) -> shader::ByList {
        let list = self.redrawn.as_ref().map(|redrawn| &redrawn.pixels);
        let pixels = list.or(tiles).unwrap_or(unread).read();
        shader::ByList { pixels, redrawn: list.is_some(), by_tile_list: list.is_none() && tiles.is_some() }
    }

    /// The sums of samples and fetches, with the same stand-in.
    pub(crate) fn counts(&self, unread: &Arc<Buffer>) -> shader::Counts {
        let counts = self.counts.as_ref().map_or_else(|| unread.unwritten(), Buffer::write);
        shader::Counts { counts, counted: self.counts.is_some() }
    }

    /// The depths at which rays become opaque enough. Where nobody asks, a word of the plan's own stands in for them: validation layers, which do
    /// not see that the shader leaves it alone, would find other plans that write the same.
    pub(crate) fn hit_depths(&self) -> shader::HitDepths {
        let at = self.target.hit_depths.map_or(0, |(_, bits)| bits);
        shader::HitDepths { hit_depths: self.hit_depths.write(), hit_at: at }
    }

    /// Refuses a route or order, `what`, that cannot split rays at translucent surfaces.
    pub(crate) fn refuse_layers(&self, what: &str, instead: &str) -> Result<()> {
        if self.layers.is_none() {
            return Ok(());
        }
        Err(Error::invalid("technique", format!("{what} draws no translucent surfaces: {instead} does")))
    }
}

/// The translucent surfaces of each pixel, as techniques read them.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    pub(crate) cursors: Arc<Buffer>,
    pub(crate) ends: Arc<Buffer>,
    pub(crate) depths: Arc<Buffer>,
    pub(crate) colours: Arc<Buffer>,
}

/// Whether raster may draw into the caller's image itself: the format matches, and the contents are either cleared or
/// composited over back to front.
pub(crate) fn draws_directly(target: &Canvas, format: vk::Format, back_to_front: bool) -> bool {
    !target.sampled
        && !target.target.part
        && target.format() == Some(format)
        && (target.mode() == TargetMode::Clear || back_to_front)
}

/// Returns the usage of an image after it is drawn: it is read back, or sampled by another pass of the frame or by the composite.
pub(crate) fn usage_after(gpu: &Gpu, target: &TargetDesc, sampled: bool) -> vk::ImageUsageFlags {
    if target.format().is_none() && !sampled {
        // A surface shows it.
        let shown = if gpu.presents() { vk::ImageUsageFlags::SAMPLED } else { Default::default() };
        vk::ImageUsageFlags::TRANSFER_SRC | shown
    } else {
        vk::ImageUsageFlags::SAMPLED
    }
}

/// Makes the image that a technique draws into, with the usages that a read-back or the composite needs; or returns the one of which it
/// draws some pixels once more.
pub(crate) fn own_image(
    gpu: &Gpu,
    name: &str,
    format: vk::Format,
    usage: vk::ImageUsageFlags,
    view: &View,
    target: &Canvas,
) -> Result<Arc<Image>> {
    if let Some(redrawn) = &target.redrawn {
        return Ok(Arc::clone(&redrawn.image));
    }
    let desc =
        ImageDesc::flat(format, view.extent(), usage | usage_after(gpu, &target.target, target.sampled));
    Ok(Arc::new(Image::new(gpu, &format!("{name}.accumulation"), &desc)?))
}

/// Composites the image of a technique into the target, by one full-screen draw.
#[derive(Debug)]
pub(crate) struct Composite {
    pipeline: Arc<Pipeline>,
    descriptors: Arc<Descriptors>,
    clear: bool,
}

impl Composite {
    /// Builds the pipeline that draws `source` into a target of `format`.
    pub(crate) fn new(gpu: &Gpu, source: &Arc<Image>, format: vk::Format, mode: TargetMode) -> Result<Self> {
        let clear = mode == TargetMode::Clear;
        let fragment = CompositeFragment { source: source.sampled(vk::Filter::NEAREST) };
        let bound = COMPOSITE_VERTEX.with(&CompositeVertex {}).and(COMPOSITE_FRAGMENT.with(&fragment));
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            blend: if clear { Blend::Copy } else { Blend::Over },
            format: Some(format),
        };
        let pipeline = gpu.graphics_pipeline("composite.draw", &bound, state)?;
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &bound)?);
        Ok(Self { pipeline, descriptors, clear })
    }

    /// Records the draw into `target`.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        recorder.draw(
            "composite.draw",
            &self.pipeline,
            &self.descriptors,
            bytemuck::bytes_of(&CompositePush { corner: target.corner.map(u32::cast_signed) }),
            &Attachment::Caller(*target),
            self.clear,
            3,
            1,
        );
    }
}
