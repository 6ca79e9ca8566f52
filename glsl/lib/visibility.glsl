// Shadow rays. All that asks a light or a VPL for light asks here.
#ifndef LIB_VISIBILITY_GLSL
#define LIB_VISIBILITY_GLSL

#include "lib/surface.glsl"
#include "trace/trace.glsl"

// What of the light from `reach` times `along` away arrives at `from`, by channel: all or none, but that surfaces of partial
// coverage take their share alone if `partial`.
vec3 visibility(vec3 from, vec3 along, float reach, const bool partial, inout uint rays) {
    ++rays;
    if (!ALPHA_BLEND || !partial) return vec3(trace_any(from, along, 0.0, reach) ? 0.0 : 1.0);
    float share = 1.0;
    Hit hit;
    while (trace_closest(from, along, 0.0, reach, hit)) {
        Surface s = surface_at(hit);
        share *= 1.0 - coverage(s.material);
        if (share <= 0.0) return vec3(0.0);
        face(s, -along);
        vec3 beyond = offset_origin(s.position, -s.geometric_normal);
        reach -= max(dot(beyond - from, along), 0.0);
        from = beyond;
        ++rays;
    }
    return vec3(share);
}

// The same between two points.
vec3 visibility(vec3 from, vec3 to, inout uint rays) { return visibility(from, to - from, 1.0, false, rays); }

// What is left of light where so much of it is visible: nothing of infinitely much, too, where none is.
vec3 shadowed(vec3 light, vec3 visible) { return visible == vec3(0.0) ? vec3(0.0) : light * visible; }

#endif
