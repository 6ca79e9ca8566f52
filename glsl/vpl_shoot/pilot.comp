#version 460
#extension GL_GOOGLE_include_directive : require
// Paths from the camera, over the whole picture whatever part of it is drawn, that ask lights infinitely far away at
// each diffuse hit. Each notes one place that such light reaches, as often as it falls there: in proportion to the cosine.
layout(local_size_x = 64) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "lib/lights.glsl"
#include "lib/visibility.glsl"
#include "trace/offset.glsl"
#include "vpl_shoot/guides.glsl"

layout(set = 1, binding = 0, scalar) writeonly buffer Found { Guide data[]; } found;
layout(push_constant, scalar) uniform Params { uint side; } params;

const uint VERTICES = 4u;
const uint ASKED = 4u; // times a vertex
const uint STEPS = 16u;

uint state;
float next() {
    state = hash(state);
    return unit_float(state);
}
vec2 next_pair() {
    float u = next();
    return vec2(u, next());
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.side * params.side) return;
    state = hash(scene.seed, 0x70696c6fu, i);
    vec2 at = vec2(scene.full_size) * (vec2(i % params.side, i / params.side) + next_pair()) / float(params.side);
    uvec2 pixel = uvec2(at);
    Ray ray = camera_ray(pixel - scene.window_origin, at - vec2(pixel));
    Guide guide = Guide(vec3(0.0), NO_SOURCE, vec2(0.0), vec3(0.0), 0.0, 0.0);
    LightTable lights = table_of_all();
    vec3 before = ray.origin;
    uint vertices = 0u, seen = 0u, rays = 0u;
    Hit hit;
    for (uint step = 0u; step < STEPS && vertices < VERTICES; ++step) {
        ++rays;
        if (!trace_closest(ray.origin, ray.direction, 0.0, 1.0 / 0.0, hit)) break;
        Surface surface = surface_at(hit);
        bool front = face(surface, -ray.direction);
        Material material = surface.material;
        if (vertices == 1u && guide.reach == 0.0) guide.reach = distance(ray.origin, surface.position);
        if (max_component(passing(surface, ray.direction)) > 0.5) {
            ray.origin = beyond(surface, ray.direction);
            continue;
        }
        Split split = split_light(material, clamp(-dot(ray.direction, surface.normal), 0.0, 1.0), front);
        float r = sum(split.reflected), t = sum(split.transmitted);
        if (r + t > 0.0 && vpl_albedo(material, 1.0, front) == vec3(0.0)) {
            // The way that most of the light takes.
            if (t > r) ray.direction = transmit(material, ray.direction, surface.normal, front);
            else ray.direction = reflect_above(ray.direction, surface.normal, surface.geometric_normal);
            ray.origin = before = offset_origin(surface.position, (t > r ? -1.0 : 1.0) * surface.geometric_normal);
            continue;
        }
        float edge = vertices == 0u ? 0.0 : distance(before, surface.position);
        ++vertices;
        vec3 from = offset_origin(surface.position, surface.geometric_normal);
        for (uint k = 0u; k < ASKED && lights.count > 0u; ++k) {
            LightChoice choice;
            uint source = choose(lights, next(), choice);
            vec2 v = next_pair();
            float chance = next(), replaces = next();
            vec3 direction = vec3(0.0);
            if (is_environment(lights, source)) {
                uvec2 cell;
                direction = sample_environment(lights, v, cell);
                source = ENVIRONMENT_SOURCE;
            } else if (source < scene.light_count) {
                Light light = LightArray(scene.lights)[source].at;
                if (is_directional(light)) direction = -light.direction;
            }
            float cosine = dot(surface.geometric_normal, direction);
            if (cosine <= chance || cosine <= 0.0) continue;
            if (arriving(vec3(1.0), from, direction, 4.0 * scene.scene_radius, rays) == vec3(0.0)) continue;
            ++seen;
            if (replaces * float(seen) < 1.0) guide = Guide(surface.position, source, v, before, edge, guide.reach);
        }
        ray.direction = basis_around(surface.geometric_normal) * sample_cosine_hemisphere(next_pair());
        ray.origin = before = from;
    }
    found.data[i] = guide;
    count_rays(rays);
}
