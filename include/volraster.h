/*
 * volraster: direct volume rendering on Vulkan.
 *
 * Written by cbindgen from src/ffi. Do not edit: `make header` writes it anew.
 *
 *     vr_gpu_create, vr_gpu_adopt       a device of the library's own, or the caller's
 *     vr_scene_create_*, vr_scene_load  data and transfer function: grids, meshes, points, splats
 *     vr_plan_create                    a technique for a view and a target format
 *     vr_plan_record                    a frame in the caller's command buffer and image
 *     vr_plans_record                   several frames side by side: a stereo pair
 *     vr_recording_completed            the frame has ended: its status
 *     vr_*_destroy                      handles, in any order
 *
 * Structures begin with struct_size, their sizeof. Other fields may be zero unless their comment says otherwise, so that
 *
 *     vr_gpu_info info = {.struct_size = sizeof info};
 *
 * stays valid when later versions add fields at the end. Functions that may fail return vr_result, and store a message for
 * vr_last_error(); handles that they return are NULL then. No function unwinds or aborts.
 *
 * Threads: each function says from which threads it may be called. Several threads may use a handle at the same time, except to
 * destroy it. Functions copy the contents of structures and strings before they return.
 */

#ifndef VOLRASTER_H
#define VOLRASTER_H

#include <stddef.h>
#include <stdint.h>
#include <vulkan/vulkan_core.h>

/**
 * Result of a call. Negative codes are failures: vr_last_error() has the message, nothing was changed, and handles that the
 * function returns are NULL.
 */
typedef enum vr_result {
    /**
     * Success.
     */
    VR_OK = 0,
    /**
     * Not a failure: the plan's capacity is too small for this view. Call vr_plan_prepare() with it.
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
     * The device, or this build of the library, lacks a feature that the request needs.
     */
    VR_ERROR_UNSUPPORTED = -5,
    /**
     * The request needs more device memory than is available.
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
     * Work on the device did not end within the time limit.
     */
    VR_ERROR_TIMEOUT = -9,
    /**
     * A defect of the library was caught. Destroy the handles of the call; their other functions fail.
     */
    VR_ERROR_PANIC = -10,
    /**
     * The device was lost, during this call or before: vr_last_vulkan_result() is VK_ERROR_DEVICE_LOST. Destroy its handles.
     */
    VR_ERROR_DEVICE_LOST = -11,
} vr_result;

/**
 * Checks of the validation layer on a device that the library opens.
 */
typedef enum vr_validation {
    /**
     * The layer is not loaded.
     */
    VR_VALIDATION_OFF = 0,
    /**
     * Core validation and synchronization validation. Messages go to stderr.
     */
    VR_VALIDATION_ON = 1,
    /**
     * As VR_VALIDATION_ON, with GPU-assisted validation.
     */
    VR_VALIDATION_GPU_ASSISTED = 2,
} vr_validation;

/**
 * Type of samples.
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
 * The elements of a mesh that have the scalars.
 */
typedef enum vr_scalars_per {
    /**
     * Points: the field is linear inside each tetrahedron.
     */
    VR_SCALARS_PER_POINT = 1,
    /**
     * Tetrahedra: the field is constant inside each.
     */
    VR_SCALARS_PER_CELL = 2,
} vr_scalars_per;

/**
 * Dependence of a surface's colour on the direction of view.
 */
typedef enum vr_shading {
    /**
     * The colour does not depend on it.
     */
    VR_SHADING_FLAT = 0,
    /**
     * The colour is scaled by the cosine between the triangle's normal and the ray, as if lit from the eye.
     */
    VR_SHADING_HEADLIGHT = 1,
} vr_shading;

/**
 * Kind of the data of a scene.
 */
typedef enum vr_data_kind {
    /**
     * A grid.
     */
    VR_DATA_GRID = 1,
    /**
     * A mesh of tetrahedra.
     */
    VR_DATA_MESH = 2,
    /**
     * Scattered points.
     */
    VR_DATA_POINTS = 3,
    /**
     * Trained Gaussian splats.
     */
    VR_DATA_GAUSSIANS = 4,
} vr_data_kind;

/**
 * Kind of a projection.
 */
typedef enum vr_projection {
    /**
     * Rays start at the eye.
     */
    VR_PROJECTION_PERSPECTIVE = 1,
    /**
     * Rays are parallel, and also show what lies behind the eye.
     */
    VR_PROJECTION_ORTHOGRAPHIC = 2,
    /**
     * view_matrix and projection_matrix map to clip coordinates whose y = 1 is the image's lowest row, as Vulkan has it. eye, target,
     * up, fov_y_deg and half_height are ignored.
     */
    VR_PROJECTION_MATRICES_Y_DOWN = 3,
    /**
     * The same with y = 1 at the image's top row, as in OpenGL, Direct3D, Metal and WebGPU.
     */
    VR_PROJECTION_MATRICES_Y_UP = 4,
} vr_projection;

/**
 * How the result combines with the contents of the target image.
 */
typedef enum vr_target_mode {
    /**
     * It replaces them; pixels without volume become transparent black.
     */
    VR_TARGET_CLEAR = 1,
    /**
     * It is composited over them.
     */
    VR_TARGET_OVER = 2,
} vr_target_mode;

/**
 * Kind of the mapping from depth to stored values.
 */
typedef enum vr_depth_kind {
    /**
     * A perspective camera: at_zero and at_one are distances from the eye along the view.
     */
    VR_DEPTH_PERSPECTIVE = 1,
    /**
     * A camera with parallel rays: at_zero and at_one are distances from the eye along the view, negative behind it.
     */
    VR_DEPTH_ORTHOGRAPHIC = 2,
    /**
     * The mapping of `matrix`.
     */
    VR_DEPTH_MATRIX = 3,
} vr_depth_kind;

/**
 * Access of the host to memory.
 */
