// Rays of a point that is seen, and the cells they end in.
#ifndef RADIANCE_CACHE_SENDERS_GLSL
#define RADIANCE_CACHE_SENDERS_GLSL

#include "radiance_cache/cells.glsl"
#include "radiance_cache/rays.glsl"

// Every pixel and every sample of it has another.
uint sender_seed(uvec2 pixel) {
    uvec2 place = pixel + scene.window_origin;
    uvec2 offset = floatBitsToUint(scene.pixel_offset);
    return hash(hash(place.x, place.y, hash(scene.seed, 0x6b6f6c6cu)), offset.x, offset.y);
}

// Ray `i`: where it ends; `weight` of that, a share of all rays of its kind.
End end_of(Sender sender, uint i, uint seed, float min_distance, out vec3 weight, inout uint rays) {
    bool lobe = i >= sender.diffuse_rays;
    vec3 origin, direction;
    float spread;
    End end;
    end.found = false;
    end.radiance = vec3(0.0);
    if (!send(sender, i, seed, origin, direction, weight, spread)) return end;
    weight /= float(lobe ? sender.lobe_rays : sender.diffuse_rays);
    end = follow(origin, direction, lobe, min_distance, hash(seed, i), rays);
    end.spread = spread;
    return end;
}

// Its cell, about as wide as what is seen along it.
Cell end_cell(End end, float least_edge) {
    return cell_at(end.surface.position, end.surface.geometric_normal, end.front, end.spread * end.way, least_edge);
}

#endif
