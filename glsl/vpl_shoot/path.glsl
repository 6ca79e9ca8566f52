// Light paths. Expects `params.paths` and `guides`, and of whoever includes it:
//     const bool ROULETTE   paths end by chance, not after `params.bounces` diffuse hits
//     const bool SCRAMBLED  Halton's points are for the first bounces alone
//     void leave(Vpl vpl)   called at every diffuse hit, in order
#ifndef VPL_SHOOT_PATH_GLSL
#define VPL_SHOOT_PATH_GLSL

layout(constant_id = 0) const bool LOBES = false;  // VPLs stand for lobes that are neither diffuse nor mirrors, too
layout(constant_id = 1) const bool GUIDED = false; // paths from infinitely far away follow `guides`

#include "lib/albedo.glsl"
#include "lib/lights.glsl"
#include "lib/media.glsl"
#include "lib/sampling.glsl"
#include "lib/sheer.glsl"
#include "trace/offset.glsl"
#include "trace/trace.glsl"

void leave(Vpl vpl);

#include "vpl_shoot/guided.glsl"

// Whether any light has a size.
bool area_lights() {
    return (EMISSIVE_TRIANGLES || ENVIRONMENT) && scene.light_choice_count > scene.light_count;
}

// Halton dimensions: 0 the light, 1 and 2 its emission, 3 and 4 where on it where lights have a size, then a pair a
// bounce.
uint first_bounce_dimension() { return area_lights() ? 5u : 3u; }

vec2 halton_pair(uint dimension, uint path) {
    // The sequence starts at 1: its element 0 is a corner in every dimension.
    return vec2(halton(dimension, path + 1u, scene.seed), halton(dimension + 1u, path + 1u, scene.seed));
}

struct Emission {
    vec3 origin;
    vec3 direction;
    vec3 flux; // carried by the path, W
    GuidedStart start;
};

Emission plain_emission(vec3 origin, vec3 direction, vec3 flux) { return Emission(origin, direction, flux, no_start()); }

Emission guided_emission(GuidedStart start, vec3 flux) { return Emission(origin_of(start), start.direction, flux, start); }

// Of a light without size; `paths_here` is p_light · P, `v` two numbers in [0, 1).
Emission emit(Light light, float paths_here, vec2 v, uint path, uint source) {
    if (GUIDED && is_directional(light)) {
        GuidedStart start = guided_start(pick_guide(path, source), source, vec2(0.0), v, light.direction, paths_here);
        return guided_emission(start, light.flux / (paths_here * beam_area() * start.density));
    }
    if (is_directional(light)) {
        vec2 disc = scene.scene_radius * sample_disc(v);
        vec3 start = scene.scene_center - scene.scene_radius * light.direction;
        return plain_emission(start + basis_around(light.direction) * vec3(disc, 0.0), light.direction, light.flux / paths_here);
    }
    if (is_spot(light)) {
        vec3 direction = basis_around(light.direction) * sample_cone(v, light.cos_outer);
        float solid_angle = 2.0 * PI * (1.0 - light.cos_outer);
        return plain_emission(light.position, direction,
                              light.intensity * (spot_falloff(light, direction) * solid_angle / paths_here));
    }
    return plain_emission(light.position, sample_sphere(v), light.flux / paths_here);
}

// Of an emissive triangle: uniform by area, on either side alike where both emit, cosine-distributed.
Emission emit(LightChoice choice, vec2 v, vec2 place) {
    EmitterPoint p = point_of(choice, place);
    float paths_here = emitter_density(p.index, scene.inverse_power) * float(params.paths); // a square metre
    bool front = true;
    if ((material_of(p).flags & MATERIAL_DOUBLE_SIDED) != 0u) {
        front = v.x < 0.5;
        v.x = front ? 2.0 * v.x : 2.0 * v.x - 1.0;
        paths_here *= 0.5;
    }
    vec3 normal = front ? p.normal : -p.normal;
    return plain_emission(offset_origin(p.position, normal), basis_around(normal) * sample_cosine_hemisphere(v),
                          emitted_at(p, front) * (PI / paths_here));
}

// Of the environment, from the disc that faces the direction.
Emission emit_sky(LightChoice choice, vec2 v, vec2 place, uint path) {
    LightSample s;
    if (GUIDED) {
        Choice way = pick_guide(path, ENVIRONMENT_SOURCE);
        v = within_cell(way, v);
        if (!sample_sky(table_of_all(), v, choice, s)) return plain_emission(vec3(0.0), vec3(0.0), vec3(0.0));
        float paths_here = choice.probability * float(params.paths);
        GuidedStart start = guided_start(way, ENVIRONMENT_SOURCE, v, place, -s.direction, paths_here);
        return guided_emission(start, s.radiance_over_pdf / (float(params.paths) * start.density));
    }
    if (!sample_sky(table_of_all(), v, choice, s)) return plain_emission(vec3(0.0), vec3(0.0), vec3(0.0));
    vec2 disc = scene.scene_radius * sample_disc(place);
    vec3 start = scene.scene_center + scene.scene_radius * s.direction;
    float area = PI * scene.scene_radius * scene.scene_radius;
    return plain_emission(start + basis_around(s.direction) * vec3(disc, 0.0), -s.direction,
                          s.radiance_over_pdf * (area / float(params.paths)));
}

