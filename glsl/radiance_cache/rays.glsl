// Rays from a surface to others, whose light the cache knows. They bring what VPLs leave out: of the diffuse part light from
// what is nearer than bounding allows, of glossy lobes all, and whatever comes by way of mirrors and glass.
#ifndef RADIANCE_CACHE_RAYS_GLSL
#define RADIANCE_CACHE_RAYS_GLSL

#include "indirect/bounding.glsl"
#include "lib/bsdf.glsl"
#include "lib/albedo.glsl"
#include "lib/lights.glsl"
#include "lib/media.glsl"
#include "lib/receiver.glsl"
#include "lib/sheer.glsl"
#include "radiance_cache/shares.glsl"
#include "trace/trace.glsl"

// What a ray ends at.
struct End {
    bool found;
    Surface surface;
    bool front;
    bool bent;     // mirrors or glass led there
    vec3 weight;   // of its irradiance
    vec3 radiance; // that the ray found on its way, by way of mirrors and glass alone
    vec3 sky;      // that comes from the environment straight, which lights are asked for, too
    float way;     // m, all of it
    float spread;  // of the lobe, as a slope
};

const uint SET_DIFFUSE = 0u;
const uint SET_LOBE = 1u;
const uint SET_LOBE_CHOICE = 2u;
const uint SET_CHOICE = 3u;
const uint SET_LIGHT = 4u;

struct Sender {
    Surface surface;
    GlossySurface glossy;
    Layers lobes;      // alone
    uint diffuse_rays; // the first of all
    uint lobe_rays;
};

Sender sender_of(Surface surface, bool front, vec3 to_viewer, uint rays, bool diffuse) {
    Sender s;
    s.surface = surface;
    if (GLOSSY) s.glossy = glossy_surface(surface, front, to_viewer);
    Shares shares = shares_of(s.glossy, rays, diffuse);
    s.diffuse_rays = shares.diffuse;
    s.lobe_rays = shares.lobe;
    if (GLOSSY && shares.lobe > 0u) s.lobes = layers_of(s.glossy.surface, front, to_viewer, LOBE_GLOSSY);
    return s;
}

// Ray `i`. `weight`: of irradiance over π, or by a lobe f·cosθ over its density; `spread`: of the lobe, as a slope.
bool send(Sender s, uint i, uint seed, out vec3 origin, out vec3 direction, out vec3 weight, out float spread) {
    weight = vec3(1.0);
    spread = 0.25;
    if (GLOSSY && i >= s.diffuse_rays) {
        uint j = i - s.diffuse_rays;
        BsdfSample b;
        vec3 u = vec3(sobol(j, hash(seed, SET_LOBE)), sobol(j, hash(seed, SET_LOBE_CHOICE)).x);
        if (!sample_layers(s.glossy.surface, s.glossy.front, s.glossy.to_viewer, u, LOBE_GLOSSY, s.lobes, b)) return false;
        direction = b.direction;
        weight = b.weight;
        spread = clamp(s.glossy.layers.alpha, 0.02, 0.25);
    } else {
        // Density cosθ/π.
        direction = basis_around(s.surface.normal) * sample_cosine_hemisphere(sobol(i, hash(seed, SET_DIFFUSE)));
        if (dot(s.surface.side_normal, direction) <= 0.0) return false;
    }
    origin = leave(s.surface, direction);
    return true;
}

// Emission of what a ray meets first.
vec3 emission_along(vec3 origin, vec3 direction, inout uint rays) {
    Hit hit;
    ++rays;
    if (!trace_closest(origin, direction, 0.0, 1.0 / 0.0, hit)) return ENVIRONMENT ? environment_radiance(direction) : vec3(0.0);
    Surface s = surface_at(hit);
    bool front = face(s, -direction);
    if ((s.material.flags & MATERIAL_UNLIT) != 0u) return vec3(0.0);
    return coverage(s.material) * emitted_radiance(s.material, front);
}

