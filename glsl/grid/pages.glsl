// A grid in pages of PAGE cells a side: the device holds those that rays need, in the slots of a pool. The page table says where.
//
// A page has an apron of one sample, so that interpolation and central differences in its cells need no other page. Beyond the domain the
// nearest sample stands there.
//
// Source: Hadwiger et al., Interactive Volume Exploration of Petascale Microscopy Data Streams, 2012 (page table, requests of rays).
#ifndef PAGES_GLSL
#define PAGES_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/integers.glsl"
#include "shared/interpolated.glsl"
#include "frame/counts.glsl"
#include "grid/lattice.glsl"
#include "grid/ray.glsl"

layout(constant_id = SPEC_PAGED) const bool PAGED = false;

// A PAGE_* word for each page, x fastest.
layout(set = 0, binding = BINDING_PAGES, std430) readonly buffer Pages { uint page_words[]; };

// 1 and the number of the last page that this invocation has missed; 0: none.
uint missed_page = 0u;

// Returns whether a look-up has found no page: what came from it is no sample.
bool has_missed() {
    return PAGED && missed_page != 0u;
}

// Returns the steps from page to page of a domain.
ivec3 page_strides(vec3 half_size, uint axis) {
    return strides_of(max(ivec3(ceil(2.0 * half_size / float(PAGE) - 1e-3)), ivec3(1)), axis);
}

// Returns the place of the slot of a page in the pool.
ivec3 slot_of(uint word) {
    return ivec3(word & 0xffu, word >> 8 & 0xffu, word >> 16 & 0xffu);
}

// The page that this invocation has last found; a texel of the pool is `pool_first` beyond its index.
vec3 last_page = vec3(-1.0), pool_first;

// Returns the number of a page.
int page_number(ivec3 page, ivec3 strides) {
    return page.x * strides.x + page.y * strides.y + page.z * strides.z;
}

// Looks up a page. Returns whether it is held; else notes that it is missed, unless nothing is visible in it.
bool look_up(ivec3 page, ivec3 strides, out bool hidden) {
    int number = page_number(page, strides);
    uint word = page_words[number];
    bool held = (word & PAGE_HELD) != 0u;
    hidden = (word & PAGE_HIDDEN) != 0u;
    if (held) pool_first = vec3(slot_of(word) * PAGE_TEXELS + 1 - page * PAGE);
    else if (!hidden) missed_page = uint(number) + 1u;
    return held;
}

// Finds the page of the cell at an index of the grid. A cell of a page that shows nothing, and is not held, is found in the apron of a page
// beside it. Returns whether its samples are held; around the cell (`around`) only where its own page is. Else a page is missed.
bool find_page(vec3 cell, bool around, ivec3 strides, vec3 last) {
    vec3 place = floor(cell / float(PAGE));
    if (place == last_page) return true;
    last_page = vec3(-1.0);
    vec3 local = cell - place * float(PAGE);
    ivec3 page = whole_of(place), most = ivec3((last - 1.0) / float(PAGE));
    ivec3 beside = ivec3(equal(local, vec3(float(PAGE - 1)))) - ivec3(equal(local, vec3(0.0)));
    for (int axes = 0; axes < 8; ++axes) {
        ivec3 chosen = ivec3(axes & 1, axes >> 1 & 1, axes >> 2), other = page + beside * chosen;
        bool hidden, exists = all(notEqual(chosen * abs(beside) - chosen, ivec3(-1))) && other == clamp(other, ivec3(0), most);
        if (!exists) continue;
        if (look_up(other, strides, hidden)) {
            if (axes == 0) last_page = place;
            else missed_page = 0u;
            return true;
        }
        if (axes == 0 && (around || !hidden)) break;
    }
    if (missed_page == 0u) missed_page = uint(page_number(page, strides)) + 1u;
    return false;
}

