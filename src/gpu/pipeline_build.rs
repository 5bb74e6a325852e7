//! Builds pipelines: the layouts when a pipeline is first asked for, and the pipelines of a recording in parallel before it.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Instant;

use ash::vk;

use super::addressing::{ADDRESSES, by_address};
use super::device::Gpu;
use super::inputs::Bound;
use super::pipeline::{Blend, GraphicsState, Pipeline, PipelineKey, Shader, SpecConstant};
use crate::error::{Error, Result};

impl Gpu {
    /// Returns the graphics pipeline of a vertex and a fragment shader, not built yet.
    pub(crate) fn graphics_pipeline(
        &self,
        name: &str,
        bound: &Bound,
        state: GraphicsState,
    ) -> Result<Arc<Pipeline>> {
        self.pipeline(name, self.key(bound, Some(state))?)
    }

    /// Returns the compute pipeline of a shader, not built yet.
    pub(crate) fn compute_pipeline(&self, name: &str, bound: &Bound) -> Result<Arc<Pipeline>> {
        self.pipeline(name, self.key(bound, None)?)
    }

    fn key(&self, bound: &Bound, state: Option<GraphicsState>) -> Result<PipelineKey> {
        let constants = self.constants(bound)?;
        Ok(PipelineKey { shaders: bound.shaders.clone(), constants, addressed: self.addressed(bound), state })
    }