typedef enum vr_memory_access {
    /**
     * None: the device alone uses it.
     */
    VR_MEMORY_DEVICE = 1,
    /**
     * The host writes it in sequence, and the device reads it: mapped and coherent.
     */
    VR_MEMORY_UPLOAD = 2,
    /**
     * The device writes it, and the host reads it: mapped and coherent, cached where there is a choice.
     */
    VR_MEMORY_DOWNLOAD = 3,
} vr_memory_access;

/**
 * Shape of a kernel.
 */
typedef enum vr_kernel {
    /**
     * A Gaussian that is cut.
     */
    VR_KERNEL_GAUSSIAN = 1,
    /**
     * The cubic B-spline.
     */
    VR_KERNEL_BSPLINE = 2,
    /**
     * Grids only: linear along each axis, so that the sum is trilinear interpolation.
     */
    VR_KERNEL_TENT = 3,
    /**
     * Grids only: Lanczos.
     */
    VR_KERNEL_SINC = 4,
} vr_kernel;

/**
 * Meaning of the kernels' sum.
 */
typedef enum vr_kernel_model {
    /**
     * Extinction: each kernel's, by its scalar, adds to that of the others.
     */
    VR_KERNEL_DENSITY = 1,
    /**
     * A scalar: the mean of the samples', weighted by the kernels.
     */
    VR_KERNEL_INTERPOLATE = 2,
} vr_kernel_model;

/**
 * The rule that Gaussian splats were trained under. The option `rule` of the technique `gaussians` selects another.
 */
typedef enum vr_trained_mode {
    /**
     * Nothing is known: that of the first paper.
     */
    VR_TRAINED_UNKNOWN = 0,
    /**
     * That of the first paper (Kerbl and others 2023).
     */
    VR_TRAINED_DEFAULT = 1,
    /**
     * The same with opacities that make up for the widening (Mip-Splatting).
     */
    VR_TRAINED_ANTIALIASED = 2,
    /**
     * Flat splats that a ray intersects (2D Gaussian Splatting).
     */
    VR_TRAINED_FLAT = 3,
    /**
     * That of KHR_gaussian_splatting.
     */
    VR_TRAINED_KHRONOS = 4,
} vr_trained_mode;

/**
 * A Vulkan device with the library's objects. It lives until this handle and all handles made from it are destroyed.
 */
typedef struct vr_gpu vr_gpu;

/**
 * Everything that frames of one size need: pipelines, buffers, images. Each frame in flight needs a plan of its own.
 */
typedef struct vr_plan vr_plan;

/**
 * A recording in a command buffer. It keeps the resources of its commands until vr_recording_completed() says that their
 * submission has ended, or vr_recording_discard() that there is none; then it has the status of the frame.
 */
typedef struct vr_recording vr_recording;

/**
 * Data with a transfer function on a device. Creating a plan uploads the data that its technique needs, which the scene then keeps.
 * A scene does not change: functions that change something make another scene, which shares the rest.
 */
typedef struct vr_scene vr_scene;

/**
 * An option of a technique.
 */
typedef struct vr_option_info {
    /**
     * Key of the option.
     */
    const char *key;
    /**
     * Allowed values.
     */
    const char *values;
    /**
     * Default value.
     */
    const char *default_value;
    /**
     * Effect of the option.
     */
    const char *effect;
} vr_option_info;

/**
 * A technique. Everything that this points to lives as long as the library.
 */
typedef struct vr_technique_info {
    /**
     * sizeof(vr_technique_info).
     */
    size_t struct_size;
    /**
     * Name of the technique.
     */
    const char *name;
    /**
     * Summary in one line, with authors and year of the paper.
     */
    const char *summary;
    /**
     * Options of the technique.
     */
    const struct vr_option_info *options;
    /**
     * Number of options.
     */
    size_t option_count;
} vr_technique_info;

/**
 * Options of a device that the library opens. Zeros are the defaults.
 */
typedef struct vr_gpu_info {
    /**
     * sizeof(vr_gpu_info).
     */
    size_t struct_size;
    /**
     * Part of the device's name; case is ignored. NULL: the environment variable VOLRASTER_DEVICE, else the best device: a
     * real GPU before a software one.
     */
    const char *device;
    /**
     * A vr_validation. A missing layer is an error.
     */
    uint32_t validation;
    /**
     * VK_TRUE keeps no pipelines on disk.
     */
    VkBool32 no_pipeline_cache;
    /**
     * Folder of the pipeline cache. NULL: volraster in the user's cache folder.
     */
    const char *pipeline_cache_folder;
    /**
     * Limit of device memory, in bytes. 0: the free memory that the driver reports, or nine tenths of the largest
     * device-local heap.
     */
    uint64_t memory_budget;
} vr_gpu_info;

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
     * Family of the queue.
     */
    uint32_t queue_family;
} vr_gpu_objects;

/**
 * Receives a queue, which no other thread uses during the call, and the user pointer.
 */
typedef void (*vr_queue_callback)(VkQueue queue, void *user);

/**
 * Receives the user pointer that was given with it.
 */
typedef void (*vr_callback)(void *user);

/**
 * A request for memory of one buffer or image.
 */
typedef struct vr_memory_request {
    /**
     * sizeof(vr_memory_request) of the library: later versions may have more fields.
     */
    size_t struct_size;
    /**
     * Name of the resource, valid during the call.
     */
    const char *name;
    /**
     * Bytes.
     */
    uint64_t size;
    /**
     * Alignment of the offset.
     */
    uint64_t alignment;
    /**
     * VkMemoryRequirements::memoryTypeBits.
     */
    uint32_t memory_type_bits;
    /**
     * A vr_memory_access.
     */
    uint32_t access;
    /**
     * Whether the resource is a buffer; else it is an image with optimal tiling, which bufferImageGranularity keeps apart.
     */
    VkBool32 is_buffer;
    /**
     * Whether shaders find the buffer by its address: the memory needs VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
     */
    VkBool32 addressed;
} vr_memory_request;

