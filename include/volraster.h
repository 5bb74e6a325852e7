/*
 * volraster: direct volume rendering on Vulkan.
 *
 * Written by cbindgen from src/ffi. Do not edit: `make header` writes it anew.
 *
 *     vr_gpu_create, vr_gpu_adopt       a device of the library's own, or the caller's
 *     vr_scene_create_*, vr_scene_load  data and transfer function: grids, meshes, points
 *     vr_plan_create                    a technique for a view and a target format
 *     vr_plan_record                    a frame in the caller's command buffer and image
 *     vr_recording_completed            the frame has ended: what it told
 *     vr_*_destroy                      in any order
 *
 * Structures begin with struct_size, their sizeof. All else may be zero unless its comment says otherwise, so that
 *
 *     vr_gpu_info info = {.struct_size = sizeof info};
 *
 * stays right when fields are added behind the others. Functions that may fail return vr_result, and leave a message for
 * vr_last_error(). Handles that they hand out are NULL then. Nothing unwinds or aborts through these functions.
 *
 * Threads: each function says from which threads it may be called. A handle may be used by several threads at once, but for its
 * destruction; what a structure or a string holds is read before the function returns and not kept.
 */

#ifndef VOLRASTER_H
#define VOLRASTER_H

#include <stddef.h>
#include <stdint.h>
#include <vulkan/vulkan_core.h>

/**
 * What became of a call. Negative codes are failures, of which vr_last_error() tells more; nothing was changed then, and
 * what a function hands out is NULL.
 */
typedef enum vr_result {
    /**
     * Done.
     */
    VR_OK = 0,
    /**
     * Not a failure: the plan has no room for this view. Call vr_plan_prepare() with it.
     */
    VR_NO_ROOM = 1,
    /**
     * An argument breaks a rule: NULL, a wrong size, a number out of range, an unknown name, a call at the wrong time.
     */
    VR_ERROR_INVALID = -1,
    /**
     * A file's contents break a rule of its format.
     */
    VR_ERROR_FILE = -2,
    /**
     * A file cannot be opened, read or written.
     */
    VR_ERROR_IO = -3,
    /**
     * No usable Vulkan: no loader, no driver, no device that qualifies.
     */
    VR_ERROR_NO_DEVICE = -4,
    /**
     * The device, or this build of the library, lacks something that the request needs.
     */
    VR_ERROR_UNSUPPORTED = -5,
    /**
     * The request needs more device memory than there is to give.
     */
    VR_ERROR_MEMORY = -6,
    /**
     * The allocator of device memory failed although the budget allowed the request.
     */
    VR_ERROR_ALLOCATION = -7,
    /**
     * A Vulkan call failed: vr_last_vulkan_result() has its code.
     */
    VR_ERROR_VULKAN = -8,
    /**
     * Work on the device did not end in time.
     */
    VR_ERROR_TIMEOUT = -9,
    /**
     * A defect of the library, which was caught. Destroy the handles of the call; their other functions refuse.
     */
    VR_ERROR_PANIC = -10,
    /**
     * The device was lost, by this call or before it: vr_last_vulkan_result() is VK_ERROR_DEVICE_LOST. Destroy what belongs to it.
     */
    VR_ERROR_DEVICE_LOST = -11,
} vr_result;

/**
 * What the validation layers check on a device that the library opens.
 */
typedef enum vr_validation {
    /**
     * They are not loaded.
     */
    VR_VALIDATION_OFF = 0,
    /**
     * Core validation and synchronization validation. Messages go to stderr.
     */
    VR_VALIDATION_ON = 1,
    /**
     * The same with GPU-assisted validation.
     */
    VR_VALIDATION_GPU_ASSISTED = 2,
} vr_validation;

/**
 * The type of samples.
 */
typedef enum vr_sample_type {
    /**
     * 8-bit unsigned.
     */
    VR_SAMPLE_U8 = 1,
    /**
     * 16-bit unsigned.
     */
    VR_SAMPLE_U16 = 2,
    /**
     * 16-bit signed.
     */
    VR_SAMPLE_I16 = 3,
    /**
     * 32-bit float. NaN marks vacuum.
     */
    VR_SAMPLE_F32 = 4,
    /**
     * 8-bit signed; kept as 32-bit float.
     */
    VR_SAMPLE_I8 = 5,
    /**
     * 32-bit unsigned; kept as 32-bit float.
     */
    VR_SAMPLE_U32 = 6,
    /**
     * 32-bit signed; kept as 32-bit float.
     */
    VR_SAMPLE_I32 = 7,
    /**
     * 64-bit unsigned; kept as 32-bit float.
     */
    VR_SAMPLE_U64 = 8,
    /**
     * 64-bit signed; kept as 32-bit float.
     */
    VR_SAMPLE_I64 = 9,
    /**
     * 64-bit float; kept as 32-bit float.
     */
    VR_SAMPLE_F64 = 10,
} vr_sample_type;

