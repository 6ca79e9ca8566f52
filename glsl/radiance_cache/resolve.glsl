// The light of a ray's end. Expects `table`, `records`, `vpls` and `count`.
#ifndef RADIANCE_CACHE_RESOLVE_GLSL
#define RADIANCE_CACHE_RESOLVE_GLSL

#include "radiance_cache/record.glsl"
#include "radiance_cache/senders.glsl"

uint slot_of(uvec2 key, uint slots) {
    uint slot = first_slot(key, slots), found = NO_SLOT;
    for (uint probe = 0u; probe < PROBES && found == NO_SLOT; ++probe) {
        if (table.keys[slot] == key) found = slot;
        slot = (slot + 1u) & (slots - 1u);
    }
    return found;
}

Probed points_here[POINTS_A_CELL];

Probed point_of(uint i) { return points_here[i]; }

// As record.comp makes it.
Record record_here(uvec2 key, float least_edge, uint bounces, inout uint rays) {
    uint seed = record_seed(key);
    Cell cell = cell_of(key);
    for (uint i = 0u; i < POINTS_A_CELL; ++i) points_here[i] = probe_cell(cell, i, seed, least_edge, rays);
    Surfaces found = surfaces_of_cell();
    uint seen = 0u;
    for (uint i = 0u; i < POINTS_A_CELL; ++i) seen |= is_seen(found, i, cell, least_edge, rays);
    Chosen c = chosen_of(found, seen);
    Sides sides = DARK;
    for (uint lane = 0u; lane < LANES && c.beside != 0u; ++lane) {
        sides = sum_of(sides, share_of_lane(c, lane, seed, least_edge, bounces, rays));
    }
    return record_of(c, cell, least_edge, sides);
}

// W/m² at an end by its cell; below 0 where no surface was found in it.
vec3 light_in_cell(uvec4 end, uint slots, float least_edge, uint bounces, inout uint rays) {
    uint slot = slot_of(end.xy, slots);
    Record record;
    if (slot != NO_SLOT) record = records.data[slot];
    else record = record_here(end.xy, least_edge, bounces, rays);
    if (record.first == 0u) return record.light;
    Cell cell = cell_of(end.xy);
    float edge = edge_of(cell.level, least_edge);
    vec3 from, along;
    if (!way_between(cell, end.w, record.first, edge, from, along)) return record.light;
    ++rays;
    return trace_any(from, along, 0.0, 1.0) ? record.behind : record.light;
}

const uint LIGHTS_AT_END = 2u;
const uint VPLS_AT_END = 8u;

// W/m² at the end of ray `i` itself, by few lights and VPLs.
vec3 light_at_end(Sender sender, uint i, uint seed, float m, float min_distance, uint bounces, inout uint rays) {
    vec3 weight, light = vec3(0.0);
    End end = end_of(sender, i, seed, m, false, weight, rays);
    Receiver x = receiver_at(end.surface);
    for (uint j = 0u; j < LIGHTS_AT_END; ++j) {
        uint k = i * LIGHTS_AT_END + j;
        vec3 u = vec3(sobol(k, hash(seed, SET_CHOICE)).x, sobol(k, hash(seed, SET_LIGHT)));
        light += arriving_light(x, u, false, rays) / float(LIGHTS_AT_END);
    }
    uint run = min(VPLS_AT_END, count.vpls), first = uint(unit_float(hash(seed, i, SET_CHOICE)) * float(count.vpls));
    for (uint j = 0u; j < run; ++j) {
        uint k = (first + j) % count.vpls;
        if (vpls.data[k].bounce + 1u >= bounces) continue;
        Connection c = connect_vpl(k, x, min_distance);
        light += arriving_vpl(c, rays) * (float(count.vpls) / float(run));
    }
    return light;
}

#endif
