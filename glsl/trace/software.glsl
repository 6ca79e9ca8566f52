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
//
// Where TWO_LEVELS holds, nodes over placements lie above nodes over a mesh's triangles. The ray goes on in object space
// for boxes alone: a triangle is placed, rounded as accel::world_position rounds it, before it is tested, so that a hit is
// the same, bit for bit, as where all triangles lie in one level.
#ifndef TRACE_SOFTWARE_GLSL
#define TRACE_SOFTWARE_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "trace/direction.glsl"

const uint MAX_STACK_DEPTH = 24u;
layout(constant_id = 111) const uint STACK_DEPTH = MAX_STACK_DEPTH; // levels of nodes
layout(constant_id = 113) const bool TWO_LEVELS = false;

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

// How far boxes stand out (m) for rays from here.
float node_slack(vec3 origin)
{
    vec3 reach = abs(origin);
    return 4 * scene.ray_epsilon + max(reach.x, max(reach.y, reach.z)) * uintBitsToFloat((127u - 19u) << 23);
}

NodeRay node_ray(vec3 origin, vec3 direction, vec3 slack)
{
    vec3 inverse = 1 / without_zeros(direction);
    vec3 enter = -origin * inverse - slack * abs(inverse);
    vec3 leave = -origin * inverse + slack * abs(inverse);
    bvec3 negative = lessThan(inverse, vec3(0));
    uint octant = (negative.x ? 0u : 4u) | (negative.y ? 0u : 2u) | (negative.z ? 0u : 1u);
    return NodeRay(inverse, enter, leave, negative, octant);
}

NodeRay node_ray(vec3 origin, vec3 direction) { return node_ray(origin, direction, vec3(node_slack(origin))); }

const uint NONE = 0xffffffffu; // no primitive

// Siblings to visit. x: the first one's index; y: which slots are to be visited (8 bits) and which hold nodes (8 bits).
uvec2 root(uint index) { return uvec2(index, 0x80000000u); }

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

// Whether anything is left to visit; if `group` is empty it comes from the stack, down to `bottom`.
bool proceed(inout uvec2 group, inout uint top, uint bottom)
{
    if (group.y > 0x00ffffffu) return true;
    if (top == bottom) return false;
    --top;
    group = trace_stack[top];
    return true;
}

// What of a ray decides which triangles it meets; of two levels also where those of the placement that it is in lie.
struct TriangleRay {
    BvhTriangles triangles;
    RayFrame frame;
    vec3 origin;
    vec3 direction;
    mat4x3 placement;
    uint instance;
};

// Seven words each, read whole: of single components lavapipe of Mesa 22.3 takes others. Twin: accel::levels::Placement.
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer BvhPlacements { vec4 word[]; };

void set_placement(uint placement, inout TriangleRay ray)
{
    BvhPlacements placements = BvhPlacements(scene.bvh_placements);
    vec4 x = placements.word[7u * placement];
    vec4 y = placements.word[7u * placement + 1u];
    vec4 z = placements.word[7u * placement + 2u];
    vec4 at = placements.word[7u * placement + 3u];
    ray.placement = mat4x3(x.xyz, y.xyz, z.xyz, at.xyz);
    ray.instance = floatBitsToUint(y.w);
}

// The ray as nodes of a placement's mesh see it, and the first of those. All its errors are within twice the slack of
// nodes in the world, carried over.
NodeRay placed_ray(uint placement, TriangleRay ray, out uint first)
{
    BvhPlacements placements = BvhPlacements(scene.bvh_placements);
    vec4 x = placements.word[7u * placement];
    vec4 at = placements.word[7u * placement + 3u];
    vec4 inverse_x = placements.word[7u * placement + 4u];
    vec4 inverse_y = placements.word[7u * placement + 5u];
    vec4 inverse_z = placements.word[7u * placement + 6u];
    first = floatBitsToUint(x.w);
    mat3 inverse = mat3(inverse_x.xyz, inverse_y.xyz, inverse_z.xyz);
    mat3 size = mat3(abs(inverse[0]), abs(inverse[1]), abs(inverse[2]));
    vec3 slack = size * vec3(2 * node_slack(ray.origin));
    return node_ray(inverse * (ray.origin - at.xyz), inverse * ray.direction, slack);
}

