#version 460
#extension GL_GOOGLE_include_directive : require
// Keeps as many VPLs of each subset as there is room for, each with a probability in proportion to its weight, by which its
// flux is divided (systematic sampling; Georgiev & Slusallek 2010). Unless paths are guided, all that matter more than the mean
// are as likely: paths are spread evenly, and unequal flux would undo that. A share goes to all alike: points that weights are
// of are few. Weights are in steps, so that rounding changes hardly any choice. One workgroup; a thread takes a run of VPLs.
#include "lib/scan.glsl"
#include "lib/sampling.glsl"
#include "shared/scene.glsl"
#include "shared/types.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Candidates { Vpl data[]; } candidates;
layout(set = 1, binding = 1, scalar) readonly buffer Found { uint vpls; uint starts[]; } found;
layout(set = 1, binding = 2, scalar) buffer Weights { float data[]; } weights;
layout(set = 1, binding = 3, scalar) writeonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 4, scalar) writeonly buffer Count { uint vpls; uint starts[]; } count;
layout(push_constant, scalar) uniform Params { uint subsets; uint room; } params;

const float ALIKE = 0.5;
const uint ROUNDS = 4u;

layout(constant_id = 0) const bool GUIDED = false;

// `weight`: in means.
float in_steps(float weight) {
    if (!GUIDED) return round(32.0 * mix(min(weight, 1.0), 1.0, ALIKE)) / 32.0;
    // Each step four times as high as the one below, and none near the mean.
    weight = mix(weight, 1.0, ALIKE);
    return weight < 0.75 ? ALIKE : exp2(2.0 * floor(0.5 * log2(weight / 0.75)));
}

// Probabilities are numbers of these, so that threads agree on the place of each VPL.
const uint WHOLE = 65536u;

shared vec2 sums[SCAN_THREADS];

// The sum of all threads' values.
vec2 sum_of(vec2 value) {
    uint thread = gl_LocalInvocationIndex;
    sums[thread] = value;
    barrier();
    for (uint half_of = SCAN_THREADS / 2u; half_of > 0u; half_of /= 2u) {
        if (thread < half_of) sums[thread] += sums[thread + half_of];
        barrier();
    }
    vec2 total = sums[0];
    barrier();
    return total;
}

uint probability(float weight, float scale) { return clamp(uint(weight * scale * float(WHOLE)), 1u, WHOLE); }

void main() {
    uint thread = gl_LocalInvocationIndex, kept = 0u;
    for (uint s = 0u; s < params.subsets; ++s) {
        uint start = found.starts[s], all = found.starts[s + 1u] - start;
        uint run = (all + SCAN_THREADS - 1u) / SCAN_THREADS;
        uint first = start + min(thread * run, all), end = start + min((thread + 1u) * run, all);
        float sum = 0.0;
        for (uint k = first; k < end; ++k) sum += weights.data[k];
        float mean = sum_of(vec2(sum)).x / float(max(all, 1u));
        for (uint k = first; k < end; ++k) {
            weights.data[k] = in_steps(mean > 0.0 ? weights.data[k] / mean : 1.0);
        }
        float scale = 0.0;
        // So that as many are kept as there is room for; what the certain ones have too much of goes to the others.
        for (uint round = 0u; round < ROUNDS; ++round) {
            vec2 parts = vec2(0.0);
            for (uint k = first; k < end; ++k) {
                float weight = weights.data[k];
                parts += weight * scale >= 1.0 ? vec2(0.0, 1.0) : vec2(weight, 0.0);
            }
            parts = sum_of(parts);
            if (parts.x > 0.0) scale = max(scale, (float(params.room) - parts.y) / parts.x);
        }
        if (all <= params.room) scale = float(WHOLE) / ALIKE;
        uint share = 0u, total;
        for (uint k = first; k < end; ++k) share += probability(weights.data[k], scale);
        uint shift = hash(scene.seed, 0x61636370u, s) & (WHOLE - 1u);
        uint at = sum_before(share, total) + shift;
        total += shift;
        for (uint k = first; k < end; ++k) {
            share = probability(weights.data[k], scale);
            uint place = at / WHOLE;
            at += share;
            if (at / WHOLE == place) continue;
            vpls.data[kept + place] = for_all(candidates.data[k], float(WHOLE) / float(share));
        }
        if (thread == 0u) count.starts[s] = kept;
        kept += total / WHOLE;
    }
    if (thread != 0u) return;
    count.starts[params.subsets] = kept;
    count.vpls = kept;
}