// Interpolates between the eight texels from i to j at one level.
float between_texels(sampler3D texels, ivec3 i, ivec3 j, vec3 w, int level) {
    taken_fetches += 8u;
    float v000 = texelFetch(texels, i, level).r;
    float v100 = texelFetch(texels, ivec3(j.x, i.y, i.z), level).r;
    float v010 = texelFetch(texels, ivec3(i.x, j.y, i.z), level).r;
    float v110 = texelFetch(texels, ivec3(j.x, j.y, i.z), level).r;
    float v001 = texelFetch(texels, ivec3(i.x, i.y, j.z), level).r;
    float v101 = texelFetch(texels, ivec3(j.x, i.y, j.z), level).r;
    float v011 = texelFetch(texels, ivec3(i.x, j.y, j.z), level).r;
    float v111 = texelFetch(texels, j, level).r;
    float low = interpolated(interpolated(v000, v100, w.x), interpolated(v010, v110, w.x), w.y);
    float high = interpolated(interpolated(v001, v101, w.x), interpolated(v011, v111, w.x), w.y);
    return interpolated(low, high, w.z);
}

// Returns the stored value at an index of the grid on a page that is held, of which texels of the pool are `first` beyond it. `last` is the
// greatest index; it interpolates along the axes whose component of `along` is 1, and the others are 0.
float on_page(sampler3D pool, vec3 index, vec3 first, vec3 along, vec3 last, Lattice lattice) {
    if (!FILTER_EXACT) {
        ++taken_fetches;
        vec3 coordinate = (index + first + 0.5) * lattice.texel;
        return textureLod(pool, sampled_at(coordinate, vec3(textureSize(pool, 0))), 0.0).r;
    }
    vec3 base = min(floor(index), last - along);
    ivec3 i = whole_of(base + first);
    return between_texels(pool, i, i + ivec3(along), index - base, 0);
}

// The same at an offset, of at most a cell along each axis, from an index on whose page it is found. Returns 0 where that page is missed.
float stored_on_page(sampler3D pool, vec3 index, vec3 offset, vec3 along, vec3 last, Lattice lattice) {
    bool around = offset != vec3(0.0);
    if (!find_page(clamp(floor(index), vec3(0.0), last - 1.0), around, lattice.pages, last)) return 0.0;
    return on_page(pool, clamp(index + offset, vec3(0.0), last), pool_first, along, last, lattice);
}

// Samples of a ray are taken in runs that lie on two pages: between runs they are looked up, in them they are not. That suits invocations that
// run in lockstep, which change pages at different depths, and lets the fetches of several samples begin together.
float run_until = -3e38; // depth up to which they lie on the first page, or in its apron
vec3 run_first;          // a texel of the pool is so far beyond the index of the first page
float page_until;        // depth up to which they lie on the last page that was found

// Returns the cell at depth z of a ray.
vec3 cell_at(Ray ray, float z, Lattice lattice) {
    return clamp(floor(fma(vec3(z), ray.d, ray.q) + lattice.half_size), vec3(0.0), 2.0 * lattice.half_size - 1.0);
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
    bool held = find_page(cell_at(ray, z, lattice), false, lattice.pages, 2.0 * lattice.half_size) && last_page.x >= 0.0;
    run_until = page_until = held ? max(leaves(ray, last_page, lattice), z) : z;
    run_first = pool_first;
    for (uint once = 0u; once < uint(run_until > z && run_until < last); ++once) {
        vec3 page = floor(cell_at(ray, run_until, lattice) / float(PAGE));
        bool hidden;
        if (look_up(whole_of(page), lattice.pages, hidden)) {
            last_page = page;
            page_until = max(leaves(ray, page, lattice), run_until);
        }
        // It is missed only once the ray is there.
        missed_page = 0u;
    }
}

// Returns parameters of reconstruction with those of a pool of pages.
Lattice with_pool(Lattice lattice, sampler3D pool, vec3 half_size) {
    if (!PAGED) return lattice;
    lattice.pages = page_strides(half_size, 2u);
    lattice.texel = 1.0 / vec3(textureSize(pool, 0));
    return lattice;
}

#endif
