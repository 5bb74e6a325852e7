// Numbers that Rust and GLSL share: build.rs turns each `#define NAME n` into a Rust constant of the same name.
//
// Includes go down this list, as build.rs checks: shear-warp, grid, frame, primitives, shared, interface. mesh and splat stand beside
// grid, on frame; gpu, resident and peak use only shared. The path in an #include starts at glsl/. Every header includes what it uses,
// and no macro of its includer changes what it means.
#ifndef INTERFACE_GLSL
#define INTERFACE_GLSL

// Bindings of descriptor set 0.
#define BINDING_VOLUME 0        // sampler3D or sampler2DArray: the grid's samples
#define BINDING_KNOTS_UNIFORM 1 // uniform block: transfer function of at most UNIFORM_KNOTS knots
#define BINDING_KNOTS 2         // storage block: the same buffer, any number of knots
#define BINDING_ACCUMULATION 3  // image2D, rgba32f: premultiplied colour and opacity
#define BINDING_SOURCE 4        // sampler2D: an image to composite
#define BINDING_RESULT 5        // storage block: results of the start-up probes
#define BINDING_TABLE_HEAD 6    // storage block: head of a pre-integration table, and the bins of a cumulative one
#define BINDING_TABLE 7         // sampler3D: nodes of a full table
#define BINDING_BRICKS 8        // storage block: a code for each brick: whether anything is visible in it, or its greatest scalar
#define BINDING_RANGES 9        // storage block: least and greatest scalar of each brick
#define BINDING_VISIBLE 10      // storage block: ranges of scalars with extinction
#define BINDING_TEXELS 11       // storage block: packed texels of the image that the shader blends into
#define BINDING_THRESHOLDS 12   // storage block: blue-noise thresholds
#define BINDING_MESH_POINTS 22  // storage block: points of a mesh, relative to its centre, in radii of the mesh
#define BINDING_MESH_SCALARS 23 // storage block: a scalar per point or per cell
#define BINDING_PRIMITIVES 24   // storage block: FACE_WORDS per face, or CELL_WORDS per cell
#define BINDING_VIEW_POINTS 25  // storage block: points in the coordinates of the view
#define BINDING_RANK_KEYS 26    // storage block: sort key of each primitive, its visibility order
#define BINDING_ORDER 27        // storage block: primitives by rank
#define BINDING_BOXES 28        // storage block: box of pixels that contains each primitive
#define BINDING_BIN_ENDS 29     // storage block: where the bin of each tile ends
#define BINDING_BINS 30         // storage block: primitives of each tile, by rank
#define BINDING_CURSORS 31      // storage block: positions in the lists, pixel by pixel
#define BINDING_LISTS 32        // storage block: fragments of each pixel, by rank
#define BINDING_STATUS 33       // storage block: STATUS_* words
#define BINDING_KBUFFER_0 34    // uimage2D, rgba32ui: two pairs of the k-buffer each
#define BINDING_KBUFFER_1 35
#define BINDING_KBUFFER_2 36
#define BINDING_KBUFFER_3 37
#define BINDING_FLAGS 38        // storage block: a word per pixel: FLAG_*, and STATE_* while it is drawn
#define BINDING_POLYGONS 39     // storage block: outline of each cell in the image, two corners per vector
#define BINDING_FANS 40         // storage block: thick segment of each cell and the corners around it

#define BINDING_SPLAT_POINTS 41 // storage block: each splat's centre, with its scalar or with its size, colour and extinction
#define BINDING_SPLAT_SHAPES 43 // storage block: its covariance and a root of the inverse
#define BINDING_SPLAT_DOMAIN 44 // storage block: half extents of a lattice, offset of its sheets; scale of the template
#define BINDING_SPLAT_RECORDS 45 // storage block: ellipse or depth range of each splat in the view
#define BINDING_SPLAT_STATE 46  // storage block: where each invocation resumes in the next dispatch
#define BINDING_SPLAT_HARMONICS 42 // storage block: coefficients of harmonics of trained splats, half floats
#define BINDING_SPLAT_SLABS 65  // storage block: for each pixel the depths between its slabs, and what the slabs hold
#define BINDING_SPLAT_TEMPLATE 47 // sampler2D: the footprint that all kernels of a lattice have under parallel rays

