#version 460
#extension GL_GOOGLE_include_directive : require
// Lists the guides that there are, in order, and takes the size of the room that they are in. One workgroup.
#include "lib/scan.glsl"
#include "vpl_shoot/guides.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Found { Guide data[]; } found;
layout(set = 1, binding = 1, scalar) writeonly buffer Guides { uint count; float radius; Guide data[]; } guides;
layout(push_constant) uniform Params { uint found; } params;

shared vec2 reaches[SCAN_THREADS];

void main() {
    uint thread = gl_LocalInvocationIndex, count = 0u;
    vec2 reach = vec2(0.0);
    for (uint first = 0u; first < params.found; first += SCAN_THREADS) {
        uint i = first + thread, total;
        bool there = i < params.found;
        if (there && found.data[i].reach > 0.0) reach += vec2(found.data[i].reach, 1.0);
        there = there && found.data[i].source != NO_SOURCE;
        uint place = count + sum_before(there ? 1u : 0u, total);
        if (there) guides.data[place] = found.data[i];
        count += total;
    }
    reaches[thread] = reach;
    barrier();
    if (thread != 0u) return;
    for (uint t = 1u; t < SCAN_THREADS; ++t) reach += reaches[t];
    float radius = reach.y > 0.0 ? 0.25 * reach.x / reach.y : 0.0;
    guides.count = radius > 0.0 ? count : 0u;
    guides.radius = radius;
}
