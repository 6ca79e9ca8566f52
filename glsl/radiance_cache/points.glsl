// Points behind mirrors and glass that send rays.
#ifndef RADIANCE_CACHE_POINTS_GLSL
#define RADIANCE_CACHE_POINTS_GLSL

#include "radiance_cache/senders.glsl"
#include "whitted/reached.glsl"

Sender sender_at(Seen seen, uint rays) {
    Surface surface = surface_at(unpack_hit(seen.hit));
    bool front = face(surface, seen.to_viewer);
    float cos_o = clamp(dot(surface.normal, seen.to_viewer), 0.0, 1.0);
    return sender_of(surface, front, seen.to_viewer, rays, diffuse_share(surface.material, cos_o, front) != vec3(0.0));
}

// Albedo that the diffuse part's light is still to be multiplied with.
vec3 diffuse_part(Sender s) {
    return GLOSSY ? bsdf_diffuse(s.surface, s.glossy.front, s.glossy.to_viewer) : vec3(1.0);
}

#endif
