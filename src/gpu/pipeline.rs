//! Pipelines, built when first asked for, and the descriptor sets that go with them.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use ash::vk;

use super::buffer::Buffer;
use super::depth::DepthImage;
use super::device::Gpu;
use super::image::Image;
use super::shader::{BindingKind, Shader, Stage};
use super::sync::Use;
use crate::error::{Error, Result};

/// A specialisation constant: its number and its value. Booleans are 0 and 1.
pub(crate) type SpecConstant = (u32, u32);

/// Fixed-function blending of premultiplied colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Blend {
    /// Replace.
    Copy,
    /// New in front of old: back to front.
    Over,
    /// New behind old: front to back.
    Under,
}

/// A graphics pipeline without vertex buffers: shaders make their vertices from indices.
#[derive(Debug)]
pub(crate) struct GraphicsDesc<'a> {
    pub(crate) vertex: &'static Shader,
    pub(crate) fragment: &'static Shader,
    pub(crate) topology: vk::PrimitiveTopology,
    pub(crate) blend: Blend,
    /// Format of the colour attachment; `None` where shaders write elsewhere.
    pub(crate) format: Option<vk::Format>,
    pub(crate) constants: &'a [SpecConstant],
}

/// A compute pipeline.
#[derive(Debug)]
pub(crate) struct ComputeDesc<'a> {
    pub(crate) shader: &'static Shader,
    pub(crate) constants: &'a [SpecConstant],
}

/// What makes two pipelines the same.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct PipelineKey {
    shaders: Vec<&'static str>,
    constants: Vec<SpecConstant>,
    state: Option<(vk::PrimitiveTopology, Blend, Option<vk::Format>)>,
}

/// A pipeline with its layout. Owned by the device's table; lives as long as the device.
#[derive(Debug)]
pub(crate) struct Pipeline {
    name: String,
    raw: vk::Pipeline,
    layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    bind_point: vk::PipelineBindPoint,
    stages: vk::ShaderStageFlags,
    push_bytes: u32,
    bindings: Vec<(u32, BindingKind)>,
}

impl Pipeline {
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    pub(crate) fn layout(&self) -> vk::PipelineLayout {
        self.layout
    }

    pub(crate) fn bind_point(&self) -> vk::PipelineBindPoint {
        self.bind_point
    }

    pub(crate) fn stages(&self) -> vk::ShaderStageFlags {
        self.stages
    }

    pub(crate) fn push_bytes(&self) -> u32 {
        self.push_bytes
    }

    /// Destroys the handles; only the device's destructor does.
    pub(super) fn destroy(&self, device: &ash::Device) {
        // SAFETY: made from this device, which is idle; null is allowed.
        unsafe { device.destroy_pipeline(self.raw, None) };
        // SAFETY: as above.
        unsafe { device.destroy_pipeline_layout(self.layout, None) };
        // SAFETY: as above; every set of this layout is gone.
        unsafe { device.destroy_descriptor_set_layout(self.set_layout, None) };
    }
}

impl Gpu {
    /// The graphics pipeline of a description, built on first use.
    pub(crate) fn graphics_pipeline(&self, name: &str, desc: &GraphicsDesc<'_>) -> Result<Arc<Pipeline>> {
        let key = PipelineKey {
            shaders: vec![desc.vertex.name, desc.fragment.name],
            constants: desc.constants.to_vec(),
            state: Some((desc.topology, desc.blend, desc.format)),
        };
        self.find_or_build(key, name, &[desc.vertex, desc.fragment], |layout| {
            self.build_graphics(desc, layout)
        })
    }

    /// The compute pipeline of a description, built on first use.
    pub(crate) fn compute_pipeline(&self, name: &str, desc: &ComputeDesc<'_>) -> Result<Arc<Pipeline>> {
        let key =
            PipelineKey { shaders: vec![desc.shader.name], constants: desc.constants.to_vec(), state: None };
        self.find_or_build(key, name, &[desc.shader], |layout| self.build_compute(desc, layout))
    }

    fn find_or_build(
        &self,
        key: PipelineKey,
        name: &str,
        shaders: &[&'static Shader],
        build: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline>,
    ) -> Result<Arc<Pipeline>> {
        self.alive()?;
        let mut table = self.pipeline_table();
        if let Some(found) = table.get(&key) {
            return Ok(Arc::clone(found));
        }
        let start = Instant::now();
        let mut pipeline = self.layout_of(name, shaders)?;
        match build(pipeline.layout) {
            Ok(raw) => pipeline.raw = raw,
            Err(error) => {
                pipeline.destroy(self.device());
                return Err(error);
            }
        }
        self.name(pipeline.raw, name);
        self.name(pipeline.layout, name);
        self.name(pipeline.set_layout, name);
        let pipeline = Arc::new(pipeline);
        table.insert(key, Arc::clone(&pipeline));
        let spent = u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX);
        self.inner.pipeline_us.fetch_add(spent, Ordering::Relaxed);
        Ok(pipeline)
    }

