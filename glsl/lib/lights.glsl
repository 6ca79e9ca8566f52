#ifndef LIB_LIGHTS_GLSL
#define LIB_LIGHTS_GLSL

#include "shared/profile.glsl"
#include "shared/scene.glsl"

// Share of a spot light's intensity along unit `direction` away from it (KHR_lights_punctual).
float spot_falloff(Light light, vec3 direction) {
    float t = clamp((dot(light.direction, direction) - light.cos_outer) / (light.cos_inner - light.cos_outer), 0.0, 1.0);
    return t * t;
}

bool is_spot(Light light) { return SPOT_LIGHTS && light.kind == LIGHT_SPOT; }
bool is_directional(Light light) { return DIRECTIONAL_LIGHTS && light.kind == LIGHT_DIRECTIONAL; }

#endif
