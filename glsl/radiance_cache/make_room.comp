#version 460
#extension GL_GOOGLE_include_directive : require
// Begins to ask for records: empties the table where not all of them might find a place.
layout(local_size_x = 1) in;
#include "radiance_cache/cells.glsl"

layout(set = 1, binding = 0, scalar) buffer Args { WantedArgs at; } args;
layout(push_constant, scalar) uniform Params { uint asks; uint slots; uint forget_groups; } params;

void main() {
    uint used = args.at.used + args.at.count;
    bool full = used + params.asks > params.slots;
    args.at.record = uvec3(0u, 1u, 1u);
    args.at.count = 0u;
    args.at.forget = uvec3(full ? params.forget_groups : 0u, 1u, 1u);
    args.at.used = full ? 0u : used;
}
