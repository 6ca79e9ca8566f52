// Traces given rays: what tests and benchmarks compare with brute force.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

#include "trace/trace.glsl"

layout(constant_id = 0) const bool ANY_HIT = false;

struct TestRay {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

struct TestHit {
    float t; // infinite: nothing
    uint instance;
    uint primitive;
    vec2 barycentrics;
};

layout(set = 1, binding = 0, scalar) readonly buffer Rays { TestRay data[]; } rays;
layout(set = 1, binding = 1, scalar) writeonly buffer Hits { TestHit data[]; } hits;
layout(push_constant, scalar) uniform Params { uint count; } params;

// Masked triangles are solid near their first vertex only.
bool alpha_hole(uint instance, uint primitive, vec2 barycentrics)
{
    return barycentrics.x + barycentrics.y > 0.5;
}

void main()
{
    uint index = gl_GlobalInvocationID.x;
    if (index >= params.count) return;
    TestRay ray = rays.data[index];
    const float infinity = uintBitsToFloat(0x7f800000u);
    Hit hit = Hit(infinity, 0u, 0u, vec2(0));
    if (ANY_HIT) {
        if (trace_any(ray.origin, ray.direction, ray.t_min, ray.t_max)) hit.t = 0;
    } else if (!trace_closest(ray.origin, ray.direction, ray.t_min, ray.t_max, hit)) {
        hit.t = infinity;
    }
    hits.data[index] = TestHit(hit.t, hit.instance, hit.primitive, hit.barycentrics);
}
