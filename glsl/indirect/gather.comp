#version 460
#extension GL_GOOGLE_include_directive : require
// Irradiance at primary hits from a range of the VPLs. Added to `sum` from the second range on. Two threads share a
// pixel's VPLs: shorter loops leave less of a GPU waiting for the last of them.
layout(local_size_x = 8, local_size_y = 4, local_size_z = 2) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "indirect/gather.glsl"
#include "trace/trace.glsl"

layout(constant_id = 0) const bool CONTINUES = false;

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 3, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 4, rgba32f) uniform readonly image2D sum;
layout(set = 1, binding = 5, rgba32f) uniform writeonly image2D out_irradiance;
layout(push_constant, scalar) uniform Params { uint first; uint last; float min_distance; } params;

const uint PARTS = gl_WorkGroupSize.z;
shared vec3 parts[PARTS][gl_WorkGroupSize.y][gl_WorkGroupSize.x];

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    uvec3 local = gl_LocalInvocationID;
    bool inside = all(lessThan(pixel, imageSize(hits)));
    vec3 irradiance = vec3(0.0);
    uint rays = 0u;
    if (inside && imageLoad(albedo, pixel).rgb != vec3(0.0)) {
        Surface surface = surface_at(unpack_hit(imageLoad(hits, pixel)));
        face(surface, direction_to_camera(surface.position));
        Receiver x = receiver_at(surface);
        vec3 target = offset_origin(x.position, x.geometric_normal);
        uint last = min(params.last, count.vpls);
        for (uint k = params.first + local.z; k < last; k += PARTS) {
            Vpl vpl = vpls.data[k];
            vec3 arriving = unshadowed(vpl, x, params.min_distance);
            if (arriving == vec3(0.0)) continue;
            ++rays;
            // From the VPL: rays that start together stay together, 8 % faster than the other way on a large GPU.
            vec3 origin = offset_origin(vpl.position, vpl.normal);
            if (!trace_any(origin, target - origin, 0.0, 1.0)) irradiance += arriving;
        }
    }
    parts[local.z][local.y][local.x] = irradiance;
    barrier();
    if (inside && local.z == 0u) {
        irradiance = CONTINUES ? imageLoad(sum, pixel).rgb : vec3(0.0);
        for (uint i = 0u; i < PARTS; ++i) irradiance += parts[i][local.y][local.x];
        imageStore(out_irradiance, pixel, vec4(irradiance, 1.0));
    }
    count_rays(COUNT_GATHER, rays);
}