/**
 * What a mesh's scalars belong to.
 */
typedef enum vr_scalars_per {
    /**
     * One at each point, linear inside each tetrahedron.
     */
    VR_SCALARS_PER_POINT = 1,
    /**
     * One for each tetrahedron, constant inside it.
     */
    VR_SCALARS_PER_CELL = 2,
} vr_scalars_per;

/**
 * How the colour of a surface depends on where it is seen from.
 */
typedef enum vr_shading {
    /**
     * Not at all.
     */
    VR_SHADING_FLAT = 0,
    /**
     * Times the cosine between the triangle's normal and the line of sight, as if lit from the eye.
     */
    VR_SHADING_HEADLIGHT = 1,
} vr_shading;

/**
 * What a scene holds.
 */
typedef enum vr_data_kind {
    /**
     * Samples on a lattice.
     */
    VR_DATA_GRID = 1,
    /**
     * Tetrahedra.
     */
    VR_DATA_MESH = 2,
    /**
     * Scattered points.
     */
    VR_DATA_POINTS = 3,
} vr_data_kind;

/**
 * How depth becomes size.
 */
typedef enum vr_projection {
    /**
     * Rays start at the eye.
     */
    VR_PROJECTION_PERSPECTIVE = 1,
    /**
     * Parallel rays, also from behind the eye.
     */
    VR_PROJECTION_ORTHOGRAPHIC = 2,
} vr_projection;

/**
 * What becomes of what the target image holds.
 */
typedef enum vr_target_mode {
    /**
     * Replaced: transparent black where the volume is not.
     */
    VR_TARGET_CLEAR = 1,
    /**
     * Covered: the volume is composited over it.
     */
    VR_TARGET_OVER = 2,
} vr_target_mode;

/**
 * How a projection stores depth.
 */
typedef enum vr_depth_kind {
    /**
     * Of a perspective camera: at_zero and at_one are distances from the eye along the view.
     */
    VR_DEPTH_PERSPECTIVE = 1,
    /**
     * Of a camera with parallel rays: the same, negative behind the eye.
     */
    VR_DEPTH_ORTHOGRAPHIC = 2,
    /**
     * As `matrix` says.
     */
    VR_DEPTH_MATRIX = 3,
} vr_depth_kind;

/**
 * A Vulkan device with what the library keeps on it. It lives until it and all that was made from it are destroyed.
 */
typedef struct vr_gpu vr_gpu;

/**
 * Everything that one frame of one size needs, fixed: pipelines, buffers, images. For several frames in flight there are as many
 * plans.
 */
typedef struct vr_plan vr_plan;

/**
 * A recording in a command buffer: it keeps what the commands name, until vr_recording_completed() says that their submission has
 * ended, or vr_recording_discard() that there is none, and then what the frame told.
 */
typedef struct vr_recording vr_recording;

/**
 * Data with a transfer function, on a device. What of it a technique needs is uploaded when a plan is first created for it,
 * and kept with the scene. It does not change: functions that change something make another scene, which shares the rest.
 */
typedef struct vr_scene vr_scene;

/**
 * An option of a technique.
 */
typedef struct vr_option_info {
    /**
     * Its key.
     */
    const char *key;
    /**
     * The values that it takes.
     */
    const char *values;
    /**
     * Its default.
     */
    const char *default_value;
    /**
     * What it does.
     */
    const char *effect;
} vr_option_info;

/**
 * A technique. Everything that it points to lives as long as the library.
 */
typedef struct vr_technique_info {
    /**
     * sizeof(vr_technique_info).
     */
    size_t struct_size;
    /**
     * Its name.
     */
    const char *name;
    /**
     * One line on what it does.
     */
    const char *summary;
    /**
     * Its options.
     */
    const struct vr_option_info *options;
    /**
     * Number of options.
     */
    size_t option_count;
} vr_technique_info;

/**
 * How a device is opened. Zeros are the defaults.
 */
typedef struct vr_gpu_info {
    /**
     * sizeof(vr_gpu_info).
     */
    size_t struct_size;
    /**
     * Part of the device's name, case ignored. NULL: what the environment variable VOLRASTER_DEVICE says, else the best
     * device, a real GPU before a software one.
     */
    const char *device;
    /**
     * A vr_validation. A missing layer is an error.
     */
    uint32_t validation;
    /**
     * Do not keep pipelines on disk.
     */
    VkBool32 no_pipeline_cache;
    /**
     * Folder of the pipeline cache. NULL: volraster in the user's cache folder.
     */
    const char *pipeline_cache;
    /**
     * Most device memory to use, in bytes. 0: what the driver says is free, or nine tenths of the largest device-local
     * heap.
     */
    uint64_t memory_budget;
} vr_gpu_info;

/**
 * Is handed the user pointer that was given with it.
 */
typedef void (*vr_callback)(void *user);

/**
 * A device of the caller, and how the library may use it.
 */
