#version 460
// The sum of a texel and its right and lower neighbours, around the border.
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D source;
layout(set = 1, binding = 1, rgba32f) uniform writeonly image2D blurred;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(blurred);
    if (any(greaterThanEqual(pixel, size))) return;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) sum += imageLoad(source, (pixel + ivec2(i, j)) % size);
    imageStore(blurred, pixel, sum);
}
