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
layout(set = 1, binding = 5, scalar) writeonly buffer Records { Record data[]; } records;
layout(push_constant, scalar) uniform Params { float least_edge; uint bounces; } params;

#include "radiance_cache/record.glsl"

shared Probed points[RECORDS][POINTS_A_CELL];
shared uint seen[RECORDS];
shared float promises[RECORDS][LANES];
shared Sides sums[RECORDS][LANES];

Probed point_of(uint i) { return points[gl_LocalInvocationID.y][i]; }

float promised(uint lane) { return promises[gl_LocalInvocationID.y][lane]; }

void main() {
    uint lane = gl_LocalInvocationID.x, row = gl_LocalInvocationID.y, rays = 0u;
    uint index = group_at(gl_WorkGroupID.x, gl_WorkGroupID.y) * RECORDS + row;
    bool inside = index < args.at.count;
    uint slot = 0u, seed = 0u;
    Cell cell = Cell(ivec3(0), 0u, 0u);
    if (inside) {
        slot = wanted.slots[index];
        uvec2 key = table.keys[slot];
        seed = record_seed(key);
        cell = cell_of(key);
        if (lane < POINTS_A_CELL) points[row][lane] = probe_cell(cell, lane, seed, params.least_edge, rays);
    }
    if (lane == 0u) seen[row] = 0u;
    barrier();
    Surfaces found = Surfaces(0u, 0u);
    if (inside) found = surfaces_of_cell();
    if (lane < POINTS_A_CELL) atomicOr(seen[row], is_seen(found, lane, cell, params.least_edge, rays));
    barrier();
    Chosen c = chosen_of(found, seen[row]);
    Target t = Target(vec3(0.0), vec3(0.0), 0.0, 0u);
    promises[row][lane] = 0.0;
    if (c.beside != 0u) {
        t = target_of(c, cell, params.least_edge, params.bounces);
        promises[row][lane] = promise_of_lane(lane, seed, t);
    }
    barrier();
    Sides sides = DARK;
    if (c.beside != 0u) sides = share_of_lane(c, t, lane, seed, params.least_edge, params.bounces, rays);
    sums[row][lane] = sides;
    barrier();
    if (inside && lane == 0u) {
        sides = DARK;
        for (uint i = 0u; i < LANES; ++i) sides = sum_of(sides, sums[row][i]);
        records.data[slot] = record_of(c, cell, params.least_edge, sides);
    }
    count_rays(rays);
}
