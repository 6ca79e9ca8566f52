#version 460
#extension GL_GOOGLE_include_directive : require
// Evaluates and samples materials on a plane whose geometric normal is +Z.
layout(local_size_x = 64) in;
#include "lib/bsdf.glsl"

struct BsdfQuery {
    vec3 wo;
    uint front;
    vec3 wi;
    uint lobes;
    vec3 u;
    uint material;
    vec3 normal;
    vec3 clearcoat_normal;
};

struct BsdfAnswer {
    vec3 f; // at wi
    float pdf;
    vec3 diffuse;
    uint found; // the sample is one
    vec3 direction;
    float sample_pdf;
    vec3 weight;
    uint lobe;
    vec3 sample_f; // at the sample's direction
    float eta;
};

layout(set = 1, binding = 0, scalar) readonly buffer Materials { Material data[]; } materials;
layout(set = 1, binding = 1, scalar) readonly buffer Queries { BsdfQuery data[]; } queries;
layout(set = 1, binding = 2, scalar) writeonly buffer Answers { BsdfAnswer data[]; } answers;
layout(push_constant) uniform Params { uint count; } params;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count) return;
    BsdfQuery q = queries.data[i];
    Surface s = Surface(vec3(0.0), vec3(0.0, 0.0, 1.0), q.normal, q.clearcoat_normal, vec3(0.0, 0.0, 1.0), vec2(0.0),
                        materials.data[q.material]);
    bool front = q.front != 0u;
    BsdfSample b;
    uint found = bsdf_sample(s, front, q.wo, q.u, q.lobes, b) ? 1u : 0u;
    vec3 sample_f = found == 1u ? bsdf_evaluate(s, front, q.wo, b.direction, q.lobes) : vec3(0.0);
    answers.data[i] =
        BsdfAnswer(bsdf_evaluate(s, front, q.wo, q.wi, q.lobes), bsdf_pdf(s, front, q.wo, q.wi, q.lobes),
                   bsdf_diffuse(s, front, q.wo), found, b.direction, b.pdf, b.weight, b.lobe, sample_f, b.eta);
}
