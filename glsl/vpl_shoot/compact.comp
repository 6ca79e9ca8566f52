#version 460
#extension GL_GOOGLE_include_directive : require
// Closes the gaps in order, a block of slots a workgroup, so that the same paths give the same list. Notes where each subset
// of the paths starts.
#include "lib/scan.glsl"
#include "shared/types.glsl"
#include "vpl_shoot/blocks.glsl"

layout(constant_id = 0) const bool BLOCKS = false; // there is more than one

layout(set = 1, binding = 0, scalar) readonly buffer Slots { Vpl data[]; } slots;
layout(set = 1, binding = 1, scalar) readonly buffer Blocks { uint before[]; } blocks;
layout(set = 1, binding = 2, scalar) writeonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 3, scalar) writeonly buffer Count { uint vpls; uint starts[]; } count;
layout(push_constant, scalar) uniform Params { uint paths; uint bounces; uint subsets; } params;

uint first_slot(uint subset) {
    return params.bounces * (subset * (params.paths / params.subsets) + min(subset, params.paths % params.subsets));
}

void main() {
    uint thread = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    uint slots_end = params.paths * params.bounces, end = min((block + 1u) * BLOCK_SLOTS, slots_end);
    uint kept = BLOCKS ? blocks.before[block] : 0u;
    for (uint start = block * BLOCK_SLOTS; start < end; start += SCAN_THREADS) {
        uint slot = start + thread, total;
        bool alive = slot < end && slots.data[slot].flux != vec3(0.0);
        uint place = kept + sum_before(alive ? 1u : 0u, total);
        if (alive) vpls.data[place] = slots.data[slot];
        for (uint s = 0u; s < params.subsets; ++s) {
            if (first_slot(s) == slot) count.starts[s] = place;
        }
        kept += total;
    }
    if (end < slots_end) return;
    if (thread == 0u) count.vpls = kept;
    // Subsets without any path, and the end of the last.
    if (thread <= params.subsets && first_slot(thread) == slots_end) count.starts[thread] = kept;
}