#define BINDING_INTERMEDIATE 48 // storage block: texels of the intermediate images on the base planes

#define BINDING_LINE_BOUNDS 49  // storage block: the two depths that bound each pixel's ray
#define BINDING_DEPTH 50        // sampler2D: depths of opaque surfaces, as a projection stores them
#define BINDING_TEXEL_BOUNDS 51 // storage block: the same bounds for each texel of base planes, along the stack
#define BINDING_EDGES 52        // storage block: texel position of each pixel, and the bounds of its ray where it is marched itself
#define BINDING_TRIANGLES 53    // storage block: plane and colour of each triangle of surfaces
#define BINDING_LAYERS 54       // storage block: colours of the translucent surfaces of each pixel
#define BINDING_LAYER_ENDS 55   // storage block: where those of each pixel end
#define BINDING_BACKGROUND 56   // storage block: colour of the opaque surface that each pixel shows
#define BINDING_LAYER_CURSORS 57 // storage block: where those of the next pixel begin
#define BINDING_LAYER_DEPTHS 58 // storage block: their depths
#define BINDING_BIN_OFFSETS 59  // storage block: where the pairs of each rank begin
#define BINDING_BIN_TILES 60    // storage block: tile of each pair
#define BINDING_HITS 61         // storage block: pixels of its tile that each pair covers, or for 128 pairs and each pixel which cover it
#define BINDING_MARKED 62       // storage block: flagged pixels of each tile, a bit each

#define BINDING_PLANES 63       // storage block: plane of each face in the view
#define BINDING_RANKED_BOXES 64 // storage block: boxes by rank

#define BINDING_PIXELS 66       // storage block: list of pixels that are drawn once more, or of tiles
#define BINDING_LIGHT 67        // uniform block: the light of a lit grid
#define BINDING_AROUND 68       // storage block: a bit for each brick: 0 where nothing is visible in it and the bricks around it
#define BINDING_TILE_INTERVALS 69 // storage block: the two depths between which each tile of the image shows anything

#define BINDING_PILOTS 70       // storage block: colours of the ray of each tile's centre at several steps
#define BINDING_ERRORS 71       // storage block: number of tiles by the error of the greatest step
#define BINDING_TILE_STEPS 72   // storage block: step of each tile of the image

#define BINDING_PAGES 77        // storage block: a PAGE_* word for each page
#define BINDING_WANTED 78       // storage block: WANTED_* words: pages that rays have missed
#define BINDING_RAYS 79         // storage block: how far the ray of each pixel has come
#define BINDING_LINE_OWNED 80   // storage block: the two depths between which a part of space owns pieces of each pixel's ray

#define BINDING_COUNTS 73       // storage block: COUNTS_* words
#define BINDING_HIT_DEPTHS 76   // storage block: the depth at which each pixel's ray becomes opaque enough; 0: none

#define BINDING_PANEL 74        // storage block: corners of the triangles of a window's panel
#define BINDING_STREAM 75       // storage block: what micro-benchmarks read

#define BINDING_SCAN_WORDS 13   // storage block: words that are replaced by their prefix sums
#define BINDING_SCAN_SUMS 14    // storage block: 64-bit sums of chunks of them
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
#define SPEC_KNOT_WALK 3    // uint: knots in BINDING_KNOTS_UNIFORM, searched in sequence; 0: binary search in BINDING_KNOTS
#define SPEC_RESUME 4       // bool: continue from the contents of the accumulation image
#define SPEC_PREFILTER 5    // bool: sample a mip level where a voxel is smaller than a pixel
#define SPEC_EMPTY_SPACE 6  // bool: skip bricks in which nothing is visible
#define SPEC_INTEGRATOR 7   // uint: integrator of a segment, one of INTEGRATOR_*
#define SPEC_BETWEEN 8      // bool: interpolate between two slices of the stack
#define SPEC_UNDER 11       // bool: the shader blends front to back
#define SPEC_TABLE_FILTER 12 // bool: the sampler interpolates the full table

