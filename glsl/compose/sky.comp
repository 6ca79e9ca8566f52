#version 460
#extension GL_GOOGLE_include_directive : require
// Direct light and what rays have found of the environment's.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/sampling.glsl"

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D direct;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D irradiance;
layout(set = 1, binding = 2, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 3, rgba32f) uniform writeonly image2D out_radiance;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(direct)))) return;
    vec3 sky = imageLoad(albedo, pixel).rgb * imageLoad(irradiance, pixel).rgb / PI;
    imageStore(out_radiance, pixel, vec4(imageLoad(direct, pixel).rgb + sky, 1.0));
}
