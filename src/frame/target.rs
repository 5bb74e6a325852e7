//! The target of a frame: who owns the image, how the result combines with its contents, and what bounds the rays.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::shader::{
    BINDING_LAYER_CURSORS, BINDING_LAYER_DEPTHS, BINDING_LAYER_ENDS, BINDING_LAYERS, BINDING_LINE_BOUNDS,
    SPEC_BOUNDED, SPEC_LAYERS,
};
use crate::gpu::{Buffer, Gpu, Image, ImageDesc, Resource, SpecConstant};
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
}

impl TargetDesc {
    /// An image of the plan's own, to be read back.
    #[must_use]
    pub fn own() -> Self {
        Self { caller: None, depth: false }
    }

    /// A colour image of the caller, of the view's extent. Values are premultiplied linear RGBA; an sRGB format encodes them.
    #[must_use]
    pub fn caller(format: vk::Format, mode: TargetMode) -> Self {
        Self { caller: Some((format, mode)), depth: false }
    }

    /// The same target with a depth image in each recording. Each pixel's ray ends at the depth that the image stores.
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

/// The target as a technique sees it, with the buffers that bound the rays of pixels.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    pub(crate) target: TargetDesc,
    /// Two depths per pixel, where anything bounds rays.
    pub(crate) bounds: Option<Arc<Buffer>>,
    /// Translucent surfaces.
    pub(crate) layers: Option<Layers>,
    /// Whether the result is composited in front of opaque surfaces, in an image of its own.
    pub(crate) behind: bool,
}

impl Canvas {
    pub(crate) fn format(&self) -> Option<vk::Format> {
        self.target.format()
    }

    pub(crate) fn mode(&self) -> TargetMode {
        self.target.mode()
    }

    /// The binding of the bounds of rays; `unread` stands in for variants that read none.
    pub(crate) fn bounds(&self, unread: &Arc<Buffer>) -> [(u32, Resource); 1] {
        [(BINDING_LINE_BOUNDS, Resource::ReadOnly(Arc::clone(self.bounds.as_ref().unwrap_or(unread))))]
    }

    /// The bindings of the translucent surfaces of pixels, with the same stand-in.
    pub(crate) fn layers(&self, unread: &Arc<Buffer>) -> [(u32, Resource); 4] {
        Layers::bound(self.layers.as_ref(), unread)
    }

    /// The constant that says whether pixels have translucent surfaces.
    pub(crate) fn layered(&self) -> SpecConstant {
        (SPEC_LAYERS, u32::from(self.layers.is_some()))
    }

    /// Refuses a route or order, `what`, that cannot split rays at translucent surfaces.
    pub(crate) fn refuse_layers(&self, what: &str, instead: &str) -> Result<()> {
        if self.layers.is_none() {
            return Ok(());
        }
        Err(Error::invalid("technique", format!("{what} draws no translucent surfaces: {instead} does")))
    }

    /// The constant that says whether rays are bounded.
    pub(crate) fn bounded(&self) -> SpecConstant {
        (SPEC_BOUNDED, u32::from(self.bounds.is_some()))
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

impl Layers {
    /// Their bindings; `unread` stands in where there are none.
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

/// Whether raster may draw into the caller's image itself: the format matches, and the contents are either cleared or
/// composited over back to front.
pub(crate) fn draws_directly(target: &Canvas, format: vk::Format, back_to_front: bool) -> bool {
    !target.behind && target.format() == Some(format) && (target.mode() == TargetMode::Clear || back_to_front)
}

/// Makes the image that a technique draws into, with the usages that a read-back or the composite needs.
pub(crate) fn own_image(
    gpu: &Gpu,
    name: &str,
    format: vk::Format,
    usage: vk::ImageUsageFlags,
    view: &View,
    target: &Canvas,
) -> Result<Arc<Image>> {
    let after = if target.format().is_none() && !target.behind {
        vk::ImageUsageFlags::TRANSFER_SRC
    } else {
        vk::ImageUsageFlags::SAMPLED
    };
    let desc = ImageDesc::flat(format, view.extent(), usage | after);
    Ok(Arc::new(Image::new(gpu, &format!("{name}.accumulation"), &desc)?))
}
