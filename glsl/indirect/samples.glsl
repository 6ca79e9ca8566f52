// Gather samples. Expects `hits` and `albedo`.
#ifndef INDIRECT_SAMPLES_GLSL
#define INDIRECT_SAMPLES_GLSL

#include "indirect/grid.glsl"
#include "trace/hit.glsl"

// Whether light is gathered there. Filters carry it to neighbours, which may be brighter; without them black receivers need
// none.
bool takes_light(ivec2 pixel) {
    if (DOWNSAMPLE * INTERLEAVE > 1u) return imageLoad(hits, pixel).x != NO_HIT;
    return imageLoad(albedo, pixel).rgb != vec3(0.0);
}

#endif
