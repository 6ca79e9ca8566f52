#version 460
#extension GL_GOOGLE_include_directive : require
// One light path a thread; a VPL in a fixed slot at every diffuse hit. Flux 0 marks a gap.
layout(local_size_x = 64) in;
#include "lib/counters.glsl"
#include "shared/types.glsl"
#include "vpl_shoot/guides.glsl"

layout(set = 1, binding = 0, scalar) writeonly buffer Slots { Vpl data[]; } slots;
layout(set = 1, binding = 1, scalar) readonly buffer Guides { uint count; float radius; Guide data[]; } guides;
layout(push_constant, scalar) uniform Params { uint paths; uint bounces; } params;

const bool ROULETTE = false;
layout(constant_id = 2) const bool SCRAMBLED = false;
#include "vpl_shoot/path.glsl"

void leave(Vpl vpl) { slots.data[vpl.path * params.bounces + vpl.bounce] = vpl; }

void main() {
    uint path = gl_GlobalInvocationID.x;
    if (path >= params.paths) return;
    Vpl gap = Vpl(vec3(0.0), path, vec3(0.0), 0u, vec3(0.0), 0.0);
    uint rays = 0u;
    for (uint bounce = shoot(path, rays); bounce < params.bounces; ++bounce) {
        slots.data[path * params.bounces + bounce] = gap;
    }
    count_rays(rays);
}
