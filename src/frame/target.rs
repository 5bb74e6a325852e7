//! The target of a frame: whose image it is, how the result is combined with it, and what bounds the rays.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::shader::{
    BINDING_LAYER_CURSORS, BINDING_LAYER_DEPTHS, BINDING_LAYER_ENDS, BINDING_LAYERS, BINDING_LINE_BOUNDS,
    SPEC_BOUNDED, SPEC_LAYERS,
};
use crate::gpu::{Buffer, Gpu, Image, ImageDesc, Resource, SpecConstant};
use crate::scene::View;

/// What becomes of what the caller's image holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetMode {
    /// Replaced: transparent black where the volume is not.
    Clear,
    /// Covered: the volume is composited over it.
    Over,
}

/// Where a plan draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TargetDesc {
    pub(crate) caller: Option<(vk::Format, TargetMode)>,
    pub(crate) depth: bool,
}

impl TargetDesc {
    /// Into an image of the plan's own, to be read back.
    #[must_use]
    pub fn own() -> Self {
        Self { caller: None, depth: false }
    }

    /// Into a colour image of the caller, of the view's extent. Values are premultiplied linear RGBA; an
    /// sRGB format encodes them.
    #[must_use]
    pub fn caller(format: vk::Format, mode: TargetMode) -> Self {
        Self { caller: Some((format, mode)), depth: false }
    }

    /// The same with a depth image in each recording: nothing behind what it shows is drawn, and what passes through it is cut
    /// there, along each pixel's line.
    #[must_use]
    pub fn with_depth(self) -> Self {
        Self { depth: true, ..self }
    }

    pub(crate) fn format(&self) -> Option<vk::Format> {
        self.caller.map(|(format, _)| format)
    }

    pub(crate) fn mode(&self) -> TargetMode {
        self.caller.map_or(TargetMode::Clear, |(_, mode)| mode)
    }
}

/// What a technique is to draw into, and between which depths of each pixel's line.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    pub(crate) target: TargetDesc,
    /// Two depths a pixel, where anything bounds lines.
    pub(crate) bounds: Option<Arc<Buffer>>,
    /// Translucent surfaces.
    pub(crate) layers: Option<Layers>,
    /// Whether what is drawn is put before opaque surfaces, in an image of its own.
    pub(crate) behind: bool,
}

impl Canvas {
    pub(crate) fn format(&self) -> Option<vk::Format> {
        self.target.format()
    }

    pub(crate) fn mode(&self) -> TargetMode {
        self.target.mode()
    }

    /// The bounds of lines as a shader binds them; what is there anyway, for variants that do not read any.
    pub(crate) fn bounds(&self, unread: &Arc<Buffer>) -> [(u32, Resource); 1] {
        [(BINDING_LINE_BOUNDS, Resource::ReadOnly(Arc::clone(self.bounds.as_ref().unwrap_or(unread))))]
    }

    /// The translucent surfaces of pixels as a shader binds them, with the same stand-in.
    pub(crate) fn layers(&self, unread: &Arc<Buffer>) -> [(u32, Resource); 4] {
        Layers::bound(self.layers.as_ref(), unread)
    }

    /// Whether there are any.
    pub(crate) fn layered(&self) -> SpecConstant {
        (SPEC_LAYERS, u32::from(self.layers.is_some()))
    }

    /// Refuses a way to draw that cannot cut lines at translucent surfaces.
    pub(crate) fn refuse_layers(&self, what: &str, instead: &str) -> Result<()> {
        if self.layers.is_none() {
            return Ok(());
        }
        Err(Error::invalid("technique", format!("{what} draws no translucent surfaces: {instead} does")))
    }

    /// Whether lines are bounded.
    pub(crate) fn bounded(&self) -> SpecConstant {
        (SPEC_BOUNDED, u32::from(self.bounds.is_some()))
    }
}

/// Where techniques find the translucent surfaces of each pixel.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    pub(crate) cursors: Arc<Buffer>,
    pub(crate) ends: Arc<Buffer>,
    pub(crate) depths: Arc<Buffer>,
    pub(crate) colours: Arc<Buffer>,
}

impl Layers {
    /// As shaders bind them; what is there anyway, for variants that do not read any.
    pub(crate) fn bound(layers: Option<&Self>, unread: &Arc<Buffer>) -> [(u32, Resource); 4] {
        let resource =
            |buffer: fn(&Self) -> &Arc<Buffer>| Resource::ReadOnly(Arc::clone(layers.map_or(unread, buffer)));
        [
            (BINDING_LAYER_CURSORS, resource(|layers| &layers.cursors)),
            (BINDING_LAYER_ENDS, resource(|layers| &layers.ends)),
            (BINDING_LAYER_DEPTHS, resource(|layers| &layers.depths)),
            (BINDING_LAYERS, resource(|layers| &layers.colours)),
        ]
    }
}

/// Whether raster may draw into the caller's image itself: same format, and what is there is either
/// cleared or covered back to front.
pub(crate) fn draws_directly(target: &Canvas, format: vk::Format, back_to_front: bool) -> bool {
    !target.behind && target.format() == Some(format) && (target.mode() == TargetMode::Clear || back_to_front)
}

pub(crate) fn own_image(
    gpu: &Gpu,
    name: &str,
    format: vk::Format,
    usage: vk::ImageUsageFlags,
    view: &View,
    target: &Canvas,
) -> Result<Arc<Image>> {
    // Read back, or composited.
    let after = if target.format().is_none() && !target.behind {
        vk::ImageUsageFlags::TRANSFER_SRC
    } else {
        vk::ImageUsageFlags::SAMPLED
    };
    let desc = ImageDesc::flat(format, view.extent(), usage | after);
    Ok(Arc::new(Image::new(gpu, &format!("{name}.accumulation"), &desc)?))
}
