#version 460
#extension GL_GOOGLE_include_directive : require
// About how much light each of some points gets, by every few VPLs of a list. Threads share a point's VPLs.
layout(local_size_x = 4, local_size_y = 16) in;
#include "lib/counters.glsl"
#include "lib/receiver.glsl"
#include "shared/types.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Points { Receiver data[]; } points;
layout(set = 1, binding = 3, scalar) writeonly buffer Totals { float data[]; } totals;
layout(push_constant, scalar) uniform Params { uint points; uint step; float min_distance; } params;

#include "indirect/vpls.glsl"

shared float parts[gl_WorkGroupSize.y][gl_WorkGroupSize.x];

void main() {
    uvec3 local = gl_LocalInvocationID;
    uint i = gl_GlobalInvocationID.x, rays = 0u;
    float part = 0.0;
    if (i < params.points) {
        Receiver x = points.data[i];
        for (uint k = local.y * params.step; k < count.vpls; k += gl_WorkGroupSize.y * params.step) {
            part += sum(arriving_vpl(connect_vpl(k, x, params.min_distance), rays));
        }
    }
    parts[local.y][local.x] = part;
    barrier();
    if (i < params.points && local.y == 0u) {
        for (uint p = 1u; p < gl_WorkGroupSize.y; ++p) part += parts[p][local.x];
        totals.data[i] = part * float(params.step);
    }
    count_rays(rays);
}