typedef struct vr_device_info {
    /**
     * sizeof(vr_device_info).
     */
    size_t struct_size;
    /**
     * Of the loader that the instance was made with. NULL: that of the system.
     */
    PFN_vkGetInstanceProcAddr get_instance_proc_addr;
    /**
     * The instance.
     */
    VkInstance instance;
    /**
     * VkApplicationInfo::apiVersion of the instance: at least VK_API_VERSION_1_3.
     */
    uint32_t api_version;
    /**
     * Number of instance_extensions.
     */
    uint32_t instance_extension_count;
    /**
     * What the instance was made with. Used is VK_EXT_debug_utils, for names and labels.
     */
    const char *const *instance_extensions;
    /**
     * The physical device, of that instance, for Vulkan 1.3 or later.
     */
    VkPhysicalDevice physical_device;
    /**
     * The device.
     */
    VkDevice device;
    /**
     * What the device was made with, or a structure that names as much of it as the library shall know of. Read are
     * extensions and features, these in any structure of the chain that may have them. Required are synchronization2 and
     * dynamicRendering; of use are fragmentStoresAndAtomics, VK_EXT_memory_budget, and VK_EXT_fragment_shader_interlock
     * with fragmentShaderPixelInterlock.
     */
    const VkDeviceCreateInfo *device_create_info;
    /**
     * The queue, for graphics and compute.
     */
    VkQueue queue;
    /**
     * Its family.
     */
    uint32_t queue_family;
    /**
     * Do not keep pipelines on disk.
     */
    VkBool32 no_pipeline_cache;
    /**
     * Folder of the pipeline cache. NULL: volraster in the user's cache folder.
     */
    const char *pipeline_cache;
    /**
     * Most device memory to use, in bytes. 0: what the driver says is free, or nine tenths of the largest device-local
     * heap.
     */
    uint64_t memory_budget;
    /**
     * Called before each submission of the library to the queue, and unlock_queue after it, on the same thread, with
     * `user`: both or neither. Without them the caller uses the queue within vr_gpu_with_queue() alone, or while no other
     * thread is in a function of the library. Recording submits nothing. The lock must not be held by a thread that calls
     * into the library, unless to record.
     */
    vr_callback lock_queue;
    /**
     * See lock_queue.
     */
    vr_callback unlock_queue;
    /**
     * Called once, with `user`, when nothing of the library's is left on the device, by the thread that destroyed the last
     * thing; also where vr_gpu_adopt() fails. Device and instance may be destroyed from then on, also by this function. May
     * be NULL.
     */
    vr_callback released;
    /**
     * For lock_queue, unlock_queue and released.
     */
    void *user;
} vr_device_info;

/**
 * The Vulkan objects behind a device.
 */
typedef struct vr_gpu_objects {
    /**
     * sizeof(vr_gpu_objects).
     */
    size_t struct_size;
    /**
     * The instance.
     */
    VkInstance instance;
    /**
     * The physical device.
     */
    VkPhysicalDevice physical_device;
    /**
     * The device.
     */
    VkDevice device;
    /**
     * The queue. See vr_gpu_with_queue().
     */
    VkQueue queue;
    /**
     * Its family.
     */
    uint32_t queue_family;
} vr_gpu_objects;

/**
 * Is handed a queue that no other thread uses meanwhile, and the user pointer.
 */
typedef void (*vr_queue_callback)(VkQueue queue, void *user);

/**
 * A regular grid: a scalar field, trilinear between samples, vacuum outside of the box that they span.
 */
typedef struct vr_grid_info {
    /**
     * sizeof(vr_grid_info).
     */
    size_t struct_size;
    /**
     * Samples along x, y and z, each at least 2.
     */
    uint32_t dims[3];
    /**
     * A vr_sample_type.
     */
    uint32_t sample_type;
    /**
     * The samples, x fastest, then y, without gaps, of any alignment. They are copied.
     */
    const void *samples;
    /**
     * Their size in bytes: that of a sample times the product of dims.
     */
    size_t sample_bytes;
    /**
     * Distance of neighbouring samples along x, y and z, in world units. All 0: 1.
     */
    double spacing[3];
    /**
     * World position of the first sample.
     */
    double origin[3];
    /**
     * World directions of the grid's x, y and z axis; they need neither unit length nor right angles. All 0: the world's axes.
     */
    double direction[3][3];
    /**
     * A sample's value is slope * stored + intercept. 0: 1.
     */
    double slope;
    /**
     * See slope.
     */
    double intercept;
} vr_grid_info;

/**
 * A knot of a transfer function: from scalar to emitted colour and extinction, linear between knots, constant beyond the ends.
 * Two knots of one scalar make a jump, where the later one holds.
 */
typedef struct vr_knot {
    /**
     * Scalar, in the data's own units; not less than that of the knot before.
     */
    double scalar;
    /**
     * Emitted colour: linear red, green and blue, not premultiplied, not negative.
     */
    double colour[3];
    /**
     * Extinction per unit of world length, not negative.
     */
    double extinction;
} vr_knot;

