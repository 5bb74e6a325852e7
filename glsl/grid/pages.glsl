// A grid in pages of PAGE cells a side: the device holds those that rays need, in the slots of a pool. The page table says where.
//
// A page has an apron of one sample, so that interpolation and central differences in its cells need no other page. Beyond the domain the
// nearest sample stands there.
//
// Techniques of stacks have a pool of slices, in which a page lies turned as the stack that it is drawn from; pages of each axis have numbers
// of their own.
//
// Source: Hadwiger et al., Interactive Volume Exploration of Petascale Microscopy Data Streams, 2012 (page table, requests of rays).
#ifndef PAGES_GLSL
#define PAGES_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/integers.glsl"
#include "grid/lattice.glsl"
#include "grid/ray.glsl"

layout(constant_id = SPEC_PAGED) const bool PAGED = false;

// A PAGE_* word for each page, x fastest; of a stack for each axis.
layout(set = 0, binding = BINDING_PAGES, std430) readonly buffer Pages { uint page_words[]; };

// 1 and the number of the last page that this invocation has missed; 0: none.
uint missed_page = 0u;

// Returns whether a look-up has found no page: what came from it is no sample.
bool has_missed() {
    return PAGED && missed_page != 0u;
}

// Returns the place of the slot of a page in the pool.
ivec3 slot_of(uint word) {
    return ivec3(word & 0xffu, word >> 8 & 0xffu, word >> 16 & 0xffu);
}

// The page that this invocation has last found; a texel of the pool is `pool_first` beyond its index.
vec3 last_page = vec3(-1.0), pool_first;

// Returns the number of a page.
int page_number(ivec3 page, ivec4 pages) {
    return pages.w + page.x * pages.x + page.y * pages.y + page.z * pages.z;
}

// Looks up a page. Returns whether it is held; else notes that it is missed, unless nothing is visible in it.
bool look_up(ivec3 page, ivec4 pages, out bool hidden) {
    int number = page_number(page, pages);
    uint word = page_words[number];
    bool held = (word & PAGE_HELD) != 0u;
    hidden = (word & PAGE_HIDDEN) != 0u;
    if (held) pool_first = vec3(slot_of(word) * PAGE_TEXELS + 1 - page * PAGE);
    else if (!hidden) missed_page = uint(number) + 1u;
    return held;
}

// Returns the cell at an index of the grid.
vec3 cell_of(vec3 index, Lattice lattice) {
    return clamp(floor(index), vec3(0.0), 2.0 * lattice.half_size - 1.0);
}

// Finds the page of the cell at an index of the grid. A cell of a page that shows nothing, and is not held, is found in the apron of a page
// beside it. Returns whether its samples are held; around the cell (`around`) only where its own page is. Else a page is missed.
bool find_page(vec3 index, bool around, Lattice lattice) {
    vec3 cell = cell_of(index, lattice);
    vec3 place = floor(cell / float(PAGE));
    if (place == last_page) return true;
    last_page = vec3(-1.0);
    vec3 local = cell - place * float(PAGE);
    ivec3 page = whole_of(place), most = ivec3((2.0 * lattice.half_size - 1.0) / float(PAGE));
    ivec3 beside = ivec3(equal(local, vec3(float(PAGE - 1)))) - ivec3(equal(local, vec3(0.0)));
    for (int axes = 0; axes < 8; ++axes) {
        ivec3 chosen = ivec3(axes & 1, axes >> 1 & 1, axes >> 2), other = page + beside * chosen;
        bool hidden, exists = all(notEqual(chosen * abs(beside) - chosen, ivec3(-1))) && other == clamp(other, ivec3(0), most);
        if (!exists) continue;
        if (look_up(other, lattice.pages, hidden)) {
            if (axes == 0) last_page = place;
            else missed_page = 0u;
            return true;
        }
        if (axes == 0 && (around || !hidden)) break;
    }
    if (missed_page == 0u) missed_page = uint(page_number(page, lattice.pages)) + 1u;
    return false;
}

