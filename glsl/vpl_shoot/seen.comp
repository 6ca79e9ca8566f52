#version 460
#extension GL_GOOGLE_include_directive : require
// Whether any VPL of a path lights any of some points.
layout(local_size_x = 64) in;
#include "lib/receiver.glsl"
#include "lib/visibility.glsl"
#include "trace/offset.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Slots { Vpl data[]; } slots;
layout(set = 1, binding = 1, scalar) readonly buffer Points { Receiver data[]; } points;
layout(set = 1, binding = 2, scalar) writeonly buffer Seen { uint data[]; } seen;
layout(push_constant, scalar) uniform Params { uint paths; uint bounces; uint points; } params;

bool lights(Vpl vpl, Receiver x) {
    vec3 to_vpl = vpl.position - x.position;
    if (dot(x.normal, to_vpl) <= 0.0 || dot(x.geometric_normal, to_vpl) <= 0.0) return false;
    if (dot(vpl.normal, to_vpl) >= 0.0) return false;
    uint rays = 0u;
    vec3 from = offset_origin(vpl.position, vpl.normal), to = target(x);
    return arriving(vec3(1.0), from, to, rays) != vec3(0.0);
}

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path >= params.paths) return;
    bool found = false;
    for (uint i = 0u; i < params.bounces * params.points && !found; ++i) {
        Vpl vpl = slots.data[path * params.bounces + i / params.points];
        if (vpl.flux == vec3(0.0)) break;
        found = lights(vpl, points.data[i % params.points]);
    }
    seen.data[path] = found ? 1u : 0u;
}
