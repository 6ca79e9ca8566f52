#version 460
#extension GL_GOOGLE_include_directive : require
// Which paths have a VPL that lights any of some points.
layout(local_size_x = 64) in;
#include "lib/receiver.glsl"
#include "lib/visibility.glsl"
#include "trace/offset.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Points { Receiver data[]; } points;
layout(set = 1, binding = 3, scalar) buffer Seen { uint data[]; } seen; // starts as 0
layout(push_constant, scalar) uniform Params { uint points; } params;

bool lights(Vpl vpl, Receiver x) {
    vec3 to_vpl = vpl.position - x.position;
    if (dot(x.normal, to_vpl) <= 0.0 || dot(x.geometric_normal, to_vpl) <= 0.0) return false;
    if (dot(vpl.normal, to_vpl) >= 0.0) return false;
    uint rays = 0u;
    vec3 from = offset_origin(vpl.position, vpl.normal), to = target(x);
    return arriving(vec3(1.0), from, to, rays) != vec3(0.0);
}

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= count.vpls) return;
    Vpl vpl = vpls.data[k];
    bool found = false;
    for (uint i = 0u; i < params.points && !found; ++i) found = lights(vpl, points.data[i]);
    // Whichever of a path's writes comes last, it is the same.
    if (found) seen.data[vpl.path] = 1u;
}
