#version 460
#extension GL_GOOGLE_include_directive : require
// One light path a thread. Counts the VPLs of each path; run again, lists them in order. Both are one kernel: two might round
// differently and then not find the same paths. Of a subset with more VPLs than there is room for as many are kept as fit,
// each with the same probability, by which its flux is divided (systematic sampling).
layout(local_size_x = 64) in;
#include "lib/counters.glsl"
#include "shared/types.glsl"
#include "vpl_shoot/guides.glsl"

layout(set = 1, binding = 0, scalar) buffer Tally { uint data[]; } tally;
layout(set = 1, binding = 1, scalar) writeonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 2, scalar) readonly buffer Guides { uint count; float radius; Guide data[]; } guides;
layout(push_constant, scalar) uniform Params { uint paths; uint bounces; uint subsets; uint room; uint lists; } params;

#include "vpl_shoot/tally.glsl"

const bool ROULETTE = true, SCRAMBLED = true;
#include "vpl_shoot/path.glsl"

uint place = 0u; // of the next VPL in its subset, before any is left out
uint start = 0u; // of the subset in the list
Thinning thinning;

void leave(Vpl vpl) {
    if (params.lists == 0u) return;
    uint kept = kept_before(place, thinning);
    bool keep = kept_before(place + 1u, thinning) != kept;
    if (thinning.share != 0u) vpl = for_all(vpl, WHOLE / float(thinning.share));
    if (keep) vpls.data[start + kept] = vpl;
    ++place;
}

void main() {
    uint path = gl_GlobalInvocationID.x, rays = 0u;
    if (path >= params.paths) return;
    if (params.lists != 0u) {
        uint subset = subset_of(path);
        uint first = tally.data[start_at(subset)];
        uint all = tally.data[start_at(subset + 1u)] - first;
        place = tally.data[path] - first;
        start = tally.data[kept_start_at(subset)];
        thinning = thinning_of(subset, all);
    }
    uint vpls_here = shoot(path, rays);
    count_rays(rays);
    if (params.lists == 0u) tally.data[path] = vpls_here;
}
