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

// As record.comp makes it.
vec3 record_here(uvec2 key, float least_edge, uint bounces, inout uint rays) {
    Probed points[POINTS_A_CELL];
    uint seed = record_seed(key), found = 0u;
    bool open = false;
    for (uint i = 0u; i < POINTS_A_CELL; ++i) {
        Probed p = probe_cell(cell_of(key), i, seed, least_edge, rays);
        if (p.found == 0u || open && !p.open) continue;
        if (p.open && !open) found = 0u;
        open = p.open;
        points[found++] = p;
    }
    if (found == 0u) return vec3(-1.0);
    vec3 total = vec3(0.0), near = vec3(0.0);
    for (uint lane = 0u; lane < LANES; ++lane) {
        near += share_of_near(receiver_of(points[lane % found]), lane, seed, least_edge, rays);
        vec3 sum = vec3(0.0);
        for (uint i = lane; i < LIGHT_SAMPLES; i += LANES) sum += share_of_light(receiver_of(points[i % found]), i, seed, rays);
        for (uint i = lane; i < run_length(); i += LANES) {
            sum += share_of_vpl(receiver_of(points[i % found]), i, seed, least_edge, bounces, rays);
        }
        total += sum;
    }
    return with_near(total, near);
}

// W/m² in the cell of an end; below 0 where no surface was found in it.
vec3 light_in_cell(uvec2 key, uint slots, float least_edge, uint bounces, inout uint rays) {
    uint slot = slot_of(key, slots);
    return slot != NO_SLOT ? records.data[slot] : record_here(key, least_edge, bounces, rays);
}

const uint LIGHTS_AT_END = 4u;
const uint VPLS_AT_END = 16u;

// W/m² at the end of ray `i` itself, by few lights and VPLs.
vec3 light_at_end(Sender sender, uint i, uint seed, float m, float min_distance, uint bounces, inout uint rays) {
    vec3 weight, light = vec3(0.0);
    End end = end_of(sender, i, seed, m, weight, rays);
    Receiver x = receiver_at(end.surface);
    for (uint j = 0u; j < LIGHTS_AT_END; ++j) {
        uint k = i * LIGHTS_AT_END + j;
        vec3 u = vec3(sobol(k, hash(seed, SET_CHOICE)).x, sobol(k, hash(seed, SET_LIGHT)));
        light += arriving_light(x, u, rays) / float(LIGHTS_AT_END);
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
