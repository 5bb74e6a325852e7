//! The routes of a frame of a grid: pipelines and the image that they write.
//!
//! - Compute: one dispatch marches every ray, or several that resume where the march is too long for one.
//! - Raster: one instanced draw of all slabs, blended by fixed function.
//! - Raster with dithering: one draw per slab, blended by the shader in packed texels.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BRICKS, BINDING_KNOTS, BINDING_TEXELS, BINDING_THRESHOLDS, SPEC_BLUE_NOISE,
    SPEC_EMPTY_SPACE, SPEC_RESUME, SPEC_TARGET, SPEC_UNDER,
};
use crate::gpu::{
    Blend, Buffer, BufferUse, ComputeDesc, Gpu, GraphicsDesc, Image, Pipeline, Resource, SpecConstant,
};
use crate::resident::GpuScene;
use crate::resident::tables::{Knots, SegmentOptions};
use crate::scene::View;
use crate::technique::grid::blue_noise;
use crate::technique::grid::dispatch_limits::{check_loops, slabs_per_dispatch};
use crate::technique::grid::options::{Dither, GridOptions, Prefilter};
use crate::technique::grid::technique::{RasterShaders, Shaders};
use crate::technique::options::{BlendOrder, EmptySpace};

/// How a frame's slabs are composited.
#[derive(Debug)]
pub(super) enum Path {
    /// Polygons blended by fixed function.
    Raster { pipeline: Arc<Pipeline>, vertices: u32 },
    /// Polygons that the shader blends into packed texels, which are then copied to the image.
    ShaderBlend { pipeline: Arc<Pipeline>, vertices: u32, texels: Arc<Buffer> },
    /// A march along each pixel's ray.
    Compute {
        first: Arc<Pipeline>,
        /// Continues where the dispatch before stopped; only where the march is split.
        resume: Option<Arc<Pipeline>>,
        /// Slabs that one dispatch may walk.
        slabs_per_dispatch: u32,
    },
}

/// A route, ready but for its descriptors.
pub(super) struct Routed {
    pub(super) path: Path,
    /// The pipeline whose layout the descriptors have.
    pub(super) pipeline: Arc<Pipeline>,
    /// The image that is written; `None` where that is the caller's.
    pub(super) image: Option<Arc<Image>>,
}

/// The description that a route is built from.
pub(super) struct RouteDesc<'a> {
    pub(super) scene: &'a GpuScene,
    pub(super) name: &'static str,
    pub(super) options: &'a GridOptions,
    pub(super) segments: Option<&'a SegmentOptions>,
    pub(super) shaders: Shaders,
    pub(super) knots: &'a Knots,
    pub(super) constants: Vec<SpecConstant>,
    pub(super) view: &'a View,
    pub(super) target: &'a Canvas,
}

