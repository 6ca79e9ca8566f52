#version 460
#extension GL_GOOGLE_include_directive : require
// Some samples more of each pixel, one path a sample, into running means. A path is followed edge by edge from the
// camera (Kajiya 1986); at each vertex one light is asked for light (next-event estimation), and what both that and the
// path's next edge find is weighted by the power heuristic (Veach 1997, §9.2).
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/bsdf.glsl"
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "lib/light_sampler.glsl"
#include "lib/media.glsl"
#include "lib/visibility.glsl"
#include "path_trace/modes.glsl"

layout(constant_id = 0) const uint TRANSPORT = TRANSPORT_FULL;
layout(constant_id = 1) const uint CONNECT = CONNECT_ALL;
layout(constant_id = 2) const bool BOX_FILTER = true; // the pixel's centre otherwise
layout(constant_id = 3) const bool FINDS_LIGHT = true; // rays may: something emits other than delta lights
layout(constant_id = 4) const bool HALVES = true;
layout(constant_id = 5) const bool ADAPTIVE = true;

layout(set = 1, binding = 0, rgba32f) uniform image2D mean; // w: samples it is of, those at a rate of r as 1/r
// Means of every second sample, from the first and from the second on; `mean` again where they are not asked for.
layout(set = 1, binding = 1, rgba32f) uniform image2D half_a;
layout(set = 1, binding = 2, rgba32f) uniform image2D half_b;
layout(set = 1, binding = 3, rgba32f) uniform readonly image2D rates; // x: samples for each of the mean pixel's, z: before the round
// Samples of the mean pixel: before this round of equal rates, in it so far, and to be taken.
layout(push_constant) uniform Params {
    uint before;
    uint first;
    uint samples;
    uint max_depth;
    uint roulette_depth;
} params;

// Sample sets of a path: a vertex takes five.
const uint SET_PIXEL = 0u;
const uint SET_DIRECTION = 1u;
const uint SET_LOBE = 2u;
const uint SET_LIGHT = 3u;
const uint SET_LIGHT_CHOICE = 4u;
const uint SET_ROULETTE = 5u;
const uint SETS_A_VERTEX = 5u;

uint pixel_seed;
uint sample_index;
uint rays = 0u;

vec2 sample_2d(uint set, uint vertex) { return sobol(sample_index, hash(pixel_seed, set + vertex * SETS_A_VERTEX)); }
float sample_1d(uint set, uint vertex) { return sample_2d(set, vertex).x; }

// f·|cosθ| of what is being computed; `albedo` where that is diffuse.
vec3 scattered(Surface s, bool front, vec3 wo, vec3 wi, uint lobes, vec3 albedo, out float pdf) {
    if (TRANSPORT != TRANSPORT_DIFFUSE_INDIRECT) return bsdf_evaluate(s, front, wo, wi, lobes, pdf);
    pdf = dot(s.side_normal, wi) > 0.0 ? max(dot(s.normal, wi), 0.0) / PI : 0.0;
    return albedo * pdf;
}

// Whether light from behind may count.
bool lets_through(Surface s) { return GLASS && s.material.transmission > 0.0; }

// Light that a source sends along an edge of its own to this vertex, and on towards wo.
vec3 connect(Surface s, bool front, vec3 wo, uint lobes, vec3 albedo, uint vertex, vec3 absorption) {
    vec3 from;
    LightSample light;
    vec3 u = vec3(sample_1d(SET_LIGHT_CHOICE, vertex), sample_2d(SET_LIGHT, vertex));
    if (!sample_light(all_lights(), receiver_at(s), lets_through(s), u, light, from)) return vec3(0.0);
    if (CONNECT == CONNECT_DELTA && !light.delta) return vec3(0.0);
    float pdf;
    vec3 f = scattered(s, front, wo, light.direction, lobes, albedo, pdf);
    if (f == vec3(0.0)) return vec3(0.0);
    if (!light.delta) f *= power_heuristic(light.pdf, pdf);
    if (GLASS && dot(s.side_normal, light.direction) < 0.0) {
        // From the other side to the same point.
        vec3 to = from + light.distance * light.direction;
        from = offset_origin(s.position, -s.geometric_normal);
        light.distance = distance(from, to);
        light.direction = (to - from) / light.distance;
        absorption = absorption_behind(s.material, front, absorption);
    }
    f *= transmittance(absorption, light.distance);
    return arriving(f * light.radiance_over_pdf, from, light.direction, light.distance, rays);
}

