#version 460
#extension GL_GOOGLE_include_directive : require
// Closes the gaps in order: an exclusive scan in one workgroup, so that the same paths give the same list.
#include "shared/types.glsl"

const uint THREADS = 256u;
layout(local_size_x = THREADS) in;
layout(set = 1, binding = 0, scalar) readonly buffer Slots { Vpl data[]; } slots;
layout(set = 1, binding = 1, scalar) writeonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 2, scalar) writeonly buffer Count { uint vpls; } count;
layout(push_constant, scalar) uniform Params { uint slots; } params;

shared uint before[THREADS];

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint kept = 0u;
    for (uint start = 0u; start < params.slots; start += THREADS) {
        uint slot = start + thread;
        bool alive = slot < params.slots && slots.data[slot].flux != vec3(0.0);
        before[thread] = alive ? 1u : 0u;
        barrier();
        for (uint step = 1u; step < THREADS; step *= 2u) {
            uint left = thread >= step ? before[thread - step] : 0u;
            barrier();
            before[thread] += left;
            barrier();
        }
        if (alive) vpls.data[kept + before[thread] - 1u] = slots.data[slot];
        kept += before[THREADS - 1u];
        barrier();
    }
    if (thread == 0u) count.vpls = kept;
}
