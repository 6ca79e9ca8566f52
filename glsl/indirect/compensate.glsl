// Irradiance that bounding the geometry term takes (Kollig & Keller 2004, "Illumination in the Presence of Weak
// Singularities"): ∫ (1 − f(d)) L cosθ dω over what is nearer than 1.2 m, by paths from the receiver. Their vertices are
// those at which light paths leave VPLs, each lit by one light chosen in proportion to power.
#ifndef INDIRECT_COMPENSATE_GLSL
#define INDIRECT_COMPENSATE_GLSL

#include "indirect/gather.glsl"
#include "lib/fresnel.glsl"
#include "lib/lights.glsl"
#include "lib/receiver.glsl"
#include "trace/trace.glsl"

// Sample sets of a path: a vertex takes three.
const uint SET_DIRECTION = 0u;
const uint SET_LIGHT = 1u;
const uint SET_LIGHT_CHOICE = 2u;
const uint SETS_A_VERTEX = 3u;

// Every pixel and every sample of it has another.
uint compensation_seed(ivec2 pixel) {
    uvec2 place = uvec2(pixel) + scene.window_origin;
    uvec2 offset = floatBitsToUint(scene.pixel_offset);
    return hash(hash(place.x, place.y, hash(scene.seed, 0x6b6f6c6cu)), offset.x, offset.y);
}

// W/m² that arrive unshadowed along one sample of the lights, over its probability.
vec3 arriving_light(Receiver x, vec3 u, inout uint rays) {
    vec3 from = offset_origin(x.position, x.geometric_normal);
    LightSample light;
    if (!sample_light(from, u, light) || dot(x.geometric_normal, light.direction) <= 0.0) return vec3(0.0);
    float cosine = dot(x.normal, light.direction);
    if (cosine <= 0.0) return vec3(0.0);
    ++rays;
    return trace_any(from, light.direction, 0.0, light.distance) ? vec3(0.0) : cosine * light.radiance_over_pdf;
}

// W/m² at the receiver by path `i`, of at most `vertices` beyond it.
vec3 lost_light(Receiver x, uint i, uint seed, uint vertices, float min_distance, inout uint rays) {
    Receiver at = x;
    vec3 sum = vec3(0.0), throughput = vec3(1.0);
    float reach = 1.2 * min_distance;
    for (uint v = 0u; v < vertices; ++v) {
        uint set = seed + SETS_A_VERTEX * v;
        // Density cosθ/π: π times the next vertex' radiance ρ/π · E is ρ · E.
        vec3 direction = basis_around(at.normal) * sample_cosine_hemisphere(sobol(i, hash(set + SET_DIRECTION)));
        if (dot(at.geometric_normal, direction) <= 0.0) break;
        Hit hit;
        ++rays;
        if (!trace_closest(offset_origin(at.position, at.geometric_normal), direction, 0.0, reach, hit)) break;
        Surface surface = surface_at(hit);
        face(surface, -direction);
        throughput *= is_glass(surface.material) ? vec3(0.0) : diffuse_albedo(surface.material);
        if (v == 0u) {
            float d = distance(x.position, surface.position);
            throughput *= 1.0 - smooth_step(0.8 * min_distance, 1.2 * min_distance, d);
        }
        if (throughput == vec3(0.0)) break;
        at = receiver_at(surface);
        vec3 u = vec3(sobol(i, hash(set + SET_LIGHT_CHOICE)).x, sobol(i, hash(set + SET_LIGHT)));
        sum += throughput * arriving_light(at, u, rays);
        reach = 1.0 / 0.0;
    }
    return sum;
}

#endif
