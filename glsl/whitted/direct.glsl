// Light from the lights themselves.
#ifndef WHITTED_DIRECT_GLSL
#define WHITTED_DIRECT_GLSL

#include "lib/glossy.glsl"
#include "lib/lights.glsl"
#include "lib/receiver.glsl"

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

// Seed of the rays to lights that have a size; every pixel and every sample of it has others.
uint area_seed(uvec2 pixel) {
    uvec2 place = pixel + scene.window_origin;
    uvec2 offset = floatBitsToUint(scene.pixel_offset);
    return hash(hash(place.x, place.y, scene.seed), offset.x, offset.y);
}

// Sample `i` of so many as scene.light_samples, to be divided by that: W/m² across the direction it comes from, unless
// something is between.
bool area_light(Receiver x, uint i, uint seed, out LightSample light, out vec3 from) {
    return sample_area_light(x, vec3(sobol(i, hash(seed, 1u)).x, sobol(i, hash(seed, 2u))), light, from);
}

#endif