    /// Returns the pipeline of a key with its layouts. [`Gpu::build`] builds it.
    pub(super) fn pipeline(&self, name: &str, key: PipelineKey) -> Result<Arc<Pipeline>> {
        self.alive()?;
        let mut table = self.pipeline_table();
        if let Some(found) = table.get(&key) {
            return Ok(Arc::clone(found));
        }
        let mut pipeline = Pipeline { name: name.to_string(), key: key.clone(), ..Pipeline::default() };
        if let Err(error) = self.make_layouts(&mut pipeline) {
            pipeline.destroy(self.device(), self.host_callbacks());
            return Err(error);
        }
        self.name(pipeline.layout, name);
        self.name(pipeline.set_layout, name);
        let pipeline = Arc::new(pipeline);
        table.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    /// Builds those of the pipelines that are not built yet: on the caller's threads, else on as many as the processor runs.
    pub(crate) fn build<'a>(&self, pipelines: impl Iterator<Item = &'a Arc<Pipeline>>) -> Result<()> {
        let mut open: Vec<&Pipeline> = Vec::new();
        for pipeline in pipelines.filter(|pipeline| !pipeline.is_built()) {
            if !open.iter().any(|other| std::ptr::eq(*other, &raw const **pipeline)) {
                open.push(pipeline);
            }
        }
        if open.is_empty() {
            return Ok(());
        }
        let start = Instant::now();
        let result = self.build_all(&open);
        let spent = u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX);
        self.inner.pipeline_us.fetch_add(spent, Ordering::Relaxed);
        result
    }

    fn build_all(&self, open: &[&Pipeline]) -> Result<()> {
        if let Some(compilation) = &self.inner.compilation {
            let failed = Mutex::new(Ok(()));
            compilation.run(open.len(), &|i| {
                if let Some(Err(error)) = open.get(i).map(|pipeline| self.build_one(pipeline)) {
                    let mut failed = failed.lock().unwrap_or_else(PoisonError::into_inner);
                    *failed = Err(error);
                }
            });
            failed.into_inner().unwrap_or_else(PoisonError::into_inner)?;
            // Those that it has left out.
            return open.iter().try_for_each(|pipeline| self.build_one(pipeline));
        }
        let next = AtomicUsize::new(0);
        let work = || {
            let mut built = Ok(());
            while let Some(pipeline) = open.get(next.fetch_add(1, Ordering::Relaxed)) {
                built = built.and(self.build_one(pipeline));
            }
            built
        };
        let threads = thread::available_parallelism().map_or(1, usize::from).min(open.len());
        // Threads of its own: a thread of a pool that waits may take other work of the caller's, which may build the same pipeline.
        thread::scope(|scope| {
            let others: Vec<_> = (1..threads).map(|_| scope.spawn(work)).collect();
            others.into_iter().fold(work(), |built, other| match other.join() {
                Ok(result) => built.and(result),
                Err(panic) => std::panic::resume_unwind(panic),
            })
        })
    }

    /// Builds a pipeline, unless another thread has.
    fn build_one(&self, pipeline: &Pipeline) -> Result<()> {
        let _building = pipeline.building.lock().unwrap_or_else(PoisonError::into_inner);
        if pipeline.is_built() {
            return Ok(());
        }
        self.alive()?;
        let start = Instant::now();
        let raw = match pipeline.key.state {
            Some(state) => self.build_graphics(&pipeline.key, state, pipeline.layout),
            None => self.build_compute(&pipeline.key, pipeline.layout),
        }?;
        // They are empty, and only the holder of the lock sets them.
        let _ = pipeline.build_time.set(start.elapsed());
        self.name(raw, &pipeline.name);
        let _ = pipeline.raw.set(raw);
        Ok(())
    }

    /// Flags of new pipelines.
    fn flags(&self) -> vk::PipelineCreateFlags {
        match self.inner.statistics {
            Some(_) => vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR,
            None => vk::PipelineCreateFlags::empty(),
        }
    }

    /// Creates the layouts that the shaders declare: set 0 with the union of their bindings.
    fn make_layouts(&self, pipeline: &mut Pipeline) -> Result<()> {
        let shaders = &pipeline.key.shaders;
        pipeline.bindings = shaders.iter().flat_map(|s| s.bindings.iter().copied()).collect();
        pipeline.bindings.sort_unstable_by_key(|&(binding, _)| binding);
        pipeline.bindings.dedup();
        let addressed = &pipeline.key.addressed;
        if !addressed.is_empty() {
            let refuses = |shader: &&&Shader| by_address(&shader.words(), addressed).is_none();
            if let Some(shader) = shaders.iter().find(refuses) {
                let most = self.limits().max_storage_buffer_range;
                let why = format!("a buffer of more than the {most} bytes that a descriptor shows it");
                return Err(Error::unsupported(shader.name, why));
            }
            pipeline.bindings.retain(|(binding, _)| !addressed.contains(binding));
            pipeline.bindings.push((ADDRESSES, vk::DescriptorType::UNIFORM_BUFFER));
        }
        let stages = shaders.iter().fold(vk::ShaderStageFlags::empty(), |all, s| all | s.stage);
        pipeline.stages = stages;
        pipeline.bind_point = if stages == vk::ShaderStageFlags::COMPUTE {
            vk::PipelineBindPoint::COMPUTE
        } else {
            vk::PipelineBindPoint::GRAPHICS
        };
        pipeline.push_bytes = shaders.iter().map(|s| s.push_bytes).max().unwrap_or(0);
        let entry = |&(binding, kind): &(u32, vk::DescriptorType)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(kind)
                .descriptor_count(1)
                .stage_flags(stages)
        };
        let entries: Vec<_> = pipeline.bindings.iter().map(entry).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
        // SAFETY: the device is alive; `info` points at `entries`, which outlive the call.
        pipeline.set_layout =
            unsafe { self.device().create_descriptor_set_layout(&info, self.host_callbacks()) }
                .map_err(|result| self.failed("vkCreateDescriptorSetLayout", result))?;
        let size = pipeline.push_bytes;
        let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size }];
        let set_layouts = [pipeline.set_layout];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts);
        if size > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: the device is alive; no shader declares more than 128 bytes of push constants, which
        // every device offers; `info` points at locals.
        pipeline.layout = unsafe { self.device().create_pipeline_layout(&info, self.host_callbacks()) }
            .map_err(|result| self.failed("vkCreatePipelineLayout", result))?;
        Ok(())
    }

    fn build_graphics(
        &self,
        key: &PipelineKey,
        state: GraphicsState,
        layout: vk::PipelineLayout,
    ) -> Result<vk::Pipeline> {
        let (entries, data) = specialisation(&key.constants);
        let constants = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
        let modules: Vec<Module<'_>> =
            key.shaders.iter().map(|shader| Module::new(self, shader, key)).collect::<Result<_>>()?;
        let stages: Vec<_> = modules.iter().map(|module| module.stage(&constants)).collect();
        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(state.topology);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(vk::CullModeFlags::NONE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let (source, destination) = match state.blend {
            Blend::Copy => (vk::BlendFactor::ONE, vk::BlendFactor::ZERO),
            Blend::Over => (vk::BlendFactor::ONE, vk::BlendFactor::ONE_MINUS_SRC_ALPHA),
            Blend::Under => (vk::BlendFactor::ONE_MINUS_DST_ALPHA, vk::BlendFactor::ONE),
        };
        let attachments = [vk::PipelineColorBlendAttachmentState::default()
            .blend_enable(state.blend != Blend::Copy)
            .src_color_blend_factor(source)
            .dst_color_blend_factor(destination)
            .color_blend_op(vk::BlendOp::ADD)
            .src_alpha_blend_factor(source)
            .dst_alpha_blend_factor(destination)
            .alpha_blend_op(vk::BlendOp::ADD)
            .color_write_mask(vk::ColorComponentFlags::RGBA)];
        let colours = state.format.map_or(0, |_| 1);
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments[..colours]);
        let states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&states);
        let formats = [state.format.unwrap_or_default()];
        let mut rendering =
            vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats[..colours]);
        let info = vk::GraphicsPipelineCreateInfo::default()
            .flags(self.flags())
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
        let built = unsafe {
            self.device().create_graphics_pipelines(self.inner.cache, &[info], self.host_callbacks())
        };
        self.first(built, "vkCreateGraphicsPipelines")
    }

    fn build_compute(&self, key: &PipelineKey, layout: vk::PipelineLayout) -> Result<vk::Pipeline> {
        let (entries, data) = specialisation(&key.constants);
        let constants = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
        let [shader] = key.shaders[..] else {
            return Err(Error::invalid("compute pipeline", "has one shader"));
        };
        let module = Module::new(self, shader, key)?;
        let info = vk::ComputePipelineCreateInfo::default()
            .flags(self.flags())
            .stage(module.stage(&constants))
            .layout(layout);
        // SAFETY: every pointer in `info` refers to a local; the module is alive.
        let built = unsafe {
            self.device().create_compute_pipelines(self.inner.cache, &[info], self.host_callbacks())
        };
        self.first(built, "vkCreateComputePipelines")
    }

    fn first(
        &self,
        built: std::result::Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
        call: &'static str,
    ) -> Result<vk::Pipeline> {
        match built {
            Ok(pipelines) => Ok(pipelines.first().copied().unwrap_or_default()),
            // A failed call for one pipeline leaves none to destroy.
            Err((_, result)) => Err(self.failed(call, result)),
        }
    }
}

