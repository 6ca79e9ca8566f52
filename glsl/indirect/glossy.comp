#version 460
#extension GL_GOOGLE_include_directive : require
// Radiance of primary hits by their glossy lobes from a range of all VPLs, added to what ranges before have left there.
// Lobes narrow what a filter could take from neighbours: every pixel has its own. Threads share VPLs as in gather.comp.
layout(local_size_x = 8, local_size_y = 4, local_size_z = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"

layout(constant_id = 0) const bool CONTINUES = false;

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 2, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 3, rgba32f) uniform readonly image2D before;
layout(set = 1, binding = 4, rgba32f) uniform writeonly image2D out_radiance;
layout(push_constant, scalar) uniform Params { uint first; uint last; float min_distance; } params;

#include "indirect/vpls.glsl"

const uint PARTS = gl_WorkGroupSize.z;
shared vec3 parts[PARTS][gl_WorkGroupSize.y][gl_WorkGroupSize.x];

void main() {
    uvec3 local = gl_LocalInvocationID;
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    bool inside = all(lessThan(pixel, imageSize(out_radiance)));
    vec3 radiance = vec3(0.0);
    uint rays = 0u;
    Hit hit;
    if (inside) hit = unpack_hit(imageLoad(hits, pixel));
    if (inside && hit.instance != NO_HIT) {
        Surface surface = surface_at(hit);
        vec3 to_viewer = direction_to_camera(surface.position);
        bool front = face(surface, to_viewer);
        GlossySurface g = glossy_surface(surface, front, to_viewer);
        Walk walk = Walk(params.first + local.z, has_glossy_lobe(g) ? min(params.last, count.vpls) : 0u, PARTS);
        radiance = radiance_from_vpls(walk, g, LOBE_GLOSSY, params.min_distance, rays);
        if (ALPHA_BLEND) radiance *= coverage(surface.material);
    }
    parts[local.z][local.y][local.x] = radiance;
    barrier();
    if (inside && local.z == 0u) {
        radiance = vec3(0.0);
        for (uint i = 0u; i < PARTS; ++i) radiance += parts[i][local.y][local.x];
        if (CONTINUES) radiance = imageLoad(before, pixel).rgb + radiance;
        imageStore(out_radiance, pixel, vec4(radiance, 1.0));
    }
    count_rays(rays);
}
