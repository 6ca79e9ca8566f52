#version 460
#extension GL_GOOGLE_include_directive : require
// Follows the rays of primary hits and keeps what they find and the cells that they end in.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "radiance_cache/senders.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, scalar) writeonly buffer Ends { uvec4 data[]; } ends;
layout(set = 1, binding = 3, rgba32f) uniform writeonly image2D out_irradiance; // by way of mirrors and glass, and whether any was asked for
layout(set = 1, binding = 4, rgba32f) uniform writeonly image2D out_radiance;   // the same of lobes
layout(set = 1, binding = 5, rgba32f) uniform writeonly image2D out_sky;        // irradiance by the environment
layout(push_constant, scalar) uniform Params {
    uint rays;
    uint first_row;
    uint end_row;
    float min_distance;
    float least_edge;
} params;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, params.first_row);
    if (any(greaterThanEqual(pixel, ivec2(imageSize(hits).x, params.end_row)))) return;
    Hit hit = unpack_hit(imageLoad(hits, pixel));
    vec3 irradiance = vec3(0.0), radiance = vec3(0.0), sky = vec3(0.0);
    uint rays = 0u, width = uint(imageSize(hits).x);
    Sender sender;
    uint sent = 0u;
    bool diffuse = false;
    if (hit.instance != NO_HIT) {
        Surface surface = surface_at(hit);
        vec3 to_viewer = direction_to_camera(surface.position);
        bool front = face(surface, to_viewer);
        diffuse = imageLoad(albedo, pixel).rgb != vec3(0.0);
        sender = sender_of(surface, front, to_viewer, params.rays, diffuse);
        sent = sender.diffuse_rays + sender.lobe_rays;
    }
    uint seed = sender_seed(uvec2(pixel));
    for (uint i = 0u; i < params.rays; ++i) {
        uvec4 kept = uvec4(0u);
        if (i < sent) {
            bool lobe = i >= sender.diffuse_rays;
            vec3 weight;
            End end = end_of(sender, i, seed, params.min_distance, ENVIRONMENT, weight, rays);
            // Albedo has its share of coverage, lobes have not.
            if (lobe) weight *= coverage(sender.surface.material);
            if (GLOSSY && lobe) radiance += weight * end.radiance;
            else irradiance += weight * PI * end.radiance;
            if (!lobe) sky += weight * PI * end.sky;
            kept = kept_end(end, weight, lobe, params.least_edge);
        }
        ends.data[(uint(gl_GlobalInvocationID.y) * width + uint(pixel.x)) * params.rays + i] = kept;
    }
    if (MIRRORS || GLASS) imageStore(out_irradiance, pixel, vec4(irradiance, diffuse ? 1.0 : 0.0));
    imageStore(out_radiance, pixel, vec4(radiance, 1.0));
    if (ENVIRONMENT) imageStore(out_sky, pixel, vec4(sky, diffuse ? 1.0 : 0.0));
    count_rays(rays);
}
