#version 460
#extension GL_GOOGLE_include_directive : require
// Adds to the irradiance at gather samples what bounding VPLs took from it.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "indirect/grid.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, rgba32f) uniform image2D irradiance;
layout(set = 1, binding = 3, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 4, scalar) readonly buffer Count { uint vpls; } count;
layout(push_constant) uniform Params { uint first; uint last; uint paths; uint vertices; float min_distance; } params;

#include "indirect/compensate.glsl"
#include "indirect/samples.glsl"

void main() {
    ivec2 index = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(index, imageSize(irradiance)))) return;
    ivec2 pixel = sample_pixel(first_cell() + uvec2(index));
    if (!takes_light(pixel)) return;
    Surface surface = surface_at(unpack_hit(imageLoad(hits, pixel)));
    face(surface, direction_to_camera(surface.position));
    Receiver x = receiver_at(surface);
    uint seed = compensation_seed(pixel), rays = 0u;
    vec3 sum = vec3(0.0);
    for (uint i = params.first; i < min(params.last, params.paths); ++i) {
        sum += lost_light(x, i, seed, params.vertices, params.min_distance, rays);
    }
    sum = imageLoad(irradiance, index).rgb + sum / float(params.paths);
    imageStore(irradiance, index, vec4(sum, 1.0));
    count_rays(rays);
}
