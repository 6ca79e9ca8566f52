#version 460
#extension GL_GOOGLE_include_directive : require
// Lights the points of the list from a range of lights and VPLs, at full resolution, as in the paper. Neighbours in the
// list are neighbours in the picture, so their rays to the same source stay together.
layout(local_size_x = 8, local_size_y = 16) in;
#include "lib/counters.glsl"
#include "whitted/reached.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Length { uint points; } list;
layout(set = 1, binding = 3, scalar) buffer Points { Reached data[]; } points;
layout(push_constant, scalar) uniform Params { uint capacity; uint first; uint last; float min_distance; } params;

#include "whitted/sources.glsl"

shared vec3 parts[PARTS][POINTS];

void main() {
    uint part = gl_LocalInvocationID.y, column = gl_LocalInvocationID.x;
    uint index = gl_WorkGroupID.x * POINTS + column;
    bool inside = index < min(list.points, params.capacity);
    uint rays = 0u;
    if (inside) parts[part][column] = irradiance_part(points.data[index].receiver, params.first, params.last, part, rays);
    barrier();
    if (inside && part == 0u) {
        vec3 irradiance = points.data[index].irradiance;
        for (uint i = 0u; i < PARTS; ++i) irradiance += parts[i][column];
        points.data[index].irradiance = irradiance;
    }
    count_rays(COUNT_SPECULAR_LIGHT, rays);
}
