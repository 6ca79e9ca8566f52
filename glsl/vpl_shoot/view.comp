#version 460
#extension GL_GOOGLE_include_directive : require
// Points that the camera sees, by way of mirrors and glass, too; spread evenly over the picture.
layout(local_size_x = 64) in;
#include "lib/camera.glsl"
#include "lib/media.glsl"
#include "lib/receiver.glsl"
#include "lib/sampling.glsl"
#include "lib/sheer.glsl"
#include "trace/offset.glsl"
#include "trace/trace.glsl"

layout(set = 1, binding = 0, scalar) writeonly buffer Points { Receiver data[]; } points; // normal 0: none
layout(push_constant, scalar) uniform Params { uvec2 origin; uvec2 extent; uint side; } params; // extent 0: all

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.side * params.side) return;
    vec2 jitter = vec2(unit_float(hash(i, 0u, scene.seed)), unit_float(hash(i, 1u, scene.seed)));
    vec2 cell = vec2(i % params.side, i / params.side);
    bool whole = params.extent.x == 0u;
    vec2 at = vec2(whole ? scene.full_size : params.extent) * (cell + jitter) / float(params.side);
    uvec2 pixel = uvec2(at);
    Ray ray = camera_ray(pixel + (whole ? uvec2(0u) - scene.window_origin : params.origin), at - vec2(pixel));
    Receiver point = Receiver(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    Hit hit;
    for (int depth = 0; depth <= int(scene.specular_depth); ++depth) {
        if (!trace_closest(ray.origin, ray.direction, 0.0, 1.0 / 0.0, hit)) break;
        Surface surface = surface_at(hit);
        bool front = face(surface, -ray.direction);
        Material material = surface.material;
        float side = 1.0;
        // Straight through is no bounce.
        if (max_component(passing(surface, ray.direction)) > 0.5) {
            side = -1.0;
            --depth;
        } else {
            Split split = split_light(material, clamp(-dot(ray.direction, surface.normal), 0.0, 1.0), front);
            float r = dot(split.reflected, vec3(1.0)), t = dot(split.transmitted, vec3(1.0));
            if (r + t <= 0.0 || vpl_albedo(material, 1.0, front) != vec3(0.0)) {
                if ((material.flags & MATERIAL_UNLIT) == 0u) point = receiver_at(surface);
                break;
            }
            // The way that most of the light takes.
            if (t > r) {
                side = -1.0;
                ray.direction = transmit(material, ray.direction, surface.normal, front);
            } else {
                ray.direction = reflect_above(ray.direction, surface.normal, surface.geometric_normal);
            }
        }
        ray.origin = offset_origin(surface.position, side * surface.geometric_normal);
    }
    points.data[i] = point;
}
