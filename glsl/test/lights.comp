#version 460
#extension GL_GOOGLE_include_directive : require
// Samples lights at a receiver, and asks for the density and the radiance of what a ray along the sample finds.
layout(local_size_x = 64) in;
#include "lib/light_sampler.glsl"
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
layout(push_constant, scalar) uniform Params { vec3 from; uint count; vec3 normal; uint set; } params;

const uint SET_ALL = 0u;
const uint SET_SAMPLED = 1u;
const uint SET_BESIDE_LOBES = 2u;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count) return;
    LightSample s;
    LightSource lights = all_lights();
    if (params.set == SET_SAMPLED) lights = sampled_lights();
    if (params.set == SET_BESIDE_LOBES) lights = lights_beside_lobes();
    // Without a normal both sides count.
    bool through = params.normal == vec3(0.0);
    Receiver x = Receiver(params.from, params.normal, params.normal, params.normal, 0.0);
    bool found = sample_light(lights, x, through, params.from, numbers.data[i], s);
    LightAnswer answer = LightAnswer(s.direction, s.distance, s.radiance_over_pdf, s.pdf, vec3(0.0), 0.0, 1.0 / 0.0,
                                     (found ? 1u : 0u) | (s.delta ? 2u : 0u), 0u, vec2(0.0));
    Hit hit;
    if (found && trace_closest(params.from, s.direction, 0.0, 1.0 / 0.0, hit)) {
        Surface surface = surface_at(hit);
        bool front = face(surface, -s.direction);
        answer.radiance = emitted_radiance(surface.material, front);
        answer.ray_pdf = light_pdf(lights, x, through, params.from, hit, surface, front, -s.direction, hit.t);
        answer.ray_distance = hit.t;
        answer.primitive = hit.primitive;
        answer.barycentrics = hit.barycentrics;
    } else if (found && !s.delta) {
        answer.radiance = environment_radiance(s.direction);
        answer.ray_pdf = environment_pdf(lights, s.direction);
    }
    answers.data[i] = answer;
}
