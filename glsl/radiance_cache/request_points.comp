#version 460
#extension GL_GOOGLE_include_directive : require
// As request.comp, for a range of the points behind mirrors and glass.
#include "whitted/reached.glsl"
layout(local_size_x = POINTS) in;
#include "lib/counters.glsl"
#include "radiance_cache/points.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer ListArgs { PointArgs at; } list;
layout(set = 1, binding = 1, scalar) buffer Points { Reached data[]; } points;
layout(set = 1, binding = 2, scalar) readonly buffer AllSeen { Seen data[]; } seen;
layout(set = 1, binding = 3, scalar) readonly buffer Order { uint at[]; } order;
layout(set = 1, binding = 4, scalar) writeonly buffer Ends { uvec4 data[]; } ends;
layout(push_constant, scalar) uniform Params {
    uint rays;
    uint capacity;
    uint first;
    uint last;
    float min_distance;
    float least_edge;
} params;

// Lamps found by way of mirrors and glass are bright and rare, and these points have no neighbours to share them with: a ray
// brings no more of them than a quarter of what is known to arrive already.
vec3 no_more_than(vec3 light, vec3 known) {
    float most = 0.25 * sum(known), all = sum(light);
    return all > most ? light * (most / all) : light;
}

void main() {
    uint index = params.first + group_at(gl_WorkGroupID.x, gl_WorkGroupID.y) * POINTS + gl_LocalInvocationIndex;
    if (index >= min(params.last, min(list.at.count, params.capacity))) return;
    uint point = order.at[index], rays = 0u;
    Seen known = seen.data[point];
    Sender sender = sender_at(known, params.rays);
    vec3 found = vec3(0.0), known_light = points.data[point].irradiance;
    for (uint i = 0u; i < params.rays; ++i) {
        uvec4 kept = uvec4(0u);
        if (i < sender.diffuse_rays + sender.lobe_rays) {
            bool lobe = i >= sender.diffuse_rays;
            vec3 weight;
            End end = end_of(sender, i, known.seed, params.min_distance, false, weight, rays);
            if (!lobe) weight *= diffuse_part(sender);
            found += no_more_than(weight * end.radiance * (GLOSSY ? 1.0 : PI), known_light);
            kept = kept_end(end, weight, lobe, params.least_edge);
        }
        ends.data[(index - params.first) * params.rays + i] = kept;
    }
    points.data[point].irradiance += found;
    count_rays(rays);
}