/// A shader module that lives while a pipeline is created.
struct Module<'a> {
    gpu: &'a Gpu,
    raw: vk::ShaderModule,
    stage: vk::ShaderStageFlags,
}

impl<'a> Module<'a> {
    fn new(gpu: &'a Gpu, shader: &'static Shader, key: &PipelineKey) -> Result<Self> {
        let words = key.words(shader);
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the device is alive; the code was compiled for this version of Vulkan at build time. Where it was rewritten,
        // the device has buffers with addresses.
        let raw = unsafe { gpu.device().create_shader_module(&info, gpu.host_callbacks()) }
            .map_err(|result| gpu.failed("vkCreateShaderModule", result))?;
        gpu.name(raw, shader.name);
        Ok(Self { gpu, raw, stage: shader.stage })
    }

    fn stage<'b>(&self, constants: &'b vk::SpecializationInfo<'b>) -> vk::PipelineShaderStageCreateInfo<'b> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(self.stage)
            .module(self.raw)
            .name(c"main")
            .specialization_info(constants)
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: made from this device; pipelines do not need their modules once built.
        unsafe { self.gpu.device().destroy_shader_module(self.raw, self.gpu.host_callbacks()) };
    }
}

/// Returns the map entries and the data of specialisation constants. Modules ignore constants that they do not declare, so
/// one list serves all stages.
fn specialisation(constants: &[SpecConstant]) -> (Vec<vk::SpecializationMapEntry>, Vec<u8>) {
    let entries = constants.iter().zip(0_u32..).map(|(&(constant_id, _), i)| vk::SpecializationMapEntry {
        constant_id,
        offset: 4 * i,
        size: 4,
    });
    (entries.collect(), constants.iter().flat_map(|&(_, value)| value.to_ne_bytes()).collect())
}