    /// Layouts from what the shaders declare: set 0 with the union of their bindings.
    fn layout_of(&self, name: &str, shaders: &[&'static Shader]) -> Result<Pipeline> {
        let mut bindings: Vec<(u32, BindingKind)> =
            shaders.iter().flat_map(|s| s.bindings.iter().copied()).collect();
        bindings.sort_unstable_by_key(|&(binding, _)| binding);
        bindings.dedup();
        let stages = shaders.iter().fold(vk::ShaderStageFlags::empty(), |all, s| all | stage_flags(s.stage));
        let push_bytes = shaders.iter().map(|s| s.push_bytes).max().unwrap_or(0);
        let entries: Vec<_> = bindings
            .iter()
            .map(|&(binding, kind)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(descriptor_type(kind))
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
        // SAFETY: the device is alive; `info` points at `entries`, which outlive the call.
        let set_layout = unsafe { self.device().create_descriptor_set_layout(&info, None) }
            .map_err(|result| self.failed("vkCreateDescriptorSetLayout", result))?;
        let mut pipeline = Pipeline {
            name: name.to_string(),
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout,
            bind_point: if stages == vk::ShaderStageFlags::COMPUTE {
                vk::PipelineBindPoint::COMPUTE
            } else {
                vk::PipelineBindPoint::GRAPHICS
            },
            stages,
            push_bytes,
            bindings,
        };
        let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: push_bytes }];
        let set_layouts = [set_layout];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts);
        if push_bytes > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: the device is alive; at most 128 bytes of push constants are declared anywhere, which
        // every device offers; `info` points at locals.
        match unsafe { self.device().create_pipeline_layout(&info, None) } {
            Ok(layout) => pipeline.layout = layout,
            Err(result) => {
                pipeline.destroy(self.device());
                return Err(self.failed("vkCreatePipelineLayout", result));
            }
        }
        Ok(pipeline)
    }

    fn build_graphics(&self, desc: &GraphicsDesc<'_>, layout: vk::PipelineLayout) -> Result<vk::Pipeline> {
        let (entries, data) = specialisation(desc.constants);
        let constants = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
        let vertex = Module::new(self, desc.vertex)?;
        let fragment = Module::new(self, desc.fragment)?;
        let stages = [vertex.stage(&constants), fragment.stage(&constants)];
        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(desc.topology);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(vk::CullModeFlags::NONE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let (source, destination) = match desc.blend {
            Blend::Copy => (vk::BlendFactor::ONE, vk::BlendFactor::ZERO),
            Blend::Over => (vk::BlendFactor::ONE, vk::BlendFactor::ONE_MINUS_SRC_ALPHA),
            Blend::Under => (vk::BlendFactor::ONE_MINUS_DST_ALPHA, vk::BlendFactor::ONE),
        };
        let attachments = [vk::PipelineColorBlendAttachmentState::default()
            .blend_enable(desc.blend != Blend::Copy)
            .src_color_blend_factor(source)
            .dst_color_blend_factor(destination)
            .color_blend_op(vk::BlendOp::ADD)
            .src_alpha_blend_factor(source)
            .dst_alpha_blend_factor(destination)
            .alpha_blend_op(vk::BlendOp::ADD)
            .color_write_mask(vk::ColorComponentFlags::RGBA)];
        let colours = desc.format.map_or(0, |_| 1);
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments[..colours]);
        let states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&states);
        let formats = [desc.format.unwrap_or_default()];
        let mut rendering =
            vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats[..colours]);
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(layout)
            .push_next(&mut rendering);
        // SAFETY: every pointer in `info` refers to a local; the modules are alive; dynamic rendering is
        // enabled, so no render pass is needed.
        let built = unsafe { self.device().create_graphics_pipelines(self.inner.cache, &[info], None) };
        self.first(built, "vkCreateGraphicsPipelines")
    }

    fn build_compute(&self, desc: &ComputeDesc<'_>, layout: vk::PipelineLayout) -> Result<vk::Pipeline> {
        let (entries, data) = specialisation(desc.constants);
        let constants = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
        let module = Module::new(self, desc.shader)?;
        let info = vk::ComputePipelineCreateInfo::default().stage(module.stage(&constants)).layout(layout);
        // SAFETY: every pointer in `info` refers to a local; the module is alive.
        let built = unsafe { self.device().create_compute_pipelines(self.inner.cache, &[info], None) };
        self.first(built, "vkCreateComputePipelines")
    }

    fn first(
        &self,
        built: std::result::Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
        call: &'static str,
    ) -> Result<vk::Pipeline> {
        match built {
            Ok(pipelines) => Ok(pipelines.first().copied().unwrap_or_default()),
            // One pipeline was asked for: on failure there is none to destroy.
            Err((_, result)) => Err(self.failed(call, result)),
        }
    }
}

