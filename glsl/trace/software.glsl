// Traversal of the eight-wide compressed BVH of accel/software.rs: Ylitie, Karras and Laine, "Efficient
// Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs" (2017), with min and max planes side by side.
//
// A closed mesh leaks no ray. The triangle test is that of Woop, Benthin and Wald, "Watertight Ray/Triangle
// Intersection" (2013): vertices are projected along the ray by a function of the vertex alone, and a sign
// of an edge function is never wrong, only zero, since rounding is monotonic; zero counts as inside, within the
// bounds of the projected triangle.
// Boxes are entered early and left late by more than all rounding errors of box and triangle test together:
// up to 20 units of 2^-24 of the origin's and the scene's largest coordinates; 32 are taken (scene.ray_epsilon
// is 8 of the scene's).
#ifndef TRACE_SOFTWARE_GLSL
#define TRACE_SOFTWARE_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "trace/direction.glsl"

const uint MAX_STACK_DEPTH = 24u;
layout(constant_id = 111) const uint STACK_DEPTH = MAX_STACK_DEPTH; // levels of nodes

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer BvhNodes { uvec4 word[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer BvhTriangles { vec4 word[]; };

// Groups of sibling nodes still to visit, by level. Private: in shared memory it leaves a GPU's caches too little room
// for nodes (on an H100 gathering at scattered points takes 1.6 times as long).
uvec2 trace_stack[STACK_DEPTH];

// Projects along the ray: (x, y) is the distance from it. The axis the ray mostly follows comes last.
struct RayFrame {
    uint axis;
    vec3 shear; // the last: 1 / the direction's largest component
};

vec3 turn(uint axis, vec3 v) { return axis == 0u ? v.yzx : axis == 1u ? v.zxy : v; }

RayFrame ray_frame(vec3 d)
{
    vec3 a = abs(d);
    uint axis = a.x >= a.y && a.x >= a.z ? 0u : a.y >= a.z ? 1u : 2u;
    vec3 t = turn(axis, d);
    return RayFrame(axis, vec3(-t.x / t.z, -t.y / t.z, 1 / t.z));
}

// z: along the ray, in units of its parameter.
vec3 project(RayFrame frame, vec3 v)
{
    vec3 t = turn(frame.axis, v);
    precise vec3 p = vec3(fma(t.z, frame.shear.x, t.x), fma(t.z, frame.shear.y, t.y), t.z * frame.shear.z);
    return p;
}

float edge(vec2 a, vec2 b)
{
    precise float left = a.x * b.y;
    precise float right = a.y * b.x;
    precise float difference = left - right;
    return difference;
}

// t and the weights of the second and third vertex; false if the ray's line misses.
bool intersect(RayFrame frame, vec3 a, vec3 b, vec3 c, out vec3 t_barycentrics)
{
    vec3 pa = project(frame, a);
    vec3 pb = project(frame, b);
    vec3 pc = project(frame, c);
    vec3 w = vec3(edge(pc.xy, pb.xy), edge(pa.xy, pc.xy), edge(pb.xy, pa.xy));
    float determinant = w.x + w.y + w.z;
    bool inside = all(greaterThanEqual(w, vec3(0))) || all(lessThanEqual(w, vec3(0)));
    if (!inside || determinant == 0) return false;
    // Far from a tiny triangle all products can round to the same.
    vec2 low = min(pa.xy, min(pb.xy, pc.xy));
    vec2 high = max(pa.xy, max(pb.xy, pc.xy));
    if (any(greaterThan(low, vec2(0))) || any(lessThan(high, vec2(0)))) return false;
    t_barycentrics = vec3(dot(w, vec3(pa.z, pb.z, pc.z)), w.yz) / determinant;
    return true;
}

uvec2 triangle_id(BvhTriangles triangles, uint first_word)
{
    return floatBitsToUint(vec2(triangles.word[first_word].w, triangles.word[first_word + 1u].w));
}

bool precedes(uvec2 id, uvec2 other)
{
    return id.x < other.x || (id.x == other.x && id.y < other.y);
}

// What of a ray decides which nodes it meets.
struct NodeRay {
    vec3 inverse;
    vec3 enter;
    vec3 leave;
    bvec3 negative;
    uint octant; // children lie in the slots of the octants they are seen from; near ones block sooner too
};

NodeRay node_ray(vec3 origin, vec3 direction)
{
    vec3 inverse = 1 / without_zeros(direction);
    vec3 reach = abs(origin);
    float slack = 4 * scene.ray_epsilon + max(reach.x, max(reach.y, reach.z)) * uintBitsToFloat((127u - 19u) << 23);
    vec3 enter = -origin * inverse - slack * abs(inverse);
    vec3 leave = -origin * inverse + slack * abs(inverse);
    bvec3 negative = lessThan(inverse, vec3(0));
    uint octant = (negative.x ? 0u : 4u) | (negative.y ? 0u : 2u) | (negative.z ? 0u : 1u);
    return NodeRay(inverse, enter, leave, negative, octant);
}

const uint NONE = 0xffffffffu; // no primitive

// Siblings to visit. x: the first one's index; y: which slots are to be visited (8 bits) and which hold nodes (8 bits).
const uvec2 ROOT = uvec2(0, 0x80000000u);

// Visits the nearest node of `group` and leaves the others on the stack; `group` becomes those of its children that
// the ray meets. Returns where its primitives begin and which of the 24 the ray may meet.
uvec2 visit(BvhNodes nodes, NodeRay ray, float t_min, float t_max, inout uvec2 group, inout uint top)
{
    uint bit = findMSB(group.y);
    group.y &= ~(1u << bit);
    if (group.y > 0x00ffffffu) {
        trace_stack[top] = group;
        ++top;
    }
    uint slot = (bit - 24u) ^ ray.octant;
    uint index = group.x + bitCount(group.y & 0xffu & ((1u << slot) - 1u));

    uvec4 n0 = nodes.word[index * 5u];
    uvec4 n1 = nodes.word[index * 5u + 1u];
    uvec4 nx = nodes.word[index * 5u + 2u];
    uvec4 ny = nodes.word[index * 5u + 3u];
    uvec4 nz = nodes.word[index * 5u + 4u];
    vec3 cell = uintBitsToFloat((uvec3(n0.w) << uvec3(23, 15, 7)) & 0x7f800000u) * ray.inverse;
    vec3 corner = uintBitsToFloat(n0.xyz);
    vec3 near = fma(corner, ray.inverse, ray.enter);
    vec3 far = fma(corner, ray.inverse, ray.leave);
    if (ray.negative.x) nx = nx.zwxy;
    if (ray.negative.y) ny = ny.zwxy;
    if (ray.negative.z) nz = nz.zwxy;

    uint octant4 = ray.octant * 0x01010101u;
    uint hits = 0u;
    [[unroll]] for (uint four = 0u; four < 2u; four++) {
        uint meta = n1[2u + four];
        uint inner = (meta & (meta << 1)) & 0x10101010u;
        uint bits = (meta ^ (octant4 & ((inner >> 4) * 0xffu))) & 0x1f1f1f1fu;
        uint counts = (meta >> 5) & 0x07070707u;
        uvec3 low = uvec3(nx[four], ny[four], nz[four]);
        uvec3 high = uvec3(nx[2u + four], ny[2u + four], nz[2u + four]);
        [[unroll]] for (uint shift = 0u; shift < 32u; shift += 8u) {
            vec3 t0 = fma(vec3((low >> shift) & 0xffu), cell, near);
            vec3 t1 = fma(vec3((high >> shift) & 0xffu), cell, far);
            if (max(max(t0.x, t0.y), max(t0.z, t_min)) <= min(min(t1.x, t1.y), min(t1.z, t_max)))
                hits |= ((counts >> shift) & 0xffu) << ((bits >> shift) & 0xffu);
        }
    }
    group = uvec2(n1.x, (hits & 0xff000000u) | (n0.w >> 24));
    return uvec2(n1.y, hits & 0x00ffffffu);
}

// Whether anything is left to visit; if `group` is empty it comes from the stack.
bool proceed(inout uvec2 group, inout uint top)
{
    if (group.y > 0x00ffffffu) return true;
    if (top == 0u) return false;
    --top;
    group = trace_stack[top];
    return true;
}

struct TriangleRay {
    BvhTriangles triangles;
    RayFrame frame;
    vec3 origin;
};

// Last word of a triangle in a leaf: bits. Twin: accel::software.
const uint LEAF_MASKED = 1u;
const uint LEAF_SHEER = 2u;
const uint LEAF_PANE = 4u;

bool meets(TriangleRay ray, uint index, uint best, float t_min, float t_max, out float t)
{
    vec4 a = ray.triangles.word[3u * index];
    vec4 b = ray.triangles.word[3u * index + 1u];
    vec4 c = ray.triangles.word[3u * index + 2u];
    vec3 t_barycentrics;
    bool met = intersect(ray.frame, a.xyz - ray.origin, b.xyz - ray.origin, c.xyz - ray.origin, t_barycentrics);
    t = t_barycentrics.x;
    met = met && t > t_min && t <= t_max;
    if (met && t == t_max) {
        uvec2 id = floatBitsToUint(vec2(a.w, b.w));
        met = best != NONE && !precedes(triangle_id(ray.triangles, 3u * best), id);
    }
    if (ALPHA_MASK && met && (floatBitsToUint(c.w) & LEAF_MASKED) != 0u) {
        met = !alpha_hole(floatBitsToUint(a.w), floatBitsToUint(b.w), t_barycentrics.yz);
    }
    return met;
}

#define RAY TriangleRay
#include "trace/traverse.glsl"
#undef RAY

// Barycentrics are worked out again rather than kept in registers all along.
Hit hit_of(TriangleRay ray, uint best, float t)
{
    vec4 a = ray.triangles.word[3u * best];
    vec4 b = ray.triangles.word[3u * best + 1u];
    vec4 c = ray.triangles.word[3u * best + 2u];
    vec3 t_barycentrics;
    intersect(ray.frame, a.xyz - ray.origin, b.xyz - ray.origin, c.xyz - ray.origin, t_barycentrics);
    return Hit(t, floatBitsToUint(a.w), floatBitsToUint(b.w), t_barycentrics.yz);
}

bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, out Hit hit)
{
    TriangleRay ray = TriangleRay(BvhTriangles(scene.bvh_triangles), ray_frame(direction), origin);
    uint best = traverse(BvhNodes(scene.bvh_nodes), node_ray(origin, direction), ray, t_min, t_max, false);
    if (best == NONE) return false;
    hit = hit_of(ray, best, t_max);
    return true;
}

bool trace_any(vec3 origin, vec3 direction, float t_min, float t_max)
{
    TriangleRay ray = TriangleRay(BvhTriangles(scene.bvh_triangles), ray_frame(direction), origin);
    return traverse(BvhNodes(scene.bvh_nodes), node_ray(origin, direction), ray, t_min, t_max, true) != NONE;
}

struct Probe {
    NodeRay node;
    TriangleRay triangle;
};

Probe probe(vec3 origin, vec3 direction)
{
    return Probe(node_ray(origin, direction), TriangleRay(BvhTriangles(scene.bvh_triangles), ray_frame(direction), origin));
}

bool meet(Probe ray, float t_min, inout float t, bool nearest, out uint met)
{
    met = traverse(BvhNodes(scene.bvh_nodes), ray.node, ray.triangle, t_min, t, !nearest);
    return met != NONE;
}

bool is_sheer(Probe ray, uint met)
{
    return (floatBitsToUint(ray.triangle.triangles.word[3u * met + 2u].w) & LEAF_SHEER) != 0u;
}

Hit hit_of(Probe ray, uint met, float t) { return hit_of(ray.triangle, met, t); }

#endif
