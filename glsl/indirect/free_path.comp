#version 460
#extension GL_GOOGLE_include_directive : require
// How far it is from points that are seen to what they see: cosine-distributed rays of each. Below 0 where there is no point,
// or nothing is met.
layout(local_size_x = 64) in;
#include "lib/receiver.glsl"
#include "lib/sampling.glsl"
#include "trace/trace.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Points { Receiver data[]; } points;
layout(set = 1, binding = 1, scalar) writeonly buffer Lengths { float data[]; } lengths;
layout(push_constant, scalar) uniform Params { uint points; uint rays; } params;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.points * params.rays) return;
    Receiver x = points.data[i / params.rays];
    float free = -1.0;
    if (x.normal != vec3(0.0)) {
        vec3 direction = basis_around(x.geometric_normal) * sample_cosine_hemisphere(sobol(i % params.rays, hash(i / params.rays)));
        Hit hit;
        if (trace_closest(target(x), direction, 0.0, 1.0 / 0.0, hit)) free = hit.t;
    }
    lengths.data[i] = free;
}