/**
 * A mesh of tetrahedra; vacuum outside of them, and in those with a scalar that is NaN. Tetrahedra that are inside out are
 * turned, those without volume are left out.
 */
typedef struct vr_mesh_info {
    /**
     * sizeof(vr_mesh_info).
     */
    size_t struct_size;
    /**
     * x, y and z of each point, in world units.
     */
    const double *points;
    /**
     * Number of points.
     */
    size_t point_count;
    /**
     * The four points of each tetrahedron, from 0.
     */
    const uint32_t *cells;
    /**
     * Number of tetrahedra.
     */
    size_t cell_count;
    /**
     * The scalars.
     */
    const float *scalars;
    /**
     * Number of scalars.
     */
    size_t scalar_count;
    /**
     * A vr_scalars_per.
     */
    uint32_t scalars_per;
    /**
     * 0.
     */
    uint32_t reserved;
} vr_mesh_info;

/**
 * Scattered points with kernels. Arrays that are NULL are left out; each other one has an element for each point.
 */
typedef struct vr_points_info {
    /**
     * sizeof(vr_points_info).
     */
    size_t struct_size;
    /**
     * x, y and z of each point, in world units.
     */
    const double *centres;
    /**
     * Number of points.
     */
    size_t point_count;
    /**
     * Scalars. NULL: 1.
     */
    const float *scalars;
    /**
     * Weights. NULL: 1.
     */
    const float *weights;
    /**
     * Support radii, in world units.
     */
    const float *radii;
    /**
     * Covariances of Gaussians, xx, xy, xz, yy, yz and zz of each point, in world units squared. Not with radii.
     */
    const float *covariances;
    /**
     * One support radius for all, where there are neither radii nor covariances. 0: estimated from the spacing.
     */
    double radius;
} vr_points_info;

/**
 * A triangle mesh of one colour that stands in the volume, seen from both sides.
 */
typedef struct vr_surface_info {
    /**
     * sizeof(vr_surface_info).
     */
    size_t struct_size;
    /**
     * x, y and z of each point, in world units.
     */
    const double *points;
    /**
     * Number of points.
     */
    size_t point_count;
    /**
     * The three points of each triangle, from 0.
     */
    const uint32_t *triangles;
    /**
     * Number of triangles.
     */
    size_t triangle_count;
    /**
     * Straight linear red, green and blue, and opacity: 1 is opaque.
     */
    double colour[4];
    /**
     * A vr_shading.
     */
    uint32_t shading;
    /**
     * 0.
     */
    uint32_t reserved;
} vr_surface_info;

/**
 * What a scene is, to place a camera and to make a transfer function.
 */
typedef struct vr_scene_info {
    /**
     * sizeof(vr_scene_info).
     */
    size_t struct_size;
    /**
     * Least corner of the box along the world's axes that holds the data.
     */
    double low[3];
    /**
     * Its greatest corner.
     */
    double high[3];
    /**
     * Smallest and largest finite scalar.
     */
    double range[2];
    /**
     * A vr_data_kind.
     */
    uint32_t data_kind;
    /**
     * Samples along x, y and z; 0 where the data is no grid.
     */
    uint32_t dims[3];
} vr_scene_info;

/**
 * A plane that cuts away what lies on the side that its normal points away from.
 */
typedef struct vr_clip_plane {
    /**
     * A point of the plane, world units.
     */
    double point[3];
    /**
     * Points to what is kept; of any length but 0.
     */
    double normal[3];
} vr_clip_plane;

/**
 * A camera, the size of its image, and what of the volume is cut away. Pixels are square; row 0 is on top.
 */
typedef struct vr_view {
    /**
     * sizeof(vr_view).
     */
    size_t struct_size;
    /**
     * Position of the eye, world units. May lie inside the data.
     */
    double eye[3];
    /**
     * A point straight ahead.
     */
    double target[3];
    /**
     * A direction that points up in the picture; need not be perpendicular to the view.
     */
    double up[3];
    /**
     * A vr_projection.
     */
    uint32_t projection;
    /**
     * Image width, in pixels: 1 to 32768.
     */
    uint32_t width;
    /**
     * Image height, in pixels: 1 to 32768.
     */
    uint32_t height;
    /**
     * Number of clip_planes, at most 6.
     */
    uint32_t clip_plane_count;
    /**
     * Of a perspective projection: the full vertical angle of view, in degrees, between 0 and 180.
     */
    double fov_y_deg;
    /**
     * Of an orthographic projection: half of the image's height, in world units.
     */
    double half_height;
    /**
     * What is cut away. Every technique cuts lines of sight exactly there.
     */
    struct vr_clip_plane clip_planes[6];
    /**
     * Least corner of a box along the world's axes, outside of which nothing is drawn; minus infinity for a side cuts
     * nothing. Both corners all 0: no box.
     */
    double crop_low[3];
    /**
     * Its greatest corner.
     */
    double crop_high[3];
} vr_view;

