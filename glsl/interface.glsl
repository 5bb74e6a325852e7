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
#define BINDING_MESH_POINTS 22  // storage block: points of a mesh, in its radii from its centre
#define BINDING_MESH_SCALARS 23 // storage block: a scalar for each point or each cell
#define BINDING_PRIMITIVES 24   // storage block: FACE_WORDS of each face, or CELL_WORDS of each cell
#define BINDING_VIEW_POINTS 25  // storage block: points as the view sees them
#define BINDING_RANK_KEYS 26    // storage block: a key of visibility for each primitive
#define BINDING_ORDER 27        // storage block: primitives by rank
#define BINDING_BOXES 28        // storage block: the pixels that each primitive may cover
#define BINDING_BIN_TABLE 29    // storage block: places in the bins, tile by tile and run by run
#define BINDING_BINS 30         // storage block: primitives of each tile, by rank
#define BINDING_CURSORS 31      // storage block: places in the lists, pixel by pixel
#define BINDING_LISTS 32        // storage block: fragments of each pixel, by rank
#define BINDING_STATUS 33       // storage block: STATUS_* words
#define BINDING_KBUFFER_0 34    // image2D, rgba32f: two pairs of the k-buffer each
#define BINDING_KBUFFER_1 35
#define BINDING_KBUFFER_2 36
#define BINDING_KBUFFER_3 37
#define BINDING_FLAGS 38        // storage block: a word a pixel, 1 where its sequence was not sorted
#define BINDING_POLYGONS 39     // storage block: outline of each cell in the image, two corners a vector
#define BINDING_FANS 40         // storage block: thick segment of each cell and the corners around it

#define BINDING_SPLAT_POINTS 41 // storage block: each splat's centre, with its scalar or with its size, colour and extinction
#define BINDING_SPLAT_SHAPES 43 // storage block: its covariance and a root of the inverse
#define BINDING_SPLAT_DOMAIN 44 // storage block: half extents of a lattice, offset of its sheets; scale of the template
#define BINDING_SPLAT_RECORDS 45 // storage block: ellipse or span of each splat as the view sees it
#define BINDING_SPLAT_STATE 46  // storage block: where each invocation goes on
#define BINDING_SPLAT_TEMPLATE 47 // sampler2D: the footprint that all kernels of a lattice have in parallel lines

#define BINDING_INTERMEDIATE 48 // storage block: texels of base planes

#define BINDING_LINE_BOUNDS 49  // storage block: the depths between which each pixel's line is drawn
#define BINDING_DEPTH 50        // sampler2D: depths of opaque surfaces, as a projection stores them
#define BINDING_TEXEL_BOUNDS 51 // storage block: the same for each texel of base planes, along the stack
#define BINDING_EDGES 52        // storage block: the texel that each pixel lies at, and its bounds where it is marched by itself
#define BINDING_TRIANGLES 53    // storage block: plane and colour of each triangle of surfaces
#define BINDING_LAYERS 54       // storage block: colours of the translucent surfaces of each pixel
#define BINDING_LAYER_ENDS 55   // storage block: where those of each pixel end
#define BINDING_LAYER_CURSORS 57 // storage block: and where those of the pixel before do
#define BINDING_LAYER_DEPTHS 58 // storage block: their depths
#define BINDING_BACKGROUND 56   // storage block: the opaque surface that each pixel shows

#define BINDING_SCAN_WORDS 13   // storage block: words to be replaced by their prefix sums
#define BINDING_SCAN_SUMS 14    // storage block: sums of chunks of them, 64 bits each
#define BINDING_SCAN_TOTAL 15   // storage block: the sum of all, lower and upper word
#define BINDING_SORT_COUNT 16   // storage block: number of pairs
#define BINDING_SORT_KEYS 17    // storage block: keys in
#define BINDING_SORT_VALUES 18  // storage block: values in
#define BINDING_SORT_DIGITS 19  // storage block: counts of digits
#define BINDING_SORTED_KEYS 20  // storage block: keys out
#define BINDING_SORTED_VALUES 21 // storage block: values out

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

#define SPEC_CELLS 13       // bool: primitives are cells, not faces
#define SPEC_CELL_SCALARS 14 // bool: scalars belong to cells
#define SPEC_BACK_TO_FRONT 15 // bool: ranks descend in depth
#define SPEC_FILL 16        // bool: entries are written, not counted
#define SPEC_K 17           // uint: entries of the k-buffer
#define SPEC_LAST_CHUNK 18  // bool: the k-buffer is emptied at the end
#define SPEC_REPAIR 19      // bool: flagged pixels only, by sorting their lists
#define SPEC_EYE_INSIDE 20  // bool: the mesh may reach behind the eye
#define SPEC_SPACE 22       // bool: fans of triangles stand in space, not in the image
#define SPEC_SHADED 21      // bool: colours belong to the vertices of fans
#define SPEC_FLAGGED 23     // bool: lists of flagged pixels only

