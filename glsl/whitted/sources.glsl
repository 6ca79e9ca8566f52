// Irradiance from lights and VPLs in one order, the lights first, with a shadow ray each. Expects `vpls` and `count`.
#ifndef WHITTED_SOURCES_GLSL
#define WHITTED_SOURCES_GLSL

#include "indirect/gather.glsl"
#include "indirect/visibility.glsl"
#include "trace/offset.glsl"
#include "trace/trace.glsl"
#include "whitted/direct.glsl"

uint source_count() { return scene.light_count + count.vpls; }

vec3 irradiance_from(Receiver x, uint first, uint last, float min_distance, inout uint rays) {
    vec3 here = offset_origin(x.position, x.geometric_normal);
    vec3 sum = vec3(0.0);
    for (uint k = first; k < last; ++k) {
        vec3 arriving, from = here, to;
        if (k < scene.light_count) {
            arriving = unshadowed(LightArray(scene.lights)[k].at, x, to);
        } else {
            Vpl vpl = vpls.data[k - scene.light_count];
            arriving = unshadowed(vpl, x, min_distance);
            from = offset_origin(vpl.position, vpl.normal);
            to = here;
        }
        if (arriving == vec3(0.0)) continue;
        ++rays;
        // One copy of trace_any where visibility is exact.
        bool imperfect = VISIBILITY != VISIBILITY_EXACT && k >= scene.light_count;
        if (!(imperfect ? occluded(from, to) : trace_any(from, to - from, 0.0, 1.0))) sum += arriving;
    }
    return sum;
}

#endif
