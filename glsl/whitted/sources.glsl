// Light from lights asked one by one, from samples of others, and from VPLs, in this order, with a shadow ray each;
// then by rays of a point's lobes. Expects `vpls` and `count`.
#ifndef WHITTED_SOURCES_GLSL
#define WHITTED_SOURCES_GLSL

#include "indirect/vpls.glsl"
#include "whitted/direct.glsl"
#include "whitted/reached.glsl"

uint source_count() { return source_count(count.vpls); }

// The first VPL of a point's run.
uint first_vpl(vec3 position) {
    if (scene.vpl_share == 1u) return 0u;
    uvec3 at = floatBitsToUint(position);
    return min(uint(unit_float(hash(hash(at.x, at.y, at.z), scene.seed)) * float(count.vpls)), count.vpls - 1u);
}

// A lit point beyond its receiver.
struct Lit {
    GlossySurface glossy; // of glossy scenes
    uint seed;            // of rays to sampled lights
};

// Irradiance; of glossy scenes the radiance that goes on to the eye.
vec3 light_from(Receiver x, Lit lit, uint first, uint last, float min_distance, inout uint rays) {
    vec3 sum = vec3(0.0);
    bool lobes = false;
    if (GLOSSY) lobes = samples_lobes(lit.glossy);
    uint lobe_rays = source_count() - scene.lobe_samples;
    for (uint k = first; k < last; ++k) {
        vec3 direction;
        Connection c = Connection(vec3(0.0), vec3(0.0), vec3(0.0));
        bool is_vpl = k >= scene.asked_lights + scene.light_samples;
        bool sampled = false;
        LightSample light;
        if (SAMPLES_LIGHTS) {
            sampled = !is_vpl && k >= scene.asked_lights;
            if (k >= lobe_rays) {
                if (lobes) sum += by_lobe(lit.glossy, k - lobe_rays, lit.seed, false, rays) / float(scene.lobe_samples);
                continue;
            }
        }
        if (sampled) {
            LightSource lights = sampled_lights();
            if (lobes) lights = lights_beside_lobes();
            if (!sampled_light(lights, x, k - scene.asked_lights, lit.seed, light, c.from)) continue;
            direction = light.direction;
            c.light = light.radiance_over_pdf / float(scene.light_samples);
            if (!GLOSSY) {
                c.light *= dot(x.side_normal, direction) > 0.0 ? max(dot(x.normal, direction), 0.0) : 0.0;
            }
            c.to = c.from + light.distance * direction;
        } else if (!is_vpl) {
            Light light = LightArray(scene.lights)[k].at;
            Receiver y = facing(x, light);
            c.from = target(y);
            if (GLOSSY) c.light = perpendicular(light, y.position, c.to, direction);
            else c.light = unshadowed(light, y, c.to);
        } else {
            uint vpl = (first_vpl(x.position) + (k - scene.asked_lights - scene.light_samples)) % count.vpls;
            if (GLOSSY) c = connect_vpl(vpl, x, min_distance, direction);
            else c = connect_vpl(vpl, x, min_distance);
            if (scene.vpl_share > 1u) c.light *= float(count.vpls) / float(vpl_run(count.vpls));
        }
        if (c.light == vec3(0.0)) continue;
        if (GLOSSY) {
            float pdf;
            c.light *= scattered(lit.glossy, direction, LOBES_LIT, pdf);
            if (c.light == vec3(0.0)) continue;
            if (sampled && lobes && !light.delta) c.light *= power_heuristic(light.pdf, pdf);
        }
        sum += arriving(c.light, c.from, c.to - c.from, 1.0, is_vpl, rays);
    }
    return sum;
}

// The same, summed group by group.
vec3 light_in_groups(Receiver x, Lit lit, uint first, uint last, float min_distance, inout uint rays) {
    vec3 sum = vec3(0.0);
    for (uint k = first; k < last; k += GROUP) sum += light_from(x, lit, k, min(k + GROUP, last), min_distance, rays);
    return sum;
}

#endif
