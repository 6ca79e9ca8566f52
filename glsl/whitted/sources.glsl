// Irradiance from every PARTS-th of a range of all lights and VPLs, one shadow ray each. Expects `vpls`, `count` and
// `params.min_distance`.
#ifndef WHITTED_SOURCES_GLSL
#define WHITTED_SOURCES_GLSL

#include "indirect/gather.glsl"
#include "trace/offset.glsl"
#include "trace/trace.glsl"
#include "whitted/direct.glsl"

vec3 irradiance_part(Receiver x, uint first, uint last, uint part, inout uint rays) {
    vec3 here = offset_origin(x.position, x.geometric_normal);
    vec3 sum = vec3(0.0);
    last = min(last, scene.light_count + count.vpls);
    for (uint k = first + part; k < last; k += PARTS) {
        vec3 arriving, from = here, to;
        if (k < scene.light_count) {
            arriving = unshadowed(LightArray(scene.lights)[k].at, x, to);
        } else {
            Vpl vpl = vpls.data[k - scene.light_count];
            arriving = unshadowed(vpl, x, params.min_distance);
            from = offset_origin(vpl.position, vpl.normal);
            to = here;
        }
        if (arriving == vec3(0.0)) continue;
        ++rays;
        if (!trace_any(from, to - from, 0.0, 1.0)) sum += arriving;
    }
    return sum;
}

#endif
