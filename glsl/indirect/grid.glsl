// Where the gather samples lie, and which part of the VPLs each uses. Everything is anchored to the whole picture, so
// that a crop holds the same pixels.
//
// A window of DOWNSAMPLE² pixels, a cell, has one sample: the pixel behind its middle. Interleaved sampling (Keller and
// Heidrich 2001; Wald et al. 2002) splits the light paths into INTERLEAVE² subsets, one for each cell of a tile.
#ifndef INDIRECT_GRID_GLSL
#define INDIRECT_GRID_GLSL

#include "lib/sampling.glsl"
#include "shared/scene.glsl"

layout(constant_id = 1) const uint DOWNSAMPLE = 1u;
layout(constant_id = 2) const uint INTERLEAVE = 1u; // 1, 2 or 3
layout(constant_id = 3) const bool IRREGULAR = false;

uvec2 first_cell() {
    uvec2 origin = scene.window_origin;
    return DOWNSAMPLE > 1u ? origin / DOWNSAMPLE : origin;
}

// The pixel of the window that stands for a cell; cells at the border may lack their middle.
ivec2 sample_pixel(uvec2 cell) {
    if (DOWNSAMPLE == 1u) return ivec2(cell - scene.window_origin);
    uint n = DOWNSAMPLE;
    return ivec2(min(cell * n + n / 2u, scene.full_size - 1u) - scene.window_origin);
}

// Where a pixel of the window lies on the grid of cells: whole numbers at samples.
vec2 grid_position(ivec2 pixel) {
    uint n = DOWNSAMPLE;
    return (vec2(uvec2(pixel) + scene.window_origin) - float(n / 2u)) / float(n);
}

// From the cells of a tile to subsets: affine modulo 2 or 3 (where a unit is its own inverse) and perhaps transposed.
struct Permutation {
    uint a, b, c;
    uvec2 shift;
    bool transpose;
};

Permutation permutation(uvec2 tile) {
    uint m = INTERLEAVE;
    uint h = hash(tile.x, tile.y, 0x51ed270bu);
    Permutation p;
    p.a = 1u + (h & 0xfu) % (m - 1u);
    p.c = 1u + ((h >> 4) & 0xfu) % (m - 1u);
    p.b = ((h >> 8) & 0xffu) % m;
    p.shift = uvec2((h >> 16) & 0x3fu, (h >> 22) & 0x3fu) % m;
    p.transpose = (h >> 28 & 1u) != 0u;
    return p;
}

// The cell of a tile that uses a subset.
uvec2 cell_of(uvec2 tile, uint subset) {
    uint m = INTERLEAVE;
    uvec2 at = uvec2(subset % m, subset / m);
    if (IRREGULAR) {
        Permutation p = permutation(tile);
        at.y = p.c * (at.y + m - p.shift.y) % m;
        at.x = p.a * (at.x + 2u * m * m - p.shift.x - p.b * at.y) % m;
        if (p.transpose) at = at.yx;
    }
    return tile * m + at;
}

#endif
