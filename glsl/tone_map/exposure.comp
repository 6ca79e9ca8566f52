#version 460
// Stops that bring the log-average luminance to the middle grey of Reinhard et al. 2002.
const uint THREADS = 256u;
layout(local_size_x = THREADS) in;
layout(set = 1, binding = 0, std430) readonly buffer Rows { vec2 data[]; } rows;
layout(set = 1, binding = 1, std430) writeonly buffer Exposure { float ev; } exposure;
layout(push_constant) uniform Params { uint rows; } params;

shared vec2 partial[THREADS];

void main() {
    uint thread = gl_LocalInvocationIndex;
    vec2 sum = vec2(0.0);
    for (uint row = thread; row < params.rows; row += THREADS) sum += rows.data[row];
    partial[thread] = sum;
    for (uint half_width = THREADS / 2u; half_width > 0u; half_width /= 2u) {
        barrier();
        if (thread < half_width) partial[thread] += partial[thread + half_width];
    }
    if (thread == 0u) exposure.ev = partial[0].y > 0.0 ? log2(0.18) - partial[0].x / partial[0].y : 0.0;
}
