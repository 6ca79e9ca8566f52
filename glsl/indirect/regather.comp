#version 460
#extension GL_GOOGLE_include_directive : require
// Irradiance from all VPLs at the listed pixels, which no sample near them fits. They are few and far between: many
// threads share a pixel.
#include "indirect/missing.glsl"
layout(local_size_x = MISSING_PIXELS, local_size_y = 64) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 2, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 3, scalar) readonly buffer List { uint pixels[]; } list;
layout(set = 1, binding = 4, scalar) readonly buffer Args { MissingArgs at; } args;
layout(set = 1, binding = 5, rgba32f) uniform image2D irradiance;
layout(push_constant, scalar) uniform Params { uint first; uint last; float min_distance; } params;

#include "indirect/vpls.glsl"

const uint PARTS = gl_WorkGroupSize.y;
shared vec3 parts[PARTS][MISSING_PIXELS];

void main() {
    uint part = gl_LocalInvocationID.y, column = gl_LocalInvocationID.x;
    uint index = missing_index(column);
    bool inside = index < args.at.count;
    ivec2 pixel = ivec2(0);
    uint rays = 0u;
    if (inside) {
        pixel = unpack_pixel(list.pixels[index]);
        Surface surface = surface_at(unpack_hit(imageLoad(hits, pixel)));
        face(surface, direction_to_camera(surface.position));
        Receiver x = receiver_at(surface);
        Walk walk = Walk(params.first + part, min(params.last, count.vpls), PARTS);
        parts[part][column] = irradiance_from_vpls(walk, x, params.min_distance, rays);
    }
    barrier();
    if (inside && part == 0u) {
        vec3 sum = imageLoad(irradiance, pixel).rgb;
        for (uint i = 0u; i < PARTS; ++i) sum += parts[i][column];
        imageStore(irradiance, pixel, vec4(sum, 1.0));
    }
    count_rays(rays);
}
