#version 460
#extension GL_GOOGLE_include_directive : require
// Of each block of slots how many VPLs lie before it. One workgroup; a thread takes a run of blocks.
#include "lib/scan.glsl"
#extension GL_EXT_scalar_block_layout : require

layout(set = 1, binding = 0, scalar) buffer Blocks { uint vpls[]; } blocks;
layout(push_constant) uniform Params { uint blocks; } params;

void main() {
    uint run = (params.blocks + SCAN_THREADS - 1u) / SCAN_THREADS;
    uint first = gl_LocalInvocationIndex * run, end = min(first + run, params.blocks);
    uint sum = 0u, total;
    for (uint block = first; block < end; ++block) sum += blocks.vpls[block];
    uint before = sum_before(sum, total);
    for (uint block = first; block < end; ++block) {
        uint vpls = blocks.vpls[block];
        blocks.vpls[block] = before;
        before += vpls;
    }
}
