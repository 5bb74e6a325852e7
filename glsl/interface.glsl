// Numbers that Rust and GLSL share. build.rs turns each into a Rust constant of the same name.

// Descriptor set 0.
#define BINDING_VOLUME 0        // sampler3D: the grid's samples
#define BINDING_KNOTS_UNIFORM 1 // uniform block: transfer function of at most UNIFORM_KNOTS knots
#define BINDING_KNOTS 2         // storage block: the same buffer, any number of knots
#define BINDING_ACCUMULATION 3  // image2D, rgba32f: premultiplied colour and alpha
#define BINDING_SOURCE 4        // sampler2D: an image to composite
#define BINDING_RESULT 5        // storage block: results of the start-up probes

// Specialisation constants.
#define SPEC_FILTER_EXACT 0 // bool: eight fetches and float32 weights instead of the sampler's filter
#define SPEC_HAS_NAN 1      // bool: samples may be NaN, which is vacuum
#define SPEC_CLIP_ENDS 2    // bool: slabs end at the domain and at the eye
#define SPEC_KNOT_WALK 3    // uint: knots to walk through in BINDING_KNOTS_UNIFORM; 0: binary search in BINDING_KNOTS
#define SPEC_RESUME 4       // bool: continue from what the accumulation image holds

#define UNIFORM_KNOTS 16
