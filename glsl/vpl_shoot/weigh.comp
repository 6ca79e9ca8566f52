#version 460
#extension GL_GOOGLE_include_directive : require
// How much each VPL matters to a picture: the root mean square of its share of the light at points all over it, which is what
// makes the noise least that a choice in proportion to it leaves there. Threads share a VPL's points.
layout(local_size_x = 4, local_size_y = 16) in;
#include "lib/counters.glsl"
#include "vpl_shoot/gives.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Points { Receiver data[]; } points;
layout(set = 1, binding = 3, scalar) readonly buffer Totals { float data[]; } totals;
layout(set = 1, binding = 4, scalar) writeonly buffer Weights { float data[]; } matters;
layout(push_constant, scalar) uniform Params { uint points; float min_distance; } params;

shared float parts[gl_WorkGroupSize.y][gl_WorkGroupSize.x];

// Points with less than this share of their mean light count as if they had it.
const float DARK = 0.05;

void main() {
    uvec3 local = gl_LocalInvocationID;
    uint k = gl_GlobalInvocationID.x, rays = 0u;
    bool there = k < count.vpls;
    float part = 0.0;
    if (there) {
        Vpl vpl = vpls.data[k];
        float mean = 0.0;
        for (uint i = 0u; i < params.points; ++i) mean += totals.data[i];
        float dark = DARK * mean / float(params.points);
        for (uint i = local.y; i < params.points; i += gl_WorkGroupSize.y) {
            float share = gives(vpl, points.data[i], params.min_distance, rays) / (totals.data[i] + dark);
            if (share > 0.0) part += share * share;
        }
    }
    parts[local.y][local.x] = part;
    barrier();
    if (there && local.y == 0u) {
        for (uint p = 1u; p < gl_WorkGroupSize.y; ++p) part += parts[p][local.x];
        matters.data[k] = sqrt(part / float(params.points));
    }
    count_rays(rays);
}