/**
 * A part of device memory, for one resource.
 */
typedef struct vr_memory_part {
    /**
     * The memory object.
     */
    VkDeviceMemory memory;
    /**
     * Where the part begins, in bytes.
     */
    uint64_t offset;
    /**
     * Where the host sees the beginning of the part; required unless the access is VR_MEMORY_DEVICE.
     */
    void *mapped;
    /**
     * A number of the caller's own.
     */
    uint64_t tag;
} vr_memory_part;

/**
 * Writes to `part`, which is zeros, memory of the requested size, alignment and type, which is no other resource's and stays valid and
 * mapped until it is freed. Returns VK_SUCCESS, or the result that the library's caller gets in an error.
 */
typedef VkResult (*vr_allocate_callback)(const struct vr_memory_request *request,
                                         struct vr_memory_part *part,
                                         void *user);

/**
 * Takes back a part. Its resource is destroyed, and the device does not use it.
 */
typedef void (*vr_free_callback)(const struct vr_memory_part *part, void *user);

/**
 * Builds the pipeline of a number.
 */
typedef void (*vr_compile_task)(uint32_t number, void *task);

/**
 * Calls `build` with `task` and each number below `count` once, on any threads, and returns when all calls have returned. What it leaves
 * out the waiting thread builds. While that waits it must not prepare another plan.
 */
typedef void (*vr_compile_callback)(uint32_t count, vr_compile_task build, void *task, void *user);

/**
 * A device of the caller, and options of its use by the library.
 */
typedef struct vr_device_info {
    /**
     * sizeof(vr_device_info).
     */
    size_t struct_size;
    /**
     * Entry point of the loader that made the instance. NULL: the system's loader.
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
     * Enabled extensions of the instance. The library uses VK_EXT_debug_utils, for names and labels.
     */
    const char *const *instance_extensions;
    /**
     * A physical device of that instance, for Vulkan 1.3 or later.
     */
    VkPhysicalDevice physical_device;
    /**
     * The device.
     */
    VkDevice device;
    /**
     * The structure that the device was made with, or one that names the extensions and features that the library may use.
     * The library reads extensions, and features in any structure of the chain that may have them. Required are
     * synchronization2 and dynamicRendering; optional are fragmentStoresAndAtomics, bufferDeviceAddress for buffers beyond
     * maxStorageBufferRange, VK_EXT_memory_budget, and VK_EXT_fragment_shader_interlock with
     * fragmentShaderPixelInterlock.
     */
    const VkDeviceCreateInfo *device_create_info;
    /**
     * A queue for graphics and compute.
     */
    VkQueue queue;
    /**
     * Family of the queue.
     */
    uint32_t queue_family;
    /**
     * The caller's cache, with which every pipeline is created, or VK_NULL_HANDLE. The caller keeps its contents, and destroys it
     * when `released` is called or later. It was not made with VK_PIPELINE_CACHE_CREATE_EXTERNALLY_SYNCHRONIZED_BIT.
     */
    VkPipelineCache pipeline_cache;
    /**
     * Folder in which the library keeps a file of pipelines, or NULL. Without this and `pipeline_cache` nothing is kept.
     */
    const char *pipeline_cache_folder;
    /**
     * Limit of device memory, in bytes. 0: the free memory that the driver reports, or nine tenths of the largest
     * device-local heap.
     */
    uint64_t memory_budget;
    /**
     * Called with `user` before each submission of the library to the queue; unlock_queue is called after it on the same
     * thread. Set both or neither. Without them the caller uses the queue only within vr_gpu_with_queue(), or while no
     * other thread is in a function of the library. Recording submits nothing. A thread that holds the lock must not call
     * into the library, except to record.
     */
    vr_callback lock_queue;
    /**
     * See lock_queue.
     */
    vr_callback unlock_queue;
    /**
     * Called once with `user` when the library has destroyed its last object on the device, by the thread that destroyed
     * the last handle; also if vr_gpu_adopt() fails. From then on device and instance may be destroyed, also by this
     * function. May be NULL; then the caller must destroy all handles before the device.
     */
    vr_callback released;
    /**
     * Passed to lock_queue, unlock_queue, released, allocate_memory, free_memory and compile.
     */
    void *user;
    /**
     * Gives the memory of all buffers and images, in place of the library's allocator, which then allocates nothing. Any thread that
     * prepares, uploads or destroys calls it. Set free_memory too, or neither.
     */
    vr_allocate_callback allocate_memory;
    /**
     * See allocate_memory.
     */
    vr_free_callback free_memory;
    /**
     * Callbacks for host memory that every object which the library makes on the device is created and destroyed with, or NULL. They are
     * copied; any thread may call them, until `released` is called. The library's allocator of device memory has none: with them go
     * allocate_memory and free_memory.
     */
    const VkAllocationCallbacks *allocation_callbacks;
    /**
     * Runs the compilation of pipelines on threads of the caller's. NULL: as many of the library's own as the processor runs.
     */
    vr_compile_callback compile;
} vr_device_info;

/**
 * A regular grid: a scalar field, trilinear between samples, with vacuum outside the box of the samples.
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
     * The samples: x fastest, then y, without gaps, of any alignment. They are copied.
     */
    const void *samples;
    /**
     * Size of the samples in bytes: the size of a sample times the product of dims.
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
     * World directions of the grid's x, y and z axes, of any length and at any angles. All 0: the world's axes.
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
 * A knot of a transfer function, which maps a scalar to emitted colour and extinction. It is linear between knots and constant
 * beyond the ends. Two knots of one scalar make a jump, at which the later one applies.
 */
typedef struct vr_knot {
    /**
     * Scalar in the data's units, not less than that of the previous knot.
     */
    double scalar;
    /**
     * Emitted colour: linear red, green and blue, not premultiplied, at least 0.
     */
    double colour[3];
    /**
     * Extinction per world unit of length, at least 0.
     */
    double extinction;
} vr_knot;

