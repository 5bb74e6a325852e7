//! The program's own opaque pass: boxes, into colour and depth.

use volraster::ash::vk;
use volraster::glam::{DMat4, Vec3, Vec4};

use super::vulkan::{Result, Vulkan};

/// Centre, half the size, colour.
const BOXES: [[[f32; 3]; 3]; 4] = [
    // A floor below the volume.
    [[0.0, -1.15, 0.0], [1.7, 0.05, 1.7], [0.32, 0.34, 0.38]],
    // In the volume.
    [[0.3, -0.2, 0.25], [0.25, 0.45, 0.25], [0.8, 0.45, 0.12]],
    // Behind it.
    [[-1.3, -0.2, -1.2], [0.3, 0.9, 0.3], [0.12, 0.3, 0.7]],
    // Between it and the eye.
    [[1.4, 0.2, 2.2], [0.14, 0.14, 0.14], [0.7, 0.05, 0.6]],
];

/// A pipeline that draws boxes, nearer ones in front: depth is reversed.
pub(crate) struct Boxes<'a> {
    vulkan: &'a Vulkan,
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
}

fn compile(stage: &str, kind: shaderc::ShaderKind) -> Result<Vec<u32>> {
    let compiler = shaderc::Compiler::new()?;
    let mut options = shaderc::CompileOptions::new()?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    options.add_macro_definition(stage, None);
    let source = include_str!("boxes.glsl");
    let artifact = compiler.compile_into_spirv(source, kind, "boxes.glsl", "main", Some(&options))?;
    Ok(artifact.as_binary().to_vec())
}

impl<'a> Boxes<'a> {
    pub(crate) fn new(vulkan: &'a Vulkan, colour: vk::Format, depth: vk::Format) -> Result<Self> {
        let device = &vulkan.device;
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: 112 }];
        let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges);
        // SAFETY: every device has 128 bytes of push constants.
        let layout = unsafe { device.create_pipeline_layout(&info, None) }?;
        let mut boxes = Self { vulkan, layout, pipeline: vk::Pipeline::null() };
        let kinds = [
            ("VERTEX", shaderc::ShaderKind::Vertex, vk::ShaderStageFlags::VERTEX),
            ("FRAGMENT", shaderc::ShaderKind::Fragment, vk::ShaderStageFlags::FRAGMENT),
        ];
        let mut modules = Vec::new();
        for (name, kind, stage) in kinds {
            let code = compile(name, kind)?;
            let info = vk::ShaderModuleCreateInfo::default().code(&code);
            // SAFETY: the code was compiled for this version of Vulkan.
            modules.push((stage, unsafe { device.create_shader_module(&info, None) }?));
        }
        let shaders: Vec<_> = modules
            .iter()
            .map(|&(stage, module)| {
                vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(c"main")
            })
            .collect();
        let vertices = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let tests = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(true)
            .depth_write_enable(true)
            .depth_compare_op(vk::CompareOp::GREATER);
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
        for (_, module) in modules {
            // SAFETY: a pipeline does not need its modules once it is built.
            unsafe { device.destroy_shader_module(module, None) };
        }
        boxes.pipeline = built.map_err(|(_, result)| result)?[0];
        Ok(boxes)
    }

    /// Draws them; a rendering of this extent was begun.
    pub(crate) fn record(&self, commands: vk::CommandBuffer, extent: vk::Extent2D, to_clip: DMat4) {
        let device = &self.vulkan.device;
        let viewport = vk::Viewport {
            width: extent.width as f32,
            height: extent.height as f32,
            max_depth: 1.0,
            ..Default::default()
        };
        // SAFETY: recording; the viewport is dynamic.
        unsafe { device.cmd_set_viewport(commands, 0, &[viewport]) };
        // SAFETY: recording; the scissor is dynamic.
        unsafe { device.cmd_set_scissor(commands, 0, &[extent.into()]) };
        // SAFETY: recording; the pipeline is for the formats of the rendering.
        unsafe { device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, self.pipeline) };
        for [centre, half_size, colour] in BOXES {
            let vectors = [centre, half_size, colour].map(|v| Vec4::from((Vec3::from(v), 0.0)).to_array());
            let floats = to_clip.as_mat4().to_cols_array();
            let floats = floats.iter().chain(vectors.as_flattened());
            let bytes: Vec<u8> = floats.flat_map(|f| f.to_ne_bytes()).collect();
            let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
            // SAFETY: the layout has one range of this size for these stages.
            unsafe { device.cmd_push_constants(commands, self.layout, stages, 0, &bytes) };
            // SAFETY: all that the pipeline needs is set.
            unsafe { device.cmd_draw(commands, 36, 1, 0, 0) };
        }
    }
}

impl Drop for Boxes<'_> {
    fn drop(&mut self) {
        // SAFETY: no submission that uses it is pending; null is allowed.
        unsafe { self.vulkan.device.destroy_pipeline(self.pipeline, None) };
        // SAFETY: as above.
        unsafe { self.vulkan.device.destroy_pipeline_layout(self.layout, None) };
    }
}
