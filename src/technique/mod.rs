//! Techniques: the registry, and the two steps that draw, [`Renderer::prepare`] and [`Plan::record`].
//!
//! [`Renderer::render`] does both and waits. An engine does them itself:
//!
//! ```no_run
//! # use volraster::ash::vk;
//! # use volraster::gpu::{CommandBuffer, Gpu, TargetImage};
//! # use volraster::scene::View;
//! # use volraster::{GpuScene, Renderer, Result, TargetDesc, TargetMode, Technique};
//! # use std::sync::Arc;
//! # fn frame(
//! #     gpu: &Gpu, scene: &Arc<GpuScene>, view: &View, commands: vk::CommandBuffer, image: vk::Image,
//! #     image_view: vk::ImageView, extent: [u32; 2],
//! # ) -> Result<()> {
//! // Once: may allocate, compile, upload, submit and wait.
//! let renderer = Renderer::new(scene, Technique::parse("slices-3d:step=0.5")?);
//! let format = vk::Format::B8G8R8A8_SRGB;
//! let mut plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
//!
//! // Each frame: only records, into the engine's own command buffer and image.
//! if !plan.set_view(view)? {
//!     plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
//! }
//! // SAFETY: the command buffer is recording, on this thread, for this device's queue family.
//! let mut commands = unsafe { CommandBuffer::from_raw(gpu, commands) };
//! // SAFETY: the image is in the layout COLOR_ATTACHMENT_OPTIMAL and outlives the submission.
//! let target = unsafe { TargetImage::from_raw(gpu, image, image_view, format, extent) };
//! let recorded = plan.record(&mut commands, Some(&target), None)?;
//!
//! // The engine submits, and later sees the submission end.
//! let status = recorded.completed()?;
//! for pass in status.passes {
//!     println!("{}: {:.3} ms", pass.name, pass.ms);
//! }
//! # Ok(())
//! # }
//! ```

pub mod grid;
pub mod mesh;
pub(crate) mod options;
mod registry;
mod renderer;
pub mod shear_warp;
pub mod splat;

pub use options::{BlendOrder, EmptySpace, OptionInfo, Route};
pub use registry::{Method, Technique};
pub use renderer::{FrameTime, Frames, Renderer};
