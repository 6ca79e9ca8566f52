#version 460
#extension GL_GOOGLE_include_directive : require
// Adds up what threads of light.comp found for the same point.
#include "whitted/reached.glsl"
layout(local_size_x = POINTS) in;

layout(set = 1, binding = 0, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 1, scalar) readonly buffer Args { PointArgs at; } args;
layout(set = 1, binding = 2, scalar) readonly buffer Parts { vec3 data[]; } parts;
layout(set = 1, binding = 3, scalar) buffer Points { Reached data[]; } points;
layout(set = 1, binding = 4, scalar) readonly buffer Order { uint at[]; } order;
layout(push_constant, scalar) uniform Params { uint capacity; uint first; uint last; } params;

void main() {
    uint index = group_at(gl_WorkGroupID.x, gl_WorkGroupID.y) * POINTS + gl_LocalInvocationIndex;
    uint listed = min(args.at.count, params.capacity);
    uint last = min(params.last, source_count(count.vpls));
    if (index >= listed || params.first >= last) return;
    uint shares = (last - params.first + args.at.share - 1u) / args.at.share;
    uint step = args.at.share == 1u ? GROUP : 1u;
    vec3 sum = vec3(0.0);
    for (uint s = 0u; s < shares; s += step) {
        // Loads that do not wait for each other.
        vec3 some[GROUP];
        for (uint i = 0u; i < GROUP; ++i) {
            some[i] = i < step && s + i < shares ? parts.data[(s + i) * listed + index] : vec3(0.0);
        }
        vec3 of_group = vec3(0.0);
        for (uint i = 0u; i < GROUP; ++i) of_group += some[i];
        sum += of_group;
    }
    points.data[order.at[index]].irradiance += sum;
}
