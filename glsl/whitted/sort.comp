#version 460
#extension GL_GOOGLE_include_directive : require
// Brings the listed points into an order in which neighbours are close in space: behind curved mirrors neighbours in
// the picture are not, and rays from one light to far-off points go separate ways. A counting sort in one workgroup, by
// cells of the points' bounding box. The order never shows. Says how many threads share a point, too.
#include "lib/scan.glsl"
#include "shared/profile.glsl"
#include "shared/scene.glsl"
#include "whitted/reached.glsl"

layout(set = 1, binding = 0, scalar) buffer Args { PointArgs at; } args;
layout(set = 1, binding = 1, scalar) readonly buffer Points { Reached data[]; } points;
layout(set = 1, binding = 2, scalar) writeonly buffer Order { uint at[]; } order;
layout(set = 1, binding = 3, scalar) readonly buffer Count { uint vpls; } count;
layout(push_constant, scalar) uniform Params { uint capacity; uint room; uint range; } params;

const uvec3 CELLS = uvec3(22u, 7u, 22u); // rooms are low
const uint SHARE = 14u;
const uint BINS = SHARE * SCAN_THREADS; // at least as many as cells; with the rest below 16 KiB, which every device has

shared uint bins[BINS];
shared uint least[3];
shared uint most[3];

// Unsigned integers in the order of the floats.
uint ordered(float v) {
    uint bits = floatBitsToUint(v);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

float unordered(uint v) { return uintBitsToFloat((v & 0x80000000u) != 0u ? v & 0x7fffffffu : ~v); }

uint bin_of(uint point) {
    vec3 low = vec3(unordered(least[0]), unordered(least[1]), unordered(least[2]));
    vec3 high = vec3(unordered(most[0]), unordered(most[1]), unordered(most[2]));
    vec3 at = (points.data[point].position - low) / max(high - low, vec3(1e-30));
    uvec3 cell = min(uvec3(at * vec3(CELLS)), CELLS - 1u);
    // To and fro, so that neighbouring bins are neighbours in space.
    uint x = (cell.z & 1u) == 0u ? cell.x : CELLS.x - 1u - cell.x;
    uint y = (x & 1u) == 0u ? cell.y : CELLS.y - 1u - cell.y;
    return (cell.z * CELLS.x + x) * CELLS.y + y;
}

// How many of `sources`, those of the widest range, a thread takes, for a list so long: one, a group or all. To read a
// glossy surface takes longer than a ray.
uint share_of(uint listed, uint sources) {
    if (!GLOSSY && listed <= params.room / sources) return 1u;
    return listed <= params.room / ((sources + GROUP - 1u) / GROUP) ? GROUP : sources;
}

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint listed = min(args.at.count, params.capacity);
    if (thread == 0u) {
        uint widest = min(params.range, source_count(count.vpls));
        args.at.share = share_of(listed, max(widest, 1u));
        args.at.light.y = (widest + args.at.share - 1u) / args.at.share;
        args.at.collect = uvec3(args.at.light.xz, 1u);
    }
    if (thread < 3u) {
        least[thread] = 0xffffffffu;
        most[thread] = 0u;
    }
    for (uint bin = thread; bin < BINS; bin += SCAN_THREADS) bins[bin] = 0u;
    barrier();
    vec3 low = vec3(1.0 / 0.0), high = -low;
    for (uint point = thread; point < listed; point += SCAN_THREADS) {
        vec3 position = points.data[point].position;
        low = min(low, position);
        high = max(high, position);
    }
    for (int axis = 0; axis < 3; ++axis) {
        atomicMin(least[axis], ordered(low[axis]));
        atomicMax(most[axis], ordered(high[axis]));
    }
    barrier();
    for (uint point = thread; point < listed; point += SCAN_THREADS) atomicAdd(bins[bin_of(point)], 1u);
    barrier();

    uint first = thread * SHARE, sum = 0u, total;
    for (uint bin = first; bin < first + SHARE; ++bin) sum += bins[bin];
    uint start = sum_before(sum, total);
    for (uint bin = first; bin < first + SHARE; ++bin) {
        uint size = bins[bin];
        bins[bin] = start;
        start += size;
    }
    barrier();
    for (uint point = thread; point < listed; point += SCAN_THREADS) order.at[atomicAdd(bins[bin_of(point)], 1u)] = point;
}
