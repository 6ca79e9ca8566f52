// Irradiance from the lights themselves.
#ifndef WHITTED_DIRECT_GLSL
#define WHITTED_DIRECT_GLSL

#include "lib/lights.glsl"
#include "lib/receiver.glsl"

// W/m² from a light if nothing is between, and where its light comes from; 0 behind the receiver's plane.
vec3 unshadowed(Light light, Receiver x, out vec3 source) {
    vec3 to_light = light.position - x.position;
    if (is_directional(light)) to_light = -light.direction * (4.0 * scene.scene_radius);
    source = x.position + to_light;
    float cosine = dot(x.normal, to_light);
    if (cosine <= 0.0 || dot(x.geometric_normal, to_light) <= 0.0) return vec3(0.0);
    float distance2 = dot(to_light, to_light);
    vec3 arriving = light.intensity * (cosine * inversesqrt(distance2));
    if (!is_directional(light)) arriving /= distance2;
    if (is_spot(light)) arriving *= spot_falloff(light, -to_light * inversesqrt(distance2));
    return arriving;
}

#endif
