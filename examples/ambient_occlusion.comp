#version 460
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/sampling.glsl"
#include "lib/surface.glsl"
#include "trace/trace.glsl"

layout(set = 1, binding = 0, rgba32f) uniform writeonly image2D out_ao;
layout(push_constant) uniform Params { float radius; uint samples; } params;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(imageSize(out_ao))))) return;
    Ray ray = camera_ray(pixel);
    Hit hit;
    float open = 0.0;
    if (trace_closest(ray.origin, ray.direction, 0.0, 1.0 / 0.0, hit)) {
        Surface surface = surface_at(hit);
        face(surface, -ray.direction);
        vec3 origin = offset_origin(surface.position, surface.geometric_normal);
        uint first = hash(pixel.x, pixel.y) >> 8;
        for (uint i = 0u; i < params.samples; ++i) {
            vec3 d = sample_cosine_hemisphere(vec2(halton(0u, first + i, 0u), halton(1u, first + i, 0u)));
            if (!trace_any(origin, basis_around(surface.geometric_normal) * d, 0.0, params.radius)) open += 1.0;
        }
    }
    imageStore(out_ao, ivec2(pixel), vec4(vec3(open / float(params.samples)), 1.0));
}
