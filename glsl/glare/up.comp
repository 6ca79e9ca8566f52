#version 460
// A level and all coarser ones, weighted. Doubling the size by weights 1 3 3 1 along each axis again and again draws
// quadratic B-splines (Chaikin 1974).
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D level;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D coarse;
layout(set = 1, binding = 2, rgba32f) uniform writeonly image2D out_sum;
layout(push_constant) uniform Params { float share; float coarse_share; } params;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_sum)))) return;
    ivec2 near = pixel / 2;
    ivec2 far = clamp(near + 2 * (pixel & 1) - 1, ivec2(0), imageSize(coarse) - 1);
    vec3 sum = 0.5625 * imageLoad(coarse, near).rgb + 0.0625 * imageLoad(coarse, far).rgb
        + 0.1875 * (imageLoad(coarse, ivec2(near.x, far.y)).rgb + imageLoad(coarse, ivec2(far.x, near.y)).rgb);
    imageStore(out_sum, pixel, vec4(params.share * imageLoad(level, pixel).rgb + params.coarse_share * sum, 1.0));
}
