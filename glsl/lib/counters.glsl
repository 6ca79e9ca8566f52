// Rays traced, by kernel; only where the host gave an array to count in. A kernel that includes this is a counter of
// shaders::RAY_COUNTERS, of which build.rs gives it the index as RAY_COUNTER.
#ifndef LIB_COUNTERS_GLSL
#define LIB_COUNTERS_GLSL

#include "shared/scene.glsl"

const uint COUNTER_LANES = 256u; // cells of 64 bits that a counter is spread over: less contention

void count_rays(uint rays) {
    if (scene.ray_counters == 0UL) return;
    uint lane = (gl_WorkGroupID.x + gl_WorkGroupID.y * 37u) % COUNTER_LANES;
    CounterArray cell = CounterArray(scene.ray_counters) + 2u * (RAY_COUNTER * COUNTER_LANES + lane);
    // The high word takes the carry: 64-bit atomics are not everywhere.
    uint before = atomicAdd(cell[0].at, rays);
    if (before + rays < before) atomicAdd(cell[1].at, 1u);
}

#endif
