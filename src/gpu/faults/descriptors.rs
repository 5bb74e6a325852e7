//! Faults of descriptors, layouts and shaders' inputs.

use ash::vk;

use super::fault::{Failure, Fault};
use super::ground::{BYTES, Ground, all_of};
use super::synchronization::{Use, stored};
use crate::gpu::shader::{FAULTS_COPY, FAULTS_OVERRUN};
use crate::gpu::validation::Validation;

pub(super) const FAULTS: [Fault; 12] = [
    Fault::new(
        "descriptor-of-a-destroyed-image",
        "after a resize, a set still names the image of the old size",
        &[
            "VUID-vkCmdDispatch-None-08114",
            "VUID-vkCmdDispatch-None-02699",
            "CoreValidation-DrawState-DescriptorSetNotUpdated",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = stored(ground, commands)?;
            let store = Use::of_image(ground, &picture)?;
            // SAFETY: the fault is the use after this; the recording is not submitted.
            unsafe { ground.device.destroy_image_view(picture.view, None) };
            store.dispatch(ground, commands);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "descriptor-of-a-destroyed-buffer",
        "after a list has grown, a set still names the buffer of the old size",
        &[
            "VUID-vkCmdDispatch-None-08114",
            "VUID-vkCmdDispatch-None-02699",
            "CoreValidation-DrawState-DescriptorSetNotUpdated",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = Use::of_buffers(ground)?;
            // SAFETY: the fault is the use after this; the recording is not submitted.
            unsafe { ground.device.destroy_buffer(copy.read, None) };
            copy.dispatch(ground, commands);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "descriptor-never-written",
        "a shader reads a binding of a set that nobody has written",
        &[
            "VUID-vkCmdDispatch-None-08114",
            "VUID-vkCmdDispatch-None-02699",
            "CoreValidation-DrawState-DescriptorSetNotUpdated",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let pipeline = ground.compute(&FAULTS_COPY)?;
            let set = ground.set(&pipeline)?;
            ground.dispatch(commands, &pipeline, set);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "set-not-bound",
        "a dispatch follows without the set that its pipeline needs",
        &["VUID-vkCmdDispatch-None-08600", "VUID-vkCmdDispatch-None-02697"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let pipeline = ground.compute(&FAULTS_COPY)?;
            ground.bind(commands, &pipeline, None);
            // SAFETY: the fault is the set that is missing; the recording is not submitted.
            unsafe { ground.device.cmd_dispatch(commands, 1, 1, 1) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "pipeline-not-bound",
        "a dispatch follows without a pipeline",
        &["VUID-vkCmdDispatch-None-08606", "VUID-vkCmdDispatch-None-02700"],
        |ground| {
            let (_, commands) = ground.commands()?;
            // SAFETY: the fault is the pipeline that is missing; the recording is not submitted.
            unsafe { ground.device.cmd_dispatch(commands, 1, 1, 1) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "set-changed-after-recording",
        "a set is written again between the recording that binds it and its submission",
        &[
            "VUID-vkQueueSubmit2-commandBuffer-03874",
            "CoreValidation-DrawState-InvalidCommandBuffer",
            "VUID-vkQueueSubmit-pCommandBuffers-00070",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = Use::of_buffers(ground)?;
            copy.dispatch(ground, commands);
            ground.end(commands)?;
            ground.write_buffer(&copy.pipeline, copy.set, 1, all_of(ground.buffer(BYTES)?));
            let infos = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
            ground.submit(vk::SubmitInfo2::default().command_buffer_infos(&infos), vk::Fence::null())?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "descriptor-offset-unaligned",
        "a part of a buffer begins at an offset that descriptors cannot have",
        &["VUID-VkWriteDescriptorSet-descriptorType-00328"],
        |ground| {
            let pipeline = ground.compute(&FAULTS_COPY)?;
            let set = ground.set(&pipeline)?;
            let buffer = ground.buffer(BYTES)?;
            ground.write_buffer(&pipeline, set, 0, vk::DescriptorBufferInfo { buffer, offset: 1, range: 64 });
            Ok(())
        },
    ),
    Fault::new(
        "descriptor-beyond-the-range",
        "a descriptor shows more of a buffer than maxStorageBufferRange",
        &["VUID-VkWriteDescriptorSet-descriptorType-00333"],
        |ground| {
            let pipeline = ground.compute(&FAULTS_COPY)?;
            let set = ground.set(&pipeline)?;
            let range = u64::from(ground.gpu.limits().max_storage_buffer_range) + 4;
            let buffer = ground.buffer(range)?;
            ground.write_buffer(&pipeline, set, 0, vk::DescriptorBufferInfo { buffer, offset: 0, range });
            Ok(())
        },
    ),
    Fault::new(
        "push-constants-beyond-the-layout",
        "more push constants are set than the pipeline's layout has",
        &["VUID-vkCmdPushConstants-offset-01795", "VUID-vkCmdPushConstants-offset-01796"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let pipeline = ground.compute(&FAULTS_COPY)?;
            let (layout, stages) = (pipeline.layout, pipeline.stages);
            // SAFETY: the fault is the size; the recording is not submitted.
            unsafe { ground.device.cmd_push_constants(commands, layout, stages, 0, &[0; 16]) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "layout-lacks-a-binding",
        "a shader has one more binding than the layout that its pipeline is made with",
        &["VUID-VkComputePipelineCreateInfo-layout-07988", "VUID-VkComputePipelineCreateInfo-layout-00703"],
        |ground| {
            remade(ground, |bindings| bindings.truncate(1))?;
            Ok(())
        },
    ),
    Fault::new(
        "layout-of-another-kind",
        "a shader takes a storage block where the layout has a uniform block",
        &["VUID-VkComputePipelineCreateInfo-layout-07990", "VUID-VkComputePipelineCreateInfo-layout-00703"],
        |ground| {
            remade(ground, |bindings| bindings[0].1 = vk::DescriptorType::UNIFORM_BUFFER)?;
            Ok(())
        },
    ),
    Fault::new(
        "index-beyond-the-list",
        "a shader writes behind the end of its list",
        &[
            "VUID-vkCmdDispatch-None-02706",
            "VUID-vkCmdDispatch-storageBuffers-06936",
            "UNASSIGNED-Device address out of bounds",
            "Device address out of bounds",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let pipeline = ground.compute(&FAULTS_OVERRUN)?;
            let set = ground.set(&pipeline)?;
            // Its memory is larger, so that the write hits nothing else.
            ground.write_buffer(&pipeline, set, 0, all_of(ground.buffer(64)?));
            ground.dispatch(commands, &pipeline, set);
            ground.run(commands)?;
            Ok(ground.wait()?)
        },
    )
    .by(Validation::GpuAssisted),
];

/// Builds the copying shader with a layout of other bindings.
fn remade(
    ground: &Ground<'_>,
    change: impl FnOnce(&mut Vec<(u32, vk::DescriptorType)>),
) -> Result<vk::Pipeline, Failure> {
    let right = ground.compute(&FAULTS_COPY)?;
    let mut bindings = right.bindings.clone();
    change(&mut bindings);
    let entry = |&(binding, kind): &(u32, vk::DescriptorType)| {
        vk::DescriptorSetLayoutBinding::default()
            .binding(binding)
            .descriptor_type(kind)
            .descriptor_count(1)
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
    };
    let entries: Vec<_> = bindings.iter().map(entry).collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
    // SAFETY: the device is alive.
    let sets = [unsafe { ground.device.create_descriptor_set_layout(&info, None) }?];
    let ranges = [vk::PushConstantRange {
        stage_flags: vk::ShaderStageFlags::COMPUTE,
        offset: 0,
        size: right.push_bytes,
    }];
    let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&ranges);
    // SAFETY: the device is alive.
    let layout = unsafe { ground.device.create_pipeline_layout(&info, None) }?;
    let words = FAULTS_COPY.shader().words();
    let info = vk::ShaderModuleCreateInfo::default().code(&words);
    // SAFETY: the code was compiled at build time.
    let module = unsafe { ground.device.create_shader_module(&info, None) }?;
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module)
        .name(c"main");
    let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
    // SAFETY: the fault is the layout; the pipeline is not used.
    let built = unsafe { ground.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
    Ok(built.map(|made| made.first().copied().unwrap_or_default()).map_err(|(_, result)| result)?)
}
