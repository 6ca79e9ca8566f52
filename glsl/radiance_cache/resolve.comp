#version 460
#extension GL_GOOGLE_include_directive : require
// Adds up what the rays of primary hits have found.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/sampling.glsl"
#include "radiance_cache/ends.glsl"

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 1, scalar) readonly buffer Ends { uvec4 data[]; } ends;
layout(set = 1, binding = 2, rgba32f) uniform writeonly image2D out_irradiance; // and whether any was asked for
layout(set = 1, binding = 3, rgba32f) uniform image2D radiance;
layout(push_constant, scalar) uniform Params { uint rays; uint first_row; uint end_row; } params;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, params.first_row);
    if (any(greaterThanEqual(pixel, ivec2(imageSize(albedo).x, params.end_row)))) return;
    Brought by_diffuse = Brought(vec3(0.0), 0u, 0u), by_lobes = by_diffuse;
    uint first = (uint(gl_GlobalInvocationID.y) * uint(imageSize(albedo).x) + uint(pixel.x)) * params.rays;
    for (uint i = 0u; i < params.rays; ++i) {
        uvec4 end = ends.data[first + i];
        if (end.w == 0u) continue;
        if ((end.w & BY_LOBE) != 0u) bring(by_lobes, end);
        else bring(by_diffuse, end);
    }
    imageStore(out_irradiance, pixel, vec4(light_of(by_diffuse), imageLoad(albedo, pixel).rgb != vec3(0.0) ? 1.0 : 0.0));
    if (by_lobes.asked > 0u) imageStore(radiance, pixel, vec4(imageLoad(radiance, pixel).rgb + light_of(by_lobes) / PI, 1.0));
}
