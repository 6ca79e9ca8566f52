#version 460
#extension GL_GOOGLE_include_directive : require
// Adds up what threads of light.comp found for the same point.
layout(local_size_x = 64) in;
#include "whitted/reached.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 1, scalar) readonly buffer Args { uint groups; uint y; uint z; uint points; } args;
layout(set = 1, binding = 2, scalar) readonly buffer Parts { vec3 data[]; } parts;
layout(set = 1, binding = 3, scalar) buffer Points { Reached data[]; } points;
layout(set = 1, binding = 4, scalar) readonly buffer Order { uint at[]; } order;
layout(push_constant, scalar) uniform Params { uint capacity; uint room; uint first; uint last; } params;

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint listed = min(args.points, params.capacity);
    uint last = min(params.last, scene.light_count + scene.light_samples + count.vpls);
    if (gl_WorkGroupID.y > 0u || index >= listed || params.first >= last) return;
    uint shares = (last - params.first + SOURCES - 1u) / SOURCES;
    if (listed > params.room / shares) return;
    vec3 sum = vec3(0.0);
    uint s = 0u;
    // Loads that do not wait for each other.
    for (; s + 4u <= shares; s += 4u) {
        vec3 four[4];
        for (uint i = 0u; i < 4u; ++i) four[i] = parts.data[(s + i) * listed + index];
        for (uint i = 0u; i < 4u; ++i) sum += four[i];
    }
    for (; s < shares; ++s) sum += parts.data[s * listed + index];
    points.data[order.at[index]].irradiance += sum;
}
