#version 460
#extension GL_GOOGLE_include_directive : require
// Every invocation has traced so many rays.
layout(local_size_x = 64) in;
#include "lib/counters.glsl"

layout(push_constant) uniform Params { uint rays; } params;

void main() { count_rays(params.rays); }
