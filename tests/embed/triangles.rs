//! The engine's own pass: a triangle of a vertex buffer, nearer ones in front, into colour and depth.

use super::common::caller::{host_buffer, write};
use super::engine::Engine;
use volraster::ash::vk;
use volraster::gpu::Gpu;

const SOURCE: &str = "#version 460
layout(push_constant) uniform Push { vec4 colour; vec4 place; };
#ifdef VERTEX
layout(location = 0) in vec2 corner;
void main() { gl_Position = vec4(corner * place.z + place.xy, place.w, 1.0); }
#else
layout(location = 0) out vec4 drawn;
void main() { drawn = colour; }
#endif
";

/// A pipeline with its vertex buffer.
pub struct Triangles<'a> {
    engine: &'a Engine,
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
    corners: (vk::Buffer, vk::DeviceMemory),
}

fn module(engine: &Engine, vertex: bool) -> vk::ShaderModule {
    let compiler = shaderc::Compiler::new().unwrap();
    let mut options = shaderc::CompileOptions::new().unwrap();
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    let kind = if vertex { shaderc::ShaderKind::Vertex } else { shaderc::ShaderKind::Fragment };
    options.add_macro_definition(if vertex { "VERTEX" } else { "FRAGMENT" }, None);
    let code = compiler.compile_into_spirv(SOURCE, kind, "triangles", "main", Some(&options)).unwrap();
    // SAFETY: compiled for this version of Vulkan.
    unsafe {
        engine
            .device
            .create_shader_module(&vk::ShaderModuleCreateInfo::default().code(code.as_binary()), None)
    }
    .unwrap()
}

impl<'a> Triangles<'a> {
    pub fn new(engine: &'a Engine, gpu: &Gpu, colour: vk::Format, depth: vk::Format) -> Self {
        let device = &engine.device;
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: 32 }];
        let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges);
        // SAFETY: valid.
        let layout = unsafe { device.create_pipeline_layout(&info, None) }.unwrap();
        let modules = [true, false].map(|vertex| module(engine, vertex));
        let shaders: Vec<_> = [vk::ShaderStageFlags::VERTEX, vk::ShaderStageFlags::FRAGMENT]
            .into_iter()
            .zip(modules)
            .map(|(stage, module)| {
                vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(c"main")
            })
            .collect();
        let bindings = [vk::VertexInputBindingDescription { stride: 8, ..Default::default() }];
        let attributes =
            [vk::VertexInputAttributeDescription { format: vk::Format::R32G32_SFLOAT, ..Default::default() }];
        let vertices = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_binding_descriptions(&bindings)
            .vertex_attribute_descriptions(&attributes);
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let tests = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(true)
            .depth_write_enable(true)
            .depth_compare_op(vk::CompareOp::GREATER_OR_EQUAL);
        let attachments =
            [vk::PipelineColorBlendAttachmentState::default()
                .color_write_mask(vk::ColorComponentFlags::RGBA)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&states);
        let formats = [colour];
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .color_attachment_formats(&formats)
            .depth_attachment_format(depth);
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&shaders)
            .vertex_input_state(&vertices)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&tests)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(layout)
            .push_next(&mut rendering);
        // SAFETY: every pointer refers to a local; the modules are alive.
        let built = unsafe { device.create_graphics_pipelines(vk::PipelineCache::null(), &[info], None) };
        for module in modules {
            // SAFETY: a pipeline does not need its modules once it is built.
            unsafe { device.destroy_shader_module(module, None) };
        }
        let corners = host_buffer(&gpu.handles(), 24, vk::BufferUsageFlags::VERTEX_BUFFER);
        let places: [f32; 6] = [-1.0, -1.0, 1.0, -1.0, 0.0, 1.0];
        write(device, corners.1, &places.map(f32::to_ne_bytes).concat());
        Self { engine, layout, pipeline: built.unwrap()[0], corners }
    }

    /// Binds the vertex buffer, which nothing else in the command buffer may disturb.
    pub fn bind_corners(&self, commands: vk::CommandBuffer) {
        // SAFETY: recording; the buffer is alive.
        unsafe { self.engine.device.cmd_bind_vertex_buffers(commands, 0, &[self.corners.0], &[0]) };
    }

    /// Draws a triangle around a place of normalised device coordinates, with its size and depth; a rendering was begun.
    pub fn draw(
        &self,
        commands: vk::CommandBuffer,
        [width, height]: [u32; 2],
        colour: [f32; 4],
        place: [f32; 4],
    ) {
        let device = &self.engine.device;
        let extent = vk::Extent2D { width, height };
        let viewport =
            vk::Viewport { width: width as f32, height: height as f32, max_depth: 1.0, ..Default::default() };
        // SAFETY: recording; the viewport is dynamic.
        unsafe { device.cmd_set_viewport(commands, 0, &[viewport]) };
        // SAFETY: recording; the scissor is dynamic.
        unsafe { device.cmd_set_scissor(commands, 0, &[extent.into()]) };
        // SAFETY: recording; the pipeline is for the formats of the rendering.
        unsafe { device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, self.pipeline) };
        let bytes = [colour, place].concat().into_iter().flat_map(f32::to_ne_bytes).collect::<Vec<u8>>();
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        // SAFETY: the layout has one range of this size for these stages.
        unsafe { device.cmd_push_constants(commands, self.layout, stages, 0, &bytes) };
        // SAFETY: all that the pipeline needs is set: the vertex buffer by `bind_corners`.
        unsafe { device.cmd_draw(commands, 3, 1, 0, 0) };
    }
}

impl Drop for Triangles<'_> {
    fn drop(&mut self) {
        let device = &self.engine.device;
        // SAFETY: no submission that uses it is pending.
        unsafe { device.destroy_pipeline(self.pipeline, None) };
        // SAFETY: as above.
        unsafe { device.destroy_pipeline_layout(self.layout, None) };
        // SAFETY: as above.
        unsafe { device.destroy_buffer(self.corners.0, None) };
        // SAFETY: its buffer is gone.
        unsafe { device.free_memory(self.corners.1, None) };
    }
}
