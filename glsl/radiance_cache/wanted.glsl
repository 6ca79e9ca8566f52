// Asking for records. Expects `table`, `wanted` and `args`.
#ifndef RADIANCE_CACHE_WANTED_GLSL
#define RADIANCE_CACHE_WANTED_GLSL

#include "radiance_cache/senders.glsl"

// Asks for a record, once. Where the table has no place near, none will be there.
void want(uvec2 key, uint slots) {
    uint slot = first_slot(key, slots);
    bool going = true;
    for (uint probe = 0u; probe < PROBES && going; ++probe) {
        uint before = atomicCompSwap(table.words[2u * slot], 0u, key.x);
        if (before == 0u || before == key.x) {
            before = atomicCompSwap(table.words[2u * slot + 1u], 0u, key.y);
            if (before == 0u) {
                uint index = atomicAdd(args.at.count, 1u);
                wanted.slots[index] = slot;
                uint groups = index / RECORDS + 1u;
                atomicMax(args.at.groups.x, groups_along(groups));
                atomicMax(args.at.groups.y, rows_of(groups));
            }
            going = before != 0u && before != key.y;
        }
        slot = (slot + 1u) & (slots - 1u);
    }
}

// Asks for the record of a ray's end, which is kept; 0 where there is none.
uvec4 keep_end(End end, vec3 weight, bool lobe, float least_edge, uint slots) {
    if (!end.found) return uvec4(0u);
    Cell cell = end_cell(end, least_edge);
    uvec2 key = key_of(cell);
    want(key, slots);
    uint place = place_in(cell, end.surface.position, edge_of(cell.level, least_edge));
    return uvec4(key, pack_weight(weight * end.weight), (lobe ? BY_LOBE : 0u) | place);
}

#endif
