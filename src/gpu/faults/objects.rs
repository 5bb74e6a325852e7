//! Faults in the making and use of buffers, images, views and memory, and requests beyond limits and features.

use ash::vk;

use super::fault::Fault;
use super::ground::{BYTES, FORMAT, Ground, SIDE, range, rows};
use super::synchronization::{sample, stored};
use crate::gpu::feature::OptionalFeature;
use crate::gpu::shader::{COMPOSITE_VERTEX, FAULTS_KBUFFER};
use crate::gpu::validation::Validation;

pub(super) const FAULTS: [Fault; 24] = [
    Fault::new(
        "empty-buffer",
        "a buffer of an empty list has 0 bytes",
        &["VUID-VkBufferCreateInfo-size-00912"],
        |ground| {
            let buffer = ground.bare_buffer(0, vk::BufferUsageFlags::STORAGE_BUFFER)?;
            // SAFETY: just made, unused.
            unsafe { ground.device.destroy_buffer(buffer, None) };
            Ok(())
        },
    ),
    Fault::new(
        "leak",
        "a buffer is not destroyed before its device",
        &["VUID-vkDestroyDevice-device-00378", "VUID-vkDestroyDevice-device-05137"],
        |ground| {
            ground.bare_buffer(BYTES, vk::BufferUsageFlags::STORAGE_BUFFER)?;
            Ok(())
        },
    ),
    Fault::new(
        "buffer-without-memory",
        "a buffer is cleared before memory is bound to it",
        &["VUID-vkCmdFillBuffer-dstBuffer-00031"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let buffer = ground.bare_buffer(BYTES, vk::BufferUsageFlags::TRANSFER_DST)?;
            ground.fill(commands, buffer);
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "memory-bound-unaligned",
        "a buffer lies in a shared block at an offset that is no multiple of its alignment",
        &["VUID-vkBindBufferMemory-memoryOffset-01036", "VUID-vkBindBufferMemory-None-10739"],
        |ground| {
            let buffer = ground.bare_buffer(BYTES, vk::BufferUsageFlags::STORAGE_BUFFER)?;
            // SAFETY: made from this device.
            let mut needs = unsafe { ground.device.get_buffer_memory_requirements(buffer) };
            needs.size *= 4;
            let memory = ground.memory(needs)?;
            // SAFETY: the fault is the offset; the memory is large enough for it.
            unsafe { ground.device.bind_buffer_memory(buffer, memory, 4) }?;
            Ok(())
        },
    ),
    Fault::new(
        "memory-bound-twice",
        "a buffer that grows is bound to larger memory, but not made anew",
        &["VUID-vkBindBufferMemory-buffer-07459", "VUID-vkBindBufferMemory-buffer-01029"],
        |ground| {
            let buffer = ground.buffer(BYTES)?;
            // SAFETY: made from this device.
            let memory = ground.memory(unsafe { ground.device.get_buffer_memory_requirements(buffer) })?;
            // SAFETY: the fault is that it has memory already.
            unsafe { ground.device.bind_buffer_memory(buffer, memory, 0) }?;
            Ok(())
        },
    ),
    Fault::new(
        "mapping-beyond-the-memory",
        "more is mapped than was allocated",
        &["VUID-vkMapMemory-size-00681"],
        |ground| {
            let buffer = ground.buffer(BYTES)?;
            // SAFETY: made from this device.
            let needs = unsafe { ground.device.get_buffer_memory_requirements(buffer) };
            let memory = ground.memory(needs)?;
            let flags = vk::MemoryMapFlags::empty();
            // SAFETY: the fault is the size; the mapping is not used.
            unsafe { ground.device.map_memory(memory, 0, 2 * needs.size, flags) }?;
            Ok(())
        },
    ),
    Fault::new(
        "copy-beyond-the-buffer",
        "a copy of a list is longer than the buffer that takes it",
        &["VUID-vkCmdCopyBuffer-size-00116"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let [from, to] = [ground.buffer(2 * BYTES)?, ground.buffer(BYTES)?];
            let copy = [vk::BufferCopy { src_offset: 0, dst_offset: 0, size: 2 * BYTES }];
            // SAFETY: the fault is the size; the recording is not submitted.
            unsafe { ground.device.cmd_copy_buffer(commands, from, to, &copy) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "clear-of-half-a-word",
        "a buffer of bytes is cleared from an offset that is no multiple of 4",
        &["VUID-vkCmdFillBuffer-dstOffset-00025"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let buffer = ground.buffer(BYTES)?;
            // SAFETY: the fault is the offset; the recording is not submitted.
            unsafe { ground.device.cmd_fill_buffer(commands, buffer, 2, 4, 0) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "update-too-long",
        "a transfer function of more than 65,536 bytes is written by an inline update",
        &["VUID-vkCmdUpdateBuffer-dataSize-00037"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let buffer = ground.buffer(1 << 17)?;
            // SAFETY: the fault is the length; the recording is not submitted.
            unsafe { ground.device.cmd_update_buffer(commands, buffer, 0, &vec![0; (1 << 16) + 4]) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "indirect-without-usage",
        "a dispatch takes its workgroups from a buffer that was not made for that",
        &["VUID-vkCmdDispatchIndirect-buffer-02709"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = super::synchronization::Use::of_buffers(ground)?;
            ground.bind(commands, &copy.pipeline, Some(copy.set));
            // SAFETY: the fault is the usage; the recording is not submitted.
            unsafe { ground.device.cmd_dispatch_indirect(commands, copy.read, 0) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "volume-beyond-limits",
        "a volume is larger than the device's 3D images, and nobody asked",
        &["VUID-VkImageCreateInfo-extent-02253", "VUID-VkImageCreateInfo-extent-02252"],
        |ground| {
            let format = vk::Format::R8_UNORM;
            let (kind, tiling) = (vk::ImageType::TYPE_3D, vk::ImageTiling::OPTIMAL);
            let usage = vk::ImageUsageFlags::SAMPLED;
            let (instance, physical) = (&ground.gpu.inner.instance.raw, ground.gpu.inner.candidate.raw);
            let flags = vk::ImageCreateFlags::empty();
            // SAFETY: the physical device belongs to the instance.
            let most = unsafe {
                instance
                    .get_physical_device_image_format_properties(physical, format, kind, tiling, usage, flags)
            }?;
            let width = most.max_extent.width + 1;
            let info = vk::ImageCreateInfo::default()
                .image_type(kind)
                .format(format)
                .extent(vk::Extent3D { width, height: 1, depth: 1 })
                .mip_levels(1)
                .array_layers(1)
                .samples(vk::SampleCountFlags::TYPE_1)
                .usage(usage);
            // SAFETY: the fault is the extent; the image gets no memory.
            unsafe { ground.device.create_image(&info, None) }?;
            Ok(())
        },
    ),
    Fault::new(
        "sampled-without-usage",
        "an image that was made for stores only is sampled",
        &["VUID-VkWriteDescriptorSet-descriptorType-00337"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = ground.picture(FORMAT, vk::ImageUsageFlags::STORAGE)?;
            sample(ground, commands, &picture, vk::ImageLayout::GENERAL)
        },
    ),
    Fault::new(
        "stored-without-usage",
        "a shader stores into an image that was made for sampling only",
        &["VUID-VkWriteDescriptorSet-descriptorType-00339"],
        |ground| {
            let picture = ground.picture(FORMAT, vk::ImageUsageFlags::SAMPLED)?;
            super::synchronization::Use::of_image(ground, &picture)?;
            Ok(())
        },
    ),
    Fault::new(
        "cleared-without-usage",
        "an image that was not made for transfers is cleared",
        &["VUID-vkCmdClearColorImage-image-00002"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = stored(ground, commands)?;
            let colour = vk::ClearColorValue::default();
            let ranges = [range(vk::ImageAspectFlags::COLOR)];
            let (image, layout) = (picture.image, vk::ImageLayout::GENERAL);
            // SAFETY: the fault is the usage; the recording is not submitted.
            unsafe { ground.device.cmd_clear_color_image(commands, image, layout, &colour, &ranges) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "copy-beyond-the-image",
        "an upload has one more plane than the volume",
        &[
            "VUID-vkCmdCopyBufferToImage-imageSubresource-07971",
            "VUID-vkCmdCopyBufferToImage-imageOffset-09104",
            "VUID-vkCmdCopyBufferToImage-imageSubresource-07972",
            "VUID-vkCmdCopyBufferToImage-pRegions-06217",
            "VUID-vkCmdCopyBufferToImage-pRegions-06218",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let usage = vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::SAMPLED;
            let picture = ground.picture(FORMAT, usage)?;
            let layout = vk::ImageLayout::GENERAL;
            ground.transition(commands, picture.image, [vk::ImageLayout::UNDEFINED, layout]);
            let buffer = ground.buffer(1 << 14)?;
            let region = rows(SIDE + 1);
            // SAFETY: the fault is the extent; the recording is not submitted.
            unsafe {
                ground.device.cmd_copy_buffer_to_image(commands, buffer, picture.image, layout, &[region])
            };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "copy-in-another-layout",
        "an image is copied as if it were ready for transfers, but it is not",
        &["VUID-vkCmdCopyImageToBuffer-srcImageLayout-00189"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let usage = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::STORAGE;
            let picture = ground.picture(FORMAT, usage)?;
            ground.transition(
                commands,
                picture.image,
                [vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL],
            );
            let buffer = ground.buffer(1 << 14)?;
            let region = rows(SIDE);
            let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
            // SAFETY: the fault is the layout; the recording is not submitted.
            unsafe {
                ground.device.cmd_copy_image_to_buffer(commands, picture.image, layout, buffer, &[region])
            };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "sampled-in-another-layout",
        "a shader samples an image whose descriptor names another layout than it has",
        &[
            "VUID-VkDescriptorImageInfo-imageLayout-00344",
            "VUID-vkCmdDispatch-imageLayout-00344",
            "VUID-vkCmdDispatch-None-09600",
            "CoreValidation-DrawState-InvalidImageLayout",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = stored(ground, commands)?;
            sample(ground, commands, &picture, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)?;
            ground.run(commands)?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "sampled-before-its-first-transition",
        "a shader samples an image that no transition has brought into a layout",
        &[
            "VUID-VkDescriptorImageInfo-imageLayout-00344",
            "VUID-vkCmdDraw-None-09600",
            "CoreValidation-DrawState-InvalidImageLayout",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let picture = ground.picture(FORMAT, vk::ImageUsageFlags::SAMPLED)?;
            sample(ground, commands, &picture, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)?;
            ground.run(commands)?;
            Ok(ground.wait()?)
        },
    ),
    Fault::new(
        "depth-in-the-layout-of-colour",
        "a depth image is brought into the layout of a colour attachment",
        &["VUID-VkImageMemoryBarrier2-oldLayout-01208"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let usage = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT;
            let image = ground.image(&Ground::flat(vk::Format::D32_SFLOAT, usage))?;
            let barriers = [vk::ImageMemoryBarrier2::default()
                .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .dst_access_mask(vk::AccessFlags2::MEMORY_WRITE)
                .new_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
                .image(image)
                .subresource_range(range(vk::ImageAspectFlags::DEPTH))];
            let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
            // SAFETY: the fault is the layout; the recording is not submitted.
            unsafe { ground.device.cmd_pipeline_barrier2(commands, &info) };
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "view-of-a-slice",
        "a slice of a volume is viewed as a 2D image, for which the volume was not made",
        &[
            "VUID-VkImageViewCreateInfo-image-04970",
            "VUID-VkImageViewCreateInfo-image-06727",
            "VUID-VkImageViewCreateInfo-image-06728",
        ],
        |ground| {
            let info = Ground::flat(FORMAT, vk::ImageUsageFlags::COLOR_ATTACHMENT)
                .image_type(vk::ImageType::TYPE_3D)
                .extent(vk::Extent3D { width: SIDE, height: SIDE, depth: SIDE });
            let image = ground.image(&info)?;
            let info = Ground::whole(image, FORMAT, vk::ImageAspectFlags::COLOR);
            // SAFETY: the fault is the type of the view, which is not used.
            unsafe { ground.device.create_image_view(&info, None) }?;
            Ok(())
        },
    ),
    Fault::new(
        "mip-level-beyond-the-image",
        "a view begins at a mip level that the volume does not have",
        &["VUID-VkImageViewCreateInfo-subresourceRange-01478"],
        |ground| {
            let image = ground.image(&Ground::flat(FORMAT, vk::ImageUsageFlags::SAMPLED))?;
            let whole = range(vk::ImageAspectFlags::COLOR).base_mip_level(1);
            let info = Ground::whole(image, FORMAT, vk::ImageAspectFlags::COLOR).subresource_range(whole);
            // SAFETY: the fault is the level; the view is not used.
            unsafe { ground.device.create_image_view(&info, None) }?;
            Ok(())
        },
    ),
    Fault::new(
        "integers-sampled-as-floats",
        "a volume of labels, whose format holds integers, is sampled as if it held floats",
        &["VUID-vkCmdDispatch-format-07753"],
        |ground| {
            let (_, commands) = ground.commands()?;
            let layout = vk::ImageLayout::GENERAL;
            let picture = ground.picture(vk::Format::R32_UINT, vk::ImageUsageFlags::SAMPLED)?;
            ground.transition(commands, picture.image, [vk::ImageLayout::UNDEFINED, layout]);
            sample(ground, commands, &picture, layout)?;
            Ok(ground.end(commands)?)
        },
    ),
    Fault::new(
        "stores-of-fragments-without-the-feature",
        "a fragment shader writes a k-buffer on a device opened without fragmentStoresAndAtomics",
        &["VUID-RuntimeSpirv-NonWritable-06340"],
        |ground| {
            ground.graphics(&COMPOSITE_VERTEX, &FAULTS_KBUFFER, Some(FORMAT))?;
            Ok(())
        },
    )
    .lacking(&[OptionalFeature::FragmentStores, OptionalFeature::OrderedStores]),
    Fault::new(
        "pools-reset-one-by-one",
        "command buffers are reset one by one instead of with their pool, and a dispatch has no workgroups",
        &[
            "BestPractices-vkCreateCommandPool-command-buffer-reset",
            "BestPractices-vkCmdDispatch-group-count-zero",
        ],
        |ground| {
            let (_, commands) = ground.commands()?;
            let copy = super::synchronization::Use::of_buffers(ground)?;
            ground.bind(commands, &copy.pipeline, Some(copy.set));
            // SAFETY: recording; pipeline and set are bound. No workgroup runs.
            unsafe { ground.device.cmd_dispatch(commands, 0, 1, 1) };
            Ok(ground.end(commands)?)
        },
    )
    .by(Validation::BestPractices),
];