// Samples of a ray are taken in runs that lie on two pages: between runs they are looked up, in them they are not. That suits invocations that
// run in lockstep, which change pages at different depths, and lets the fetches of several samples begin together.
float run_until = -3e38; // depth up to which they lie on the first page, or in its apron
vec3 run_first;          // a texel of the pool is so far beyond the index of the first page
float page_until;        // depth up to which they lie on the last page that was found

// Returns the index of the grid at depth z of a ray.
vec3 index_at(Ray ray, float z, Lattice lattice) {
    return fma(vec3(z), ray.d, ray.q) + lattice.half_size;
}

// Returns the depth at which a ray leaves a page; its apron, but for what rounding may take.
float leaves(Ray ray, vec3 page, Lattice lattice) {
    const float IN_APRON = 0.9; // cells
    vec3 face = mix(page * float(PAGE) - IN_APRON, (page + 1.0) * float(PAGE) + IN_APRON, greaterThan(ray.inverse, vec3(0.0)));
    vec3 leave = (face - lattice.half_size - ray.q) * ray.inverse;
    return min(min(leave.x, leave.y), leave.z);
}

// Finds the pages of a run of samples between two depths: that of the first, and the next one, if that is held. The run ends at `page_until`;
// at z where the first is missed, or not held and shows nothing.
void enter_pages(Ray ray, float z, float last, Lattice lattice) {
    bool held = find_page(index_at(ray, z, lattice), false, lattice) && last_page.x >= 0.0;
    run_until = page_until = held ? max(leaves(ray, last_page, lattice), z) : z;
    run_first = pool_first;
    for (uint once = 0u; once < uint(run_until > z && run_until < last); ++once) {
        vec3 page = floor(cell_of(index_at(ray, run_until, lattice), lattice) / float(PAGE));
        bool hidden;
        if (look_up(whole_of(page), lattice.pages, hidden)) {
            last_page = page;
            page_until = max(leaves(ray, page, lattice), run_until);
        }
        // It is missed only once the ray is there.
        missed_page = 0u;
    }
}

// Finds the pages of a run of samples, one for each slab from `slab` to before `stop`: the first lies at depth z, and the others follow by h or
// less each. Returns the slab before which they leave these pages. A run is no longer than a walk, so that invocations which run in lockstep do
// not wait for the longest; and a walk ends with its run, because the next page may show nothing, and then need not be held.
float run_on_pages(float slab, float stop, float walk, float z, float h, Ray ray, Lattice lattice) {
    if (!PAGED || slab >= stop) return stop;
    stop = min(stop, slab + walk);
    enter_pages(ray, z, fma(stop - slab, h, z), lattice);
    return clamp(floor((page_until - z) / h) + slab + 1.0, slab + 1.0, stop);
}

// The same where slabs are counted in integers.
uint run_on_pages(uint slab, uint stop, uint walk, float z, float h, Ray ray, Lattice lattice) {
    if (!PAGED) return stop;
    return uint(run_on_pages(float(slab), float(stop), float(walk), z, h, ray, lattice));
}

// Returns the place in the pool, beyond an index, of the page of a sample of a run at depth z. Beyond the run any will do.
vec3 first_in_run(float z) {
    return z <= run_until ? run_first : pool_first;
}

// Returns parameters of reconstruction with those of a pool of so many texels: of a volume, or of slices, of whose pages there are `copies`
// before those of the axis.
Lattice with_pool(Lattice lattice, ivec3 texels, uint copies) {
    if (!PAGED) return lattice;
    ivec3 count = max(ivec3(ceil(2.0 * lattice.half_size / float(PAGE) - 1e-3)), ivec3(1));
    lattice.pages = ivec4(strides_of(count, lattice.axis), int(copies) * count.x * count.y * count.z);
    lattice.texel = 1.0 / vec3(texels);
    return lattice;
}

#endif
