#version 460
// Stops that bring the log-average luminance to the middle grey of Reinhard et al. 2002.
layout(local_size_x = 1) in;
layout(set = 1, binding = 0, std430) readonly buffer Rows { vec2 data[]; } rows;
layout(set = 1, binding = 1, std430) writeonly buffer Exposure { float ev; } exposure;
layout(push_constant) uniform Params { uint rows; } params;

void main() {
    vec2 sum = vec2(0.0);
    for (uint row = 0u; row < params.rows; ++row) sum += rows.data[row];
    exposure.ev = sum.y > 0.0 ? log2(0.18) - sum.x / sum.y : 0.0;
}
