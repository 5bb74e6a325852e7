/*
 * volraster in a C program: instance, device, image and command buffer are the program's.
 *
 *     embed OUT.ppm [SCENE|DATA]
 *
 * Without a file it draws a shell of fog around a dense core. Ends with 0 if the picture is not empty and the validation layers,
 * where there are any, had nothing to say.
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <vulkan/vulkan.h>

#include "volraster.h"

enum { WIDTH = 320, HEIGHT = 240, SIDE = 48, TRIES = 8 };

#define LENGTH(array) (sizeof(array) / sizeof(array)[0])

static void fail(const char *what, const char *why)
{
    fprintf(stderr, "embed: %s: %s\n", what, why);
    exit(1);
}

/* Of Vulkan. */
static void vk(VkResult result, const char *what)
{
    if (result < 0) {
        char code[32];
        snprintf(code, sizeof code, "VkResult %d", (int)result);
        fail(what, code);
    }
}

/* Of volraster. */
static void vr(vr_result result, const char *what)
{
    if (result < 0)
        fail(what, vr_last_error());
}

/* ------------------------------------------------------------------------------------------------------ the program's Vulkan */

typedef struct {
    VkInstance instance;
    int debug_utils;
    VkDebugUtilsMessengerEXT messenger;
    unsigned messages;
    VkPhysicalDevice physical;
    uint32_t family;
    VkDevice device;
    VkQueue queue;
} engine;

static VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                                 VkDebugUtilsMessageTypeFlagsEXT types,
                                                 const VkDebugUtilsMessengerCallbackDataEXT *data, void *user)
{
    (void)severity, (void)types;
    fprintf(stderr, "validation: %s\n", data->pMessage);
    ++*(unsigned *)user;
    return VK_FALSE;
}

static int has_layer(const char *name)
{
    VkLayerProperties layers[64];
    uint32_t count = LENGTH(layers);
    vk(vkEnumerateInstanceLayerProperties(&count, layers), "vkEnumerateInstanceLayerProperties");
    for (uint32_t i = 0; i < count; ++i)
        if (!strcmp(layers[i].layerName, name))
            return 1;
    return 0;
}

static int has_extension(const char *layer, const char *name)
{
    VkExtensionProperties extensions[128];
    uint32_t count = LENGTH(extensions);
    vk(vkEnumerateInstanceExtensionProperties(layer, &count, extensions), "vkEnumerateInstanceExtensionProperties");
    for (uint32_t i = 0; i < count; ++i)
        if (!strcmp(extensions[i].extensionName, name))
            return 1;
    return 0;
}

/* The first device for Vulkan 1.3, a real GPU before a software one. */
static VkPhysicalDevice choose(VkInstance instance)
{
    VkPhysicalDevice devices[16], best = VK_NULL_HANDLE;
    uint32_t count = LENGTH(devices);
    vk(vkEnumeratePhysicalDevices(instance, &count, devices), "vkEnumeratePhysicalDevices");
    for (uint32_t i = 0; i < count; ++i) {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(devices[i], &properties);
        if (properties.apiVersion < VK_API_VERSION_1_3)
            continue;
        if (properties.deviceType != VK_PHYSICAL_DEVICE_TYPE_CPU)
            return devices[i];
        if (!best)
            best = devices[i];
    }
    if (!best)
        fail("device", "none supports Vulkan 1.3");
    return best;
}

