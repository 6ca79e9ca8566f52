#version 460
// Log luminance of each row, a workgroup a row: sum and number of pixels with any light.
const uint THREADS = 64u;
layout(local_size_x = THREADS) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D radiance;
layout(set = 1, binding = 1, std430) writeonly buffer Rows { vec2 data[]; } rows;

shared vec2 partial[THREADS];

void main() {
    uint row = gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    ivec2 size = imageSize(radiance);
    if (row >= uint(size.y)) return;
    vec2 sum = vec2(0.0);
    for (uint x = thread; x < uint(size.x); x += THREADS) {
        float luminance = dot(imageLoad(radiance, ivec2(x, row)).rgb, vec3(0.2126, 0.7152, 0.0722));
        if (luminance > 0.0 && luminance <= 3.4e38) sum += vec2(log2(luminance), 1.0);
    }
    partial[thread] = sum;
    for (uint half_width = THREADS / 2u; half_width > 0u; half_width /= 2u) {
        barrier();
        if (thread < half_width) partial[thread] += partial[thread + half_width];
    }
    if (thread == 0u) rows.data[row] = partial[0];
}
