#version 460
#extension GL_GOOGLE_include_directive : require
// beauty = direct + specular + indirect + glossy, all radiance; `indirect` multiplies by the albedo at last.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/sampling.glsl"

layout(constant_id = 0) const bool SPECULAR = true;
layout(constant_id = 1) const bool LOBES = true;

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D direct;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D specular;
layout(set = 1, binding = 2, rgba32f) uniform readonly image2D irradiance;
layout(set = 1, binding = 3, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 4, rgba32f) uniform readonly image2D glossy;
layout(set = 1, binding = 5, rgba32f) uniform writeonly image2D out_radiance;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(direct)))) return;
    vec3 radiance = imageLoad(direct, pixel).rgb + imageLoad(albedo, pixel).rgb * imageLoad(irradiance, pixel).rgb / PI;
    if (SPECULAR) radiance += imageLoad(specular, pixel).rgb;
    if (LOBES) radiance += imageLoad(glossy, pixel).rgb;
    imageStore(out_radiance, pixel, vec4(radiance, 1.0));
}