/* Makes the engine's objects, and has volraster take them. */
static vr_gpu *open_engine(engine *e)
{
    static const char *const layers[] = {"VK_LAYER_KHRONOS_validation"};
    const char *names[3];
    uint32_t name_count = 0;
    int validated = has_layer(layers[0]);
    e->debug_utils = validated || has_extension(NULL, VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
    if (e->debug_utils)
        names[name_count++] = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;

    VkDebugUtilsMessengerCreateInfoEXT messenger = {
        .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
        .messageSeverity =
            VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT,
        .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
        .pfnUserCallback = on_message,
        .pUserData = &e->messages,
    };
    VkValidationFeatureEnableEXT check = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
    VkValidationFeaturesEXT checks = {
        .sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT,
        .pNext = &messenger,
        .enabledValidationFeatureCount = 1,
        .pEnabledValidationFeatures = &check,
    };
    int synchronization = validated && has_extension(layers[0], VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);
    if (synchronization)
        names[name_count++] = VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME;

    VkApplicationInfo application = {
        .sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
        .pApplicationName = "embed",
        .apiVersion = VK_API_VERSION_1_3,
    };
    VkInstanceCreateInfo instance_info = {
        .sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
        .pNext = synchronization ? (void *)&checks : validated ? (void *)&messenger : NULL,
        .pApplicationInfo = &application,
        .enabledLayerCount = validated ? 1 : 0,
        .ppEnabledLayerNames = layers,
        .enabledExtensionCount = name_count,
        .ppEnabledExtensionNames = names,
    };
    vk(vkCreateInstance(&instance_info, NULL, &e->instance), "vkCreateInstance");
    if (validated) {
        PFN_vkCreateDebugUtilsMessengerEXT create =
            (PFN_vkCreateDebugUtilsMessengerEXT)vkGetInstanceProcAddr(e->instance, "vkCreateDebugUtilsMessengerEXT");
        vk(create(e->instance, &messenger, NULL, &e->messenger), "vkCreateDebugUtilsMessengerEXT");
    }

    e->physical = choose(e->instance);
    VkQueueFamilyProperties families[32];
    uint32_t family_count = LENGTH(families);
    vkGetPhysicalDeviceQueueFamilyProperties(e->physical, &family_count, families);
    VkQueueFlags both = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    while (e->family < family_count && (families[e->family].queueFlags & both) != both)
        ++e->family;
    if (e->family == family_count)
        fail("device", "no queue family for graphics and compute");

    /* What volraster requires. What is optional and not enabled, it does without. */
    VkPhysicalDeviceVulkan13Features features13 = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES,
        .synchronization2 = VK_TRUE,
        .dynamicRendering = VK_TRUE,
    };
    float priority = 1;
    VkDeviceQueueCreateInfo queue_info = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = e->family,
        .queueCount = 1,
        .pQueuePriorities = &priority,
    };
    VkDeviceCreateInfo device_info = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
        .pNext = &features13,
        .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue_info,
    };
    vk(vkCreateDevice(e->physical, &device_info, NULL, &e->device), "vkCreateDevice");
    vkGetDeviceQueue(e->device, e->family, 0, &e->queue);

    vr_device_info info = {
        .struct_size = sizeof info,
        .get_instance_proc_addr = vkGetInstanceProcAddr,
        .instance = e->instance,
        .api_version = application.apiVersion,
        .instance_extension_count = name_count,
        .instance_extensions = names,
        .physical_device = e->physical,
        .device = e->device,
        .device_create_info = &device_info,
        .queue = e->queue,
        .queue_family = e->family,
    };
    vr_gpu *gpu;
    vr(vr_gpu_adopt(&info, &gpu), "vr_gpu_adopt");
    return gpu;
}

/* The number of validation messages. */
static unsigned close_engine(engine *e)
{
    vkDestroyDevice(e->device, NULL);
    if (e->messenger) {
        PFN_vkDestroyDebugUtilsMessengerEXT destroy =
            (PFN_vkDestroyDebugUtilsMessengerEXT)vkGetInstanceProcAddr(e->instance, "vkDestroyDebugUtilsMessengerEXT");
        destroy(e->instance, e->messenger, NULL);
    }
    vkDestroyInstance(e->instance, NULL);
    return e->messages;
}

/* ------------------------------------------------------------------------------------------------------- the program's images */

typedef struct {
    VkImage image, depth;
    VkImageView view, depth_view;
    VkDeviceMemory memory, depth_memory, buffer_memory;
    VkBuffer buffer;
    VkCommandPool pool;
    VkCommandBuffer commands;
    VkFence fence;
} frame;

static const VkFormat FORMAT = VK_FORMAT_R8G8B8A8_UNORM;
static const VkFormat DEPTH_FORMAT = VK_FORMAT_D16_UNORM;

