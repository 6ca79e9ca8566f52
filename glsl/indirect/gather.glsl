// Irradiance from virtual point lights (Marques & Santos 2010, eq. 1).
#ifndef INDIRECT_GATHER_GLSL
#define INDIRECT_GATHER_GLSL

#include "lib/receiver.glsl"
#include "lib/sampling.glsl"

// The paper's cubic f(a, b, d).
float smooth_step(float a, float b, float d) {
    if (d >= b) return 1.0;
    if (d <= a) return 0.0;
    float s = (d - a) / (b - a);
    return s * s * (3.0 - 2.0 * s);
}

// W/m² from a VPL if nothing is between; 0 behind the plane of either.
vec3 unshadowed(Vpl vpl, Receiver x, float min_distance) {
    vec3 to_vpl = vpl.position - x.position;
    float cos_x = dot(x.normal, to_vpl);
    float cos_k = -dot(vpl.normal, to_vpl);
    if (cos_x <= 0.0 || cos_k <= 0.0 || dot(x.geometric_normal, to_vpl) <= 0.0) return vec3(0.0);
    float distance2 = dot(to_vpl, to_vpl);
    float g = (cos_x / distance2) * (cos_k / distance2);
    if (min_distance > 0.0) {
        float f = smooth_step(0.8 * min_distance, 1.2 * min_distance, sqrt(distance2));
        if (f == 0.0) return vec3(0.0); // before 0 · ∞ where they all but touch
        g *= f;
    }
    return vpl.flux * (g / PI);
}

#endif
