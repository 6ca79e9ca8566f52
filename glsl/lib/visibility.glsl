// Shadow rays. All that asks a light or a VPL for light asks here.
#ifndef LIB_VISIBILITY_GLSL
#define LIB_VISIBILITY_GLSL

#include "lib/sheer.glsl"
#include "trace/trace.glsl"

// What of `light`, which comes from `reach` times `along` away, arrives at `from`: panes take their tint, surfaces of
// partial coverage their share, each once, all others everything.
//
// Whether anything is there is asked first, and what it is of one hit: in loops over VPLs to ask every hit would cost 4 %
// on a large GPU, to follow hits by the same code as asks first 12 %.
vec3 arriving(vec3 light, vec3 from, vec3 along, float reach, inout uint rays) {
    ++rays;
    Probe ray = probe(from, along);
    float t = reach;
    uvec2 met;
    if (!meet(ray, 0.0, t, false, met)) return light;
    if (!SHEER || !is_sheer(ray, met)) return vec3(0.0);
    float t_min = 0.0;
    bool going = true;
    // Mesa 22.3's lavapipe loses returns from loops on some lanes.
    while (going) {
        ++rays;
        t = reach;
        going = meet(ray, t_min, t, true, met);
        if (going) {
            vec3 share = is_sheer(ray, met) ? passing(surface_at(hit_of(ray, met, t)), normalize(along)) : vec3(0.0);
            // It may be infinite.
            light = share == vec3(0.0) ? vec3(0.0) : light * share;
            t_min = t;
            going = light != vec3(0.0);
        }
    }
    return light;
}

// The same between two points.
vec3 arriving(vec3 light, vec3 from, vec3 to, inout uint rays) { return arriving(light, from, to - from, 1.0, rays); }

#endif
