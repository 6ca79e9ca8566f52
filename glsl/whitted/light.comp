#version 460
#extension GL_GOOGLE_include_directive : require
// Lights the points of the list from a range of lights and VPLs, at full resolution, as in the paper. Where the list is
// short a thread takes one point and one source, and collect.comp adds them up; else it takes them all.
// Neighbours in the order are neighbours in space, so their rays to the same source stay together.
layout(local_size_x = 64) in;
#include "lib/counters.glsl"
#include "whitted/reached.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Args { uint groups; uint y; uint z; uint points; } args;
layout(set = 1, binding = 3, scalar) buffer Points { Reached data[]; } points;
layout(set = 1, binding = 4, scalar) writeonly buffer Parts { vec3 data[]; } parts;
layout(set = 1, binding = 5, scalar) readonly buffer Order { uint at[]; } order;
layout(push_constant, scalar) uniform Params { uint capacity; uint room; uint first; uint last; float min_distance; } params;

#include "whitted/sources.glsl"

void main() {
    uint index = gl_GlobalInvocationID.x, part = gl_WorkGroupID.y;
    uint listed = min(args.points, params.capacity);
    uint last = min(params.last, source_count());
    if (index >= listed || params.first >= last) return;
    uint sources = last - params.first;
    bool shared_out = listed <= params.room / sources;
    if (part >= (shared_out ? sources : 1u)) return;
    uint rays = 0u;
    uint point = order.at[index];
    Receiver x = points.data[point].receiver;
    if (shared_out) {
        uint source = params.first + part;
        parts.data[part * listed + index] = irradiance_from(x, source, source + 1u, params.min_distance, rays);
    } else {
        points.data[point].irradiance += irradiance_from(x, params.first, last, params.min_distance, rays);
    }
    count_rays(COUNT_SPECULAR_LIGHT, rays);
}
