#version 460
// Running mean over pixel samples.
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D value;
layout(set = 1, binding = 1, rgba32f) uniform image2D mean;
layout(push_constant) uniform Params { uint count; } params; // samples before this one

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(value)))) return;
    vec4 v = imageLoad(value, pixel);
    if (params.count > 0u) {
        vec4 before = imageLoad(mean, pixel);
        v = before + (v - before) / float(params.count + 1u);
    }
    imageStore(mean, pixel, v);
}