#define SPEC_CELLS 13       // bool: primitives are cells, not faces
#define SPEC_CELL_SCALARS 14 // bool: scalars belong to cells
#define SPEC_BACK_TO_FRONT 15 // bool: ranks descend in depth
#define SPEC_FILL 16        // bool: entries are written, not counted
#define SPEC_K 17           // uint: entries of the k-buffer
#define SPEC_LAST_CHUNK 18  // bool: this dispatch is the last and empties the k-buffer
#define SPEC_EYE_INSIDE 20  // bool: the mesh may reach behind the eye
#define SPEC_SHADED 21      // bool: colours belong to the vertices of fans
#define SPEC_SPACE 22       // bool: fans of triangles lie in space, not in the image
#define SPEC_FLAGGED 23     // bool: bins for flagged pixels only
#define SPEC_LISTED 32       // uint: FLAG_* of the pixels that are drawn again, from lists; 0: all
#define SPEC_BY_PLANES 10     // bool: lines meet faces by their planes, where these tell enough; else by their corners

#define SPEC_SPLAT_SHAPE 24   // uint: sizes of splats, one of SHAPE_*
#define SPEC_SPLAT_KERNEL 25  // uint: one of KERNEL_*
#define SPEC_SPLAT_DENSITY 26 // bool: extinctions add up; else scalars are interpolated
#define SPEC_SPLAT_EWA 27     // bool: footprints are ellipses in the image
#define SPEC_SPLAT_ORDER 28   // uint: sort key of splats, one of ORDER_*
#define SPEC_SPLAT_AXIS 29    // uint: axis that sheets are stacked along
#define SPEC_SPLAT_LOWPASS 30 // uint: filter of footprints below a pixel, one of LOWPASS_*
#define SPEC_SPLAT_TABULATED 31 // bool: footprints come from a table
#define SPEC_SPLAT_BY_PIXEL 9 // bool: each pixel blends splats in an order of its own

#define SPEC_WARP 33          // uint: the warp's filter, one of WARP_*
#define SPEC_EVERY 34         // bool: a slab holds several slices of the stack

#define SPEC_BOUNDED 35       // bool: rays are bounded by the depths of BINDING_LINE_BOUNDS
#define SPEC_LAYERED 36       // bool: the volume contains translucent surfaces
#define SPEC_REDRAWN 37       // bool: only the pixels of BINDING_PIXELS are drawn
#define SPEC_REFINES 38       // bool: pixels for which fewer do not suffice are listed in BINDING_PIXELS
#define SPEC_LIT 39           // bool: emitted colours are lit
#define SPEC_PLACED 40        // bool: segments tell where they emit
#define SPEC_GREATEST 41      // bool: bricks hold their greatest scalars
#define SPEC_BY_TILES 42      // bool: BINDING_TILE_INTERVALS bounds what rays show
#define SPEC_BY_STEPS 43      // bool: tiles have steps of their own, BINDING_TILE_STEPS
#define SPEC_BY_TILE_LIST 44  // bool: only the tiles of BINDING_PIXELS are drawn
#define SPEC_SPLAT_RULE 46    // uint: rule that trained splats are drawn by, one of RULE_*
#define SPEC_SLAB_COUNT 47   // uint: slabs of each pixel
#define SPEC_COUNTED 45       // bool: samples and fetches are counted
#define SPEC_HIT_AT 48        // uint: bits of the transmittance whose depth BINDING_HIT_DEPTHS gets; 0: nobody asks

#define SPEC_PAGED 49         // bool: the grid is kept in pages
#define SPEC_OWNED 50        // bool: only the pieces of rays in a part of space are drawn

