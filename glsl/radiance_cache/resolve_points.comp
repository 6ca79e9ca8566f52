#version 460
#extension GL_GOOGLE_include_directive : require
// As resolve.comp, for a range of the points behind mirrors and glass.
#include "lib/lights.glsl"
#include "whitted/reached.glsl"
layout(local_size_x = POINTS) in;
#include "radiance_cache/ends.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer ListArgs { PointArgs at; } list;
layout(set = 1, binding = 1, scalar) buffer Points { Reached data[]; } points;
layout(set = 1, binding = 2, scalar) readonly buffer Order { uint at[]; } order;
layout(set = 1, binding = 3, scalar) readonly buffer Ends { uvec4 data[]; } ends;
layout(push_constant, scalar) uniform Params { uint rays; uint capacity; uint first; uint last; } params;

void main() {
    uint index = params.first + group_at(gl_WorkGroupID.x, gl_WorkGroupID.y) * POINTS + gl_LocalInvocationIndex;
    if (index >= min(params.last, min(list.at.count, params.capacity))) return;
    Brought by_diffuse = Brought(vec3(0.0), 0u, 0u), by_lobes = by_diffuse;
    for (uint i = 0u; i < params.rays; ++i) {
        uvec4 end = ends.data[(index - params.first) * params.rays + i];
        if (end.w == 0u) continue;
        if ((end.w & BY_LOBE) != 0u) bring(by_lobes, end);
        else bring(by_diffuse, end);
    }
    vec3 light = light_of(by_diffuse) + light_of(by_lobes);
    points.data[order.at[index]].irradiance += GLOSSY ? light / PI : light;
}