// Follows a ray to a surface that scatters light. `m`: the distance that bounds VPLs (m); 0 where nothing is left to them.
// `sky`: whether the environment is looked for.
End follow(vec3 origin, vec3 direction, bool lobe, bool sky, float m, uint seed, inout uint rays) {
    End end;
    end.found = false;
    end.weight = vec3(0.0);
    end.radiance = vec3(0.0);
    end.sky = vec3(0.0);
    end.way = 0.0;
    end.spread = 0.0;
    bool far = lobe || sky;
    if (MIRRORS || GLASS) far = true;
    float reach = far ? 1.0 / 0.0 : 1.2 * m;
    vec3 throughput = vec3(1.0), absorption = vec3(0.0);
    uint specular = 0u, met = 0u;
    bool bent = false, going = true; // by a mirror or glass
    bool known = false;              // what the next surface emits
    while (going) {
        Hit hit;
        ++rays;
        if (!trace_closest(origin, direction, 0.0, reach, hit)) {
            if (ENVIRONMENT && bent && !known) end.radiance += throughput * environment_radiance(direction);
            if (ENVIRONMENT && sky && !bent) end.sky = throughput * environment_radiance(direction);
            going = false;
            continue;
        }
        Surface s = surface_at(hit);
        bool front = face(s, -direction);
        float away = distance(origin, s.position);
        end.way += away;
        reach -= away;
        throughput *= transmittance(absorption, away);
        float covered = coverage(s.material);
        ++met;
        bool counts = bent && !known;
        known = false;
        if (covered < 1.0 && unit_float(hash(seed, met)) >= covered) {
            origin = beyond(s, direction);
            continue;
        }
        if (counts && (s.material.flags & MATERIAL_UNLIT) == 0u) end.radiance += throughput * emitted_radiance(s.material, front);
        float cos_i = clamp(-dot(s.normal, direction), 0.0, 1.0);
        Split split = followed(s.material, cos_i, front);
        vec3 albedo = scattered_albedo(s.material, cos_i, front);
        bool pane = is_pane(s.material);
        vec3 through = pane ? pane_share(s, direction) : split.transmitted;
        // Light that VPLs bring does not count.
        float left = 1.0;
        if (!lobe && !bent) left = m > 0.0 ? 1.0 - bounded(end.way, m) : 0.0;
        float a = left > 0.0 ? sum(albedo) : 0.0, r = sum(split.reflected), t = sum(through);
        if (a + r + t <= 0.0) {
            going = false;
            continue;
        }
        // A lamp in a coat that reflects little is too bright to be found as seldom as the coat is chosen.
        if (r > 0.0 && r < a + r + t && specular < scene.specular_depth) {
            vec3 mirrored = reflect_above(direction, s.normal, s.side_normal);
            vec3 share = throughput * split.reflected;
            end.radiance += share * emission_along(leave(s, mirrored), mirrored, rays);
            known = true;
        }
        float u = unit_float(hash(seed, met, 1u)) * (a + r + t);
        if (u < a) {
            end.found = true;
            end.surface = s;
            end.front = front;
            end.bent = bent;
            end.weight = throughput * albedo * (left * (a + r + t) / a);
            going = false;
        } else if (u < a + r) {
            throughput *= split.reflected * ((a + r + t) / r);
            direction = reflect_above(direction, s.normal, s.side_normal);
            origin = leave(s, direction);
            bent = true;
            going = ++specular <= scene.specular_depth;
        } else {
            known = false;
            throughput *= through * ((a + r + t) / t);
            if (pane) {
                origin = beyond(s, direction);
            } else {
                direction = transmit(s.material, direction, s.normal, front);
                origin = offset_origin(s.position, -s.geometric_normal);
                absorption = absorption_behind(s.material, front, absorption);
                bent = true;
                going = ++specular <= scene.specular_depth;
            }
        }
        if (bent) reach = 1.0 / 0.0;
    }
    return end;
}

#endif
