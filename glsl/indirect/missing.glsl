// The list of pixels for which the filters found no fitting sample.
#ifndef INDIRECT_MISSING_GLSL
#define INDIRECT_MISSING_GLSL

#extension GL_EXT_scalar_block_layout : require
#include "lib/groups.glsl"

const uint MISSING_PIXELS = 4u; // of a workgroup

struct MissingArgs {
    uvec3 groups; // along a row, rows, 1
    uint count;
};

// The place in the list of a pixel of this workgroup.
uint missing_index(uint pixel) { return group_at(gl_WorkGroupID.x, gl_WorkGroupID.y) * MISSING_PIXELS + pixel; }

uint pack_pixel(ivec2 pixel) { return uint(pixel.x) | uint(pixel.y) << 16; }
ivec2 unpack_pixel(uint packed) { return ivec2(packed & 0xffffu, packed >> 16); }

#endif
