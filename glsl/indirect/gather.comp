#version 460
#extension GL_GOOGLE_include_directive : require
// Irradiance at gather samples from a range of their VPLs, added to what ranges before have left there. Eight threads share
// a sample's VPLs: shorter loops leave less of a GPU waiting for the last of them. With interleaved sampling a workgroup
// takes samples of one subset, whose rays start at the same VPLs.
layout(local_size_x = 8, local_size_y = 4, local_size_z = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "indirect/grid.glsl"

layout(constant_id = 0) const bool CONTINUES = false;

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 3, scalar) readonly buffer Count { uint vpls; uint starts[]; } count;
layout(set = 1, binding = 4, rgba32f) uniform readonly image2D before;
layout(set = 1, binding = 5, rgba32f) uniform writeonly image2D out_irradiance;
layout(push_constant, scalar) uniform Params { uint first; uint last; float min_distance; uvec2 block; } params;

#include "indirect/samples.glsl"
#include "indirect/vpls.glsl"

const uint PARTS = gl_WorkGroupSize.z;
shared vec3 parts[PARTS][gl_WorkGroupSize.y][gl_WorkGroupSize.x];

// The sample of this invocation in the output: invocations run subset by subset, each a block of so many.
ivec2 sample_index(out uint subset) {
    subset = 0u;
    uvec2 index = gl_GlobalInvocationID.xy;
    if (INTERLEAVE == 1u) return ivec2(index);
    uvec2 of = index / params.block;
    subset = of.y * INTERLEAVE + of.x;
    uvec2 tile = first_cell() / INTERLEAVE + index % params.block;
    return ivec2(cell_of(tile, subset)) - ivec2(first_cell());
}

void main() {
    uvec3 local = gl_LocalInvocationID;
    uint subset;
    ivec2 index = sample_index(subset);
    bool inside = all(greaterThanEqual(index, ivec2(0))) && all(lessThan(index, imageSize(out_irradiance)));
    vec3 irradiance = vec3(0.0);
    uint rays = 0u;
    ivec2 pixel = sample_pixel(first_cell() + uvec2(index));
    if (inside && takes_light(pixel)) {
        Surface surface = surface_at(unpack_hit(imageLoad(hits, pixel)));
        face(surface, direction_to_camera(surface.position));
        Receiver x = receiver_at(surface);
        uint base = 0u, end = count.vpls;
        if (INTERLEAVE > 1u) {
            base = count.starts[subset];
            end = count.starts[subset + 1u];
        }
        Walk walk = Walk(base + params.first + local.z, min(base + params.last, end), PARTS);
        irradiance = irradiance_from_vpls(walk, x, params.min_distance, rays);
    }
    parts[local.z][local.y][local.x] = irradiance;
    barrier();
    if (inside && local.z == 0u) {
        irradiance = vec3(0.0);
        for (uint i = 0u; i < PARTS; ++i) irradiance += parts[i][local.y][local.x];
        if (INTERLEAVE > 1u) irradiance *= float(INTERLEAVE * INTERLEAVE);
        if (CONTINUES) irradiance = imageLoad(before, index).rgb + irradiance;
        imageStore(out_irradiance, index, vec4(irradiance, 1.0));
    }
    count_rays(rays);
}