#define SPEC_SPLAT_SHAPE 24   // uint: which sizes splats have, one of SHAPE_*
#define SPEC_SPLAT_KERNEL 25  // uint: one of KERNEL_*
#define SPEC_SPLAT_DENSITY 26 // bool: extinctions add up; else scalars are interpolated
#define SPEC_SPLAT_EWA 27     // bool: footprints are ellipses in the image
#define SPEC_SPLAT_ORDER 28   // uint: what splats are sorted by, one of ORDER_*
#define SPEC_SPLAT_AXIS 29    // uint: axis that sheets are stacked along
#define SPEC_SPLAT_LOWPASS 30 // uint: what is done against footprints below a pixel, one of LOWPASS_*
#define SPEC_SPLAT_TEMPLATE 31 // bool: footprints come from a table
#define SPEC_RUNS 32          // uint: runs of ranks of each tile's bin

#define SPEC_WARP 33          // uint: the warp's filter, one of WARP_*
#define SPEC_EVERY 34         // bool: a slab holds several slices of the stack

#define SPEC_BOUNDED 35       // bool: lines are drawn between the depths of BINDING_LINE_BOUNDS
#define SPEC_LAYERS 36        // bool: translucent surfaces stand in the volume

// Values of SPEC_INTEGRATOR.
#define INTEGRATOR_MIDPOINT 0
#define INTEGRATOR_INTEGRAL 1
#define INTEGRATOR_FULL 2
#define INTEGRATOR_EXACT 3
#define INTEGRATOR_SMOKE 4

// Values of SPEC_TARGET.
#define TARGET_RGBA8 0
#define TARGET_RGBA16 1
#define TARGET_RGBA16F 2

// Values of SPEC_SPLAT_SHAPE, SPEC_SPLAT_KERNEL, SPEC_SPLAT_ORDER, SPEC_SPLAT_LOWPASS.
#define SHAPE_ALIKE 0
#define SHAPE_RADII 1
#define SHAPE_COVARIANCES 2
#define KERNEL_GAUSSIAN 0
#define KERNEL_BSPLINE 1
#define KERNEL_TENT 2
#define KERNEL_SINC 3
#define ORDER_CENTRES 0
#define ORDER_NEAREST 1
#define ORDER_SHEETS 2
#define LOWPASS_NONE 0
#define LOWPASS_AUTO 1
#define LOWPASS_FULL 2

// Values of SPEC_WARP.
#define WARP_BILINEAR 0
#define WARP_MIP 1
#define WARP_BICUBIC 2

#define SHEETS 4          // slabs that are summed up at a time
#define SPLAT_WINDOW 8    // splats that wait to be sorted
#define FOOTPRINT_PARTS 8 // of a line integral without a closed form, two points each

#define TABLE_BINS_PER_ROW 256 // bins of a cumulative table in one row of its texture
#define BRICK 8            // cells along each side of a brick
#define THRESHOLD_SIDE 64  // side of the tile of thresholds

#define LANE_GROUP 8    // workgroup of independent invocations on devices that emulate workgroups
#define WIDE_GROUP 256  // workgroup of prefix sums and sorting elsewhere

#define SCAN_CHUNKS 4096      // most chunks of a scan
#define SCAN_LANE_WORDS 32768 // most words of a chunk that one invocation scans
#define SCAN_ITEMS 8          // words in a row of an invocation of a workgroup
#define SCAN_GROUP_TURNS 64   // most tiles of WIDE_GROUP * SCAN_ITEMS words in a chunk

#define SORT_LANE_DIGITS 128  // most values of a digit, one invocation a run: 256 want more caches than a pass costs
#define SORT_LANE_FOURS 32768 // most pairs of such a run, in fours
#define SORT_TILE 2048        // pairs that a workgroup ranks

#define UNIFORM_KNOTS 16

#define TILE 8        // pixels along each side of a tile
#define TILE_PIXELS 64
#define FACE_WORDS 5  // corners, cell that the normal points to, cell on the other side
#define CELL_WORDS 4  // corners
#define NO_CELL 4294967295

// Words of the status block.
#define STATUS_OVERFLOW_PIXELS 2 // pixels whose sequence was not sorted
#define STATUS_LOST 3            // entries that had no room
#define STATUS_NAN_KEYS 4        // primitives without a rank
#define STATUS_UNREPAIRED 5      // pixels that repair has not put in order yet
#define STATUS_LONGEST_BIN 6     // primitives of the fullest tile
#define STATUS_OVERLAPS 7        // pixels in which cells overlap
#define STATUS_CUT 8             // pixels whose loop the device ended early
#define STATUS_UNFINISHED 9      // invocations that another dispatch is to go on with
#define STATUS_WORDS 10

// Bits of a pixel's flags, when it is drawn.
#define FLAG_UNSORTED 1 // what left the k-buffer was not in order
#define FLAG_REPAIRED 2 // it was not, and is now
#define FLAG_OVERLAPS 4 // cells overlap

#define OUTLINE_VERTICES 6 // of the triangles that a cell's outline is cut into
#define FAN_VERTICES 12    // of the triangles around a cell's thick vertex

#define MOST_LAYERS 1000  // translucent surfaces that a pixel's line may pass; a number of 10 bits
#define EDGE_NONE 1000000000 // in place of bounds: the warp's pixel stands

#define MOST_TURNS 60000 // of a loop, that every device makes
#define LIST_WINDOW 900  // primitives of a tile in one dispatch: a turn for each pixel of the tile at most
#define COUNT_BITS 10    // of a number up to LIST_WINDOW
