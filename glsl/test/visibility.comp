// Whether triangles' boxes block given rays: what tests compare with brute force.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

#include "trace/boxes.glsl"

struct TestRay {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

layout(set = 1, binding = 0, scalar) readonly buffer Rays { TestRay data[]; } rays;
layout(set = 1, binding = 1, scalar) writeonly buffer Blocked { uint data[]; } blocked;
layout(push_constant, scalar) uniform Params { uint count; } params;

// Masked triangles are nothing but holes, which boxes do not notice.
bool alpha_hole(uint instance, uint primitive, vec2 barycentrics)
{
    return true;
}

void main()
{
    uint index = gl_GlobalInvocationID.x;
    if (index >= params.count) return;
    TestRay ray = rays.data[index];
    blocked.data[index] = uint(trace_any_box(ray.origin, ray.direction, ray.t_min, ray.t_max));
}
