#version 460
#extension GL_GOOGLE_include_directive : require
// Makes the records of the cells that are wanted. The lanes of a record share its surfaces and its rays.
#include "radiance_cache/cells.glsl"
layout(local_size_x = 32, local_size_y = RECORDS) in;
#include "lib/counters.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 1, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 2, scalar) readonly buffer Table { uvec2 keys[]; } table;
layout(set = 1, binding = 3, scalar) readonly buffer Wanted { uint slots[]; } wanted;
layout(set = 1, binding = 4, scalar) readonly buffer Args { WantedArgs at; } args;
layout(set = 1, binding = 5, scalar) writeonly buffer Records { vec3 data[]; } records;
layout(push_constant, scalar) uniform Params { float least_edge; uint bounces; } params;

#include "radiance_cache/record.glsl"

shared Probed points[RECORDS][POINTS_A_CELL];
shared vec3 sums[RECORDS][LANES];
shared vec3 nears[RECORDS][LANES];

void main() {
    uint lane = gl_LocalInvocationID.x, row = gl_LocalInvocationID.y, rays = 0u;
    uint index = group_at(gl_WorkGroupID.x, gl_WorkGroupID.y) * RECORDS + row;
    bool inside = index < args.at.count;
    uint slot = 0u, seed = 0u;
    uvec2 key = uvec2(0u);
    if (inside) {
        slot = wanted.slots[index];
        key = table.keys[slot];
        seed = record_seed(key);
        if (lane < POINTS_A_CELL) points[row][lane] = probe_cell(cell_of(key), lane, seed, params.least_edge, rays);
    }
    barrier();
    vec3 sum = vec3(0.0), near = vec3(0.0);
    uint found = 0u;
    uint which[POINTS_A_CELL];
    if (inside) {
        bool open = false;
        for (uint i = 0u; i < POINTS_A_CELL; ++i) open = open || points[row][i].open;
        for (uint i = 0u; i < POINTS_A_CELL; ++i) {
            if (points[row][i].found > 0u && points[row][i].open == open) which[found++] = i;
        }
    }
    if (found > 0u) {
        near = share_of_near(receiver_of(points[row][which[lane % found]]), lane, seed, params.least_edge, rays);
        for (uint i = lane; i < LIGHT_SAMPLES; i += LANES) {
            Receiver x = receiver_of(points[row][which[i % found]]);
            sum += share_of_light(x, i, seed, rays);
        }
        for (uint i = lane; i < run_length(); i += LANES) {
            Receiver x = receiver_of(points[row][which[i % found]]);
            sum += share_of_vpl(x, i, seed, params.least_edge, params.bounces, rays);
        }
    }
    sums[row][lane] = sum;
    nears[row][lane] = near;
    barrier();
    if (inside && lane == 0u) {
        sum = near = vec3(0.0);
        for (uint i = 0u; i < LANES; ++i) {
            sum += sums[row][i];
            near += nears[row][i];
        }
        // Below 0: no surface was found.
        records.data[slot] = found > 0u ? with_near(sum, near) : vec3(-1.0);
    }
    count_rays(rays);
}
