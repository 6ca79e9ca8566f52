#ifndef VPL_SHOOT_GIVES_GLSL
#define VPL_SHOOT_GIVES_GLSL

#include "indirect/bounding.glsl"
#include "lib/receiver.glsl"
#include "lib/visibility.glsl"
#include "trace/offset.glsl"

// W/m² of all three primaries that a point gets from a VPL.
float gives(Vpl vpl, Receiver x, float min_distance, inout uint rays) {
    vec3 to_vpl = vpl.position - x.position;
    float cos_x = dot(x.normal, to_vpl), cos_k = -dot(vpl.normal, to_vpl);
    if (cos_x <= 0.0 || cos_k <= 0.0 || dot(x.geometric_normal, to_vpl) <= 0.0) return 0.0;
    float distance2 = dot(to_vpl, to_vpl);
    float share = min_distance > 0.0 ? bounded(sqrt(distance2), min_distance) : 1.0;
    if (share == 0.0) return 0.0;
    vec3 light = vpl.flux * (share * (cos_x / distance2) * (cos_k / distance2) / PI);
    return sum(arriving(light, offset_origin(vpl.position, vpl.normal), target(x), rays));
}

#endif
