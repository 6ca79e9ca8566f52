#version 460
#extension GL_GOOGLE_include_directive : require
// Radiance leaving primary hits by emission and by direct light on their diffuse part.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "lib/sampling.glsl"
#include "lib/surface.glsl"
#include "trace/trace.glsl"
#include "whitted/direct.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, rgba32f) uniform writeonly image2D out_radiance;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(hits)))) return;
    Hit hit = unpack_hit(imageLoad(hits, pixel));
    vec3 radiance = vec3(0.0);
    uint rays = 0u;
    if (hit.instance != NO_HIT) {
        Surface surface = surface_at(hit);
        bool front = face(surface, direction_to_camera(surface.position));
        radiance = emitted_radiance(surface.material, front);
        vec3 reflectance = imageLoad(albedo, pixel).rgb;
        if (reflectance != vec3(0.0)) {
            Receiver x = receiver_at(surface);
            vec3 origin = offset_origin(x.position, x.geometric_normal);
            vec3 irradiance = vec3(0.0);
            for (uint i = 0u; i < scene.light_count; ++i) {
                vec3 source;
                vec3 arriving = unshadowed(LightArray(scene.lights)[i].at, x, source);
                if (arriving == vec3(0.0)) continue;
                ++rays;
                if (!trace_any(origin, source - origin, 0.0, 1.0)) irradiance += arriving;
            }
            radiance += reflectance * irradiance / PI;
        }
    }
    imageStore(out_radiance, pixel, vec4(radiance, 1.0));
    count_rays(COUNT_DIRECT, rays);
}
