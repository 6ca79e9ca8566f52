#version 460
#extension GL_GOOGLE_include_directive : require
// Radiance through mirrors and glass: emission seen there and the light of the pixel's points, last one first.
layout(local_size_x = 8, local_size_y = 8) in;
#include "whitted/reached.glsl"

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D emitted;
layout(set = 1, binding = 1, r32ui) uniform readonly uimage2D last;
layout(set = 1, binding = 2, scalar) readonly buffer Points { Reached data[]; } points;
layout(set = 1, binding = 3, rgba32f) uniform writeonly image2D out_radiance;
layout(push_constant) uniform Params { uint first_row; uint end_row; } params;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, params.first_row);
    if (any(greaterThanEqual(pixel, ivec2(imageSize(emitted).x, params.end_row)))) return;
    vec3 radiance = imageLoad(emitted, pixel).rgb;
    for (uint i = imageLoad(last, pixel).r; i != NO_POINT; i = points.data[i].previous) {
        radiance += points.data[i].reflected * points.data[i].irradiance;
    }
    imageStore(out_radiance, pixel, vec4(radiance, 1.0));
}
