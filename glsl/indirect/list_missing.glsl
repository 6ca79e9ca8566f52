// Expects `list` and `args`.
#ifndef INDIRECT_LIST_MISSING_GLSL
#define INDIRECT_LIST_MISSING_GLSL

#include "indirect/missing.glsl"

void list_missing(ivec2 pixel) {
    uint i = atomicAdd(args.at.count, 1u);
    list.pixels[i] = pack_pixel(pixel);
    uint groups = i / MISSING_PIXELS + 1u;
    atomicMax(args.at.groups.x, groups_along(groups));
    atomicMax(args.at.groups.y, rows_of(groups));
}

#endif