vec3 vertex(TriangleRay ray, vec4 word)
{
    if (!TWO_LEVELS) return word.xyz - ray.origin;
    mat4x3 m = ray.placement;
    precise vec3 at = ((m[0] * word.x + m[1] * word.y) + m[2] * word.z) + m[3];
    return at - ray.origin;
}

// Last word of a triangle in a leaf: bits. Twin: accel::software.
const uint LEAF_MASKED = 1u;
const uint LEAF_SHEER = 2u;
const uint LEAF_PANE = 4u;

// Of two levels what does not move is placed together, and each of its triangles knows how far behind its instance is.
uint instance_of(TriangleRay ray, vec4 a) { return ray.instance + floatBitsToUint(a.w); }

// Of two levels a triangle is named by its index and its placement.
uvec2 triangle_id(TriangleRay ray, uvec2 met)
{
    vec4 a = ray.triangles.word[3u * met.x];
    vec4 b = ray.triangles.word[3u * met.x + 1u];
    if (TWO_LEVELS) set_placement(met.y, ray);
    return uvec2(instance_of(ray, a), floatBitsToUint(b.w));
}

bool meets(TriangleRay ray, uint index, uvec2 best, float t_min, float t_max, out float t)
{
    vec4 a = ray.triangles.word[3u * index];
    vec4 b = ray.triangles.word[3u * index + 1u];
    vec4 c = ray.triangles.word[3u * index + 2u];
    vec3 t_barycentrics;
    bool met = intersect(ray.frame, vertex(ray, a), vertex(ray, b), vertex(ray, c), t_barycentrics);
    t = t_barycentrics.x;
    uint instance = instance_of(ray, a);
    met = met && t > t_min && t <= t_max;
    if (met && t == t_max) {
        met = best.x != NONE && !precedes(triangle_id(ray, best), uvec2(instance, floatBitsToUint(b.w)));
    }
    if (ALPHA_MASK && met && (floatBitsToUint(c.w) & LEAF_MASKED) != 0u) {
        met = !alpha_hole(instance, floatBitsToUint(b.w), t_barycentrics.yz);
    }
    return met;
}

#define RAY TriangleRay
#define LEVELS
#include "trace/traverse.glsl"
#undef LEVELS
#undef RAY

// Barycentrics are worked out again rather than kept in registers all along.
Hit hit_of(TriangleRay ray, uvec2 best, float t)
{
    vec4 a = ray.triangles.word[3u * best.x];
    vec4 b = ray.triangles.word[3u * best.x + 1u];
    vec4 c = ray.triangles.word[3u * best.x + 2u];
    if (TWO_LEVELS) set_placement(best.y, ray);
    vec3 t_barycentrics;
    intersect(ray.frame, vertex(ray, a), vertex(ray, b), vertex(ray, c), t_barycentrics);
    return Hit(t, instance_of(ray, a), floatBitsToUint(b.w), t_barycentrics.yz);
}

struct Probe {
    NodeRay node;
    TriangleRay triangle;
};

Probe probe(vec3 origin, vec3 direction)
{
    BvhTriangles triangles = BvhTriangles(scene.bvh_triangles);
    TriangleRay ray = TriangleRay(triangles, ray_frame(direction), origin, direction, mat4x3(1.0), 0u);
    return Probe(node_ray(origin, direction), ray);
}

bool meet(Probe ray, float t_min, inout float t, bool nearest, out uvec2 met)
{
    BvhNodes nodes = BvhNodes(TWO_LEVELS ? scene.bvh_top : scene.bvh_nodes);
    met = traverse(nodes, ray.node, ray.triangle, t_min, t, !nearest);
    return met.x != NONE;
}

bool is_sheer(Probe ray, uvec2 met)
{
    return (floatBitsToUint(ray.triangle.triangles.word[3u * met.x + 2u].w) & LEAF_SHEER) != 0u;
}

Hit hit_of(Probe ray, uvec2 met, float t) { return hit_of(ray.triangle, met, t); }

bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, out Hit hit)
{
    Probe ray = probe(origin, direction);
    uvec2 met;
    if (!meet(ray, t_min, t_max, true, met)) return false;
    hit = hit_of(ray, met, t_max);
    return true;
}

bool trace_any(vec3 origin, vec3 direction, float t_min, float t_max)
{
    uvec2 met;
    return meet(probe(origin, direction), t_min, t_max, false, met);
}

#endif