impl RouteDesc<'_> {
    fn gpu(&self) -> &Gpu {
        self.scene.gpu()
    }

    /// Builds the route `compute` for a first view of so many slabs. Adds its bindings to `resources`.
    pub(super) fn march(&self, slabs: u32, resources: &mut Vec<(u32, Resource)>) -> Result<Routed> {
        let Self { scene, name, segments, knots, .. } = *self;
        let gpu = self.gpu();
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = own_image(gpu, name, format, vk::ImageUsageFlags::STORAGE, self.view, self.target)?;
        resources.push((BINDING_ACCUMULATION, Resource::Storage(Arc::clone(&image))));
        let skips = self.options.empty_space == EmptySpace::Skip && self.options.prefilter != Prefilter::Mip;
        // A variant that reads no bricks binds the knots in their place.
        let bricks = if skips {
            Resource::ReadOnly(scene.bricks(scene.margin(segments))?)
        } else {
            Resource::Buffer(Arc::clone(&knots.buffer))
        };
        resources.push((BINDING_BRICKS, bricks));
        let rays = self.view.extent().map(u64::from).iter().product();
        let most = slabs_per_dispatch(gpu, name, slabs, knots, segments, scene.grid()?, rays)?;
        // Translucent surfaces take loop iterations of their own.
        let slabs_per_dispatch = match self.target.layers {
            Some(_) => (most / 2).max(1),
            None => most,
        };
        let pipeline = |resume: bool| {
            let mut constants = self.constants.clone();
            constants.push((SPEC_RESUME, u32::from(resume)));
            constants.push((SPEC_EMPTY_SPACE, u32::from(skips)));
            let name = if resume { format!("{name}.march.resume") } else { format!("{name}.march") };
            let desc = ComputeDesc { shader: self.shaders.compute, constants: &constants };
            gpu.compute_pipeline(&name, &desc)
        };
        let first = pipeline(false)?;
        let resume = if slabs > slabs_per_dispatch { Some(pipeline(true)?) } else { None };
        let path = Path::Compute { first: Arc::clone(&first), resume, slabs_per_dispatch };
        Ok(Routed { path, pipeline: first, image: Some(image) })
    }

    /// Builds the route `raster`, by fixed function or, with dithering, by the shader. Adds its bindings to `resources`.
    pub(super) fn raster(&self, resources: &mut Vec<(u32, Resource)>) -> Result<Routed> {
        let name = self.name;
        let Some(raster) = self.shaders.raster else {
            return Err(Error::unsupported(format!("{name} route=raster"), "polygons: it has none"));
        };
        check_loops(self.gpu(), name, self.knots, self.segments)?;
        match self.options.accumulation().code() {
            Some(code) if self.options.dither != Dither::None => self.shader_blend(&raster, code, resources),
            _ => self.fixed_function(&raster),
        }
    }

    /// Blends the slabs by fixed function.
    fn fixed_function(&self, raster: &RasterShaders) -> Result<Routed> {
        let Self { name, view, target, .. } = *self;
        let gpu = self.gpu();
        let back_to_front = self.options.order() == BlendOrder::BackToFront;
        let format = self.options.accumulation().format();
        let pipeline = gpu.graphics_pipeline(
            &format!("{name}.draw"),
            &GraphicsDesc {
                vertex: raster.vertex,
                fragment: raster.fragment,
                topology: raster.topology,
                blend: if back_to_front { Blend::Over } else { Blend::Under },
                format: Some(format),
                constants: &self.constants,
            },
        )?;
        let image = if draws_directly(target, format, back_to_front) {
            None
        } else {
            Some(own_image(gpu, name, format, vk::ImageUsageFlags::COLOR_ATTACHMENT, view, target)?)
        };
        let path = Path::Raster { pipeline: Arc::clone(&pipeline), vertices: raster.vertices };
        Ok(Routed { path, pipeline, image })
    }

    /// Blends the slabs in the shader, with dithering; `code` is the shader's code of the accumulation format.
    fn shader_blend(
        &self,
        raster: &RasterShaders,
        code: u32,
        resources: &mut Vec<(u32, Resource)>,
    ) -> Result<Routed> {
        let Self { name, options, view, target, .. } = *self;
        let gpu = self.gpu();
        let mut constants = self.constants.clone();
        constants.extend([
            (SPEC_TARGET, code),
            (SPEC_BLUE_NOISE, u32::from(options.dither == Dither::Blue)),
            (SPEC_UNDER, u32::from(options.order() == BlendOrder::FrontToBack)),
        ]);
        let pipeline = gpu.graphics_pipeline(
            &format!("{name}.dither"),
            &GraphicsDesc {
                vertex: raster.vertex,
                fragment: raster.shader_blend,
                topology: raster.topology,
                blend: Blend::Copy,
                format: None,
                constants: &constants,
            },
        )?;
        // An image view needs a usage beyond transfers.
        let usage = vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::SAMPLED;
        gpu.check_drawing(name, view.extent())?;
        let image = own_image(gpu, name, options.accumulation().format(), usage, view, target)?;
        let bytes = image.desc().texel_bytes();
        let texels = Arc::new(Buffer::new(gpu, &format!("{name}.texels"), bytes, BufferUse::ShaderWrite)?);
        resources.push((BINDING_TEXELS, Resource::Buffer(Arc::clone(&texels))));
        let thresholds = if options.dither == Dither::Blue {
            Buffer::with_data(gpu, "blue-noise", bytemuck::cast_slice(blue_noise::tile()))?
        } else {
            match resources.iter().find(|(binding, _)| *binding == BINDING_KNOTS) {
                Some((_, Resource::Buffer(knots))) => Arc::clone(knots),
                _ => Arc::clone(&texels),
            }
        };
        resources.push((BINDING_THRESHOLDS, Resource::Buffer(thresholds)));
        let path = Path::ShaderBlend { pipeline: Arc::clone(&pipeline), vertices: raster.vertices, texels };
        Ok(Routed { path, pipeline, image: Some(image) })
    }
}
