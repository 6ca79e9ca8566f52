#version 460
#extension GL_GOOGLE_include_directive : require
// Lights the points of the list from a range of lights and VPLs, at full resolution, as in the paper: the shorter the
// list, the more threads share a point. collect.comp adds up what they find.
// Neighbours in the order are neighbours in space, so their rays to the same source stay together.
#include "whitted/reached.glsl"
layout(local_size_x = POINTS) in;
#include "lib/counters.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Args { PointArgs at; } args;
layout(set = 1, binding = 3, scalar) readonly buffer Points { Reached data[]; } points;
layout(set = 1, binding = 4, scalar) writeonly buffer Parts { vec3 data[]; } parts;
layout(set = 1, binding = 5, scalar) readonly buffer AllSeen { Seen data[]; } seen; // empty where nothing needs it
layout(set = 1, binding = 6, scalar) readonly buffer Order { uint at[]; } order;
layout(push_constant, scalar) uniform Params { uint capacity; uint first; uint last; float min_distance; } params;

#include "whitted/sources.glsl"

void main() {
    uint index = group_at(gl_WorkGroupID.x, gl_WorkGroupID.z) * POINTS + gl_LocalInvocationIndex;
    uint part = gl_WorkGroupID.y;
    uint listed = min(args.at.count, params.capacity);
    uint last = min(params.last, source_count());
    if (index >= listed || params.first >= last) return;
    uint source = params.first + part * args.at.share;
    if (source >= last) return;
    uint rays = 0u;
    uint point = order.at[index];
    Reached reached = points.data[point];
    Receiver x = Receiver(reached.position, reached.normal, reached.geometric_normal, reached.geometric_normal, 0.0);
    Lit lit;
    if (GLOSSY) {
        lit.glossy = glossy_surface(unpack_hit(seen.data[point].hit), seen.data[point].to_viewer);
        if (CURVED) x = receiver_at(lit.glossy.surface);
    } else if (CURVED) {
        Surface surface = surface_at(unpack_hit(seen.data[point].hit));
        face(surface, seen.data[point].to_viewer);
        x = receiver_at(surface);
    }
    if (SAMPLES_LIGHTS) lit.seed = seen.data[point].seed;
    uint end = min(source + args.at.share, last);
    parts.data[part * listed + index] = light_in_groups(x, lit, source, end, params.min_distance, rays);
    count_rays(rays);
}
