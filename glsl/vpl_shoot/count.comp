#version 460
#extension GL_GOOGLE_include_directive : require
// How many VPLs each block of slots holds.
#include "lib/scan.glsl"
#include "shared/types.glsl"
#include "vpl_shoot/blocks.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Slots { Vpl data[]; } slots;
layout(set = 1, binding = 1, scalar) writeonly buffer Blocks { uint vpls[]; } blocks;
layout(push_constant) uniform Params { uint slots; } params;

void main() {
    uint thread = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    uint end = min((block + 1u) * BLOCK_SLOTS, params.slots);
    uint vpls = 0u, total;
    for (uint slot = block * BLOCK_SLOTS + thread; slot < end; slot += SCAN_THREADS) {
        if (slots.data[slot].flux != vec3(0.0)) ++vpls;
    }
    sum_before(vpls, total);
    if (thread == 0u) blocks.vpls[block] = total;
}