static VkDeviceMemory allocate(const engine *e, VkMemoryRequirements needed, VkMemoryPropertyFlags wanted)
{
    VkPhysicalDeviceMemoryProperties all;
    vkGetPhysicalDeviceMemoryProperties(e->physical, &all);
    uint32_t type = 0;
    while (type < all.memoryTypeCount && !((needed.memoryTypeBits >> type & 1) &&
                                           (all.memoryTypes[type].propertyFlags & wanted) == wanted))
        ++type;
    if (type == all.memoryTypeCount)
        fail("memory", "no type fits");
    VkMemoryAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
        .allocationSize = needed.size,
        .memoryTypeIndex = type,
    };
    VkDeviceMemory memory;
    vk(vkAllocateMemory(e->device, &info, NULL, &memory), "vkAllocateMemory");
    return memory;
}

static void make_image(const engine *e, VkFormat format, VkImageUsageFlags usage, VkImageAspectFlags aspect,
                       VkImage *image, VkDeviceMemory *memory, VkImageView *view)
{
    VkImageCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO,
        .imageType = VK_IMAGE_TYPE_2D,
        .format = format,
        .extent = {WIDTH, HEIGHT, 1},
        .mipLevels = 1,
        .arrayLayers = 1,
        .samples = VK_SAMPLE_COUNT_1_BIT,
        .usage = usage,
    };
    vk(vkCreateImage(e->device, &info, NULL, image), "vkCreateImage");
    VkMemoryRequirements needed;
    vkGetImageMemoryRequirements(e->device, *image, &needed);
    *memory = allocate(e, needed, 0);
    vk(vkBindImageMemory(e->device, *image, *memory, 0), "vkBindImageMemory");
    VkImageViewCreateInfo view_info = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO,
        .image = *image,
        .viewType = VK_IMAGE_VIEW_TYPE_2D,
        .format = format,
        .subresourceRange = {.aspectMask = aspect, .levelCount = 1, .layerCount = 1},
    };
    vk(vkCreateImageView(e->device, &view_info, NULL, view), "vkCreateImageView");
}

static void make_frame(const engine *e, frame *f)
{
    make_image(e, FORMAT, VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT,
               VK_IMAGE_ASPECT_COLOR_BIT, &f->image, &f->memory, &f->view);
    make_image(e, DEPTH_FORMAT, VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_SAMPLED_BIT,
               VK_IMAGE_ASPECT_DEPTH_BIT, &f->depth, &f->depth_memory, &f->depth_view);
    VkBufferCreateInfo buffer_info = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
        .size = 4 * WIDTH * HEIGHT,
        .usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT,
    };
    vk(vkCreateBuffer(e->device, &buffer_info, NULL, &f->buffer), "vkCreateBuffer");
    VkMemoryRequirements needed;
    vkGetBufferMemoryRequirements(e->device, f->buffer, &needed);
    f->buffer_memory =
        allocate(e, needed, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    vk(vkBindBufferMemory(e->device, f->buffer, f->buffer_memory, 0), "vkBindBufferMemory");
    VkCommandPoolCreateInfo pool_info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
        .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
        .queueFamilyIndex = e->family,
    };
    vk(vkCreateCommandPool(e->device, &pool_info, NULL, &f->pool), "vkCreateCommandPool");
    VkCommandBufferAllocateInfo commands_info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = f->pool,
        .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
        .commandBufferCount = 1,
    };
    vk(vkAllocateCommandBuffers(e->device, &commands_info, &f->commands), "vkAllocateCommandBuffers");
    VkFenceCreateInfo fence_info = {.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
    vk(vkCreateFence(e->device, &fence_info, NULL, &f->fence), "vkCreateFence");
}

static void destroy_frame(const engine *e, frame *f)
{
    vkDestroyFence(e->device, f->fence, NULL);
    vkDestroyCommandPool(e->device, f->pool, NULL);
    vkDestroyBuffer(e->device, f->buffer, NULL);
    vkFreeMemory(e->device, f->buffer_memory, NULL);
    vkDestroyImageView(e->device, f->depth_view, NULL);
    vkDestroyImage(e->device, f->depth, NULL);
    vkFreeMemory(e->device, f->depth_memory, NULL);
    vkDestroyImageView(e->device, f->view, NULL);
    vkDestroyImage(e->device, f->image, NULL);
    vkFreeMemory(e->device, f->memory, NULL);
}

