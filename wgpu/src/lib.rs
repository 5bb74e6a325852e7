//! [volraster] in renderers on [wgpu]: a device that both use, and frames between wgpu's own passes.
//!
//! [`Context::open`] opens an adapter in place of [`wgpu::Adapter::request_device`], which cannot enable the features of Vulkan that the
//! library needs. [`Context::composite`] records a frame into command buffers of its own, which are submitted between those of wgpu's passes;
//! it is cut by a depth texture of wgpu.
//!
//! ```no_run
//! # use volraster::gpu::DepthProjection;
//! # use volraster::scene::{Field, Scene, TransferFunction, View};
//! # use volraster::{GpuScene, Renderer, Result, Technique};
//! # use volraster_wgpu::Context;
//! # fn frame(adapter: &wgpu::Adapter, scene: Scene, view: &View, colour: &wgpu::Texture, depth: &wgpu::Texture) -> Result<()> {
//! let context = Context::open(adapter, &wgpu::DeviceDescriptor::default())?;
//! let renderer = Renderer::new(&GpuScene::new(context.gpu(), scene), Technique::parse("raycast")?);
//! // Once for each frame in flight.
//! let mut plan = renderer.prepare(view, &context.target(colour.format())?.with_depth())?;
//!
//! // Each frame: wgpu's passes, the volume between them, one submission.
//! let encoder = context.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
//! let projection = DepthProjection::perspective(f64::INFINITY, 0.1)?;
//! let frame = context.composite(&mut plan, colour, Some((depth, projection)))?;
//! context.submit([encoder.finish()], frame, [], |status| drop(status));
//! # Ok(())
//! # }
//! ```
//!
//! # What to know
//!
//! - **Threads.** wgpu does not tell of the queue's lock. [`Context::submit`] submits while the library does not; so must everything else
//!   that uses the queue while another thread prepares plans, among it [`wgpu::Queue::submit`], [`wgpu::Queue::present`],
//!   [`wgpu::Queue::on_submitted_work_done`], [`wgpu::Surface::configure`] and [`wgpu::Buffer::map_async`]: call it in [`Gpu::with_queue`]. A
//!   program that prepares and submits on one thread needs none of this.
//! - **Callbacks** of wgpu may run inside its functions that submit or wait, and then under the library's lock: they must not submit, prepare
//!   or render.
//! - **First contents.** wgpu fills a texture with zeros before its first use by wgpu, unless it has cleared or written it itself, and does not
//!   see what the library writes: clear it by a pass of wgpu before the first frame.
//! - **Losses.** [`wgpu::Device::set_device_lost_callback`] may own [`Gpu::loss_note`], and tell it. A clone of the [`Gpu`] or the
//!   [`Context`] there would keep the device alive for ever.
//! - **Lifetimes.** The [`Gpu`] holds the device and the queue: they go with the last object of either library.
//! - **Features.** The device has what wgpu enables, `synchronization2`, `dynamicRendering`, and `bufferDeviceAddress` where it is offered.
//!   Techniques do without stores of fragment shaders, since wgpu does not tell whether it has enabled them.

mod hal;

use std::sync::Arc;

use volraster::ash::vk;
use volraster::gpu::DepthProjection;
use volraster::{Error, Gpu, Plan, Recorded, Result, Status, TargetDesc, TargetMode};

/// A device with its queue, as wgpu and as volraster have it. Clones share it.
#[derive(Clone, Debug)]
pub struct Context {
    adapter: wgpu::Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    gpu: Gpu,
}

/// A frame of [`Context::composite`], for [`Context::submit`]. One that is dropped is not drawn, and its plan can record again.
#[derive(Debug)]
#[must_use = "is drawn when it is submitted"]
pub struct Frame {
    /// wgpu records no passes into a command buffer that has commands of others: hence two, the transitions of the textures and the frame.
    commands: Option<[wgpu::CommandBuffer; 2]>,
    recorded: Option<Recorded>,
}

impl Drop for Frame {
    fn drop(&mut self) {
        // It was not submitted: its commands can be submitted nowhere else.
        if let Some(recorded) = self.recorded.take() {
            recorded.discarded();
        }
    }
}

impl Context {
    /// Opens a device of an adapter for both libraries.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] where the adapter is not Vulkan's or is for less than Vulkan 1.3 with synchronization2 and dynamic rendering, or
    /// does not offer what the descriptor asks for; [`Error::Vulkan`] when a call fails.
    pub fn open(adapter: &wgpu::Adapter, descriptor: &wgpu::DeviceDescriptor<'_>) -> Result<Self> {
        let (device, queue, enabled) = hal::open(adapter, descriptor)?;
        let gpu = hal::adopt(&device, &queue, enabled)?;
        Ok(Self { adapter: adapter.clone(), device, queue, gpu })
    }