/**
 * A mesh of tetrahedra, with vacuum outside of them and in those with a NaN scalar. The library reorients tetrahedra that are
 * inside out, and removes those without volume.
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
     * Indices of the four points of each tetrahedron, from 0.
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
 * Scattered points with kernels. Arrays may be NULL; others have one element per point.
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
     * Covariances of Gaussians, xx, xy, xz, yy, yz and zz of each point, in world units squared. Excludes radii.
     */
    const float *covariances;
    /**
     * Support radius of all points, used without radii and covariances. 0: estimated from the spacing.
     */
    double radius;
} vr_points_info;

/**
 * Trained Gaussian splats. Those with NaN, infinite places or quaternions of length 0 are left out.
 */
typedef struct vr_gaussians_info {
    /**
     * sizeof(vr_gaussians_info).
     */
    size_t struct_size;
    /**
     * Number of splats.
     */
    size_t splat_count;
    /**
     * x, y and z of each centre, in world units.
     */
    const float *centres;
    /**
     * Quaternion w, x, y, z of each.
     */
    const float *rotations;
    /**
     * Natural logarithms of the standard deviations along the rotated x, y and z of each; -INFINITY is flat.
     */
    const float *log_scales;
    /**
     * Opacity of each in its middle, 0 to 1.
     */
    const float *opacities;
    /**
     * For each splat the coefficients of red, green and blue for each of the (degree + 1)^2 spherical harmonics.
     */
    const float *harmonics;
    /**
     * Degree of the spherical harmonics, 0 to 4.
     */
    uint32_t degree;
    /**
     * A vr_trained_mode.
     */
    uint32_t trained;
    /**
     * Three letters that say what x, y and z point to, such as "rdf": r right, l left, u up, d down, f front, b back. NULL: "rub".
     */
    const char *axes;
} vr_gaussians_info;

/**
 * Properties of a scene, for placing a camera and making a transfer function.
 */
typedef struct vr_scene_info {
    /**
     * sizeof(vr_scene_info).
     */
    size_t struct_size;
    /**
     * Least corner of the data's bounding box, whose sides are parallel to the world's axes.
     */
    double low[3];
    /**
     * Greatest corner of the bounding box.
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
     * Samples along x, y and z; 0 if the data is not a grid.
     */
    uint32_t dims[3];
} vr_scene_info;

/**
 * A clip plane. It removes the side that its normal points away from.
 */
typedef struct vr_clip_plane {
    /**
     * A point of the plane, world units.
     */
    double point[3];
    /**
     * Normal, which points to the side that is kept; of any length but 0.
     */
    double normal[3];
} vr_clip_plane;

/**
 * A camera, the size of its image, and the clipping of the volume. Row 0 is on top. Pixels are square, but for matrices.
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
     * A direction that points up in the image; it need not be perpendicular to the view.
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
     * Full vertical angle of view of a perspective projection, in degrees, between 0 and 180.
     */
    double fov_y_deg;
    /**
     * Half of the image's height in an orthographic projection, in world units.
     */
    double half_height;
    /**
     * Clip planes. Every technique cuts rays exactly there.
     */
    struct vr_clip_plane clip_planes[6];
    /**
     * Least corner of the crop box, whose sides are parallel to the world's axes; nothing is drawn outside. Minus infinity
     * leaves a side open. Both corners all 0: no box.
     */
    double crop_low[3];
    /**
     * Greatest corner of the crop box; infinity leaves a side open.
     */
    double crop_high[3];
    /**
     * Matrix from world to view coordinates, column by column; times a model matrix of the volume where it has one: lengths and
     * extinctions stay those of the scene. A parallel projection looks along -z of view coordinates, a perspective one along -z or +z.
     */
    double view_matrix[16];
    /**
     * Matrix from view to clip coordinates, column by column. It may be off-centre, jittered, and have any depths, reversed and infinite
     * ones too.
     */
    double projection_matrix[16];
} vr_view;

/**
 * A triangle mesh of one colour in the volume, visible from both sides.
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
     * Indices of the three points of each triangle, from 0.
     */
    const uint32_t *triangles;
    /**
     * Number of triangles.
     */
    size_t triangle_count;
    /**
     * Linear red, green and blue, not premultiplied, and opacity: 1 is opaque.
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
 * Illumination of a grid by one directional light, from both sides. The emitted colour c becomes
 * c (ambient + diffuse |n.l|) + specular |n.h|^shininess, where n is the normalised central difference of the scalars, l points to the
 * light, and h halves the angle between l and the direction to the eye.
 */
typedef struct vr_lighting {
    /**
     * sizeof(vr_lighting).
     */
    size_t struct_size;
    /**
     * Share of the colour that is seen whatever the direction of the light, at least 0.
     */
    double ambient;
    /**
     * Share of the colour that is seen where n points to the light, at least 0.
     */
    double diffuse;
    /**
     * Brightness of the white highlight, at least 0.
     */
    double specular;
    /**
     * Exponent of the highlight, 1 to 1024.
     */
    double shininess;
    /**
     * Direction to the light, in world coordinates, of any length; 0, 0, 0: to the eye.
     */
    double direction[3];
    /**
     * Length of the gradient, in scalars per unit of world length, up to which nothing is lit; negative: chosen for the data.
     */
    double least_gradient;
} vr_lighting;

/**
 * Kernels that reconstruct a field from the samples of a grid, the points of a mesh, or points. Zeros are the defaults.
 */
typedef struct vr_kernels_info {
    /**
     * sizeof(vr_kernels_info).
     */
    size_t struct_size;
    /**
     * A vr_kernel. 0: VR_KERNEL_GAUSSIAN.
     */
    uint32_t kernel;
    /**
     * A vr_kernel_model. 0: VR_KERNEL_DENSITY for points, else VR_KERNEL_INTERPOLATE.
     */
    uint32_t model;
    /**
     * Grids and Gaussians: standard deviation, in voxels along each axis. 0: 0.7.
     */
    double sigma;
    /**
     * Gaussians: distance at which they are cut, in standard deviations. 0: 3.
     */
    double cut;
    /**
     * VR_KERNEL_INTERPOLATE: smallest sum of weights that is not vacuum. 0: 0.05.
     */
    double least;
} vr_kernels_info;

