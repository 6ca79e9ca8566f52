#version 460
#extension GL_GOOGLE_include_directive : require
// Adds up what rays have found: the light of their cells. A cell that found no place in the table is lit here, in the same
// order; where no surface was found in one, the very point is.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "radiance_cache/cells.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 3, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 4, scalar) readonly buffer Table { uvec2 keys[]; } table;
layout(set = 1, binding = 5, scalar) readonly buffer Records { Record data[]; } records;
layout(set = 1, binding = 6, scalar) readonly buffer Ends { uvec4 data[]; } ends;
layout(set = 1, binding = 7, rgba32f) uniform writeonly image2D out_irradiance; // and whether any was asked for
layout(set = 1, binding = 8, rgba32f) uniform image2D radiance;
layout(push_constant, scalar) uniform Params {
    uint slots;
    uint rays;
    uint first_row;
    uint end_row;
    float min_distance;
    float least_edge;
    uint bounces; // of light that is asked for
} params;

#include "radiance_cache/resolve.glsl"

Sender sender_at(ivec2 pixel) {
    Surface surface = surface_at(unpack_hit(imageLoad(hits, pixel)));
    vec3 to_viewer = direction_to_camera(surface.position);
    bool front = face(surface, to_viewer);
    return sender_of(surface, front, to_viewer, params.rays, imageLoad(albedo, pixel).rgb != vec3(0.0));
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, params.first_row);
    if (any(greaterThanEqual(pixel, ivec2(imageSize(hits).x, params.end_row)))) return;
    vec3 by_diffuse = vec3(0.0), by_lobes = vec3(0.0);
    uint rays = 0u, width = uint(imageSize(hits).x);
    for (uint i = 0u; i < params.rays; ++i) {
        uvec4 end = ends.data[(uint(gl_GlobalInvocationID.y) * width + uint(pixel.x)) * params.rays + i];
        if (end.x == 0u) continue;
        vec3 light = light_in_cell(end, params.slots, params.least_edge, params.bounces, rays);
        if (light.x < 0.0) {
            uint seed = sender_seed(uvec2(pixel));
            light = light_at_end(sender_at(pixel), i, seed, params.min_distance, params.least_edge, params.bounces, rays);
        }
        light *= weight_of(end);
        if (GLOSSY && by_lobe(end)) by_lobes += light / PI;
        else by_diffuse += light;
    }
    imageStore(out_irradiance, pixel, vec4(by_diffuse, imageLoad(albedo, pixel).rgb != vec3(0.0) ? 1.0 : 0.0));
    if (GLOSSY) imageStore(radiance, pixel, vec4(imageLoad(radiance, pixel).rgb + by_lobes, 1.0));
    count_rays(rays);
}
