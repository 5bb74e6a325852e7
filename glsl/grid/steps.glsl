// entry compute ERRORS
// entry compute CHOICE
//
// Chooses the step of each tile of 8 x 8 pixels, so that the image has the RMSE that was asked for and as few samples as possible.
//
// The ray of each tile's centre was drawn with steps of 8, 4, 2, ... voxels (PILOT of raycast.glsl). At half the step the error is a
// quarter, and of another sign as often as not, because the samples meet other places of the features: so the change to the next
// level is the error of a level, and no less than a quarter of the change from the level before. The greatest of the 3 x 3 tiles
// around counts, because one ray may miss what its tile shows.
//
// Least samples for a given sum of squares take nearly the same error in every tile: theta where the step can be that fine, less where
// the greatest step has less. theta follows from the sum over tiles of min(e0^2, theta^2), e0 the error of the greatest step.
//
//   ERRORS   counts the tiles in bins of e0^2
//   CHOICE   finds theta^2, and for each tile the step whose error is theta, between two levels by a power law
//
//   in    pilots: changes of colour for each tile and level
//   out   steps of tiles, in units of the smallest voxel spacing
//   cost  about 90 numbers per tile
//
// Source: error control along rays: Novins and Arvo, 1992.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "grid/pilots.glsl"

layout(push_constant, std430) uniform StepsPush {
    uvec2 tiles;
    float bound; // squared error that is allowed in the mean
    uint pad0;
} push;

layout(set = 0, binding = BINDING_ERRORS, std430) buffer Errors { uint count[]; } errors;
layout(set = 0, binding = BINDING_TILE_STEPS, std430) buffer TileSteps { float tile_steps[]; };

layout(local_size_x = 64) in;

// The last level is drawn for the error of the one before.
const uint LEVELS = PILOT_LEVELS - 1u;

// Each bin of squared errors is a quarter of an octave; the first begins at 2^-60.
const float BINS_PER_OCTAVE = 4.0, FIRST_OCTAVE = -60.0;

// Returns the squared error in the middle of a bin.
float error_of(uint bin) {
    return exp2((float(bin) + 0.5) / BINS_PER_OCTAVE + FIRST_OCTAVE);
}

// Returns the number of a neighbour of a tile; beyond the border, of the nearest tile inside.
uint neighbour(uint tile, uint i) {
    ivec2 place = ivec2(tile % push.tiles.x, tile / push.tiles.x) + ivec2(i % 3u, i / 3u) - 1;
    place = clamp(place, ivec2(0), ivec2(push.tiles) - 1);
    return uint(place.y) * push.tiles.x + uint(place.x);
}

#ifdef ERRORS
void main() {
    uint tile = INVOCATION_NUMBER;
    if (tile >= push.tiles.x * push.tiles.y) return;
    float error = 0.0;
    for (uint i = 0u; i < 9u; ++i) error = max(error, pilots[neighbour(tile, i)].changes[0]);
    float bin = floor(BINS_PER_OCTAVE * (log2(max(error, 1e-37)) - FIRST_OCTAVE));
    if (bin >= 0.0) atomicAdd(errors.count[uint(min(bin, float(ERROR_BINS - 1)))], 1u);
}
#endif

#ifdef CHOICE
const uint BINS_EACH = ERROR_BINS / 64u;

shared uint counts[64]; // of the bins of each invocation
shared float sums[64];  // of their squared errors
shared uint theta_2_bits;

// Returns theta^2, with which the mean over tiles is the bound: the greatest, over bins, of what the bins before leave for each other tile.
float find_theta_2() {
    uint own = gl_LocalInvocationIndex, count = 0u;
    float sum = 0.0;
    for (uint bin = own * BINS_EACH; bin < (own + 1u) * BINS_EACH; ++bin) {
        count += errors.count[bin];
        sum += error_of(bin) * float(errors.count[bin]);
    }
    counts[own] = count;
    sums[own] = sum;
    if (own == 0u) theta_2_bits = floatBitsToUint(push.bound);
    barrier();
    float left = push.bound * float(push.tiles.x * push.tiles.y), greatest = 0.0;
    uint others = 0u;
    for (uint i = 0u; i < 64u; ++i) {
        if (i < own) left -= sums[i];
        else others += counts[i];
    }
    for (uint bin = own * BINS_EACH; bin < (own + 1u) * BINS_EACH && others > 0u; ++bin) {
        greatest = max(greatest, left / float(others));
        left -= error_of(bin) * float(errors.count[bin]);
        others -= errors.count[bin];
    }
    atomicMax(theta_2_bits, floatBitsToUint(greatest));
    barrier();
    return uintBitsToFloat(theta_2_bits);
}

void main() {
    float theta_2 = find_theta_2();
    uint tile = INVOCATION_NUMBER;
    if (tile >= push.tiles.x * push.tiles.y) return;

    float changes[PILOT_LEVELS];
    for (uint level = 0u; level < PILOT_LEVELS; ++level) changes[level] = 0.0;
    for (uint i = 0u; i < 9u; ++i) {
        uint other = neighbour(tile, i), levels = pilots[other].levels;
        float change = 0.0;
        for (uint level = 1u; level < PILOT_LEVELS; ++level) {
            change = level < levels ? pilots[other].changes[level] : change / 16.0;
            changes[level] = max(changes[level], change);
        }
    }

    // From the finest level to the first whose squared error is above theta^2. An error does not grow from a level to the next. Where the
    // finer level has none, it is taken.
    float chosen = float(LEVELS - 1u), finer = 0.0;
    for (uint i = 0u; i < LEVELS; ++i) {
        uint level = LEVELS - 1u - i;
        float error = max(finer, max(changes[level + 1u], changes[level] / 16.0));
        if (error > theta_2) {
            if (finer > 0.0) chosen = float(level) + clamp(log2(error / theta_2) / log2(error / finer), 0.0, 1.0);
            break;
        }
        finer = error;
        chosen = float(level);
    }
    tile_steps[tile] = float(PILOT_COARSEST) * exp2(-chosen);
}
#endif
