#version 460
#extension GL_GOOGLE_include_directive : require
// Closes the gaps in order: a scan in one workgroup, so that the same paths give the same list. Notes where each subset
// of the paths starts.
#include "shared/types.glsl"

const uint THREADS = 256u;
layout(local_size_x = THREADS) in;
layout(set = 1, binding = 0, scalar) readonly buffer Slots { Vpl data[]; } slots;
layout(set = 1, binding = 1, scalar) writeonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 2, scalar) writeonly buffer Count { uint vpls; uint starts[]; } count;
layout(push_constant, scalar) uniform Params { uint paths; uint bounces; uint subsets; } params;

shared uint before[THREADS];

uint first_slot(uint subset) {
    return params.bounces * (subset * (params.paths / params.subsets) + min(subset, params.paths % params.subsets));
}

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint slots_end = params.paths * params.bounces;
    uint kept = 0u;
    for (uint start = 0u; start < slots_end; start += THREADS) {
        uint slot = start + thread;
        bool alive = slot < slots_end && slots.data[slot].flux != vec3(0.0);
        before[thread] = alive ? 1u : 0u;
        barrier();
        for (uint step = 1u; step < THREADS; step *= 2u) {
            uint left = thread >= step ? before[thread - step] : 0u;
            barrier();
            before[thread] += left;
            barrier();
        }
        if (alive) vpls.data[kept + before[thread] - 1u] = slots.data[slot];
        for (uint s = 0u; s < params.subsets; ++s) {
            if (first_slot(s) == slot) count.starts[s] = kept + before[thread] - (alive ? 1u : 0u);
        }
        kept += before[THREADS - 1u];
        barrier();
    }
    if (thread == 0u) count.vpls = kept;
    // Subsets without any path, and the end of the last.
    if (thread <= params.subsets && first_slot(thread) == slots_end) count.starts[thread] = kept;
}