// Values of SPEC_INTEGRATOR.
#define INTEGRATOR_MIDPOINT 0
#define INTEGRATOR_INTEGRAL 1
#define INTEGRATOR_FULL 2
#define INTEGRATOR_EXACT 3
#define INTEGRATOR_SMOKE 4

// Values of OPTION_TARGET and OPTION_DITHER.
#define TARGET_RGBA8 0
#define TARGET_RGBA16 1
#define TARGET_RGBA16F 2
#define DITHER_BLUE 2

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
#define ORDER_DEPTHS 3
#define ORDER_DISTANCES 4
#define ORDER_PIXELS 5
#define LOWPASS_NONE 0
#define LOWPASS_AUTO 1
#define LOWPASS_FULL 2

// Values of SPEC_SPLAT_RULE.
#define RULE_KHR 0
#define RULE_INRIA 1
#define RULE_ANTIALIASED 2
#define RULE_RAY 3
#define RULE_OVERLAP 4
#define RULE_INTEGRAL 5

// Trained splats: words of one without its further colours; vectors of one as a view sees it, and by rules of rays.
#define TRAINED_WORDS 10
#define TRAINED_RECORD 3
#define TRAINED_RAY_RECORD 5

// Values of SPEC_WARP.
#define WARP_BILINEAR 0
#define WARP_MIP 1
#define WARP_BICUBIC 2

// Words of BINDING_PIXELS: the workgroups of TILE_PIXELS invocations that draw them, in three dimensions; their number; from then on x of
// each, and y in the upper half.
#define PIXELS_COUNT 3
#define PIXELS_FIRST 4

// Words of BINDING_PAGES: flags, and of a page that is held the place of its slot, 8 bits an axis.
#define PAGE_HELD 2147483648   // it is in a slot
#define PAGE_HIDDEN 1073741824 // nothing is visible in it

// Words of BINDING_WANTED: whether a ray has not ended; bits of the greatest transmittance of such rays; the sum of their squared
// transmittances in units of 2^-16, the lower word first; the number of missed pages; the first of them; then a word for each page: whether
// it has been missed.
#define WANTED_UNFINISHED 0
#define WANTED_GREATEST 1
#define WANTED_SQUARES 2
#define WANTED_COUNT 4
#define WANTED_FIRST 5
#define WANTED_MOST 4096

// Words of BINDING_COUNTS: sums, the lower word first.
#define COUNTS_SAMPLES 0
#define COUNTS_FETCHES 2
#define COUNTS_WORDS 4

#define SHEETS 4          // slabs of splats that are accumulated at a time
#define FOOTPRINT_PARTS 8 // intervals of a ray integral without a closed form, two points each

#define BRICK 8            // cells along each side of a brick
#define BRICK_ROW 32       // divides the codes of a row of bricks
#define PAGE 64            // cells along each side of a page
#define PAGE_TEXELS 67     // samples along each side of a page with its apron, of one sample on each side
#define PAGE_BRICKS 8      // bricks along each side of a page
#define THRESHOLD_SIDE 64  // side of the tile of thresholds

#define LANE_GROUP 8    // workgroup of independent invocations on devices that emulate workgroups
#define WIDE_GROUP 256  // workgroup of prefix sums and sorting elsewhere

#define SCAN_CHUNKS 4096      // most chunks of a scan
#define SCAN_LANE_WORDS 32768 // most words of a chunk that one invocation scans
#define SCAN_ITEMS 8          // consecutive words per invocation of a workgroup
#define SCAN_GROUP_TURNS 64   // most tiles of WIDE_GROUP * SCAN_ITEMS words in a chunk

#define SORT_LANE_DIGITS 128  // most values of a digit where one invocation sorts a run: 256 need more cache than a pass saves
#define SORT_LANE_FOURS 32768 // most groups of four pairs in such a run
#define SORT_TILE 2048        // pairs that a workgroup ranks

#define UNIFORM_KNOTS 16

// Steps of the rays of tiles' centres (steps.glsl), each half the one before.
#define PILOT_COARSEST 8 // voxel spacings
#define PILOT_LEVELS 8
#define ERROR_BINS 256 // of the squared errors of tiles

