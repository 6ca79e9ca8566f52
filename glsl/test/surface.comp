#version 460
#extension GL_GOOGLE_include_directive : require
// What surface_at makes of given hits.
layout(local_size_x = 64) in;
#include "lib/surface.glsl"

struct SurfaceQuery {
    uint instance;
    uint primitive;
    vec2 barycentrics;
};

struct SurfaceAnswer {
    vec3 position;
    vec3 geometric_normal;
    vec3 normal;
    vec3 clearcoat_normal;
    Material material;
};

layout(set = 1, binding = 0, scalar) readonly buffer Queries { SurfaceQuery data[]; } queries;
layout(set = 1, binding = 1, scalar) writeonly buffer Answers { SurfaceAnswer data[]; } answers;
layout(push_constant) uniform Params { uint count; } params;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count) return;
    SurfaceQuery q = queries.data[i];
    Surface s = surface_at(Hit(0.0, q.instance, q.primitive, q.barycentrics));
    answers.data[i] = SurfaceAnswer(s.position, s.geometric_normal, s.normal, s.clearcoat_normal, s.material);
}
