#version 460
#extension GL_GOOGLE_include_directive : require
// Everything lib/sampling.glsl computes, for a test to compare with its twin.
#include "lib/sampling.glsl"

layout(local_size_x = 64) in;
layout(set = 1, binding = 0, std430) writeonly buffer Out { float data[]; } out_samples;
layout(set = 1, binding = 1, std430) writeonly buffer Bits { uint data[]; } out_bits;
layout(push_constant) uniform Params { uint count; uint dimension; uint seed; float cos_max; } params;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count) return;
    uvec2 digits = halton_digits(params.dimension, i, params.seed);
    uvec2 sobol = sobol_bits(i, params.seed);
    out_bits.data[5u * i] = digits.x;
    out_bits.data[5u * i + 1u] = digits.y;
    out_bits.data[5u * i + 2u] = hash(i, params.seed);
    out_bits.data[5u * i + 3u] = sobol.x;
    out_bits.data[5u * i + 4u] = sobol.y;
    vec2 u = vec2(halton(0u, i, params.seed), halton(1u, i, params.seed));
    vec3 sphere = sample_sphere(u);
    vec3 values[4] = vec3[4](sphere, sample_cone(u, params.cos_max), sample_cosine_hemisphere(u), basis_around(sphere)[0]);
    for (uint k = 0u; k < 12u; ++k) out_samples.data[12u * i + k] = values[k / 3u][k % 3u];
}
