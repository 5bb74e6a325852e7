//! A window shows the picture of [`Frames`], and over it the triangles of a panel, which any toolkit may make. Behind the feature
//! `window`; without it there are surfaces that nothing shows.
//!
//! The surface is in `gpu`. This room uses `frame`, `technique` and `gpu`; the program uses it.

use std::sync::Arc;

use ash::vk;
#[cfg(feature = "window")]
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use crate::error::{Error, Result};
use crate::gpu::shader::{
    self, COMPOSITE_VERTEX, CompositeVertex, PANEL_FRAGMENT, PANEL_VERTEX, PICTURE_FRAGMENT, PanelFragment,
    PanelVertex,
};
use crate::gpu::{
    Attachment, Blend, Bound, Buffer, Commands, Descriptors, Gpu, GraphicsState, Image, ImageDesc, Pipeline,
    Recorder, Surface,
};
use crate::image::{Colours, srgb};
use crate::interface::{PanelPush, PicturePush};
use crate::num::{count, f32_of, index};
use crate::technique::Frames;

pub use crate::interface::PanelCorner;

/// A picture in a window.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Their last frame is shown.
    pub frames: &'a Frames,
    /// Upper left corner in the window, in pixels.
    pub corner: [u32; 2],
    /// Size in the window, in pixels; a frame of another size is magnified.
    pub size: [u32; 2],
    /// Straight linear RGBA behind the picture. The window is opaque: what shows through is black.
    pub background: [f64; 4],
}

/// Draws into a window by the device that renders.
#[derive(Debug)]
pub struct Screen {
    gpu: Gpu,
    surface: Surface,
    commands: Commands,
    atlas: Option<Arc<Image>>,
}

