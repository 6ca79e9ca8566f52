#version 460
#extension GL_GOOGLE_include_directive : require
// Brings triangles in leaf order to where their vertices are.
layout(local_size_x = 64) in;
#include "deform/deform.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Triangles { DeformTriangle data[]; } triangles;
layout(set = 1, binding = 1, scalar) readonly buffer Positions { vec3 at[]; } positions;
layout(set = 1, binding = 2, scalar) writeonly buffer Leaves { vec4 word[]; } leaves;
layout(push_constant, scalar) uniform Params { uint first; uint count; } params;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count) return;
    DeformTriangle triangle = triangles.data[i];
    vec3 a = positions.at[triangle.vertices.x];
    vec3 b = positions.at[triangle.vertices.y];
    vec3 c = positions.at[triangle.vertices.z];
    // What has lost its area has no normal to shade with; a point no ray meets.
    if (cross(b - a, c - a) == vec3(0.0)) b = c = a;
    uint leaf = 3u * (params.first + i);
    leaves.word[leaf] = vec4(a, 0.0);
    leaves.word[leaf + 1u] = vec4(b, uintBitsToFloat(triangle.name >> 3));
    leaves.word[leaf + 2u] = vec4(c, uintBitsToFloat(triangle.name & 7u));
}
