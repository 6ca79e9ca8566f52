#version 460
#extension GL_GOOGLE_include_directive : require
// Fits nodes whose children are all fitted to what they hold, so that each decoded box contains it. Twin:
// accel::software::requantise, bit for bit.
layout(local_size_x = 64) in;
#include "deform/deform.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Order { uint node[]; } order;
layout(set = 1, binding = 1, scalar) readonly buffer Leaves { vec4 word[]; } leaves;
layout(set = 1, binding = 2, scalar) buffer Nodes { uvec4 word[]; } nodes;
layout(set = 1, binding = 3, scalar) buffer Boxes { NodeBox data[]; } boxes;
layout(set = 1, binding = 4, scalar) writeonly buffer Costs { float at[]; } costs;
layout(push_constant, scalar) uniform Params { uint first; uint count; uint first_node; } params;

// a - b without error: the second is what the first lacks (Knuth).
vec2 difference(float a, float b)
{
    precise float d = a - b;
    precise float back = d - a;
    precise float error = (a - (d - back)) - (b + back);
    return vec2(d, error);
}

float cell_of(uint exponent) { return uintBitsToFloat(exponent << 23); }

// The biased exponent of the smallest power of two of which 255 reach over an extent, at least 2^-100.
uint grid_exponent(vec2 extent)
{
    float at_least = extent.y > 0.0 ? uintBitsToFloat(floatBitsToUint(extent.x) + 1u) : extent.x;
    uint exponent = uint(max(int(floatBitsToUint(at_least) >> 23) - 8, 27));
    while (exponent < 254u && cell_of(exponent) * 255.0 < at_least) ++exponent;
    return exponent;
}

// Products by powers of two are exact, quotients need not be.
float in_cells(float d, uint exponent) { return d * uintBitsToFloat((254u - exponent) << 23); }

uint steps_down(vec2 d, uint exponent)
{
    float cells = in_cells(d.x, exponent);
    float steps = floor(cells);
    if (d.y < 0.0 && steps == cells) steps -= 1.0;
    return uint(clamp(steps, 0.0, 255.0));
}

uint steps_up(vec2 d, uint exponent)
{
    float cells = in_cells(d.x, exponent);
    float steps = ceil(cells);
    if (d.y > 0.0 && steps == cells) steps += 1.0;
    return uint(clamp(steps, 0.0, 255.0));
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= params.count) return;
    uint node = order.node[params.first + i];
    uvec4 n0 = nodes.word[5u * node];
    uvec4 n1 = nodes.word[5u * node + 1u];
    uint holds = n0.w >> 24;
    NodeBox children[8];
    NodeBox all = NodeBox(vec3(1.0 / 0.0), vec3(-1.0 / 0.0));
    float cost = 0.0;
    for (uint slot = 0u; slot < 8u; ++slot) {
        uint meta = (n1[2u + slot / 4u] >> (8u * (slot % 4u))) & 0xffu;
        if (meta == 0u) continue;
        NodeBox box;
        if ((holds >> slot & 1u) != 0u) {
            uint child = n1.x + bitCount(holds & ((1u << slot) - 1u));
            box = boxes.data[child - params.first_node];
        } else {
            box = NodeBox(vec3(1.0 / 0.0), vec3(-1.0 / 0.0));
            uint count = bitCount(meta >> 5), first = 3u * (n1.y + (meta & 31u));
            for (uint word = first; word < first + 3u * count; ++word) {
                vec4 at = leaves.word[word];
                box.low = min(box.low, at.xyz);
                box.high = max(box.high, at.xyz);
            }
            cost += half_area(box) * float(count);
        }
        children[slot] = box;
        all.low = min(all.low, box.low);
        all.high = max(all.high, box.high);
    }
    boxes.data[node - params.first_node] = all;
    costs.at[node - params.first_node] = half_area(all) + cost;

    uint exponents = 0u;
    for (uint axis = 0u; axis < 3u; ++axis) {
        uint exponent = grid_exponent(difference(all.high[axis], all.low[axis]));
        exponents |= exponent << (8u * axis);
        uvec4 planes = nodes.word[5u * node + 2u + axis];
        for (uint slot = 0u; slot < 8u; ++slot) {
            uint shift = 8u * (slot % 4u);
            if (((n1[2u + slot / 4u] >> shift) & 0xffu) == 0u) continue;
            uint low = steps_down(difference(children[slot].low[axis], all.low[axis]), exponent);
            uint high = steps_up(difference(children[slot].high[axis], all.low[axis]), exponent);
            uint at = slot / 4u;
            planes[at] = (planes[at] & ~(0xffu << shift)) | low << shift;
            planes[2u + at] = (planes[2u + at] & ~(0xffu << shift)) | high << shift;
        }
        nodes.word[5u * node + 2u + axis] = planes;
    }
    nodes.word[5u * node] = uvec4(floatBitsToUint(all.low), (holds << 24) | exponents);
}
