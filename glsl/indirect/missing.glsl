// Pixels for which the filters found no fitting sample, listed for regather.comp. Expects `list` and `args`.
#ifndef INDIRECT_MISSING_GLSL
#define INDIRECT_MISSING_GLSL

const uint REGATHER_PIXELS = 4u; // a workgroup

void list_missing(ivec2 pixel) {
    uint i = atomicAdd(args.count, 1u);
    list.pixels[i] = uint(pixel.x) | uint(pixel.y) << 16;
    atomicMax(args.groups, i / REGATHER_PIXELS + 1u);
}

#endif
