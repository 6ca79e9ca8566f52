#version 460
#extension GL_GOOGLE_include_directive : require
// Morph targets, then skins (glTF 2.0, sections 3.7.2.2 and 3.7.3.3). Twin: scene::motion::shape, in 64 bits from the
// joints on.
layout(local_size_x = 64) in;
#include "deform/deform.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vertices { DeformVertex data[]; } vertices;
layout(set = 1, binding = 1, scalar) readonly buffer Deltas { MorphDelta data[]; } deltas;
layout(set = 1, binding = 2, scalar) readonly buffer Influences { Influence data[]; } influences;
layout(set = 1, binding = 3, scalar) readonly buffer Weights { float at[]; } weights;
layout(set = 1, binding = 4, scalar) readonly buffer Joints { vec3 column[]; } joints; // four a joint
layout(set = 1, binding = 5, scalar) writeonly buffer Positions { vec3 at[]; } positions;
layout(set = 1, binding = 6, scalar) writeonly buffer Normals { vec3 at[]; } normals;
layout(push_constant, scalar) uniform Params { uint count; uint with_normals; } params;

void main() {
    uint v = gl_GlobalInvocationID.x;
    if (v >= params.count) return;
    DeformVertex vertex = vertices.data[v];
    precise vec3 position = vertex.position;
    precise vec3 normal = vertex.normal;
    uint delta = 0u, influence = 0u;
    if (v > 0u) {
        delta = vertices.data[v - 1u].deltas_end;
        influence = vertices.data[v - 1u].influences_end;
    }
    for (; delta < vertex.deltas_end; ++delta) {
        MorphDelta by = deltas.data[delta];
        precise float weight = weights.at[by.weight];
        position = position + weight * by.position;
        normal = normal + weight * by.normal;
    }
    if (influence < vertex.influences_end) {
        mat4x3 m = mat4x3(0.0);
        for (; influence < vertex.influences_end; ++influence) {
            Influence by = influences.data[influence];
            for (uint i = 0u; i < 4u; ++i) m[i] += by.weight * joints.column[4u * by.joint + i];
        }
        position = m * vec4(position, 1.0);
        // The cofactor matrix carries normals whatever the scaling.
        normal = mat3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])) * normal;
    }
    positions.at[vertex.at] = position;
    if (params.with_normals == 0u) return;
    // Its square may be too small for a number.
    float size = max(max(abs(normal.x), abs(normal.y)), abs(normal.z));
    normals.at[vertex.at] = size > 0.0 ? normalize(normal / size) : vec3(0.0);
}