#define TILE 8        // pixels along each side of a tile
#define BIN_PAIRS 16  // pairs of a tile and a primitive that an invocation emits
#define TILE_PIXELS 64
#define HIT_PAIRS 128 // pairs of which a pixel has a bit each in a vector of words
#define FACE_AHEAD 2147483648  // bits of a face's first corner: there is a cell that the normal points to
#define FACE_BEHIND 1073741824 // there is one on the other side
#define CELL_WORDS 4  // corners

// Words of the status block.
#define STATUS_OVERFLOW_PIXELS 2 // pixels whose fragments came out of order
#define STATUS_LOST 3            // entries of bins, and pixels whose list had no room in its buffer
#define STATUS_NAN_KEYS 4        // primitives without a rank
#define STATUS_UNREPAIRED 5      // pixels still out of order after repair
#define STATUS_LONGEST_BIN 6     // primitives of the fullest tile
#define STATUS_OVERLAPS 7        // pixels in which cells overlap
#define STATUS_CUT 8             // pixels whose loop the device ended early
#define STATUS_UNFINISHED 9      // invocations that another dispatch has to resume
#define STATUS_FRAGMENTS 10      // fragments that pixels have walked through, modulo 2^32
#define STATUS_FRAGMENTS_HIGH 11 // the upper word
#define STATUS_WORDS 12

// Flags of a pixel that has been drawn.
#define FLAG_UNSORTED 1 // fragments left the k-buffer out of order
#define FLAG_REPAIRED 2 // the pixel was redrawn with its list sorted
#define FLAG_OVERLAPS 4 // cells overlap

// Further bits of the same word while the pixel is drawn (pixel-state.glsl).
#define STATE_BEGUN 8
#define STATE_INSIDE_SHIFT 4 // signed
#define STATE_INSIDE_BITS 18
#define STATE_PASSED_SHIFT 22

// GridPush.order in raster routes: the bit, and above it (stacks only) the first slab in front of the eye along the stack.
#define RASTER_BACK_TO_FRONT 1
#define RASTER_FIRST_SHIFT 1

// GridPush.order in compute routes, and the lower bits of BasePlanePush.order.
#define MARCH_AXIS 3      // mask: the grid's axis that index space calls z; the other two follow it cyclically
#define MARCH_CONTINUES 4 // another dispatch resumes the march
#define MARCH_WIDE 8      // the rays of a tile lie more than a brick apart
#define MARCH_RESUMES 16  // rays go on from where BINDING_RAYS says
#define MARCH_SAME_PAGES 32 // no page has been loaded since the dispatch before

// Further bits of BasePlanePush.order.
#define PLANE_DOWN 8           // rays go down the stack
#define PLANE_BACK_TO_FRONT 16 // raster: the first instance is the farthest slab
#define PLANE_EVERY_SHIFT 8    // slices per slab, in the bits above

// Bits of BoundsPush.count.
#define BOUNDS_PLANES 15       // mask: number of planes
#define BOUNDS_PERSPECTIVE 16
#define BOUNDS_FAR_AT_ONE 32   // the depth image stores the far end as 1, not as 0
#define BOUNDS_OWNED 64        // a ray in a plane belongs to one side of it

// Bits of WarpPush.flags.
#define WARP_SHARED 1  // other base planes show part of this image
#define WARP_LATER 2   // another base plane has been warped before
#define WARP_YIELDS_U 4 // a pixel on the seam with the planes of axis u belongs to the other plane
#define WARP_YIELDS_V 8 // the same for axis v

#define OUTLINE_VERTICES 6 // of the triangles that a cell's outline is cut into
#define FAN_VERTICES 12    // of the triangles around a cell's thick vertex

#define MOST_LAYERS 1000  // translucent surfaces along a pixel's ray; fits in 10 bits
#define EDGE_NONE 1000000000 // replaces the bounds of a pixel that is not marched itself

#endif
