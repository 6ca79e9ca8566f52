#version 460
// Numbers that differ from texel to texel, after as many steps as asked: a kernel as slow as a test needs.
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform writeonly image2D noise;
layout(push_constant) uniform Params { uint seed; uint steps; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(noise);
    if (any(greaterThanEqual(pixel, size))) return;
    uint state = seed + uint(pixel.y * size.x + pixel.x) * 747796405u;
    for (uint i = 0u; i < steps; ++i) state = state * 1664525u + 1013904223u;
    uvec4 words = uvec4(state, state >> 8, state >> 16, state >> 24) & 255u;
    imageStore(noise, pixel, vec4(words));
}
