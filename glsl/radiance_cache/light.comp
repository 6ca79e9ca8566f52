#version 460
#extension GL_GOOGLE_include_directive : require
// The light of a range of rays' ends, by the records of their cells.
layout(local_size_x = 64) in;
#include "lib/counters.glsl"
#include "lib/surface.glsl"
#include "radiance_cache/ends.glsl"
#include "trace/trace.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Table { uvec2 keys[]; } table;
layout(set = 1, binding = 1, scalar) readonly buffer Records { Record data[]; } records;
layout(set = 1, binding = 2, scalar) buffer Ends { uvec4 data[]; } ends;
layout(push_constant, scalar) uniform Params { uint first; uint last; uint slots; float least_edge; } params;

// Of a cell that was asked for.
uint slot_of(uvec2 key) {
    uint slot = first_slot(key, params.slots);
    while (table.keys[slot] != key) slot = (slot + 1u) & (params.slots - 1u);
    return slot;
}

void main() {
    uint i = params.first + gl_GlobalInvocationID.x, rays = 0u;
    if (i >= params.last) return;
    uvec4 end = ends.data[i];
    // Most rays of a picture end nowhere: lavapipe skips this where no lane takes it, and would not after a return.
    if (end.x != 0u) {
        Record r = records.data[slot_of(end.xy)];
        Cell cell = cell_of(end.xy);
        vec3 from, along;
        if (r.first != 0u && way_between(cell, end.w, r.first, edge_of(cell.level, params.least_edge), from, along)) {
            ++rays;
            if (trace_any(from, along, 0.0, 1.0)) r.light = r.behind;
        }
        ends.data[i] = lit_end(end, r.light);
    }
    count_rays(rays);
}
