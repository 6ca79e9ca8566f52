#version 460
#extension GL_GOOGLE_include_directive : require
// Radiance leaving primary hits by emission and by direct light; the environment's where there are none. Ranges of
// rays to lights that have a size are added to what those before have left.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "lib/sampling.glsl"
#include "lib/surface.glsl"
#include "radiance_cache/shares.glsl"
#include "whitted/direct.glsl"

layout(constant_id = 0) const bool CONTINUES = false;
layout(constant_id = 1) const bool BESIDE_RAYS = false; // others bring the environment's light of the diffuse part, too

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, rgba32f) uniform readonly image2D before;
layout(set = 1, binding = 3, rgba32f) uniform writeonly image2D out_radiance;
layout(push_constant, scalar) uniform Params { uint first; uint last; uint rays; } params;

// What the surface reflects of lights asked one by one and of a range of samples of others.
vec3 reflected(Surface surface, bool front, vec3 to_viewer, vec3 reflectance, uint seed, inout uint rays) {
    Receiver x = receiver_at(surface);
    GlossySurface glossy;
    if (GLOSSY) glossy = glossy_surface(surface, front, to_viewer);
    vec3 irradiance = vec3(0.0), radiance = vec3(0.0);
    if (!CONTINUES) {
        for (uint i = 0u; i < scene.asked_lights; ++i) {
            vec3 source, light_here, direction;
            Light light = LightArray(scene.lights)[i].at;
            Receiver y = facing(x, light);
            if (GLOSSY) {
                light_here = perpendicular(light, y.position, source, direction);
                if (light_here != vec3(0.0)) light_here *= scattered(glossy, direction, LOBES_LIT);
            } else {
                light_here = unshadowed(light, y, source);
            }
            if (light_here == vec3(0.0)) continue;
            light_here = arriving(light_here, target(y), source, rays);
            if (GLOSSY) radiance += light_here;
            else irradiance += light_here;
        }
    }
    if (SAMPLES_LIGHTS) {
        vec3 sampled = vec3(0.0);
        LightSource lights = sampled_lights();
        bool lobes = false;
        if (GLOSSY) lobes = samples_lobes(glossy);
        if (lobes || BESIDE_RAYS) lights = lights_beside_lobes();
        // Of cosine-distributed rays, times the cosine.
        float by_rays = 0.0;
        if (BESIDE_RAYS) {
            bool diffuse = reflectance != vec3(0.0);
            by_rays = float(shares_of(glossy, params.rays, diffuse).diffuse) / (PI * float(scene.light_samples));
        }
        uint last = min(params.last, scene.light_samples);
        for (uint i = params.first; i < last; ++i) {
            if (lobes) sampled += by_lobe(glossy, i, seed, BESIDE_RAYS, rays);
            LightSample light;
            vec3 origin;
            if (!sampled_light(lights, x, i, seed, light, origin)) continue;
            vec3 share;
            float pdf;
            if (GLOSSY) share = scattered(glossy, light.direction, LOBES_LIT, pdf);
            else share = vec3(dot(x.side_normal, light.direction) > 0.0 ? max(dot(x.normal, light.direction), 0.0) : 0.0);
            if (share == vec3(0.0)) continue;
            vec3 beside_rays = vec3(0.0);
            if (BESIDE_RAYS && light.sky) {
                float by_ray = by_rays * max(dot(x.normal, light.direction), 0.0);
                vec3 diffuse = share;
                if (lobes) diffuse = scattered(glossy, light.direction, LOBE_DIFFUSE);
                share -= diffuse;
                beside_rays = diffuse * (light.pdf / (light.pdf + by_ray));
            }
            if (lobes && !light.delta) share *= power_heuristic(light.pdf, pdf);
            share += beside_rays;
            sampled += arriving(share * light.radiance_over_pdf, origin, light.direction, light.distance, rays);
        }
        sampled /= float(max(scene.light_samples, 1u));
        if (GLOSSY) radiance += sampled;
        else irradiance += sampled;
    }
    if (GLOSSY) return radiance;
    return reflectance * irradiance / PI;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(hits)))) return;
    Hit hit = unpack_hit(imageLoad(hits, pixel));
    vec3 radiance = vec3(0.0);
    uint rays = 0u;
    if (hit.instance != NO_HIT) {
        Surface surface = surface_at(hit);
        vec3 to_viewer = direction_to_camera(surface.position);
        bool front = face(surface, to_viewer);
        if (!CONTINUES) radiance = emitted_radiance(surface.material, front);
        if (ALPHA_BLEND) radiance *= coverage(surface.material);
        vec3 reflectance = imageLoad(albedo, pixel).rgb;
        if (GLOSSY || reflectance != vec3(0.0)) {
            vec3 sent = reflected(surface, front, to_viewer, reflectance, area_seed(uvec2(pixel)), rays);
            // Albedo has its share of coverage, lobes have not.
            if (ALPHA_BLEND && GLOSSY) sent *= coverage(surface.material);
            radiance += sent;
        }
    } else if (ENVIRONMENT && !CONTINUES) {
        radiance = environment_radiance(camera_ray(uvec2(pixel)).direction);
    }
    if (CONTINUES) radiance = imageLoad(before, pixel).rgb + radiance;
    imageStore(out_radiance, pixel, vec4(radiance, 1.0));
    count_rays(rays);
}
