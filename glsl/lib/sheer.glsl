// Surfaces that let light straight through, which then has met no vertex: neither shadow rays nor paths end there.
#ifndef LIB_SHEER_GLSL
#define LIB_SHEER_GLSL

#include "lib/bsdf.glsl"
#include "trace/offset.glsl"

// Share of light, by channel, that goes on along a ray of unit length as if nothing had been there.
vec3 passing(Surface s, vec3 along) {
    float covered = coverage(s.material);
    vec3 share = vec3(1.0 - covered);
    if (is_pane(s.material)) share += covered * pane_share(s, along);
    return share;
}

// Where a ray goes on behind a surface.
vec3 beyond(Surface s, vec3 along) {
    return offset_origin(s.position, dot(s.geometric_normal, along) < 0.0 ? -s.geometric_normal : s.geometric_normal);
}

// Probability that a path of random choices passes.
float passing_probability(vec3 share) { return min(max_component(share), 1.0); }

#endif