impl Screen {
    /// Makes the screen of a window, for a device opened with [`GpuOptions::window`](crate::gpu::GpuOptions::window).
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] where the device cannot present on the display, [`Error::Vulkan`] when a call fails.
    #[cfg(feature = "window")]
    pub fn new<W>(gpu: &Gpu, window: Arc<W>) -> Result<Self>
    where
        W: HasDisplayHandle + HasWindowHandle + Send + Sync + 'static,
    {
        Self::of(gpu, Surface::new(gpu, window)?)
    }

    /// Makes a screen that nothing shows, for a device opened with
    /// [`GpuOptions::headless_surface`](crate::gpu::GpuOptions::headless_surface). Layers that capture frames find their ends in what it
    /// presents.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] where the device cannot present, [`Error::Vulkan`] when a call fails.
    pub fn headless(gpu: &Gpu) -> Result<Self> {
        Self::of(gpu, Surface::headless(gpu)?)
    }

    fn of(gpu: &Gpu, surface: Surface) -> Result<Self> {
        Ok(Self { gpu: gpu.clone(), surface, commands: Commands::new(gpu)?, atlas: None })
    }

    /// Replaces the atlas of glyphs: premultiplied sRGB with opacity, a byte each, row by row.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] unless there are as many texels as the size says; errors of memory and of Vulkan.
    pub fn set_atlas(&mut self, size: [u32; 2], texels: &[[u8; 4]]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(texels);
        if size.map(index).iter().product::<usize>() != texels.len() || texels.is_empty() {
            return Err(Error::invalid("atlas", format!("{} texels for {size:?}", texels.len())));
        }
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let desc = ImageDesc::flat(vk::Format::R8G8B8A8_UNORM, size, usage);
        // A flat image has one plane.
        let fill = |_, _, memory: &mut [u8]| memory.copy_from_slice(bytes);
        self.atlas = Some(Image::with_data(&self.gpu, "atlas", &desc, fill)?);
        Ok(())
    }

    /// Shows a picture and the triangles of a panel over it, three corners each, in a window of `size` pixels, and waits until both are drawn.
    /// Returns `false` if nothing was shown, because the window is hidden or is just changing: show it again later.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`], [`Error::Vulkan`] and errors of memory.
    pub fn show(
        &mut self,
        size: [u32; 2],
        picture: Option<&Picture<'_>>,
        panel: &[PanelCorner],
    ) -> Result<bool> {
        if size.contains(&0) {
            return Ok(false);
        }
        let source = picture.and_then(|picture| Some((picture, picture.frames.plan().image()?)));
        let picture_draw = source.map(|(picture, (image, _))| self.picture(picture, image)).transpose()?;
        let panel_draw = match &self.atlas {
            Some(atlas) if !panel.is_empty() => Some(self.panel(atlas, panel)?),
            _ => None,
        };
        let Some((number, target)) = self.surface.acquire(size)? else { return Ok(false) };
        let push = PanelPush { size: target.extent.map(|side| f32_of(side.into())) };
        let attachment = Attachment::Caller(target);
        self.commands.run("window", |recorder| {
            recorder.assume_acquired(&target);
            let mut clear = true;
            if let (Some((_, (image, last))), Some((draw, push))) = (source, &picture_draw) {
                recorder.assume_after(image, last);
                draw.record(recorder, bytemuck::bytes_of(push), &attachment, clear, 3);
                recorder.leave(image, last);
                clear = false;
            }
            if let Some(draw) = &panel_draw {
                draw.record(recorder, bytemuck::bytes_of(&push), &attachment, clear, count(panel.len()));
            }
            recorder.leave_presented(&target);
        })?;
        self.surface.present(number)?;
        Ok(true)
    }

    /// Makes the draw of a picture.
    fn picture(&self, picture: &Picture<'_>, image: &Arc<Image>) -> Result<(Draw, PicturePush)> {
        let fragment = shader::Picture { source: image.sampled(vk::Filter::NEAREST) };
        let bound = COMPOSITE_VERTEX.with(&CompositeVertex {}).and(PICTURE_FRAGMENT.with(&fragment));
        let is_displayed = picture.frames.colours() == Colours::Displayed;
        let [r, g, b, a] = picture.background;
        let [r, g, b] = if is_displayed { [r, g, b].map(srgb) } else { [r, g, b] };
        let push = PicturePush {
            background: [r * a, g * a, b * a, a].map(f32_of),
            corner: picture.corner.map(|place| f32_of(place.into())),
            size: picture.size.map(|side| f32_of(side.into())),
            displayed: u32::from(is_displayed),
        };
        Ok((self.draw("window.picture", &bound, Blend::Copy)?, push))
    }

    /// Makes the draw of a panel, and uploads its corners.
    fn panel(&self, atlas: &Arc<Image>, corners: &[PanelCorner]) -> Result<Draw> {
        let corners = Buffer::with_data(&self.gpu, "panel", bytemuck::cast_slice(corners))?;
        let fragment = PanelFragment { source: atlas.sampled(vk::Filter::LINEAR) };
        let vertex = PanelVertex { panel: corners.read() };
        let bound = PANEL_VERTEX.with(&vertex).and(PANEL_FRAGMENT.with(&fragment));
        self.draw("window.panel", &bound, Blend::Over)
    }

    fn draw(&self, name: &'static str, bound: &Bound, blend: Blend) -> Result<Draw> {
        let topology = vk::PrimitiveTopology::TRIANGLE_LIST;
        let state = GraphicsState { topology, blend, format: Some(self.surface.format()) };
        let pipeline = self.gpu.graphics_pipeline(name, bound, state)?;
        let descriptors = Arc::new(Descriptors::new(&self.gpu, &pipeline, bound)?);
        Ok(Draw { name, pipeline, descriptors })
    }
}

/// A draw into the window.
struct Draw {
    name: &'static str,
    pipeline: Arc<Pipeline>,
    descriptors: Arc<Descriptors>,
}

impl Draw {
    fn record(
        &self,
        recorder: &mut Recorder<'_>,
        push: &[u8],
        target: &Attachment,
        clear: bool,
        vertices: u32,
    ) {
        recorder.draw(self.name, &self.pipeline, &self.descriptors, push, target, clear, vertices, 1);
    }
}