Emission emit(uint path) {
    float u = halton(0u, path + 1u, scene.seed);
    vec2 v = halton_pair(1u, path);
    if (area_lights()) {
        LightTable lights = table_of_all();
        LightChoice choice;
        uint i = choose(lights, u, choice);
        if (is_environment(lights, i)) return emit_sky(choice, v, halton_pair(3u, path), path);
        if (EMISSIVE_TRIANGLES && i >= scene.light_count) return emit(choice, v, halton_pair(3u, path));
        return emit(LightArray(scene.lights)[i].at, choice.probability * float(params.paths), v, path, i);
    }
    uint low = 0u, high = scene.light_count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (LightArray(scene.lights)[middle].at.power_cdf > u) high = middle;
        else low = middle + 1u;
    }
    Light light = LightArray(scene.lights)[low].at;
    float before = low == 0u ? 0.0 : LightArray(scene.lights)[low - 1u].at.power_cdf;
    return emit(light, (light.power_cdf - before) * float(params.paths), v, path, low);
}

// Probability with which roulette lets a path go on, at most: white walls end paths too.
const float MOST_SURVIVAL = 0.9;

// Bounces whose directions are Halton's, if not all are. Points in higher bases are lines for thousands of paths.
const uint HALTON_BOUNCES = 3u;

vec2 bounce_pair(uint bounce, uint path) {
    if (SCRAMBLED && bounce >= HALTON_BOUNCES) return sobol(path, hash(scene.seed, 0x626f756eu, bounce));
    return halton_pair(first_bounce_dimension() + 2u * bounce, path);
}

Split followed_share(Material material, float cos_i, bool front) {
    if (LOBES) return followed(material, cos_i, front);
    return split_light(material, cos_i, front);
}

// How many VPLs it has left.
uint shoot(uint path, inout uint rays) {
    uint bounce = 0u;
    if (scene.light_choice_count > 0u) {
        Emission emission = emit(path);
        vec3 origin = emission.origin, direction = emission.direction, flux = emission.flux;
        float spread = emission.start.spread;
        vec3 absorption = vec3(0.0);
        uint specular = 0u;
        Hit hit;
        while (bounce < params.bounces && flux != vec3(0.0)) {
            ++rays;
            if (!trace_closest(origin, direction, 0.0, 1.0 / 0.0, hit)) break;
            Surface surface = surface_at(hit);
            bool front = face(surface, -direction);
            flux *= transmittance(absorption, distance(origin, surface.position));
            float covered = coverage(surface.material);
            if (covered < 1.0 && unit_float(hash(hash(scene.seed, path), rays)) >= covered) {
                origin = beyond(surface, direction);
                continue;
            }
            float cos_s = max(0.0, -dot(direction, surface.normal));
            float cos_g = -dot(direction, surface.geometric_normal);
            bool pane = is_pane(surface.material);
            vec3 albedo = vpl_albedo(surface.material, min(cos_s, 1.0), front);
            if (LOBES) albedo = scattered_albedo(surface.material, min(cos_s, 1.0), front);
            if ((LOBES || pane) && albedo != vec3(0.0)) {
                Split split = followed_share(surface.material, min(cos_s, 1.0), front);
                float p = sum(albedo) / (sum(albedo) + sum(split.reflected) + sum(split.transmitted));
                bool scatters = unit_float(hash(hash(scene.seed, path), rays, 1u)) < p;
                flux /= scatters ? p : 1.0 - p;
                if (!scatters) albedo = vec3(0.0);
            }
            if (albedo != vec3(0.0)) {
                // The correction makes light paths equal camera paths where normals are interpolated.
                float before = sum(flux);
                flux *= albedo * (cos_g > 0.0 ? cos_s / cos_g : 0.0);
                if (flux == vec3(0.0)) break;
                leave(Vpl(surface.position, path, surface.geometric_normal, bounce, flux, spread));
                vec2 u = bounce_pair(bounce, path);
                direction = basis_around(surface.geometric_normal) * sample_cosine_hemisphere(u);
                float weight = 1.0;
                if (GUIDED && bounce == 0u && emission.start.source != NO_SOURCE) {
                    uint bits = hash(hash(scene.seed, path), 0x6261636bu);
                    direction = guided_bounce(emission.start, surface.position, surface.geometric_normal, u, bits, weight);
                }
                origin = offset_origin(surface.position, surface.geometric_normal);
                ++bounce;
                specular = 0u;
                if (ROULETTE) {
                    float survival = min(sum(flux) / before, MOST_SURVIVAL);
                    flux = unit_float(hash(hash(scene.seed, path), rays, 2u)) < survival ? flux / survival : vec3(0.0);
                }
                flux *= weight;
                spread *= weight;
                continue;
            }
            // Mirrors and glass leave no VPL: the path goes on one way, chosen by its share of the light. Through a pane is
            // no bounce.
            if (!pane && ++specular > scene.specular_depth) break;
            Split split = followed_share(surface.material, min(cos_s, 1.0), front);
            float r = dot(split.reflected, vec3(1.0)), t = dot(split.transmitted, vec3(1.0));
            if (r + t <= 0.0) break;
            float p = r / (r + t);
            if (unit_float(hash(scene.seed, path, rays)) < p) {
                if (pane && ++specular > scene.specular_depth) break;
                flux *= split.reflected / p;
                direction = reflect_above(direction, surface.normal, surface.side_normal);
                origin = leave(surface, direction);
            } else {
                flux *= (pane ? pane_share(surface, direction) : split.transmitted) / (1.0 - p);
                direction = transmit(surface.material, direction, surface.normal, front);
                origin = offset_origin(surface.position, -surface.geometric_normal);
                absorption = absorption_behind(surface.material, front, absorption);
            }
        }
    }
    return bounce;
}

#endif
