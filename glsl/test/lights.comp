#version 460
#extension GL_GOOGLE_include_directive : require
// Samples lights at a point, and asks for the density and the radiance of what a ray along the sample finds.
layout(local_size_x = 64) in;
#include "lib/lights.glsl"
#include "trace/trace.glsl"

struct LightAnswer {
    vec3 direction;
    float distance;
    vec3 radiance_over_pdf;
    float pdf;
    vec3 radiance; // found by the ray
    float ray_pdf;
    float ray_distance; // infinite: the ray leaves the scene
    uint flags;         // 1: there is a sample, 2: it is a delta light's
    uint primitive;     // that the ray hit
    vec2 barycentrics;
};

layout(set = 1, binding = 0, scalar) readonly buffer Numbers { vec3 data[]; } numbers;
layout(set = 1, binding = 1, scalar) writeonly buffer Answers { LightAnswer data[]; } answers;
layout(push_constant, scalar) uniform Params { vec3 from; uint count; uint beside_lobes; } params;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count) return;
    LightSample s;
    LightTable lights = table_of_all();
    bool found;
    if (params.beside_lobes == 0u) {
        found = sample_light(params.from, numbers.data[i], s);
    } else {
        lights = table_beside_lobes();
        found = sample_area_light(lights, params.from, numbers.data[i], s);
    }
    LightAnswer answer = LightAnswer(s.direction, s.distance, s.radiance_over_pdf, s.pdf, vec3(0.0), 0.0, 1.0 / 0.0,
                                     (found ? 1u : 0u) | (s.delta ? 2u : 0u), 0u, vec2(0.0));
    Hit hit;
    if (found && trace_closest(params.from, s.direction, 0.0, 1.0 / 0.0, hit)) {
        Surface surface = surface_at(hit);
        bool front = face(surface, -s.direction);
        answer.radiance = emitted_radiance(surface.material, front);
        answer.ray_pdf = light_pdf(lights, hit, surface, front, -s.direction, hit.t);
        answer.ray_distance = hit.t;
        answer.primitive = hit.primitive;
        answer.barycentrics = hit.barycentrics;
    } else if (found && !s.delta) {
        answer.radiance = environment_radiance(s.direction);
        answer.ray_pdf = environment_pdf(lights, s.direction);
    }
    answers.data[i] = answer;
}