/**
 * Is told how many of how many bytes have been read, now and then, by any thread; 0 of all where their number is not known.
 */
typedef void (*vr_progress_callback)(uint64_t done, uint64_t all, void *user);

/**
 * Which of a file's arrays are read, and how. Zeros are the defaults. Arrays are named NAME, NAME:PART, point:NAME or
 * cell:NAME:PART, PART being a component (0, x, r, ...) or magnitude.
 */
typedef struct vr_read_info {
    /**
     * sizeof(vr_read_info).
     */
    size_t struct_size;
    /**
     * Most bytes of memory that the data may take. 0: 16 GiB.
     */
    uint64_t max_bytes;
    /**
     * The array to show. NULL: the file's active one, else the first with one component.
     */
    const char *array;
    /**
     * Of points: the array of support radii.
     */
    const char *radius;
    /**
     * Of points: the array of covariances.
     */
    const char *covariance;
    /**
     * Of points: the array of weights.
     */
    const char *weight;
    /**
     * Told how far reading is, with `user`. May be NULL.
     */
    vr_progress_callback progress;
    /**
     * For progress.
     */
    void *user;
} vr_read_info;

/**
 * What a plan is for.
 */
typedef struct vr_plan_info {
    /**
     * sizeof(vr_plan_info).
     */
    size_t struct_size;
    /**
     * NAME[:key=value,...], such as "slabs:step=0.5". NULL: vr_scene_technique().
     */
    const char *technique;
    /**
     * Format of target images. Values are premultiplied linear RGBA; an sRGB format encodes them.
     */
    VkFormat format;
    /**
     * A vr_target_mode.
     */
    uint32_t mode;
    /**
     * Whether each recording has a depth image: nothing behind what it shows is drawn, and what passes through it is cut there.
     */
    VkBool32 with_depth;
    /**
     * 0.
     */
    uint32_t reserved;
} vr_plan_info;

/**
 * A depth image of the caller.
 */
typedef struct vr_depth_image {
    /**
     * sizeof(vr_depth_image).
     */
    size_t struct_size;
    /**
     * Two-dimensional, of one level, one layer and the depth aspect alone. The image has one sample and the usage
     * VK_IMAGE_USAGE_SAMPLED_BIT.
     */
    VkImageView view;
    /**
     * Its format, one with depth.
     */
    VkFormat format;
    /**
     * Its layout when the commands run. VK_IMAGE_LAYOUT_UNDEFINED stands for VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL. It is left in
     * that layout, last read in the compute shader stage.
     */
    VkImageLayout layout;
    /**
     * Its size: that of the plan's view.
     */
    VkExtent2D extent;
    /**
     * A vr_depth_kind.
     */
    uint32_t kind;
    /**
     * Depth along the view, in world units, where the image holds 0: near for the usual projection, far for a reversed one,
     * INFINITY for one without a far end. What holds the far end itself shows no surface.
     */
    double at_zero;
    /**
     * The same where the image holds 1.
     */
    double at_one;
    /**
     * From view coordinates to clip coordinates with depths from 0 to 1, column after column.
     */
    double matrix[16];
} vr_depth_image;

/**
 * Where a frame is recorded.
 */
typedef struct vr_record_info {
    /**
     * sizeof(vr_record_info).
     */
    size_t struct_size;
    /**
     * In the recording state, outside of any rendering, of a pool for the device's queue family.
     */
    VkCommandBuffer commands;
    /**
     * With the usage VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT. When the commands run it is in the layout
     * VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, and earlier accesses are available and visible to the colour attachment output
     * stage. It is left in that layout, last written in that stage.
     */
    VkImage image;
    /**
     * Of the image: two-dimensional, of one level and one layer.
     */
    VkImageView view;
    /**
     * Its format: that of the plan.
     */
    VkFormat format;
    /**
     * Its size: that of the plan's view.
     */
    VkExtent2D extent;
    /**
     * NULL where the plan is without depth.
     */
    const struct vr_depth_image *depth;
} vr_record_info;

/**
 * Time of a pass.
 */
typedef struct vr_pass_time {
    /**
     * The pass.
     */
    const char *name;
    /**
     * Milliseconds on the device.
     */
    double ms;
} vr_pass_time;

/**
 * Work of a frame, counted on the device.
 */
typedef struct vr_counter {
    /**
     * What was counted.
     */
    const char *name;
    /**
     * How many.
     */
    uint64_t value;
} vr_counter;

/**
 * What a frame told.
 */
