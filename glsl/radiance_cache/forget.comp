#version 460
#extension GL_GOOGLE_include_directive : require
// Empties the table.
layout(local_size_x = 64) in;
#include "radiance_cache/cells.glsl"

layout(set = 1, binding = 0, scalar) writeonly buffer Table { uvec2 keys[]; } table;
layout(set = 1, binding = 1, scalar) readonly buffer Args { WantedArgs at; } args;
layout(push_constant, scalar) uniform Params { uint slots; } params;

void main() {
    if (gl_GlobalInvocationID.x < params.slots) table.keys[gl_GlobalInvocationID.x] = uvec2(0u);
}