// Radiance that arrives along a ray; W/(sr·m²).
vec3 trace_path(Ray ray) {
    vec3 sum = vec3(0.0), throughput = vec3(1.0), absorption = vec3(0.0);
    // Of the last scattering: density of the direction, 0 where no light sample competes with it, and the lobe.
    float pdf = 0.0;
    uint lobe = LOBE_DELTA;
    vec3 from = ray.origin;
    Receiver last;
    bool through = false;
    float above = 0.0; // how far a ray from over a facet runs before it sinks below its plane
    float scale = 1.0;   // of radiance, by refraction
    float covered = 0.0; // distance since the last scattering, sheer surfaces passed
    uint passes = 0u;    // of partial coverage
    uint vertex = 0u;    // sample sets: vertices and panes so far
    uint depth = 1u; // of the edge ahead
    while (true) {
        Hit hit;
        ++rays;
        bool counts = TRANSPORT != TRANSPORT_DIFFUSE_INDIRECT || depth > 2u;
        if (!trace_closest(ray.origin, ray.direction, 0.0, 1.0 / 0.0, hit)) {
            if (ENVIRONMENT && counts) {
                float weight = 1.0;
                if (CONNECT == CONNECT_ALL && pdf > 0.0) weight = power_heuristic(pdf, environment_pdf(all_lights(), ray.direction));
                sum += throughput * environment_radiance(ray.direction) * weight;
            }
            break;
        }
        Surface s = surface_at(hit);
        vec3 wo = -ray.direction;
        bool front = face(s, wo);
        float length = distance(ray.origin, s.position);
        covered += length;
        throughput *= transmittance(absorption, length);
        if (ALPHA_BLEND) {
            float share = coverage(s.material);
            if (share < 1.0 && unit_float(hash(pixel_seed, sample_index, ++passes)) >= share) {
                ray.origin = beyond(s, ray.direction);
                continue;
            }
        }
        bool unlit = (s.material.flags & MATERIAL_UNLIT) != 0u;
        vec3 emitted = emitted_radiance(s.material, front);
        if (CURVED && covered < above) emitted = vec3(0.0);
        // Unlit surfaces are seen, also mirrored, but light nothing.
        if (counts && emitted != vec3(0.0) && !(unlit && lobe == LOBE_DIFFUSE)) {
            float weight = 1.0;
            if (CONNECT == CONNECT_ALL && pdf > 0.0) {
                float by_light = light_pdf(all_lights(), last, through, from, hit, s, front, wo, covered);
                weight = power_heuristic(pdf, by_light);
            }
            sum += throughput * emitted * weight;
        }
        bool ends = depth >= params.max_depth;
        bool pane = is_pane(s.material);
        if (ends && !pane) break;

        uint lobes = TRANSPORT == TRANSPORT_DIRECT ? LOBE_ALL & ~LOBE_DELTA : LOBE_ALL;
        vec3 albedo = vec3(0.0);
        bool connects = true;
        if (TRANSPORT == TRANSPORT_DIFFUSE_INDIRECT) {
            if (pane) {
                vec3 share = pane_share(s, ray.direction);
                float p = passing_probability(share);
                if (sample_1d(SET_LOBE, vertex) < p) {
                    throughput *= share / p;
                    ray.origin = beyond(s, ray.direction);
                    ++vertex;
                    continue;
                }
                throughput /= 1.0 - p;
                if (ends) break;
            }
            albedo = depth == 1u ? bsdf_diffuse(s, front, wo) : diffuse_albedo(s.material);
            if (albedo == vec3(0.0)) break;
            connects = depth > 1u;
        }
        if (CONNECT != CONNECT_NONE && connects && !ends) {
            sum += throughput * connect(s, front, wo, lobes, albedo, vertex, absorption);
        }
        bool finds = FINDS_LIGHT || depth + 1u != params.max_depth;
        if (!finds && !pane) break;

        vec2 u = sample_2d(SET_DIRECTION, vertex);
        if (TRANSPORT == TRANSPORT_DIFFUSE_INDIRECT) {
            vec3 local = sample_cosine_hemisphere(u);
            ray.direction = basis_around(s.normal) * local;
            if (dot(s.side_normal, ray.direction) <= 0.0) break;
            throughput *= albedo;
            pdf = local.z / PI;
            lobe = LOBE_DIFFUSE;
        } else {
            BsdfSample b;
            if (!bsdf_sample(s, front, wo, vec3(u, sample_1d(SET_LOBE, vertex)), lobes, b)) break;
            throughput *= b.weight;
            if (b.lobe == LOBE_PANE) {
                ray.origin = beyond(s, ray.direction);
                ++vertex;
                continue;
            }
            if (ends || !finds) break;
            ray.direction = b.direction;
            pdf = b.pdf;
            lobe = b.lobe;
            scale *= b.eta * b.eta;
        }
        bool behind = dot(s.side_normal, ray.direction) < 0.0;
        ray.origin = behind ? offset_origin(s.position, -s.geometric_normal) : leave(s, ray.direction);
        // Emitters above the facet are asked from there: a ray from over it that finds one does not count.
        bool over = lobe != LOBE_DELTA && lifted(s.lifts.x, s.geometric_normal, ray.direction);
        above = over ? s.lifts.x / max(-dot(s.geometric_normal, ray.direction), 1e-30) : 0.0;
        if (behind) absorption = absorption_behind(s.material, front, absorption);
        covered = 0.0;
        if (LIGHT_TREE) {
            from = ray.origin;
            last = receiver_at(s);
            through = lets_through(s);
        }
        ++depth;
        uint here = vertex++;
        if (depth > params.roulette_depth) {
            float survival = min(max_component(throughput) * scale, 0.95);
            if (sample_1d(SET_ROULETTE, here) >= survival) break;
            throughput /= survival;
        }
    }
    return sum;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(mean)))) return;
    uvec2 place = uvec2(pixel) + scene.window_origin;
    uint seed = hash(place.x, place.y, scene.seed);
    vec4 all = imageLoad(mean, pixel), a = vec4(0.0), b = vec4(0.0);
    if (HALVES) {
        a = imageLoad(half_a, pixel);
        b = imageLoad(half_b, pixel);
    }
    vec3 rates_here = ADAPTIVE ? imageLoad(rates, pixel).xyz : vec3(1.0, 1.0, 0.0);
    float rate = rates_here.x, before = float(params.before);
    uint taken = uint(rates_here.z); // an even number
    uint i = uint(ceil(float(params.first) * rate)), end = uint(ceil(float(params.first + params.samples) * rate));
    for (; i < end; ++i) {
        // Halves have sequences of their own, or they would not tell how much a pixel varies.
        uint half_index = i & 1u;
        pixel_seed = hash(seed, half_index);
        sample_index = (taken + i) >> 1;
        vec2 offset_in_pixel = BOX_FILTER ? sobol(sample_index, hash(pixel_seed, SET_PIXEL)) : vec2(0.5);
        vec3 radiance = trace_path(camera_ray(uvec2(pixel), offset_in_pixel));
        // As a count over the rate, not a sum of parts: exact at any length.
        all.w = before + float(i + 1u) / rate;
        all.rgb += (radiance - all.rgb) / (all.w * rate);
        float half_weight = 0.5 * before + float((i >> 1) + 1u) / rate;
        if (HALVES && half_index == 0u) {
            a.w = half_weight;
            a.rgb += (radiance - a.rgb) / (a.w * rate);
        } else if (HALVES) {
            b.w = half_weight;
            b.rgb += (radiance - b.rgb) / (b.w * rate);
        }
    }
    imageStore(mean, pixel, all);
    if (HALVES) {
        imageStore(half_a, pixel, a);
        imageStore(half_b, pixel, b);
    }
    count_rays(rays);
}
