#version 460
#extension GL_GOOGLE_include_directive : require
// Asks for the records of the cells that a range of rays end in, each once. All of them have a place.
layout(local_size_x = 64) in;
#include "radiance_cache/cells.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Ends { uvec4 data[]; } ends;
layout(set = 1, binding = 1, scalar) buffer Table { uint words[]; } table;
layout(set = 1, binding = 2, scalar) writeonly buffer Wanted { uint slots[]; } wanted;
layout(set = 1, binding = 3, scalar) buffer Args { WantedArgs at; } args;
layout(push_constant, scalar) uniform Params { uint first; uint last; uint slots; } params;

void main() {
    uint i = params.first + gl_GlobalInvocationID.x;
    if (i >= params.last) return;
    uvec2 key = ends.data[i].xy;
    uint slot = first_slot(key, params.slots);
    bool going = key.x != 0u;
    while (going) {
        uint before = atomicCompSwap(table.words[2u * slot], 0u, key.x);
        if (before == 0u || before == key.x) {
            before = atomicCompSwap(table.words[2u * slot + 1u], 0u, key.y);
            if (before == 0u) {
                uint index = atomicAdd(args.at.count, 1u);
                wanted.slots[index] = slot;
                uint groups = index / RECORDS + 1u;
                atomicMax(args.at.record.x, groups_along(groups));
                atomicMax(args.at.record.y, rows_of(groups));
            }
            going = before != 0u && before != key.y;
        }
        slot = (slot + 1u) & (params.slots - 1u);
    }
}