static void barrier(const frame *f, VkImage image, VkImageAspectFlags aspect, VkImageLayout from, VkImageLayout to)
{
    VkAccessFlags2 all = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
    VkImageMemoryBarrier2 image_barrier = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .srcAccessMask = all,
        .dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .dstAccessMask = all,
        .oldLayout = from,
        .newLayout = to,
        .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .image = image,
        .subresourceRange = {.aspectMask = aspect, .levelCount = 1, .layerCount = 1},
    };
    VkDependencyInfo info = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .imageMemoryBarrierCount = 1,
        .pImageMemoryBarriers = &image_barrier,
    };
    vkCmdPipelineBarrier2(f->commands, &info);
}

/* The program's own drawing: a blue background, and a wall in the right half, `wall` as the depth image stores it. */
static void draw_solids(const frame *f, float wall)
{
    const VkImageLayout colour = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    const VkImageLayout depth = VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL;
    barrier(f, f->image, VK_IMAGE_ASPECT_COLOR_BIT, VK_IMAGE_LAYOUT_UNDEFINED, colour);
    barrier(f, f->depth, VK_IMAGE_ASPECT_DEPTH_BIT, VK_IMAGE_LAYOUT_UNDEFINED, depth);
    VkRenderingAttachmentInfo colour_info = {
        .sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO,
        .imageView = f->view,
        .imageLayout = colour,
        .loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR,
        .storeOp = VK_ATTACHMENT_STORE_OP_STORE,
        .clearValue = {.color = {.float32 = {0, 0, 0.25F, 1}}},
    };
    VkRenderingAttachmentInfo depth_info = {
        .sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO,
        .imageView = f->depth_view,
        .imageLayout = depth,
        .loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR,
        .storeOp = VK_ATTACHMENT_STORE_OP_STORE,
        .clearValue = {.depthStencil = {1, 0}},
    };
    VkRenderingInfo rendering = {
        .sType = VK_STRUCTURE_TYPE_RENDERING_INFO,
        .renderArea = {{0, 0}, {WIDTH, HEIGHT}},
        .layerCount = 1,
        .colorAttachmentCount = 1,
        .pColorAttachments = &colour_info,
        .pDepthAttachment = &depth_info,
    };
    vkCmdBeginRendering(f->commands, &rendering);
    VkClearAttachment attachment = {
        .aspectMask = VK_IMAGE_ASPECT_DEPTH_BIT,
        .clearValue = {.depthStencil = {wall, 0}},
    };
    VkClearRect right = {{{WIDTH / 2, 0}, {WIDTH - WIDTH / 2, HEIGHT}}, 0, 1};
    vkCmdClearAttachments(f->commands, 1, &attachment, 1, &right);
    vkCmdEndRendering(f->commands);
    barrier(f, f->image, VK_IMAGE_ASPECT_COLOR_BIT, colour, colour);
    barrier(f, f->depth, VK_IMAGE_ASPECT_DEPTH_BIT, depth, VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL);
}

static void read_out(const frame *f)
{
    barrier(f, f->image, VK_IMAGE_ASPECT_COLOR_BIT, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
            VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
    VkBufferImageCopy region = {
        .imageSubresource = {.aspectMask = VK_IMAGE_ASPECT_COLOR_BIT, .layerCount = 1},
        .imageExtent = {WIDTH, HEIGHT, 1},
    };
    vkCmdCopyImageToBuffer(f->commands, f->image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, f->buffer, 1, &region);
    VkMemoryBarrier2 memory = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
        .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
        .dstStageMask = VK_PIPELINE_STAGE_2_HOST_BIT,
        .dstAccessMask = VK_ACCESS_2_HOST_READ_BIT,
    };
    VkDependencyInfo info = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .memoryBarrierCount = 1,
        .pMemoryBarriers = &memory,
    };
    vkCmdPipelineBarrier2(f->commands, &info);
}

