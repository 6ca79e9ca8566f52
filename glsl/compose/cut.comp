#version 460
// A part of an image.
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D image;
layout(set = 1, binding = 1, rgba32f) uniform writeonly image2D out_cut;
layout(push_constant) uniform Params { uvec2 origin; } params;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_cut)))) return;
    imageStore(out_cut, pixel, imageLoad(image, pixel + ivec2(params.origin)));
}