/**
 * Receives the number of bytes read so far and of all bytes, now and then, on any thread; `all` is 0 if it is unknown.
 */
typedef void (*vr_progress_callback)(uint64_t done, uint64_t all, void *user);

/**
 * How a file is read, and which of its arrays. Zeros are the defaults. Arrays are named NAME, NAME:PART, point:NAME or
 * cell:NAME:PART; PART is a component (0, x, r, ...) or "magnitude".
 */
typedef struct vr_read_info {
    /**
     * sizeof(vr_read_info).
     */
    size_t struct_size;
    /**
     * Limit of the memory for the data, in bytes. 0: 16 GiB.
     */
    uint64_t max_bytes;
    /**
     * The array to show. NULL: the file's active one, else the first with one component.
     */
    const char *array;
    /**
     * The array of support radii of points.
     */
    const char *radius;
    /**
     * The array of covariances of points.
     */
    const char *covariance;
    /**
     * The array of weights of points.
     */
    const char *weight;
    /**
     * Receives the progress. May be NULL.
     */
    vr_progress_callback progress;
    /**
     * Passed to progress.
     */
    void *user;
} vr_read_info;

/**
 * Technique and target of a plan.
 */
typedef struct vr_plan_info {
    /**
     * sizeof(vr_plan_info).
     */
    size_t struct_size;
    /**
     * Technique with options, NAME[:key=value,...], such as "slabs:step=0.5". NULL: vr_scene_technique().
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
     * Whether each recording has a depth image, which cuts the rays of the volume at its surfaces.
     */
    VkBool32 with_depth;
    /**
     * Whether the target is a rectangle of a larger image, placed by vr_record_info::corner.
     */
    VkBool32 in_part;
    /**
     * Format of the images of hit depths: a colour format with red, such as VK_FORMAT_R32_SFLOAT.
     */
    VkFormat hit_format;
    /**
     * 0.
     */
    uint32_t reserved;
    /**
     * Opacity whose depth on each ray an image of each recording gets, above 0 and below 1; 0: no such image. 1/255 is where the volume
     * begins to show, 1/2 its apparent surface.
     */
    double hit_opacity;
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
     * A two-dimensional view with one level, one layer and only the depth aspect. Its image has one sample per texel and the
     * usage VK_IMAGE_USAGE_SAMPLED_BIT.
     */
    VkImageView view;
    /**
     * Format of the view, with depth.
     */
    VkFormat format;
    /**
     * Layout when the commands run. VK_IMAGE_LAYOUT_UNDEFINED stands for VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL. The commands
     * leave the image in that layout, last read in the compute shader stage.
     */
    VkImageLayout layout;
    /**
     * Size of the image, equal to that of the plan's view. Of a plan with in_part it may be larger, and the plan reads the rectangle at
     * `corner`.
     */
    VkExtent2D extent;
    /**
     * A vr_depth_kind.
     */
    uint32_t kind;
    /**
     * Depth along the view, in world units, that is stored as 0: near for the usual projection, far for a reversed one,
     * INFINITY for a reversed one without a far plane. A pixel that stores the far end shows no surface.
     */
    double at_zero;
    /**
     * Depth along the view, in world units, that is stored as 1.
     */
    double at_one;
    /**
     * Matrix from view coordinates to clip coordinates with depths from 0 to 1, column by column.
     */
    double matrix[16];
    /**
     * First texel of the rectangle, from the left and the top.
     */
    uint32_t corner[2];
    /**
     * World units in one of the scene, where a model matrix scales it: depths are in world units, divided by it. 0: 1.
     */
    double unit;
} vr_depth_image;

/**
 * An image of the caller that gets the depth at which each pixel's ray reaches vr_plan_info::hit_opacity, as a depth image of the projection
 * would hold a surface there; without one the far end.
 */
typedef struct vr_hit_depths {
    /**
     * sizeof(vr_hit_depths).
     */
    size_t struct_size;
    /**
     * A colour image of vr_plan_info::hit_format, in the states of vr_record_info::image.
     */
    VkImage image;
    /**
     * A two-dimensional view of the image, with one level and one layer.
     */
    VkImageView view;
    /**
     * A vr_depth_kind.
     */
    uint32_t kind;
    /**
     * Depth along the view, in world units, that is stored as 0.
     */
    double at_zero;
    /**
     * Depth along the view, in world units, that is stored as 1.
     */
    double at_one;
    /**
     * Matrix from view coordinates to clip coordinates with depths from 0 to 1, column by column.
     */
    double matrix[16];
    /**
     * First texel of the rectangle, from the left and the top, for plans with in_part; else 0.
     */
    uint32_t corner[2];
    /**
     * World units in one of the scene, where a model matrix scales it: depths are in world units, divided by it. 0: 1.
     */
    double unit;
} vr_hit_depths;

/**
 * Command buffer and images of a recording.
 */
typedef struct vr_record_info {
    /**
     * sizeof(vr_record_info).
     */
    size_t struct_size;
    /**
     * A command buffer in the recording state, outside of rendering, from a pool for the device's queue family.
     */
    VkCommandBuffer commands;
    /**
     * The target image, with the usage VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT. When the commands run it is in the layout
     * VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, and earlier accesses are available and visible to the colour attachment output
     * stage. The commands leave it in that layout, last written in that stage.
     */
    VkImage image;
    /**
     * A two-dimensional view of the image, with one level and one layer.
     */
    VkImageView view;
    /**
     * Format of the view, equal to that of the plan.
     */
    VkFormat format;
    /**
     * Size of the image, or of its rectangle at `corner`, equal to that of the plan's view.
     */
    VkExtent2D extent;
    /**
     * Depth image; NULL if the plan is without depth.
     */
    const struct vr_depth_image *depth;
    /**
     * First pixel of the rectangle, from the left and the top, for plans with in_part; else 0.
     */
    uint32_t corner[2];
    /**
     * Image of hit depths; NULL if the plan is without.
     */
    const struct vr_hit_depths *hit_depths;
} vr_record_info;