    /// Returns the device as wgpu has it.
    #[must_use]
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Returns the queue as wgpu has it.
    #[must_use]
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Returns the device as volraster has it.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Returns the target of plans whose frames are composited over textures of a format.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] for a format that is no colour.
    pub fn target(&self, format: wgpu::TextureFormat) -> Result<TargetDesc> {
        if format.is_depth_stencil_format() || format.is_compressed() || format.is_multi_planar_format() {
            return Err(unsupported(format!("target of format {format:?}"), "a colour format"));
        }
        Ok(TargetDesc::caller(self.raw_format(format)?, TargetMode::Over))
    }

    /// Records a frame of a plan over the contents of `colour`; with a depth texture and the projection that drew it, behind nothing that it
    /// shows. Passes before and after it in a submission use both textures as usual.
    ///
    /// `colour` is a texture of the plan's format and size with the usage `RENDER_ATTACHMENT`, and no texture of a surface: wgpu makes each
    /// command buffer that uses one end with it ready to be presented, so draw into a texture of your own, and copy or draw that. The depth
    /// texture has the usage `TEXTURE_BINDING`, and may have stencil. Both are of this device and have one mip level, layer and sample. The
    /// frame keeps them until it has ended.
    ///
    /// # Panics
    ///
    /// As wgpu does for textures of another device.
    ///
    /// # Errors
    ///
    /// Those of [`Plan::record`]; [`Error::Invalid`] for textures without these properties.
    pub fn composite(
        &self,
        plan: &mut Plan,
        colour: &wgpu::Texture,
        depth: Option<(&wgpu::Texture, DepthProjection)>,
    ) -> Result<Frame> {
        check(colour, "colour texture", wgpu::TextureUsages::RENDER_ATTACHMENT)?;
        let format = self.raw_format(colour.format())?;
        let colour = hal::Used { texture: colour, view: view(colour, None), format };
        let depth = depth
            .map(|(texture, projection)| {
                check(texture, "depth texture", wgpu::TextureUsages::TEXTURE_BINDING)?;
                if !texture.format().has_depth_aspect() {
                    return Err(invalid(
                        "depth texture",
                        format!("its format {:?} has no depth", texture.format()),
                    ));
                }
                let format = self.raw_format(texture.format())?;
                let view = view(texture, Some(wgpu::TextureAspect::DepthOnly));
                Ok((hal::Used { texture, view, format }, projection))
            })
            .transpose()?;
        let [mut transitions, mut encoder] =
            [(); 2].map(|()| self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()));
        transitions.transition_resources(
            std::iter::empty(),
            [(colour.texture, wgpu::TextureUses::COLOR_TARGET)]
                .into_iter()
                .chain(depth.iter().map(|(depth, _)| (depth.texture, wgpu::TextureUses::RESOURCE)))
                .map(|(texture, state)| wgpu::TextureTransition { texture, selector: None, state }),
        );
        // wgpu checks here that the textures are of this device.
        let transitions = transitions.finish();
        let depth = depth.as_ref().map(|(depth, projection)| (depth, *projection));
        let recorded = hal::record(&self.gpu, &mut encoder, plan, &colour, depth)?;
        Ok(Frame { commands: Some([transitions, encoder.finish()]), recorded: Some(recorded) })
    }

    /// Submits command buffers before and after a frame, in one submission, while the library submits nothing. `then` gets the status of the
    /// frame when the submission has ended. wgpu notices that in [`wgpu::Device::poll`], in a submission, or in a present; `then` may run there,
    /// and must neither submit nor prepare.
    pub fn submit(
        &self,
        before: impl IntoIterator<Item = wgpu::CommandBuffer>,
        mut frame: Frame,
        after: impl IntoIterator<Item = wgpu::CommandBuffer>,
        then: impl FnOnce(Result<Status>) + Send + 'static,
    ) -> wgpu::SubmissionIndex {
        let (commands, recorded) = (frame.commands.take(), frame.recorded.take());
        self.gpu.with_queue(|_| {
            let index =
                self.queue.submit(before.into_iter().chain(commands.into_iter().flatten()).chain(after));
            // It may submit pending writes.
            self.queue.on_submitted_work_done(move || {
                if let Some(recorded) = recorded {
                    then(recorded.completed());
                }
            });
            index
        })
    }

    /// Returns Vulkan's format of textures of a format, which depends on the device.
    fn raw_format(&self, format: wgpu::TextureFormat) -> Result<vk::Format> {
        hal::raw_format(&self.adapter, format)
    }
}

/// Makes the view that a recording uses.
fn view(texture: &wgpu::Texture, aspect: Option<wgpu::TextureAspect>) -> Arc<wgpu::TextureView> {
    Arc::new(texture.create_view(&wgpu::TextureViewDescriptor {
        label: Some("volraster"),
        aspect: aspect.unwrap_or_default(),
        ..Default::default()
    }))
}

fn check(texture: &wgpu::Texture, name: &str, usage: wgpu::TextureUsages) -> Result<()> {
    let plain = texture.mip_level_count() == 1
        && texture.depth_or_array_layers() == 1
        && texture.sample_count() == 1
        && texture.dimension() == wgpu::TextureDimension::D2;
    if !plain {
        return Err(invalid(
            name,
            "must be two-dimensional, with one mip level, layer and sample: resolve it first".into(),
        ));
    }
    if !texture.usage().contains(usage) {
        return Err(invalid(name, format!("must have the usage {usage:?}")));
    }
    Ok(())
}

fn invalid(what: &str, why: String) -> Error {
    Error::Invalid { what: what.into(), why }
}

fn unsupported(what: impl Into<String>, missing: impl Into<String>) -> Error {
    Error::Unsupported { what: what.into(), missing: missing.into() }
}