/// A shader module for the length of a pipeline's creation.
struct Module<'a> {
    gpu: &'a Gpu,
    raw: vk::ShaderModule,
    stage: Stage,
}

impl<'a> Module<'a> {
    fn new(gpu: &'a Gpu, shader: &'static Shader) -> Result<Self> {
        let words: Vec<u32> =
            shader.code.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the device is alive; the code was compiled for this version of Vulkan at build time.
        let raw = unsafe { gpu.device().create_shader_module(&info, None) }
            .map_err(|result| gpu.failed("vkCreateShaderModule", result))?;
        gpu.name(raw, shader.name);
        Ok(Self { gpu, raw, stage: shader.stage })
    }

    fn stage<'b>(&self, constants: &'b vk::SpecializationInfo<'b>) -> vk::PipelineShaderStageCreateInfo<'b> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(stage_flags(self.stage))
            .module(self.raw)
            .name(c"main")
            .specialization_info(constants)
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: made from this device; pipelines do not need their modules once built.
        unsafe { self.gpu.device().destroy_shader_module(self.raw, None) };
    }
}

/// A constant that a module does not declare is ignored, so one list serves all stages.
fn specialisation(constants: &[SpecConstant]) -> (Vec<vk::SpecializationMapEntry>, Vec<u8>) {
    let entries = constants.iter().zip(0_u32..).map(|(&(constant_id, _), i)| vk::SpecializationMapEntry {
        constant_id,
        offset: 4 * i,
        size: 4,
    });
    (entries.collect(), constants.iter().flat_map(|&(_, value)| value.to_ne_bytes()).collect())
}

fn stage_flags(stage: Stage) -> vk::ShaderStageFlags {
    match stage {
        Stage::Vertex => vk::ShaderStageFlags::VERTEX,
        Stage::Fragment => vk::ShaderStageFlags::FRAGMENT,
        Stage::Compute => vk::ShaderStageFlags::COMPUTE,
    }
}

fn descriptor_type(kind: BindingKind) -> vk::DescriptorType {
    match kind {
        BindingKind::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
        BindingKind::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
        BindingKind::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        BindingKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
    }
}

/// How images of the caller are sampled.
const EXTERNAL_FILTER: vk::Filter = vk::Filter::NEAREST;

/// What a binding is filled with.
#[derive(Clone, Debug)]
pub(crate) enum Resource {
    /// A whole buffer.
    Buffer(Arc<Buffer>),
    /// A whole buffer that some other pass has written and this one only reads.
    ReadOnly(Arc<Buffer>),
    /// An image with a filter to sample it with.
    Sampled(Arc<Image>, vk::Filter),
    /// A storage image.
    Storage(Arc<Image>),
    /// An image of the caller, named by [`Descriptors::sample_external`] before each recording.
    External,
}

/// A descriptor set that keeps what it names alive.
#[derive(Debug)]
pub(crate) struct Descriptors {
    gpu: Gpu,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
    resources: Vec<(u32, BindingKind, Resource)>,
}

