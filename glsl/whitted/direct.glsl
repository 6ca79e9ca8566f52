// Light from the lights themselves.
#ifndef WHITTED_DIRECT_GLSL
#define WHITTED_DIRECT_GLSL

#include "lib/glossy.glsl"
#include "lib/light_sampler.glsl"
#include "lib/receiver.glsl"
#include "lib/visibility.glsl"

// Where a light without size meets a receiver.
Receiver facing(Receiver x, Light light) {
    return facing(x, is_directional(light) ? -light.direction : light.position - x.position);
}

// W/m² from a light if nothing is between, and where its light comes from; 0 behind its plane.
vec3 unshadowed(Light light, Receiver x, out vec3 source) {
    vec3 to_light = light.position - x.position;
    if (is_directional(light)) to_light = -light.direction * (4.0 * scene.scene_radius);
    source = x.position + to_light;
    float cosine = dot(x.normal, to_light);
    if (cosine <= 0.0 || dot(x.side_normal, to_light) <= 0.0) return vec3(0.0);
    float distance2 = dot(to_light, to_light);
    vec3 arriving = light.intensity * (cosine * inversesqrt(distance2));
    if (!is_directional(light)) arriving /= distance2;
    if (is_spot(light)) arriving *= spot_falloff(light, -to_light * inversesqrt(distance2));
    return arriving;
}

// W/m² across the direction to a light, if nothing is between.
vec3 perpendicular(Light light, vec3 position, out vec3 source, out vec3 direction) {
    vec3 to_light = light.position - position;
    if (is_directional(light)) to_light = -light.direction * (4.0 * scene.scene_radius);
    source = position + to_light;
    float distance2 = dot(to_light, to_light);
    direction = to_light * inversesqrt(distance2);
    if (distance2 == 0.0) return vec3(0.0);
    vec3 arriving = light.intensity;
    if (!is_directional(light)) arriving /= distance2;
    if (is_spot(light)) arriving *= spot_falloff(light, -direction);
    return arriving;
}

// Whether some lights are not asked one by one.
const bool SAMPLES_LIGHTS = EMISSIVE_TRIANGLES || ENVIRONMENT || LIGHT_TREE;

// Seed of the rays to sampled lights; every pixel and every sample of it has others.
uint area_seed(uvec2 pixel) {
    uvec2 place = pixel + scene.window_origin;
    uvec2 offset = floatBitsToUint(scene.pixel_offset);
    return hash(hash(place.x, place.y, scene.seed), offset.x, offset.y);
}

// Sample `i` of so many as scene.light_samples, to be divided by that: W/m² across the direction it comes from, unless
// something is between.
bool sampled_light(LightSource lights, Receiver x, uint i, uint seed, out LightSample light, out vec3 from) {
    return sample_light(lights, x, false, vec3(sobol(i, hash(seed, 1u)).x, sobol(i, hash(seed, 2u))), light, from);
}

// Whether a surface's lobes are sampled beside the lights that have a size: the power heuristic weighs what both find.
bool samples_lobes(GlossySurface g) { return GLOSSY && scene.lobe_samples > 0u && has_glossy_lobe(g); }

// Radiance of lights that have a size along a ray whose direction lobes gave with density `pdf`, weighted. From over a
// facet emitters above it do not count: those are asked from the facet. `sky_share`: of the environment's.
vec3 light_along(Surface x, vec3 direction, float pdf, vec3 sky_share, inout uint rays) {
    vec3 from = leave(x, direction);
    bool over = lifted(x.lifts.x, x.geometric_normal, direction);
    LightSource lights = lights_beside_lobes();
    vec3 sum = vec3(0.0), sky = vec3(0.0);
    if (ENVIRONMENT) {
        sky = environment_radiance(direction) * sky_share * power_heuristic(pdf, environment_pdf(lights, direction));
    }
    if (!EMISSIVE_TRIANGLES) {
        if (sky == vec3(0.0)) return sky;
        return arriving(sky, from, direction, 4.0 * scene.scene_radius, rays);
    }
    vec3 origin = from, share = vec3(1.0);
    Hit hit;
    while (share != vec3(0.0)) {
        ++rays;
        if (!trace_closest(origin, direction, 0.0, 1.0 / 0.0, hit)) {
            sum += share * sky;
            break;
        }
        Surface s = surface_at(hit);
        bool front = face(s, -direction);
        float covered = coverage(s.material);
        // Unlit surfaces light nothing.
        bool counts = !over || dot(x.geometric_normal, s.position - x.position) <= 0.0;
        if (counts && s.material.emission != vec3(0.0) && (s.material.flags & MATERIAL_UNLIT) == 0u) {
            float by_light = light_pdf(lights, receiver_at(x), false, from, hit, s, front, -direction, distance(from, s.position));
            sum += share * covered * emitted_radiance(s.material, front) * power_heuristic(pdf, by_light);
        }
        share *= passing(s, direction);
        origin = beyond(s, direction);
    }
    return sum;
}

// Radiance that a surface reflects of lights that have a size, by ray `i` of its lobes, of so many as scene.lobe_samples;
// to be divided by that. `diffuse_beside`: others bring what the diffuse part reflects of the environment.
vec3 by_lobe(GlossySurface g, uint i, uint seed, bool diffuse_beside, inout uint rays) {
    BsdfSample b;
    if (!sample_lit(g, vec3(sobol(i, hash(seed, 3u)), sobol(i, hash(seed, 4u)).x), b)) return vec3(0.0);
    vec3 sky_share = vec3(1.0);
    if (ENVIRONMENT && diffuse_beside) {
        vec3 all = scattered(g, b.direction, LOBES_LIT);
        sky_share -= scattered(g, b.direction, LOBE_DIFFUSE) / max(all, vec3(1e-30));
    }
    return b.weight * light_along(g.surface, b.direction, b.pdf, sky_share, rays);
}

#endif
