// How many VPLs paths leave, and where subsets of them, equal runs of paths, start. Expects `params.paths`,
// `params.subsets` and `params.room`. One array holds, in this order, the VPLs of each path, and later how many lie before it; where each
// subset starts among all VPLs and the last one ends; the same among those that are kept.
#ifndef VPL_SHOOT_TALLY_GLSL
#define VPL_SHOOT_TALLY_GLSL

#include "lib/sampling.glsl"
#include "shared/scene.glsl"

uint start_at(uint subset) { return params.paths + subset; }
uint kept_start_at(uint subset) { return start_at(params.subsets + 1u + subset); }

// The first path of a subset; of the one past the last, the number of paths.
uint first_path(uint subset) {
    return subset * (params.paths / params.subsets) + min(subset, params.paths % params.subsets);
}

uint subset_of(uint path) {
    uint subset = 0u;
    for (uint s = 1u; s < params.subsets; ++s) {
        if (first_path(s) <= path) subset = s;
    }
    return subset;
}

// Which of a subset's VPLs are kept.
struct Thinning {
    uint share; // times 2³²; 0: all
    uint shift;
};

const float WHOLE = 4294967296.0;

Thinning thinning_of(uint subset, uint all) {
    // A hair less, so that rounding keeps no more than there is room for.
    uint share = all > params.room ? uint(float(params.room) / float(all) * 0.999999 * WHOLE) : 0u;
    return Thinning(share, hash(scene.seed, 0x6c697374u, subset));
}

// Of the VPLs before one those that are.
uint kept_before(uint at, Thinning t) {
    if (t.share == 0u) return at;
    uint high, low, carry;
    umulExtended(at, t.share, high, low);
    uaddCarry(low, t.shift, carry);
    return high + carry;
}

#endif
