// Rays traced, by kernel; only where the host gave an array to count in. Twin: techniques::RAY_COUNTERS.
#ifndef LIB_COUNTERS_GLSL
#define LIB_COUNTERS_GLSL

#include "shared/scene.glsl"

const uint COUNT_VPL_SHOOT = 0u;
const uint COUNT_GBUFFER = 1u;
const uint COUNT_DIRECT = 2u;
const uint COUNT_SPECULAR_TREE = 3u;
const uint COUNT_SPECULAR_LIGHT = 4u;
const uint COUNT_GATHER = 5u;
const uint COUNT_REGATHER = 6u;
const uint COUNT_PATH_TRACE = 7u;
const uint COUNT_GLOSSY = 8u;
const uint COUNT_COMPENSATE = 9u;
const uint COUNTER_LANES = 256u; // spread over cells: less contention, and no overflow of 32 bits

void count_rays(uint counter, uint rays) {
    if (scene.ray_counters == 0UL) return;
    uint lane = (gl_WorkGroupID.x + gl_WorkGroupID.y * 37u) % COUNTER_LANES;
    atomicAdd(CounterArray(scene.ray_counters)[counter * COUNTER_LANES + lane].at, rays);
}

#endif
