#version 460
#extension GL_GOOGLE_include_directive : require
// One camera ray a pixel: what it hits that is there at all, the albedo that irradiance is multiplied with there, and in
// its last channel whether anything is mirrored or transmitted.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "lib/glossy.glsl"
#include "lib/sheer.glsl"
#include "trace/trace.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform writeonly uimage2D out_hits;
layout(set = 1, binding = 1, rgba32f) uniform writeonly image2D out_albedo;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_hits)))) return;
    Ray ray = camera_ray(uvec2(pixel));
    Hit hit;
    vec3 albedo = vec3(0.0);
    float specular = 0.0;
    uint rays = 1u;
    bool found = trace_closest(ray.origin, ray.direction, 0.0, 1.0 / 0.0, hit);
    Surface surface;
    if (found) surface = surface_at(hit);
    while (ALPHA_BLEND && found && coverage(surface.material) == 0.0) {
        ++rays;
        found = trace_closest(beyond(surface, ray.direction), ray.direction, 0.0, 1.0 / 0.0, hit);
        if (found) surface = surface_at(hit);
    }
    if (found) {
        bool front = face(surface, -ray.direction);
        if (is_mirror(surface.material) || is_glass(surface.material)) specular = 1.0;
        if (smooth_coat(surface.material, front) || coverage(surface.material) < 1.0) specular = 1.0;
        if (GLOSSY) albedo = bsdf_diffuse(surface, front, -ray.direction);
        else albedo = diffuse_share(surface.material, max(0.0, -dot(surface.normal, ray.direction)), front);
        albedo *= coverage(surface.material);
    } else {
        hit.instance = NO_HIT;
    }
    imageStore(out_hits, pixel, pack_hit(hit));
    imageStore(out_albedo, pixel, vec4(albedo, specular));
    count_rays(rays);
}