typedef struct vr_status {
    /**
     * sizeof(vr_status).
     */
    size_t struct_size;
    /**
     * Whether everything was drawn. VK_FALSE where room was short: call vr_plan_prepare() and draw the frame again.
     */
    VkBool32 complete;
    /**
     * Number of passes; 0 where the device has no timestamps.
     */
    uint32_t pass_count;
    /**
     * Their times. Valid as long as the recording's handle.
     */
    const struct vr_pass_time *passes;
    /**
     * Work that only the device knows. Valid as long as the recording's handle.
     */
    const struct vr_counter *counters;
    /**
     * Number of counters.
     */
    uint32_t counter_count;
} vr_status;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The message of this thread's last failure: one line of UTF-8, never NULL, "" before the first. Valid until this thread's next
 * failure, or its end.
 *
 * Threads: each has its own.
 */
const char *vr_last_error(void);

/**
 * The code of the Vulkan call that failed, where this thread's last failure was VR_ERROR_VULKAN; VK_ERROR_DEVICE_LOST where it
 * was VR_ERROR_DEVICE_LOST; else VK_SUCCESS.
 *
 * Threads: each has its own.
 */
VkResult vr_last_vulkan_result(void);

/**
 * The library's version, such as "1.2.3".
 *
 * Threads: any.
 */
const char *vr_version(void);

/**
 * Number of techniques.
 *
 * Threads: any.
 */
uint32_t vr_technique_count(void);

/**
 * Describes a technique, from 0 to vr_technique_count() - 1.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `info` is NULL or valid, with its size.
 */
enum vr_result vr_technique_query(uint32_t index, struct vr_technique_info *info);

/**
 * Checks a technique with its options, NAME[:key=value,...].
 *
 * Fails with VR_ERROR_INVALID, and the message says what may stand there.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `technique` is NULL or ends with NUL.
 */
enum vr_result vr_technique_parse(const char *technique);

/**
 * Opens a device, without a window. `info` may be NULL: the best device.
 *
 * Fails with VR_ERROR_NO_DEVICE (with the reason for each device), VR_ERROR_UNSUPPORTED where validation is asked for and
 * its layer is missing, VR_ERROR_VULKAN.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `info` is NULL or valid, with its strings; `gpu` is valid.
 */
enum vr_result vr_gpu_create(const struct vr_gpu_info *info,
                             struct vr_gpu **gpu);

/**
 * Takes a device that the caller made. The library destroys neither it nor its instance; what it makes on the device is gone
 * when the handle and all that was made from it are destroyed, without a wait.
 *
 * Fails with VR_ERROR_UNSUPPORTED naming what is required and missing, VR_ERROR_INVALID for a null handle, a physical
 * device of another instance, or what is said to be enabled and cannot be, VR_ERROR_VULKAN.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `info` and `gpu` are valid. The objects are of one another, and were made with what `info` says; they live until
 * `released` is called. The queue is no protected one.
 */
enum vr_result vr_gpu_adopt(const struct vr_device_info *info,
                            struct vr_gpu **gpu);

/**
 * Destroys a device's handle; NULL is nothing. The device itself lives as long as anything that was made from it.
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `gpu` is NULL, or a handle that was not destroyed.
 */
void vr_gpu_destroy(struct vr_gpu *gpu);

/**
 * The device's name; NULL for NULL. Valid as long as the handle.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `gpu` is NULL or valid.
 */
const char *vr_gpu_name(const struct vr_gpu *gpu);

/**
 * Bytes of device memory that the library has taken, and how many it may take in all. Either pointer may be NULL.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `gpu` is NULL or valid; the others are NULL or valid.
 */
enum vr_result vr_gpu_memory(const struct vr_gpu *gpu, uint64_t *used, uint64_t *budget);

/**
 * The Vulkan objects behind a device, for callers that record on one that the library has opened. They live as long as the
 * handle and what was made from it do; what is made from them must be destroyed before.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `gpu` is NULL or valid; `objects` is NULL or valid, with its size.
 */
enum vr_result vr_gpu_handles(const struct vr_gpu *gpu,
                              struct vr_gpu_objects *objects);

/**
 * Calls `work` once, before it returns, with the queue that the library submits to, while no other thread submits through the
 * library. `work` must call nothing of the library that draws, uploads or prepares: it would wait for itself.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `gpu` is NULL or valid; `work` may be called with `user`.
 */
enum vr_result vr_gpu_with_queue(const struct vr_gpu *gpu,
                                 vr_queue_callback work,
                                 void *user);

/**
 * Makes a scene of a grid in memory, which is copied. Without knots (NULL, 0) a transfer function is chosen.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays as long as is said.
 */
enum vr_result vr_scene_create_grid(const struct vr_gpu *gpu,
                                    const struct vr_grid_info *info,
                                    const struct vr_knot *knots,
                                    size_t knot_count,
                                    struct vr_scene **scene);

/**
 * Makes a scene of tetrahedra in memory, which are copied. Without knots (NULL, 0) a transfer function is chosen.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays as long as is said.
 */
