// Numbers that Rust and GLSL share. build.rs turns each into a Rust constant of the same name.

// Descriptor set 0.
#define BINDING_VOLUME 0        // sampler3D: the grid's samples
#define BINDING_KNOTS_UNIFORM 1 // uniform block: transfer function of at most UNIFORM_KNOTS knots
#define BINDING_KNOTS 2         // storage block: the same buffer, any number of knots
#define BINDING_ACCUMULATION 3  // image2D, rgba32f: premultiplied colour and alpha
#define BINDING_SOURCE 4        // sampler2D: an image to composite
#define BINDING_RESULT 5        // storage block: results of the start-up probes
#define BINDING_TABLE_HEAD 6    // storage block: head of a pre-integration table
#define BINDING_TABLE 7         // sampler3D: its bins or nodes
#define BINDING_BRICKS 8        // storage block: one word a brick, 0 where nothing is visible
#define BINDING_RANGES 9        // storage block: least and greatest scalar of each brick
#define BINDING_VISIBLE 10      // storage block: ranges of scalars with extinction
#define BINDING_TEXELS 11       // storage block: an image's texels, packed, that the shader blends into
#define BINDING_THRESHOLDS 12   // storage block: blue-noise thresholds

// Specialisation constants.
#define SPEC_FILTER_EXACT 0 // bool: single fetches and float32 weights instead of the sampler's filter
#define SPEC_HAS_NAN 1      // bool: samples may be NaN, which is vacuum
#define SPEC_CLIP_ENDS 2    // bool: slabs end at the domain and at the eye
#define SPEC_KNOT_WALK 3    // uint: knots to walk through in BINDING_KNOTS_UNIFORM; 0: binary search in BINDING_KNOTS
#define SPEC_RESUME 4       // bool: continue from what the accumulation image holds
#define SPEC_PREFILTER 5    // bool: sample a mip level where a voxel is smaller than a pixel
#define SPEC_EMPTY_SPACE 6  // bool: pass over bricks in which nothing is visible
#define SPEC_INTEGRATOR 7   // uint: how a segment is integrated, one of INTEGRATOR_*
#define SPEC_BETWEEN 8      // bool: blend two slices of the stack
#define SPEC_TARGET 9       // uint: format that the shader blends in, one of TARGET_*
#define SPEC_BLUE_NOISE 10  // bool: thresholds from a blue-noise tile instead of white noise
#define SPEC_UNDER 11       // bool: the shader blends front to back
#define SPEC_TABLE_FILTER 12 // bool: the sampler interpolates the full table

// Values of SPEC_INTEGRATOR.
#define INTEGRATOR_MIDPOINT 0
#define INTEGRATOR_INTEGRAL 1
#define INTEGRATOR_FULL 2
#define INTEGRATOR_EXACT 3

// Values of SPEC_TARGET.
#define TARGET_RGBA8 0
#define TARGET_RGBA16 1
#define TARGET_RGBA16F 2

#define TABLE_BINS_PER_ROW 256 // bins of a cumulative table in one row of its texture
#define BRICK 8            // cells along each side of a brick
#define THRESHOLD_SIDE 64  // side of the tile of thresholds

#define UNIFORM_KNOTS 16
