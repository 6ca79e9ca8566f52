// Irradiance that bounding the geometry term takes (Kollig & Keller 2004, "Illumination in the Presence of Weak
// Singularities"): ∫ (1 − f(d)) L cosθ dω over what is nearer than 1.2 m, by a path from the receiver. Each vertex is lit
// by one light, chosen in proportion to power, by one VPL, bounded as others are, and, for what that takes, by the next
// vertex. Expects `vpls` and `count`.
#ifndef INDIRECT_COMPENSATE_GLSL
#define INDIRECT_COMPENSATE_GLSL

#include "indirect/vpls.glsl"
#include "lib/fresnel.glsl"
#include "lib/lights.glsl"

// Sample sets of a path: a vertex takes three.
const uint SET_DIRECTION = 0u;
const uint SET_LIGHT = 1u;
const uint SET_CHOICE = 2u;
const uint SETS_A_VERTEX = 3u;

// Every pixel and every sample of it has another.
uint compensation_seed(ivec2 pixel) {
    uvec2 place = uvec2(pixel) + scene.window_origin;
    uvec2 offset = floatBitsToUint(scene.pixel_offset);
    return hash(hash(place.x, place.y, hash(scene.seed, 0x6b6f6c6cu)), offset.x, offset.y);
}

// W/m² that arrive unshadowed along one sample of the lights, over its probability.
vec3 arriving_light(Receiver x, vec3 u, inout uint rays) {
    vec3 from;
    LightSample light;
    if (!sample_light(x, u, light, from) || dot(x.side_normal, light.direction) <= 0.0) return vec3(0.0);
    float cosine = dot(x.normal, light.direction);
    if (cosine <= 0.0) return vec3(0.0);
    return arriving(cosine * light.radiance_over_pdf, from, light.direction, light.distance, rays);
}

// The same from one VPL of those that `bounces` diffuse hits at most have left.
vec3 arriving_vpl(Receiver x, float u, uint bounces, float min_distance, inout uint rays) {
    if (count.vpls == 0u) return vec3(0.0);
    uint k = min(uint(u * float(count.vpls)), count.vpls - 1u);
    if (vpls.data[k].bounce >= bounces) return vec3(0.0);
    Connection c = connect_vpl(k, x, min_distance);
    if (c.light == vec3(0.0)) return vec3(0.0);
    return arriving(float(count.vpls) * c.light, c.from, c.to, rays);
}

// The first surface within `reach` (m) that a path does not pass, which it does of sheer ones by chance; false if none.
bool next_surface(vec3 from, vec3 along, float reach, uint seed, out Surface surface, inout vec3 throughput, inout uint rays) {
    Hit hit;
    ++rays;
    if (!SHEER) {
        if (!trace_closest(from, along, 0.0, reach, hit)) return false;
        surface = surface_at(hit);
        return true;
    }
    bool found = false;
    uint passes = 0u;
    while (!found && trace_closest(from, along, 0.0, reach, hit)) {
        surface = surface_at(hit);
        vec3 share = passing(surface, along);
        float p = passing_probability(share);
        found = unit_float(hash(seed, passes++)) >= p;
        throughput *= found ? vec3(coverage(surface.material) / (1.0 - p)) : share / p;
        vec3 there = beyond(surface, along);
        reach -= max(dot(there - from, along), 0.0);
        from = there;
        if (!found) ++rays;
    }
    return found;
}

// W/m² at the receiver by path `i`, of at most `vertices` beyond it.
vec3 lost_light(Receiver x, uint i, uint seed, uint vertices, float min_distance, inout uint rays) {
    vec3 sum = vec3(0.0), throughput = vec3(1.0);
    for (uint v = 1u; v <= vertices; ++v) {
        uint set = seed + SETS_A_VERTEX * v;
        // Density cosθ/π: π times the next vertex' radiance ρ/π · E is ρ · E.
        vec3 direction = basis_around(x.normal) * sample_cosine_hemisphere(sobol(i, hash(set + SET_DIRECTION)));
        if (dot(x.geometric_normal, direction) <= 0.0) break;
        vec3 origin = target(x);
        Surface surface;
        if (!next_surface(origin, direction, 1.2 * min_distance, hash(set, i), surface, throughput, rays)) break;
        bool front = face(surface, -direction);
        float d = distance(x.position, surface.position);
        float cos_i = clamp(-dot(surface.normal, direction), 0.0, 1.0);
        throughput *= vpl_albedo(surface.material, cos_i, front) * (1.0 - bounded(d, min_distance));
        if (throughput == vec3(0.0)) break;
        x = receiver_at(surface);
        vec2 choice = sobol(i, hash(set + SET_CHOICE));
        vec3 arriving = arriving_light(x, vec3(choice.x, sobol(i, hash(set + SET_LIGHT))), rays);
        if (v < vertices) arriving += arriving_vpl(x, choice.y, vertices - v, min_distance, rays);
        sum += throughput * arriving;
    }
    return sum;
}

#endif
