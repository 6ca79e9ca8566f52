#version 460
#extension GL_GOOGLE_include_directive : require
// How much each VPL matters to a picture: the root mean square of its share of the light at points all over it, which is what
// makes the noise least that a choice in proportion to it leaves there. Threads share a VPL's points.
layout(local_size_x = 4, local_size_y = 16) in;
#include "lib/counters.glsl"
#include "lib/receiver.glsl"
#include "shared/types.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Points { Receiver data[]; } points;
layout(set = 1, binding = 3, scalar) readonly buffer Totals { float data[]; } totals;
layout(set = 1, binding = 4, scalar) writeonly buffer Weights { float data[]; } matters;
layout(push_constant, scalar) uniform Params { uint points; float min_distance; } params;

#include "indirect/vpls.glsl"

const uint THREADS = gl_WorkGroupSize.x * gl_WorkGroupSize.y;
shared float parts[gl_WorkGroupSize.y][gl_WorkGroupSize.x];
shared float sums[THREADS];

// Points with less than this share of their mean light count as if they had it.
const float DARK = 0.05;

void main() {
    uvec3 local = gl_LocalInvocationID;
    uint k = gl_GlobalInvocationID.x, rays = 0u;
    bool there = k < count.vpls;
    float part = 0.0;
    for (uint i = gl_LocalInvocationIndex; i < params.points; i += THREADS) part += totals.data[i];
    sums[gl_LocalInvocationIndex] = part;
    barrier();
    part = 0.0;
    if (there) {
        float dark = 0.0;
        for (uint i = 0u; i < THREADS; ++i) dark += sums[i] * (DARK / float(params.points));
        for (uint i = local.y; i < params.points; i += gl_WorkGroupSize.y) {
            Connection c = connect_vpl(k, points.data[i], params.min_distance);
            float share = sum(arriving_vpl(c, rays)) / (totals.data[i] + dark);
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