enum vr_result vr_scene_create_mesh(const struct vr_gpu *gpu,
                                    const struct vr_mesh_info *info,
                                    const struct vr_knot *knots,
                                    size_t knot_count,
                                    struct vr_scene **scene);

/**
 * Makes a scene of points in memory, which are copied. Without knots (NULL, 0) a transfer function is chosen.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays as long as is said.
 */
enum vr_result vr_scene_create_points(const struct vr_gpu *gpu,
                                      const struct vr_points_info *info,
                                      const struct vr_knot *knots,
                                      size_t knot_count,
                                      struct vr_scene **scene);

/**
 * Makes a scene of the same data under another transfer function, which shares what is on the device of the data. `source` stays
 * as it is.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays as long as is said.
 */
enum vr_result vr_scene_with_transfer(const struct vr_scene *source,
                                      const struct vr_knot *knots,
                                      size_t knot_count,
                                      struct vr_scene **scene);

/**
 * Makes a scene of other samples in the same grid: place, transfer function, surfaces and view stay. The samples are copied, and
 * may be of another type; see vr_grid_info. `source` stays as it is.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, `samples` as large as is said.
 */
enum vr_result vr_scene_with_samples(const struct vr_scene *source,
                                     uint32_t sample_type,
                                     const void *samples,
                                     size_t sample_bytes,
                                     struct vr_scene **scene);

/**
 * Makes a scene of the same mesh with other scalars, as vr_mesh_info has them, and with another transfer function where there are
 * knots. Points and tetrahedra stay on the device. Scalars for tetrahedra are those of the tetrahedra that were kept. `source`
 * stays as it is.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays as long as is said.
 */
enum vr_result vr_scene_with_scalars(const struct vr_scene *source,
                                     uint32_t scalars_per,
                                     const float *scalars,
                                     size_t scalar_count,
                                     const struct vr_knot *knots,
                                     size_t knot_count,
                                     struct vr_scene **scene);

/**
 * Makes a scene of the same data among other surfaces, of which there may be none; what is on the device of the data is shared.
 * Opaque surfaces are drawn by every technique, translucent ones by some: vr_plan_create() refuses the others.
 *
 * `surfaces` are `surface_count` pointers. Everything is copied, and `source` stays as it is. Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays as long as is said.
 */
enum vr_result vr_scene_with_surfaces(const struct vr_scene *source,
                                      const struct vr_surface_info *const *surfaces,
                                      size_t surface_count,
                                      struct vr_scene **scene);

/**
 * Destroys a scene's handle; NULL is nothing. Plans and recordings that were made from it go on.
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `scene` is NULL, or a handle that was not destroyed.
 */
void vr_scene_destroy(struct vr_scene *scene);

/**
 * Tells what a scene is.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `scene` is NULL or valid; `info` is NULL or valid, with its size.
 */
enum vr_result vr_scene_query(const struct vr_scene *scene, struct vr_scene_info *info);

/**
 * Fills in the view that a scene file asks for, or one that is chosen for the data, of an image of this size; width and height 0:
 * of the scene's own size.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `scene` is NULL or valid; `view` is NULL or valid, with its size.
 */
enum vr_result vr_scene_view(const struct vr_scene *scene,
                             uint32_t width,
                             uint32_t height,
                             struct vr_view *view);

/**
 * The technique that the scene's file asks for, else the default for its data, as vr_plan_info takes it; NULL for NULL. Valid as
 * long as the handle.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `scene` is NULL or valid.
 */
const char *vr_scene_technique(const struct vr_scene *scene);

/**
 * What may not be as it seems in the file that was read, one warning a line; "" if there is none, NULL for NULL. Valid as long as
 * the handle.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `scene` is NULL or valid.
 */
const char *vr_scene_warnings(const struct vr_scene *scene);

/**
 * Whether a technique, with or without options, draws a scene's kind of data.
 *
 * Fails with VR_ERROR_INVALID for what is no technique.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, strings end with NUL.
 */
enum vr_result vr_scene_draws(const struct vr_scene *scene, const char *technique, VkBool32 *draws);

/**
 * Reads a scene file (.json), a data file of any format that the library knows, or a folder of slices. A data file gets a
 * camera and a transfer function that are chosen for it. `info` may be NULL.
 *
 * `path` is UTF-8, on Unix any bytes. Fails with VR_ERROR_IO, VR_ERROR_FILE naming file, place and rule,
 * VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, strings end with NUL.
 */
enum vr_result vr_scene_load(const struct vr_gpu *gpu,
                             const char *path,
                             const struct vr_read_info *info,
                             struct vr_scene **scene);

/**
 * Fixes everything that frames of this view's size need. May allocate, compile, upload, submit and wait.
 *
 * Fails with VR_ERROR_INVALID for options that do not exist or do not fit the scene, VR_ERROR_UNSUPPORTED and VR_ERROR_MEMORY for
 * what the device lacks, VR_ERROR_VULKAN.
 *
 * Threads: any; plans of one scene may be created at the same time.
 *
 * # Safety
 *
 * Pointers are NULL or valid, structures with their sizes.
 */
