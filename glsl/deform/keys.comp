#version 460
#extension GL_GOOGLE_include_directive : require
// Where triangles lie along a Hilbert curve through their tree's box, with their places in the tree.
layout(local_size_x = 64) in;
#include "deform/deform.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Leaves { vec4 word[]; } leaves;
layout(set = 1, binding = 1, scalar) readonly buffer Boxes { NodeBox data[]; } boxes;
layout(set = 1, binding = 2, scalar) writeonly buffer Keys { uvec2 at[]; } keys;
layout(push_constant, scalar) uniform Params { uint first; uint count; uint room; uint root; } params;

const uint BITS = 10u;

// Skilling, "Programming the Hilbert curve" (2004), three dimensions.
uint hilbert(uvec3 at)
{
    for (uint q = 1u << (BITS - 1u); q > 1u; q >>= 1) {
        uint p = q - 1u;
        for (int axis = 0; axis < 3; ++axis) {
            if ((at[axis] & q) != 0u) {
                at.x ^= p;
            } else {
                uint t = (at.x ^ at[axis]) & p;
                at.x ^= t;
                at[axis] ^= t;
            }
        }
    }
    at.y ^= at.x;
    at.z ^= at.y;
    uint t = 0u;
    for (uint q = 1u << (BITS - 1u); q > 1u; q >>= 1) {
        if ((at.z & q) != 0u) t ^= q - 1u;
    }
    at ^= uvec3(t);
    uint key = 0u;
    for (uint bit = BITS; bit-- > 0u;) {
        key = key << 3 | ((at.x >> bit & 1u) << 2) | ((at.y >> bit & 1u) << 1) | (at.z >> bit & 1u);
    }
    return key;
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.room) return;
    uint key = 0xffffffffu;
    if (i < params.count) {
        uint leaf = 3u * (params.first + i);
        vec4 a = leaves.word[leaf];
        vec4 b = leaves.word[leaf + 1u];
        vec4 c = leaves.word[leaf + 2u];
        vec3 center = (min(a.xyz, min(b.xyz, c.xyz)) + max(a.xyz, max(b.xyz, c.xyz))) * 0.5;
        NodeBox box = boxes.data[params.root];
        vec3 size = box.high - box.low;
        float widest = max(size.x, max(size.y, size.z));
        vec3 at = widest > 0.0 ? (center - box.low) / widest : vec3(0.0);
        float cells = float(1u << BITS);
        key = hilbert(uvec3(clamp(at * cells, vec3(0.0), vec3(cells - 1.0))));
    }
    keys.at[i] = uvec2(key, i);
}
