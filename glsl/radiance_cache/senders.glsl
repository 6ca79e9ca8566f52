// Rays of a point that is seen, and the cells they end in.
#ifndef RADIANCE_CACHE_SENDERS_GLSL
#define RADIANCE_CACHE_SENDERS_GLSL

#include "radiance_cache/ends.glsl"
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

// As it is kept; 0 where there is none.
uvec4 kept_end(End end, vec3 weight, bool lobe, float least_edge) {
    if (!end.found) return uvec4(0u);
    Cell cell = end_cell(end, least_edge);
    uint place = place_in(cell, end.surface.position, edge_of(cell.level, least_edge));
    return asking_end(key_of(cell), weight * end.weight, lobe, place);
}

#endif
