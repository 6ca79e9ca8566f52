#version 460
#extension GL_GOOGLE_include_directive : require
// What a ray that meets a tree's root is expected to visit, nodes and triangles (the surface-area heuristic): a workgroup
// a tree.
const uint THREADS = 64u;
layout(local_size_x = THREADS) in;
#include "deform/deform.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Trees { uvec2 at[]; } trees; // first node and number of nodes
layout(set = 1, binding = 1, scalar) readonly buffer Boxes { NodeBox data[]; } boxes;
layout(set = 1, binding = 2, scalar) readonly buffer Costs { float at[]; } costs;
layout(set = 1, binding = 3, scalar) writeonly buffer Sums { float at[]; } sums;

shared float partial[THREADS];

void main() {
    uvec2 tree = trees.at[gl_WorkGroupID.x];
    uint thread = gl_LocalInvocationIndex;
    float sum = 0.0;
    for (uint node = thread; node < tree.y; node += THREADS) sum += costs.at[tree.x + node];
    partial[thread] = sum;
    for (uint half_size = THREADS / 2u; half_size > 0u; half_size /= 2u) {
        barrier();
        if (thread < half_size) partial[thread] += partial[thread + half_size];
    }
    if (thread != 0u) return;
    float area = half_area(boxes.data[tree.x]);
    sums.at[gl_WorkGroupID.x] = area > 0.0 ? partial[0] / area : 0.0;
}