/**
 * Time of one pass.
 */
typedef struct vr_pass_time {
    /**
     * Name of the pass.
     */
    const char *name;
    /**
     * Milliseconds on the device.
     */
    double ms;
} vr_pass_time;

/**
 * A count of work that the device has done for a frame.
 */
typedef struct vr_counter {
    /**
     * Name of the counter.
     */
    const char *name;
    /**
     * The count.
     */
    uint64_t value;
} vr_counter;

/**
 * Status of a frame.
 */
typedef struct vr_status {
    /**
     * sizeof(vr_status).
     */
    size_t struct_size;
    /**
     * Whether everything was drawn. VK_FALSE if pages of a grid, or parts of a mesh or points, are missing: call vr_plan_load(); or if a capacity was too small: call
     * vr_plan_prepare(). Then draw the frame again.
     */
    VkBool32 complete;
    /**
     * Number of passes; 0 if the device has no timestamps.
     */
    uint32_t pass_count;
    /**
     * Times of the passes, valid as long as the recording's handle.
     */
    const struct vr_pass_time *passes;
    /**
     * Counters, valid as long as the recording's handle.
     */
    const struct vr_counter *counters;
    /**
     * Number of counters.
     */
    uint32_t counter_count;
    /**
     * How far the image is from the complete one at most, in each component of its premultiplied linear colour and opacity: root of the mean
     * square over pixels. 0 if it is complete, INFINITY if no bound is known; there is one for grids in pages.
     */
    double bound_rmse;
    /**
     * The same at any pixel.
     */
    double bound_greatest;
} vr_status;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns the message of this thread's last failure: one line of UTF-8, never NULL, "" before the first failure. It is valid
 * until this thread's next failure or its end.
 *
 * Threads: each has its own.
 */
const char *vr_last_error(void);

/**
 * Returns the code of the failed Vulkan call if this thread's last failure was VR_ERROR_VULKAN, VK_ERROR_DEVICE_LOST if it
 * was VR_ERROR_DEVICE_LOST, else VK_SUCCESS.
 *
 * Threads: each has its own.
 */
VkResult vr_last_vulkan_result(void);

/**
 * Returns the library's version, such as "1.2.3".
 *
 * Threads: any.
 */
const char *vr_version(void);

/**
 * Returns the number of techniques.
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
 * Fails with VR_ERROR_INVALID; the message lists the allowed names, keys or values.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `technique` is NULL or ends with NUL.
 */
enum vr_result vr_technique_parse(const char *technique);

/**
 * Opens a device, without a window. `info` may be NULL, for default options.
 *
 * Fails with VR_ERROR_NO_DEVICE, whose message has the reason for each device, VR_ERROR_UNSUPPORTED if the layer of a
 * requested validation is missing, VR_ERROR_VULKAN.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `info` is NULL or valid, and so are its strings; `gpu` is NULL or valid.
 */
enum vr_result vr_gpu_create(const struct vr_gpu_info *info, struct vr_gpu **gpu);

/**
 * Destroys a device's handle; NULL is ignored. The device lives as long as anything that was made from it.
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `gpu` is NULL, or a handle that was not destroyed.
 */
void vr_gpu_destroy(struct vr_gpu *gpu);

/**
 * Returns the device's name, valid as long as the handle; NULL for NULL.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `gpu` is NULL or valid.
 */
const char *vr_gpu_name(const struct vr_gpu *gpu);

/**
 * Writes the bytes of device memory that the library uses, and its limit. Either pointer may be NULL.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `gpu` is NULL or valid; the others are NULL or valid.
 */
enum vr_result vr_gpu_memory(const struct vr_gpu *gpu, uint64_t *used, uint64_t *budget);

/**
 * Writes the Vulkan objects behind a device, for callers that record on a device that the library has opened. The objects live as
 * long as the handle and everything made from it; callers destroy what they make from the objects before.
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
 * Calls `work` once with the queue that the library submits to, while no other thread submits through the library, and then
 * returns. `work` must not call functions of the library that draw, upload or prepare: they would deadlock.
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
 * Adopts a device that the caller made. The library destroys neither the device nor its instance. Destroying the handle and
 * all handles made from it destroys everything that the library has made on the device, without a wait.
 *
 * Fails with VR_ERROR_UNSUPPORTED, whose message names the missing requirement, VR_ERROR_INVALID for a null handle, a
 * physical device of another instance, or an enabled feature that the device does not offer, VR_ERROR_VULKAN.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `info` and `gpu` are NULL or valid. The objects belong together and were made with what `info` says; they live until
 * `released` is called. The queue is not protected.
 */
enum vr_result vr_gpu_adopt(const struct vr_device_info *info,
                            struct vr_gpu **gpu);

/**
 * Makes a scene of a grid in memory, which is copied. Without knots (NULL, 0) the library chooses a transfer function.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays have the given lengths.
 */
enum vr_result vr_scene_create_grid(const struct vr_gpu *gpu,
                                    const struct vr_grid_info *info,
                                    const struct vr_knot *knots,
                                    size_t knot_count,
                                    struct vr_scene **scene);

/**
 * Makes a scene of tetrahedra in memory, which are copied. Without knots (NULL, 0) the library chooses a transfer function.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays have the given lengths.
 */
enum vr_result vr_scene_create_mesh(const struct vr_gpu *gpu,
                                    const struct vr_mesh_info *info,
                                    const struct vr_knot *knots,
                                    size_t knot_count,
                                    struct vr_scene **scene);

