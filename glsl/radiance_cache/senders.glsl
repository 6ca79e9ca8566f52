// Rays of a point that is seen, and the cells they end in.
#ifndef RADIANCE_CACHE_SENDERS_GLSL
#define RADIANCE_CACHE_SENDERS_GLSL

#include "radiance_cache/cells.glsl"
#include "lib/light_sampler.glsl"
#include "radiance_cache/rays.glsl"

// Every pixel and every sample of it has another.
uint sender_seed(uvec2 pixel) {
    uvec2 place = pixel + scene.window_origin;
    uvec2 offset = floatBitsToUint(scene.pixel_offset);
    return hash(hash(place.x, place.y, hash(scene.seed, 0x6b6f6c6cu)), offset.x, offset.y);
}

// Ray `i`: where it ends; `weight` of that, a share of all rays of its kind. `sky`: rays of the diffuse part bring the
// environment's light, too, as much of it as the balance heuristic leaves to them beside samples of lights.
End end_of(Sender sender, uint i, uint seed, float min_distance, bool sky, out vec3 weight, inout uint rays) {
    bool lobe = i >= sender.diffuse_rays;
    vec3 origin, direction;
    float spread;
    End end;
    end.found = false;
    end.radiance = end.sky = vec3(0.0);
    if (!send(sender, i, seed, origin, direction, weight, spread)) return end;
    weight /= float(lobe ? sender.lobe_rays : sender.diffuse_rays);
    end = follow(origin, direction, lobe, sky && !lobe, min_distance, hash(seed, i), rays);
    if (ENVIRONMENT && sky && end.sky != vec3(0.0)) {
        float by_ray = float(sender.diffuse_rays) * dot(sender.surface.normal, direction) / PI;
        end.sky *= by_ray / (by_ray + float(scene.light_samples) * environment_pdf(lights_beside_lobes(), direction));
    }
    end.spread = spread;
    return end;
}

// Its cell, about as wide as what is seen along it.
Cell end_cell(End end, float least_edge) {
    return cell_at(end.surface.position, end.surface.geometric_normal, end.front, end.spread * end.way, least_edge);
}

// An end as it is kept: the key of its cell, its share of the light there, its place in it, and whether a lobe sent it.
const uint BY_LOBE = 1u << 31;

bool by_lobe(uvec4 end) { return (end.w & BY_LOBE) != 0u; }

// Nine bits for each of three with one exponent.
uint pack_weight(vec3 weight) {
    float most = max_component(weight);
    if (!(most > 0.0)) return 0u;
    int exponent = clamp(int(floor(log2(most))) - 8, -24, 7);
    uvec3 digits = uvec3(clamp(weight * exp2(float(-exponent)) + 0.5, vec3(0.0), vec3(511.0)));
    return uint(exponent + 24) << 27 | digits.x << 18 | digits.y << 9 | digits.z;
}

vec3 weight_of(uvec4 end) {
    vec3 digits = vec3(end.z >> 18 & 511u, end.z >> 9 & 511u, end.z & 511u);
    return digits * exp2(float(int(end.z >> 27) - 24));
}

#endif
