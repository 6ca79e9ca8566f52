#version 460
// Half the size: weights 1 3 3 1 along each axis, which take every pixel equally often. Borders are mirrored.
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D fine;
layout(set = 1, binding = 1, rgba32f) uniform writeonly image2D out_coarse;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_coarse)))) return;
    ivec2 last = imageSize(fine) - 1;
    vec3 sum = vec3(0.0);
    for (int y = -1; y <= 2; ++y) {
        for (int x = -1; x <= 2; ++x) {
            float weight = (x < 0 || x > 1 ? 0.125 : 0.375) * (y < 0 || y > 1 ? 0.125 : 0.375);
            sum += weight * imageLoad(fine, clamp(2 * pixel + ivec2(x, y), ivec2(0), last)).rgb;
        }
    }
    imageStore(out_coarse, pixel, vec4(sum, 1.0));
}