/**
 * Makes a scene of points in memory, which are copied. Without knots (NULL, 0) the library chooses a transfer function.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays have the given lengths.
 */
enum vr_result vr_scene_create_points(const struct vr_gpu *gpu,
                                      const struct vr_points_info *info,
                                      const struct vr_knot *knots,
                                      size_t knot_count,
                                      struct vr_scene **scene);

/**
 * Makes a scene of trained Gaussian splats in memory, which are copied. They have colours of their own.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays have the given lengths.
 */
enum vr_result vr_scene_create_gaussians(const struct vr_gpu *gpu,
                                         const struct vr_gaussians_info *info,
                                         struct vr_scene **scene);

/**
 * Destroys a scene's handle; NULL is ignored. Plans and recordings made from it stay valid.
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `scene` is NULL, or a handle that was not destroyed.
 */
void vr_scene_destroy(struct vr_scene *scene);

/**
 * Writes the properties of a scene.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `scene` is NULL or valid; `info` is NULL or valid, with its size.
 */
enum vr_result vr_scene_query(const struct vr_scene *scene, struct vr_scene_info *info);

/**
 * Writes the view of the scene file, or a view that the library chooses for the data, for an image of this size. Width and
 * height 0 stand for the scene's own size.
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
 * Returns the technique of the scene file, else the default for the data, in the format of vr_plan_info, valid as long as the
 * handle; NULL for NULL.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `scene` is NULL or valid.
 */
const char *vr_scene_technique(const struct vr_scene *scene);

/**
 * Returns the warnings about the file that was read, one per line, "" if there are none, valid as long as the handle; NULL for
 * NULL.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `scene` is NULL or valid.
 */
const char *vr_scene_warnings(const struct vr_scene *scene);

/**
 * Writes whether a technique, with or without options, supports a scene.
 *
 * Fails with VR_ERROR_INVALID for an unknown technique or invalid options.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, strings end with NUL.
 */
enum vr_result vr_scene_draws(const struct vr_scene *scene, const char *technique, VkBool32 *draws);

/**
 * Makes a scene of the same data with another transfer function. The scenes share the data on the device; `source` is
 * unchanged.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays have the given lengths.
 */
enum vr_result vr_scene_with_transfer(const struct vr_scene *source,
                                      const struct vr_knot *knots,
                                      size_t knot_count,
                                      struct vr_scene **scene);

/**
 * Makes a scene of other samples in the same grid, with the same placement, transfer function, surfaces and view. The samples are
 * copied, and may be of another type; see vr_grid_info. `source` is unchanged.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, `samples` has `sample_bytes` bytes.
 */
enum vr_result vr_scene_with_samples(const struct vr_scene *source,
                                     uint32_t sample_type,
                                     const void *samples,
                                     size_t sample_bytes,
                                     struct vr_scene **scene);

/**
 * Makes a scene of the same mesh with other scalars, as in vr_mesh_info, and with another transfer function if there are knots. The
 * scenes share points and tetrahedra on the device. Scalars per tetrahedron are given for the tetrahedra that were kept. `source`
 * is unchanged.
 *
 * Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays have the given lengths.
 */
enum vr_result vr_scene_with_scalars(const struct vr_scene *source,
                                     uint32_t scalars_per,
                                     const float *scalars,
                                     size_t scalar_count,
                                     const struct vr_knot *knots,
                                     size_t knot_count,
                                     struct vr_scene **scene);

/**
 * Makes a scene of the same data with other surfaces, or with none. The scenes share the data on the device. Every technique draws
 * opaque surfaces, some draw translucent ones, and none does so with a resolution below full: vr_plan_create() refuses the others.
 *
 * `surfaces` are `surface_count` pointers. Everything is copied, and `source` is unchanged. Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, arrays have the given lengths.
 */
enum vr_result vr_scene_with_surfaces(const struct vr_scene *source,
                                      const struct vr_surface_info *const *surfaces,
                                      size_t surface_count,
                                      struct vr_scene **scene);

/**
 * Makes a scene of the same data in another mode, a vr_mode. The scenes share the data on the device; `source` is unchanged. Techniques
 * that do not draw a mode are refused by vr_plan_create().
 *
 * `lighting` is for VR_MODE_LIT; NULL stands for a light at the eye. Fails with VR_ERROR_INVALID.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid.
 */
enum vr_result vr_scene_with_mode(const struct vr_scene *source,
                                  uint32_t mode,
                                  const struct vr_lighting *lighting,
                                  struct vr_scene **scene);

/**
 * Makes a scene whose field other kernels reconstruct. The scenes share the data on the device; `source` is unchanged. Splatting techniques
 * draw it; for grids and meshes all others refuse it.
 *
 * Fails with VR_ERROR_INVALID, also for trained Gaussian splats, which are kernels of their own.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid.
 */
enum vr_result vr_scene_with_kernels(const struct vr_scene *source,
                                     const struct vr_kernels_info *info,
                                     struct vr_scene **scene);

/**
 * Makes a scene from a scene file (.json), a data file of any supported format, or a folder of slices. For a data file the
 * library chooses a camera and a transfer function. `info` may be NULL.
 *
 * `path` is UTF-8; on Unix it may have any bytes. Fails with VR_ERROR_IO, with VR_ERROR_FILE whose message names file, place and
 * rule, and with VR_ERROR_INVALID.
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
 * Makes a plan for frames of this view's size. May allocate, compile, upload, submit and wait.
 *
 * Fails with VR_ERROR_INVALID for options that do not exist or do not fit the scene, with VR_ERROR_UNSUPPORTED or
 * VR_ERROR_MEMORY if the device lacks a feature or memory, and with VR_ERROR_VULKAN.
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
 * Sets another view of the same image size. Allocates nothing and does not wait. Returns VR_NO_ROOM and changes nothing if the
 * plan's capacity is too small for the view, if its size differs, or if it clips and the plan was made without clipping: call
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
 * Loads what the last recording lacked of a grid in pages or a mesh or points in parts, since the device has no room for the whole, where vr_status::complete
 * is VK_FALSE. VR_OK says that the next recording goes on with the image, or begins anew where the view has changed since; VR_NO_ROOM that nothing was lacking: call
 * vr_plan_prepare() then. Reads the source of the data, submits and waits.
 *
 * Fails with VR_ERROR_INVALID while a recording is not completed, with errors of the data's source, and as vr_plan_create().
 *
 * Threads: any; calls with one plan wait for each other.
 *
 * # Safety
 *
 * Pointers are NULL or valid.
 */
