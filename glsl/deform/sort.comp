#version 460
#extension GL_GOOGLE_include_directive : require
// A stage of a bitonic sort (Batcher 1968): by keys, equal ones by their places. Steps that fit a workgroup's memory are
// taken at once.
const uint THREADS = 128u;
layout(local_size_x = THREADS) in;
#extension GL_EXT_scalar_block_layout : require

layout(set = 1, binding = 0, scalar) buffer Keys { uvec2 at[]; } keys;
layout(push_constant, scalar) uniform Params { uint pairs; uint size; uint reach; } params;

shared uvec2 near[2u * THREADS];

bool is_out_of_order(uvec2 a, uvec2 b, bool up)
{
    bool greater = a.x > b.x || (a.x == b.x && a.y > b.y);
    return greater == up;
}

void main() {
    uint pair = gl_GlobalInvocationID.x;
    if (params.reach > THREADS) {
        if (pair >= params.pairs) return;
        uint a = 2u * pair - (pair & (params.reach - 1u));
        uint b = a + params.reach;
        uvec2 first = keys.at[a], second = keys.at[b];
        if (is_out_of_order(first, second, (a & params.size) == 0u)) {
            keys.at[a] = second;
            keys.at[b] = first;
        }
        return;
    }
    uint thread = gl_LocalInvocationIndex;
    uint start = 2u * THREADS * gl_WorkGroupID.x;
    bool inside = pair < params.pairs;
    uint own = 2u * thread;
    if (inside) {
        near[own] = keys.at[start + own];
        near[own + 1u] = keys.at[start + own + 1u];
    }
    for (uint reach = params.reach; reach > 0u; reach /= 2u) {
        barrier();
        uint a = 2u * thread - (thread & (reach - 1u));
        if (inside && is_out_of_order(near[a], near[a + reach], ((start + a) & params.size) == 0u)) {
            uvec2 swapped = near[a];
            near[a] = near[a + reach];
            near[a + reach] = swapped;
        }
    }
    barrier();
    if (inside) {
        keys.at[start + own] = near[own];
        keys.at[start + own + 1u] = near[own + 1u];
    }
}
