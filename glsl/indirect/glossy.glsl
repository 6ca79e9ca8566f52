// Light of a virtual point light on surfaces that are not Lambertian.
#ifndef INDIRECT_GLOSSY_GLSL
#define INDIRECT_GLOSSY_GLSL

#include "indirect/gather.glsl"

// W/m² across the direction to a VPL, if nothing is between; clamped as irradiance is.
vec3 perpendicular(Vpl vpl, vec3 position, float min_distance, out vec3 direction) {
    vec3 to_vpl = vpl.position - position;
    float distance2 = dot(to_vpl, to_vpl);
    float inverse = inversesqrt(distance2);
    direction = inverse * to_vpl;
    float cos_k = -dot(vpl.normal, direction);
    if (!(cos_k > 0.0)) return vec3(0.0);
    float share = 1.0;
    if (min_distance > 0.0) {
        share = smooth_step(0.8 * min_distance, 1.2 * min_distance, sqrt(distance2));
        if (share == 0.0) return vec3(0.0);
    }
    return vpl.flux * (share * cos_k / (distance2 * PI));
}

#endif
