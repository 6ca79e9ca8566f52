#version 460
#extension GL_GOOGLE_include_directive : require
// Of each path how many VPLs lie before it; where each subset of the paths starts among all VPLs, and then among those that
// are kept. One workgroup; a thread takes a run of paths.
#include "lib/scan.glsl"
#extension GL_EXT_scalar_block_layout : require

layout(set = 1, binding = 0, scalar) coherent buffer Tally { uint data[]; } tally;
layout(set = 1, binding = 1, scalar) writeonly buffer Count { uint vpls; uint starts[]; } count;
layout(push_constant) uniform Params { uint paths; uint subsets; uint room; } params;

#include "vpl_shoot/tally.glsl"

const uint MOST_SUBSETS = 9u;
shared uint starts[MOST_SUBSETS + 1u];

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint run = (params.paths + SCAN_THREADS - 1u) / SCAN_THREADS;
    uint first = min(thread * run, params.paths), end = min(first + run, params.paths);
    uint sum = 0u, total;
    for (uint path = first; path < end; ++path) sum += tally.data[path];
    uint before = sum_before(sum, total);
    for (uint path = first; path < end; ++path) {
        uint vpls = tally.data[path];
        tally.data[path] = before;
        before += vpls;
    }
    memoryBarrierBuffer();
    barrier();
    if (thread <= params.subsets) {
        uint path = first_path(thread);
        starts[thread] = path < params.paths ? tally.data[path] : total;
    }
    barrier();
    if (thread != 0u) return;
    uint kept = 0u;
    for (uint s = 0u; s <= params.subsets; ++s) {
        tally.data[start_at(s)] = starts[s];
        tally.data[kept_start_at(s)] = kept;
        count.starts[s] = kept;
        if (s == params.subsets) continue;
        uint all = starts[s + 1u] - starts[s];
        kept += kept_before(all, thinning_of(s, all));
    }
    count.vpls = kept;
}
