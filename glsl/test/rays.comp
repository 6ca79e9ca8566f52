#version 460
#extension GL_GOOGLE_include_directive : require
// Every invocation has traced so many rays.
layout(local_size_x = 64) in;
#include "lib/counters.glsl"

layout(set = 1, binding = 0, scalar) writeonly buffer Done { uint data[]; } done;
layout(push_constant) uniform Params { uint rays; } params;

void main() {
    count_rays(params.rays);
    done.data[gl_GlobalInvocationID.x] = 1u;
}