enum vr_result vr_plan_load(struct vr_plan *plan);

/**
 * Makes a plan anew for a view of any size, with the capacity that earlier frames lacked. Resources of its recordings live until
 * these are completed. May allocate, compile, upload, submit and wait.
 *
 * Fails as vr_plan_create(), and leaves the plan unchanged.
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
 * Returns the route of the technique on this device (raster, compute, ...), valid as long as the handle; NULL for NULL.
 *
 * Threads: any.
 *
 * # Safety
 *
 * `plan` is NULL or valid.
 */
const char *vr_plan_route(const struct vr_plan *plan);

/**
 * Destroys a plan's handle; NULL is ignored. Resources of its recordings live until these are completed.
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `plan` is NULL, or a handle that was not destroyed.
 */
void vr_plan_destroy(struct vr_plan *plan);

/**
 * Draws a frame and waits for it, for tests, thumbnails and files. Writes width * height pixels of premultiplied linear red, green,
 * blue and alpha to `pixels`, row by row, top row first; `float_count` is the number of floats that `pixels` can hold.
 *
 * Fails as vr_plan_create(), and with VR_ERROR_TIMEOUT.
 *
 * Threads: any.
 *
 * # Safety
 *
 * Pointers are NULL or valid, structures with their sizes; `pixels` can hold `float_count` floats; `technique` ends with NUL.
 */
enum vr_result vr_render(const struct vr_scene *scene,
                         const char *technique,
                         const struct vr_view *view,
                         float *pixels,
                         size_t float_count);

/**
 * Records a frame into the caller's command buffer, without submission, wait or allocation of device memory. The caller submits,
 * waits for the end of the submission by a fence, a semaphore or an idle queue, and calls vr_recording_completed(). A plan has at
 * most one recording that is not completed.
 *
 * Fails with VR_ERROR_INVALID if an image does not fit the plan or the plan's last recording is not completed, and with
 * VR_ERROR_UNSUPPORTED if the device cannot sample the format of the depth image. Nothing is recorded then.
 *
 * Threads: any that may record into the command buffer; calls with one plan wait for each other.
 *
 * # Safety
 *
 * Pointers are NULL or valid, structures with their sizes. The Vulkan objects belong to the plan's device and are as vr_record_info
 * and vr_depth_image require; images and views live until every submission that uses them has ended. The command buffer is not
 * submitted again while a submission of it is pending, and only to the device's queue family.
 */
enum vr_result vr_plan_record(struct vr_plan *plan,
                              const struct vr_record_info *info,
                              struct vr_recording **recording);

/**
 * Records the frames of `count` plans of one device into one command buffer: the eyes of a stereo pair, the faces of a cube. Their
 * passes lie side by side and wait for each other only where plans share a target, so that a device that one frame does not fill draws
 * them in less than the sum of their times. Images are those of vr_plan_record(). Writes a recording for each plan, each to be
 * completed; the status of the one with the most passes has the times, each with those of the passes beside it.
 *
 * Fails as vr_plan_record(), and with VR_ERROR_INVALID if a plan is given twice or `commands` differs. Nothing is recorded then, and
 * `recordings` are NULL.
 *
 * Threads: as vr_plan_record().
 *
 * # Safety
 *
 * As of vr_plan_record(); `plans`, `infos` and `recordings` point to `count` pointers each.
 */
enum vr_result vr_plans_record(struct vr_plan *const *plans,
                               const struct vr_record_info *const *infos,
                               uint32_t count,
                               struct vr_recording **recordings);

/**
 * Declares that the submission of a recording has ended: a fence or a semaphore was signalled, or the queue is idle. Frees the
 * resources of the recording, and writes the status of the frame; later calls write the same. `status` may be NULL.
 *
 * Fails with VR_ERROR_VULKAN if the status cannot be read, though it frees the resources, and with VR_ERROR_INVALID for a
 * recording that was discarded.
 *
 * Threads: any; calls with one recording wait for each other.
 *
 * # Safety
 *
 * `recording` is NULL or valid, and no submission of it is pending; `status` is NULL or valid, with its size.
 */
enum vr_result vr_recording_completed(struct vr_recording *recording,
                                      struct vr_status *status);

/**
 * Declares that a recording will not be submitted, or not again, for instance because a resized window made its frame obsolete.
 * Frees the resources of the recording, and the plan can record again. Does nothing for a recording that was completed or
 * discarded.
 *
 * Fails with VR_ERROR_INVALID for NULL.
 *
 * Threads: any; calls with one recording wait for each other.
 *
 * # Safety
 *
 * `recording` is NULL or valid, and no submission of it is pending or will be made.
 */
enum vr_result vr_recording_discard(struct vr_recording *recording);

/**
 * Destroys a recording's handle; NULL is ignored. If it was neither completed nor discarded, its resources are never freed, since
 * the device may still use them, and the plan cannot record until vr_plan_prepare().
 *
 * Threads: any, while no other function uses this handle.
 *
 * # Safety
 *
 * `recording` is NULL, or a handle that was not destroyed.
 */
void vr_recording_destroy(struct vr_recording *recording);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VOLRASTER_H */

/* Checksum of the sources: 7912cb1490ed712a */
