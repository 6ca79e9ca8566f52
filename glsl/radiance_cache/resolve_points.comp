#version 460
#extension GL_GOOGLE_include_directive : require
// As resolve.comp, for a range of the points behind mirrors and glass.
#include "whitted/reached.glsl"
layout(local_size_x = POINTS) in;
#include "lib/counters.glsl"
#include "radiance_cache/cells.glsl"
#include "radiance_cache/points.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer ListArgs { PointArgs at; } list;
layout(set = 1, binding = 1, scalar) buffer Points { Reached data[]; } points;
layout(set = 1, binding = 2, scalar) readonly buffer AllSeen { Seen data[]; } seen;
layout(set = 1, binding = 3, scalar) readonly buffer Order { uint at[]; } order;
layout(set = 1, binding = 4, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 5, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 6, scalar) readonly buffer Table { uvec2 keys[]; } table;
layout(set = 1, binding = 7, scalar) readonly buffer Records { Record data[]; } records;
layout(set = 1, binding = 8, scalar) readonly buffer Ends { uvec4 data[]; } ends;
layout(push_constant, scalar) uniform Params {
    uint slots;
    uint rays;
    uint capacity;
    uint first;
    uint last;
    float min_distance;
    float least_edge;
    uint bounces; // of light that is asked for
} params;

#include "radiance_cache/resolve.glsl"

void main() {
    uint index = params.first + group_at(gl_WorkGroupID.x, gl_WorkGroupID.y) * POINTS + gl_LocalInvocationIndex;
    if (index >= min(params.last, min(list.at.count, params.capacity))) return;
    uint point = order.at[index], rays = 0u;
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < params.rays; ++i) {
        uvec4 end = ends.data[(index - params.first) * params.rays + i];
        if (end.x == 0u) continue;
        vec3 light = light_in_cell(end, params.slots, params.least_edge, params.bounces, rays);
        if (light.x < 0.0) {
            Seen known = seen.data[point];
            Sender sender = sender_at(known, params.rays);
            light = light_at_end(sender, i, known.seed, params.min_distance, params.least_edge, params.bounces, rays);
        }
        light *= weight_of(end);
        sum += GLOSSY ? light / PI : light;
    }
    points.data[point].irradiance += sum;
    count_rays(rays);
}