impl Descriptors {
    /// A set for `pipeline`. Every binding that the pipeline declares must be given; others are ignored.
    pub(crate) fn new(gpu: &Gpu, pipeline: &Pipeline, given: &[(u32, Resource)]) -> Result<Self> {
        gpu.alive()?;
        let missing = |binding: u32| {
            Error::invalid(
                format!("descriptors of {}", pipeline.name),
                format!("binding {binding} is not given"),
            )
        };
        let mut resources = Vec::new();
        for &(binding, kind) in &pipeline.bindings {
            let found =
                given.iter().find(|(number, _)| *number == binding).ok_or_else(|| missing(binding))?;
            resources.push((binding, kind, found.1.clone()));
        }
        let sizes: Vec<_> = pipeline
            .bindings
            .iter()
            .map(|&(_, kind)| vk::DescriptorPoolSize { ty: descriptor_type(kind), descriptor_count: 1 })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive; every pipeline here has at least one binding, so the sizes are not
        // empty.
        let pool = unsafe { gpu.device().create_descriptor_pool(&info, None) }
            .map_err(|result| gpu.failed("vkCreateDescriptorPool", result))?;
        let mut descriptors =
            Self { gpu: gpu.clone(), pool, set: vk::DescriptorSet::null(), resources: Vec::new() };
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for one set of this layout.
        let sets = unsafe { gpu.device().allocate_descriptor_sets(&info) }
            .map_err(|result| gpu.failed("vkAllocateDescriptorSets", result))?;
        descriptors.set = sets.first().copied().unwrap_or_default();
        for (binding, kind, resource) in &resources {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(descriptors.set)
                .dst_binding(*binding)
                .descriptor_type(descriptor_type(*kind));
            let (buffer, image);
            let write = match resource {
                Resource::Buffer(b) | Resource::ReadOnly(b) => {
                    // A uniform block may be the start of a larger buffer.
                    let most = u64::from(gpu.inner.properties.limits.max_uniform_buffer_range);
                    let range =
                        if *kind == BindingKind::UniformBuffer { b.size().min(most) } else { b.size() };
                    buffer = [vk::DescriptorBufferInfo { buffer: b.raw(), offset: 0, range }];
                    write.buffer_info(&buffer)
                }
                Resource::Sampled(i, filter) => {
                    image = [vk::DescriptorImageInfo {
                        sampler: gpu.sampler(*filter, i.desc().levels > 1)?,
                        image_view: i.view(),
                        image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
                    }];
                    write.image_info(&image)
                }
                Resource::Storage(i) => {
                    image = [vk::DescriptorImageInfo {
                        sampler: vk::Sampler::null(),
                        image_view: i.view(),
                        image_layout: vk::ImageLayout::GENERAL,
                    }];
                    write.image_info(&image)
                }
                Resource::External => {
                    // Made now: recording makes nothing.
                    gpu.sampler(EXTERNAL_FILTER, false)?;
                    continue;
                }
            };
            // SAFETY: the set is not in use; the resources are alive and `descriptors` keeps them so.
            unsafe { gpu.device().update_descriptor_sets(&[write], &[]) };
        }
        descriptors.resources = resources;
        Ok(descriptors)
    }

    /// Fills a binding that was left for an image of the caller. No recording that names the set may be pending.
    pub(crate) fn sample_external(&self, binding: u32, depth: &DepthImage) -> Result<()> {
        let image = [vk::DescriptorImageInfo {
            sampler: self.gpu.sampler(EXTERNAL_FILTER, false)?,
            image_view: depth.view,
            image_layout: depth.layout,
        }];
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.set)
            .dst_binding(binding)
            .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
            .image_info(&image);
        // SAFETY: the set is not in use, by this function's contract with its one caller, which has the plan to itself and its
        // last recording completed; the view is alive by the contract of `DepthImage::from_raw`.
        unsafe { self.gpu.device().update_descriptor_sets(&[write], &[]) };
        Ok(())
    }

    /// What a binding was filled with.
    pub(crate) fn resource(&self, binding: u32) -> Option<Resource> {
        self.resources.iter().find(|(number, ..)| *number == binding).map(|(_, _, resource)| resource.clone())
    }

    pub(crate) fn set(&self) -> vk::DescriptorSet {
        self.set
    }

    /// The resources with the use that a pass of this bind point makes of them.
    pub(crate) fn uses(&self, compute: bool) -> impl Iterator<Item = (&Resource, Use)> {
        self.resources.iter().filter_map(move |(_, kind, resource)| {
            let usage = match (resource, compute) {
                // Ready by its owner's word.
                (Resource::External, _) => return None,
                (Resource::Sampled(..), true) => Use::ComputeSample,
                (Resource::Sampled(..), false) => Use::FragmentSample,
                (Resource::Storage(_), true) => Use::ComputeReadWrite,
                (Resource::Storage(_), false) => Use::FragmentReadWrite,
                (Resource::Buffer(_), true) if *kind == BindingKind::UniformBuffer => Use::ComputeRead,
                (Resource::Buffer(b), true) if b.is_written_by_shaders() => Use::ComputeReadWrite,
                (Resource::Buffer(_), true) => Use::ComputeRead,
                (Resource::Buffer(b), false)
                    if *kind == BindingKind::StorageBuffer && b.is_written_by_shaders() =>
                {
                    Use::FragmentReadWrite
                }
                (Resource::Buffer(_) | Resource::ReadOnly(_), false) => Use::FragmentRead,
                (Resource::ReadOnly(_), true) => Use::ComputeRead,
            };
            Some((resource, usage))
        })
    }
}

impl Drop for Descriptors {
    fn drop(&mut self) {
        // SAFETY: a submission holds its descriptors until its fence has signalled; sets go with the pool.
        unsafe { self.gpu.device().destroy_descriptor_pool(self.pool, None) };
    }
}