static void submit_and_wait(const engine *e, const frame *f)
{
    VkCommandBufferSubmitInfo commands = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO,
        .commandBuffer = f->commands,
    };
    VkSubmitInfo2 submission = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO_2,
        .commandBufferInfoCount = 1,
        .pCommandBufferInfos = &commands,
    };
    /* No other thread is in a function of the library, so that no lock is needed. */
    vk(vkQueueSubmit2(e->queue, 1, &submission, f->fence), "vkQueueSubmit2");
    vk(vkWaitForFences(e->device, 1, &f->fence, VK_TRUE, UINT64_MAX), "vkWaitForFences");
    vk(vkResetFences(e->device, 1, &f->fence), "vkResetFences");
}

/* --------------------------------------------------------------------------------------------------------------- the volume */

static vr_scene *make_scene(const vr_gpu *gpu)
{
    static const vr_knot knots[] = {
        {0.0, {0.2, 0.4, 1.0}, 0}, {0.2, {0.2, 0.4, 1.0}, 0},   {0.35, {0.3, 0.6, 1.0}, 0.8},
        {0.5, {0.2, 0.8, 0.6}, 0}, {0.7, {1.0, 0.7, 0.2}, 0.5}, {1.0, {1.0, 0.2, 0.1}, 20},
    };
    float *samples = malloc(sizeof(float) * SIDE * SIDE * SIDE);
    if (!samples)
        fail("samples", "out of memory");
    float *sample = samples;
    for (int z = 0; z < SIDE; ++z)
        for (int y = 0; y < SIDE; ++y)
            for (int x = 0; x < SIDE; ++x) {
                float half = (SIDE - 1) * 0.5F;
                float p[] = {(float)x / half - 1, (float)y / half - 1, (float)z / half - 1};
                float distance = sqrtf(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
                *sample++ = fmaxf(0, 1 - distance);
            }
    double spacing = 2.0 / (SIDE - 1);
    vr_grid_info info = {
        .struct_size = sizeof info,
        .dims = {SIDE, SIDE, SIDE},
        .sample_type = VR_SAMPLE_F32,
        .samples = samples,
        .sample_bytes = sizeof(float) * SIDE * SIDE * SIDE,
        .spacing = {spacing, spacing, spacing},
        .origin = {-1, -1, -1},
    };
    vr_scene *scene;
    vr(vr_scene_create_grid(gpu, &info, knots, LENGTH(knots), &scene), "vr_scene_create_grid");
    free(samples);
    return scene;
}

static void write_ppm(const char *path, const unsigned char *pixels)
{
    FILE *file = fopen(path, "wb");
    if (!file)
        fail(path, "cannot be written");
    fprintf(file, "P6\n%d %d\n255\n", WIDTH, HEIGHT);
    for (size_t i = 0; i < WIDTH * HEIGHT; ++i)
        fwrite(pixels + 4 * i, 1, 3, file);
    if (fclose(file))
        fail(path, "cannot be written");
}

int main(int argc, char **argv)
{
    if (argc < 2 || argc > 3)
        fail("usage", "embed OUT.ppm [SCENE|DATA]");
    engine e = {0};
    vr_gpu *gpu = open_engine(&e);
    printf("volraster %s on %s\n", vr_version(), vr_gpu_name(gpu));

    vr_scene *scene;
    if (argc > 2)
        vr(vr_scene_load(gpu, argv[2], NULL, &scene), "vr_scene_load");
    else
        scene = make_scene(gpu);

    vr_view view = {.struct_size = sizeof view};
    vr(vr_scene_view(scene, WIDTH, HEIGHT, &view), "vr_scene_view");
    vr_plan_info plan_info = {
        .struct_size = sizeof plan_info,
        .format = FORMAT,
        .mode = VR_TARGET_OVER,
        .with_depth = VK_TRUE,
    };
    /* Once: uploads, compiles, allocates. */
    vr_plan *plan;
    vr(vr_plan_create(scene, &plan_info, &view, &plan), "vr_plan_create");
    printf("%s by %s\n", vr_scene_technique(scene), vr_plan_route(plan));

    /* The wall stands in the middle of the data. */
    vr_scene_info info = {.struct_size = sizeof info};
    vr(vr_scene_query(scene, &info), "vr_scene_query");
    double wall = 0;
    for (int i = 0; i < 3; ++i) {
        double middle = (info.low[i] + info.high[i]) / 2;
        wall += (middle - view.eye[i]) * (view.target[i] - view.eye[i]);
    }
    double distance = 0;
    for (int i = 0; i < 3; ++i)
        distance += (view.target[i] - view.eye[i]) * (view.target[i] - view.eye[i]);
    wall /= sqrt(distance);

    frame f;
    make_frame(&e, &f);
    vr_depth_image depth = {
        .struct_size = sizeof depth,
        .view = f.depth_view,
        .format = DEPTH_FORMAT,
        .extent = {WIDTH, HEIGHT},
        .kind = VR_DEPTH_PERSPECTIVE,
        .at_zero = wall / 100,
        .at_one = wall * 100,
    };
    float stored = (float)((1 / depth.at_zero - 1 / wall) / (1 / depth.at_zero - 1 / depth.at_one));
    vr_record_info record = {
        .struct_size = sizeof record,
        .commands = f.commands,
        .image = f.image,
        .view = f.view,
        .format = FORMAT,
        .extent = {WIDTH, HEIGHT},
        .depth = &depth,
    };

    /* Each frame. Where the plan was short of room, it is prepared again with more. */
    vr_status status = {.struct_size = sizeof status};
    vr_recording *recording = NULL;
    for (int i = 0; i < TRIES && !status.complete; ++i) {
        if (i > 0) {
            vr_recording_destroy(recording);
            vr(vr_plan_prepare(plan, &view), "vr_plan_prepare");
        }
        VkCommandBufferBeginInfo begin = {
            .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
            .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT,
        };
        vk(vkBeginCommandBuffer(f.commands, &begin), "vkBeginCommandBuffer");
        draw_solids(&f, stored);
        vr(vr_plan_record(plan, &record, &recording), "vr_plan_record");
        read_out(&f);
        vk(vkEndCommandBuffer(f.commands), "vkEndCommandBuffer");
        submit_and_wait(&e, &f);
        vr(vr_recording_completed(recording, &status), "vr_recording_completed");
    }
    if (!status.complete)
        fail("frame", "there was never room enough");
    for (uint32_t i = 0; i < status.pass_count; ++i)
        printf("%-24s %8.3f ms\n", status.passes[i].name, status.passes[i].ms);
    for (uint32_t i = 0; i < status.counter_count; ++i)
        printf("%-24s %8llu\n", status.counters[i].name, (unsigned long long)status.counters[i].value);

    void *mapped;
    vk(vkMapMemory(e.device, f.buffer_memory, 0, VK_WHOLE_SIZE, 0, &mapped), "vkMapMemory");
    const unsigned char *pixels = mapped;
    write_ppm(argv[1], pixels);
    /* Pixels that are not the background: left, and right, before the wall. */
    size_t drawn[2] = {0, 0};
    unsigned long long light[2] = {0, 0};
    for (size_t i = 0; i < WIDTH * HEIGHT; ++i) {
        const unsigned char *pixel = pixels + 4 * i;
        int side = i % WIDTH >= WIDTH / 2;
        drawn[side] += pixel[0] > 4;
        light[side] += pixel[0];
    }
    vkUnmapMemory(e.device, f.buffer_memory);
    printf("pixels drawn: %zu left, %zu right; red: %llu left, %llu right\n", drawn[0], drawn[1], light[0], light[1]);

    /* In any order. */
    vr_gpu_destroy(gpu);
    vr_scene_destroy(scene);
    vr_recording_destroy(recording);
    vr_plan_destroy(plan);
    destroy_frame(&e, &f);
    unsigned messages = close_engine(&e);
    if (messages)
        fail("validation", "there were messages");
    if (drawn[0] < WIDTH * HEIGHT / 50 || drawn[1] < WIDTH * HEIGHT / 50)
        fail("picture", "is empty");
    return 0;
}
