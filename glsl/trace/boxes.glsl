// Imperfect visibility: rays blocked by triangles' bounding boxes (Marques and Santos 2010, section 4.1).
//
// bool trace_any_box(vec3 origin, vec3 direction, float t_min, float t_max);   true: something blocks
//
// As trace_any, but for what blocks (trace/box.glsl), for alpha, which boxes ignore, and for panes, which have none. The host builds what VISIBILITY
// needs; where it is exact, this is trace_any.
#ifndef TRACE_BOXES_GLSL
#define TRACE_BOXES_GLSL

#include "trace/trace.glsl"
#include "trace/box.glsl"

layout(constant_id = 112) const uint VISIBILITY = 0u; // techniques::indirect::Visibility

const uint VISIBILITY_EXACT = 0u;
const uint VISIBILITY_BOXES = 1u;
const uint VISIBILITY_BOXES_PLANE = 2u;
const uint VISIBILITY_BOXES_INLINE = 3u;

bool stored_box_blocks(Segment ray, uint index)
{
    vec3 low = Vec3Array(scene.boxes)[2u * index].at;
    vec3 high = Vec3Array(scene.boxes)[2u * index + 1u].at;
    vec2 passage;
    if (!box_blocks(ray, low, high, passage)) return false;
    if (VISIBILITY != VISIBILITY_BOXES_PLANE || is_flat(low, high)) return true;
    return crosses(ray, passage, Vec4Array(scene.box_planes)[index].at);
}

#ifdef TRACE_RAY_QUERY

layout(set = 0, binding = 2) uniform accelerationStructureEXT trace_boxes;

bool trace_any_box(vec3 origin, vec3 direction, float t_min, float t_max)
{
    if (VISIBILITY == VISIBILITY_EXACT) return trace_any(origin, direction, t_min, t_max);
    Segment ray = segment(origin, direction, t_min, t_max);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, trace_boxes, gl_RayFlagsNoneEXT, 0xffu, origin, t_min, direction, t_max);
    while (rayQueryProceedEXT(query)) {
        if (stored_box_blocks(ray, uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false)))) return true;
    }
    return false;
}

#else

bool triangles_box_blocks(Segment ray, uint index)
{
    BvhTriangles triangles = BvhTriangles(scene.bvh_triangles);
    if (PANES && (floatBitsToUint(triangles.word[3u * index + 2u].w) & LEAF_PANE) != 0u) return false;
    vec3 a = triangles.word[3u * index].xyz;
    vec3 b = triangles.word[3u * index + 1u].xyz;
    vec3 c = triangles.word[3u * index + 2u].xyz;
    vec2 passage;
    return box_blocks(ray, min(a, min(b, c)), max(a, max(b, c)), passage);
}

// Any box that blocks is as good as the nearest.
bool meets(Segment ray, uint index, uvec2 best, float t_min, float t_max, out float t)
{
    t = t_max;
    return VISIBILITY == VISIBILITY_BOXES_INLINE ? triangles_box_blocks(ray, index) : stored_box_blocks(ray, index);
}

#define RAY Segment
#include "trace/traverse.glsl"
#undef RAY

bool trace_any_box(vec3 origin, vec3 direction, float t_min, float t_max)
{
    if (VISIBILITY == VISIBILITY_EXACT) return trace_any(origin, direction, t_min, t_max);
    BvhNodes nodes = BvhNodes(VISIBILITY == VISIBILITY_BOXES_INLINE ? scene.bvh_nodes : scene.box_nodes);
    Segment ray = segment(origin, direction, t_min, t_max);
    return traverse(nodes, node_ray(origin, direction), ray, t_min, t_max, true).x != NONE;
}

#endif
#endif
