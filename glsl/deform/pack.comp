#version 460
#extension GL_GOOGLE_include_directive : require
// Packs sorted triangles into a full tree, eight a node (Kamel and Faloutsos, "On Packing R-trees", 1993): what nodes and
// leaves hold, boxes left to be fitted. Levels lie one after the other, the root first. Children take the slots of the
// octants in which they lie, as traversal wants them.
layout(local_size_x = 64) in;
#include "deform/deform.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Keys { uvec2 at[]; } keys;
layout(set = 1, binding = 1, scalar) readonly buffer Leaves { vec4 word[]; } leaves;
layout(set = 1, binding = 2, scalar) readonly buffer Before { DeformTriangle data[]; } before;
layout(set = 1, binding = 3, scalar) writeonly buffer After { DeformTriangle data[]; } after;
layout(set = 1, binding = 4, scalar) writeonly buffer Nodes { uvec4 word[]; } nodes;
layout(push_constant, scalar) uniform Params {
    uint first;      // triangle of the tree, among leaves
    uint count;      // of its triangles
    uint own;        // its first among those that change shape
    uint first_node; // of a level
    uint level_size; // nodes of that level
    uint span;       // triangles under a full child; 1: children are triangles
} params;

vec3 center_of(uint child, uint span)
{
    uint start = child * span;
    uint middle = start + (min(span, params.count - start) >> 1);
    uint leaf = 3u * (params.first + keys.at[middle].y);
    return (leaves.word[leaf].xyz + leaves.word[leaf + 1u].xyz + leaves.word[leaf + 2u].xyz) / 3.0;
}

// The slots of up to eight children, four bits each.
uint slots_of(uint first_child, uint children, uint span)
{
    vec3 centers[8];
    vec3 mean = vec3(0.0);
    for (uint child = 0u; child < children; ++child) {
        centers[child] = center_of(first_child + child, span);
        mean += centers[child] / float(children);
    }
    uint slots = 0u, placed = 0u, taken = 0u;
    for (uint round = 0u; round < children; ++round) {
        float best = -1.0 / 0.0;
        uint best_child = 0u, best_slot = 0u;
        for (uint child = 0u; child < children; ++child) {
            vec3 off = centers[child] - mean;
            for (uint slot = 0u; slot < 8u; ++slot) {
                if ((placed >> child & 1u) != 0u || (taken >> slot & 1u) != 0u) continue;
                float along = ((slot & 4u) != 0u ? off.x : -off.x) + ((slot & 2u) != 0u ? off.y : -off.y)
                    + ((slot & 1u) != 0u ? off.z : -off.z);
                if (along > best) {
                    best = along;
                    best_child = child;
                    best_slot = slot;
                }
            }
        }
        placed |= 1u << best_child;
        taken |= 1u << best_slot;
        slots |= best_slot << (4u * best_child);
    }
    return slots;
}

uint children_of(uint node, uint span)
{
    uint all = (params.count + span - 1u) / span;
    return min(8u, all - 8u * node);
}

// Where siblings of lower slots leave a node its place.
uint place_of(uint node)
{
    if (params.level_size == 1u) return 0u;
    uint span = 8u * params.span, parent = node / 8u;
    uint children = children_of(parent, span);
    uint slots = slots_of(8u * parent, children, span);
    uint own = slots >> (4u * (node % 8u)) & 15u;
    uint place = 8u * parent;
    for (uint child = 0u; child < children; ++child) {
        if ((slots >> (4u * child) & 15u) < own) ++place;
    }
    return place;
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (params.span == 1u && i < params.count) after.data[params.own + i] = before.data[params.own + keys.at[i].y];
    if (i >= params.level_size) return;
    uint children = children_of(i, params.span);
    uint meta[2] = uint[](0u, 0u);
    uint holds = 0u;
    if (params.span == 1u) {
        for (uint child = 0u; child < children; ++child) {
            meta[child / 4u] |= (0x20u | child) << (8u * (child % 4u));
        }
    } else {
        uint slots = slots_of(8u * i, children, params.span);
        for (uint child = 0u; child < children; ++child) {
            uint slot = slots >> (4u * child) & 15u;
            holds |= 1u << slot;
            meta[slot / 4u] |= (0x38u | slot) << (8u * (slot % 4u));
        }
    }
    uint node = 5u * (params.first_node + place_of(i));
    uint first_child = params.first_node + params.level_size + 8u * i;
    nodes.word[node] = uvec4(0u, 0u, 0u, holds << 24);
    nodes.word[node + 1u] = uvec4(first_child, params.first + 8u * i, meta[0], meta[1]);
    for (uint axis = 0u; axis < 3u; ++axis) nodes.word[node + 2u + axis] = uvec4(0u);
}