enum vr_result vr_plan_create(const struct vr_scene *scene,
                              const struct vr_plan_info *info,
                              const struct vr_view *view,
                              struct vr_plan **plan);

/**
 * Turns a plan to another view of the same image size. Allocates nothing, and does not wait. Returns VR_NO_ROOM, and nothing is
 * changed, where the plan has no room for it, the size is another one, or the view is the first with anything cut away: call
 * vr_plan_prepare() then.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any; calls with one plan wait for each other.
 *
 * # Safety
 *
 * Pointers are NULL or valid, structures with their sizes.
 */
enum vr_result vr_plan_set_view(struct vr_plan *plan,
                                const struct vr_view *view);

/**
 * Makes a plan anew for a view of any size, with room for what frames were short of. What recordings of it still name stays until
 * they are completed. May allocate, compile, upload, submit and wait.
 *
 * Fails as vr_plan_create(), and the plan is what it was.
 *
 * Threads: any; calls with one plan wait for each other.
 *
 * # Safety
 *
 * Pointers are NULL or valid, structures with their sizes.
 */
enum vr_result vr_plan_prepare(struct vr_plan *plan,
                               const struct vr_view *view);

/**
 * How the technique draws on this device: raster, compute, ...; NULL for NULL. Valid as long as the handle.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `plan` is NULL or valid.
 */
const char *vr_plan_route(const struct vr_plan *plan);

/**
 * Records a frame into the caller's command buffer: no submission, no wait, no device memory. The caller submits, sees the
 * submission end by a fence, a semaphore or an idle queue, and calls vr_recording_completed(). A plan has one recording at a time
 * that was not completed.
 *
 * Fails with VR_ERROR_INVALID where an image is not what the plan is for, or its last recording was not completed,
 * VR_ERROR_UNSUPPORTED for a depth image of a format that the device cannot sample. Nothing was recorded then.
 *
 * Threads: any that may record into the command buffer; calls with one plan wait for each other.
 *
 * # Safety
 *
 * Pointers are NULL or valid, structures with their sizes. The Vulkan objects are of the plan's device and as vr_record_info and
 * vr_depth_image say; images and views live until every submission that uses them has ended. The command buffer is submitted at
 * most once at a time, to the device's queue family.
 */
enum vr_result vr_plan_record(struct vr_plan *plan,
                              const struct vr_record_info *info,
                              struct vr_recording **recording);

/**
 * Destroys a plan's handle; NULL is nothing. What recordings of it name stays until they are completed.
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `plan` is NULL, or a handle that was not destroyed.
 */
void vr_plan_destroy(struct vr_plan *plan);

/**
 * Says that the submission of a recording has ended: a fence or a semaphore was signalled, or the queue is idle. Frees what the
 * recording kept, and tells what the frame told. `status` may be NULL. Called again it tells the same.
 *
 * Fails with VR_ERROR_VULKAN where the status cannot be read, though what the recording kept is freed, and with
 * VR_ERROR_INVALID for a recording that was discarded.
 *
 * Threads: any; calls with one recording wait for each other.
 *
 * # Safety
 *
 * `recording` is NULL or valid, and the device has no more use for what it recorded; `status` is NULL or valid, with its size.
 */
enum vr_result vr_recording_completed(struct vr_recording *recording,
                                      struct vr_status *status);

/**
 * Says that a recording will not be submitted, or not again: its command buffer was reset, freed or forgotten, as when a frame is
 * dropped because the window changed. Frees what the recording kept. The plan can be recorded again. Of a recording that was
 * completed or discarded: does nothing.
 *
 * Fails with VR_ERROR_INVALID for NULL.
 *
 * Threads: any; calls with one recording wait for each other.
 *
 * # Safety
 *
 * `recording` is NULL or valid, and no submission of what it recorded is pending or will be made.
 */
enum vr_result vr_recording_discard(struct vr_recording *recording);

/**
 * Destroys a recording's handle; NULL is nothing. Where it was neither completed nor discarded, what the recording kept is never
 * freed, for the device may still use it, and the plan records no more until vr_plan_prepare().
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `recording` is NULL, or a handle that was not destroyed.
 */
void vr_recording_destroy(struct vr_recording *recording);

/**
 * Draws a frame and waits for it: for tests, thumbnails and files. `pixels` gets width * height times premultiplied linear red,
 * green, blue and alpha, row by row, top row first; `float_count` is the number of floats that it has room for.
 *
 * Fails as vr_plan_create(), and with VR_ERROR_TIMEOUT.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, structures with their sizes, `pixels` as large as is said, `technique` NULL or text.
 */
enum vr_result vr_render(const struct vr_scene *scene,
                         const char *technique,
                         const struct vr_view *view,
                         float *pixels,
                         size_t float_count);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VOLRASTER_H */
