#version 460
#extension GL_GOOGLE_include_directive : require
// Shading normal with depth along the viewing direction, and position, of primary hits. Misses: all 0.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/surface.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform writeonly image2D out_normal_depth;
layout(set = 1, binding = 2, rgba32f) uniform writeonly image2D out_position;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(hits)))) return;
    Hit hit = unpack_hit(imageLoad(hits, pixel));
    vec4 normal_depth = vec4(0.0), position = vec4(0.0);
    if (hit.instance != NO_HIT) {
        Surface surface = surface_at(hit);
        face(surface, direction_to_camera(surface.position));
        normal_depth = vec4(surface.normal, dot(surface.position - scene.camera.eye, scene.camera.forward));
        position = vec4(surface.position, 1.0);
    }
    imageStore(out_normal_depth, pixel, normal_depth);
    imageStore(out_position, pixel, position);
}
