// Light from the lights, from samples of lights that have a size, and from VPLs, in this order, with a shadow ray each.
// Expects `vpls` and `count`.
#ifndef WHITTED_SOURCES_GLSL
#define WHITTED_SOURCES_GLSL

#include "indirect/glossy.glsl"
#include "lib/glossy.glsl"
#include "indirect/visibility.glsl"
#include "trace/offset.glsl"
#include "trace/trace.glsl"
#include "whitted/direct.glsl"
#include "whitted/reached.glsl"

uint source_count() { return scene.light_count + scene.light_samples + count.vpls; }

// A lit point beyond its receiver.
struct Lit {
    GlossySurface glossy; // of glossy scenes
    uint seed;            // of rays to lights that have a size
};

// Irradiance; of glossy scenes the radiance that goes on to the eye.
vec3 light_from(Receiver x, Lit lit, uint first, uint last, float min_distance, inout uint rays) {
    vec3 here = offset_origin(x.position, x.geometric_normal);
    vec3 sum = vec3(0.0);
    for (uint k = first; k < last; ++k) {
        vec3 arriving, from = here, to, direction;
        bool is_vpl = k >= scene.light_count + scene.light_samples;
        bool sampled = false;
        if (EMISSIVE_TRIANGLES || ENVIRONMENT) sampled = !is_vpl && k >= scene.light_count;
        if (sampled) {
            LightSample light;
            if (!area_light(here, k - scene.light_count, lit.seed, light)) continue;
            direction = light.direction;
            arriving = light.radiance_over_pdf / float(scene.light_samples);
            if (!GLOSSY) {
                arriving *= dot(x.geometric_normal, direction) > 0.0 ? max(dot(x.normal, direction), 0.0) : 0.0;
            }
            to = here + light.distance * direction;
        } else if (!is_vpl) {
            Light light = LightArray(scene.lights)[k].at;
            if (GLOSSY) arriving = perpendicular(light, x.position, to, direction);
            else arriving = unshadowed(light, x, to);
        } else {
            Vpl vpl = vpls.data[k - scene.light_count - scene.light_samples];
            if (GLOSSY) arriving = perpendicular(vpl, x.position, min_distance, direction);
            else arriving = unshadowed(vpl, x, min_distance);
            from = offset_origin(vpl.position, vpl.normal);
            to = here;
        }
        if (arriving == vec3(0.0)) continue;
        if (GLOSSY) {
            arriving *= scattered(lit.glossy, direction, LOBES_LIT);
            if (arriving == vec3(0.0)) continue;
        }
        ++rays;
        // One copy of trace_any where visibility is exact.
        bool imperfect = VISIBILITY != VISIBILITY_EXACT && is_vpl;
        if (!(imperfect ? occluded(from, to) : trace_any(from, to - from, 0.0, 1.0))) sum += arriving;
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
