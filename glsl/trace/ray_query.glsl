// VK_KHR_ray_query over one bottom-level structure a mesh range: its opaque triangles, then as a geometry of
// their own its alpha-masked ones. The instance's custom index is its id, its shader table offset the
// primitive at which the masked triangles begin.
#ifndef TRACE_RAY_QUERY_GLSL
#define TRACE_RAY_QUERY_GLSL

#extension GL_EXT_ray_query : require

layout(set = 0, binding = 1) uniform accelerationStructureEXT trace_scene;

// Runs the query; true if it committed a hit. Hit attributes must not be read otherwise: lavapipe crashes.
bool proceed(rayQueryEXT query, uint flags, vec3 origin, vec3 direction, float t_min, float t_max)
{
    flags |= ALPHA_MASK ? gl_RayFlagsNoneEXT : gl_RayFlagsOpaqueEXT;
    rayQueryInitializeEXT(query, trace_scene, flags, 0xffu, origin, t_min, direction, t_max);
    while (rayQueryProceedEXT(query)) {
        if (!ALPHA_MASK) continue;
        uint instance = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false));
        uint primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false))
            + rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, false);
        if (!alpha_hole(instance, primitive, rayQueryGetIntersectionBarycentricsEXT(query, false)))
            rayQueryConfirmIntersectionEXT(query);
    }
    return rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
}

Hit committed(rayQueryEXT query)
{
    Hit hit;
    hit.t = rayQueryGetIntersectionTEXT(query, true);
    hit.instance = INSTANCED ? uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true)) : 0u;
    hit.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
    if (ALPHA_MASK && rayQueryGetIntersectionGeometryIndexEXT(query, true) > 0)
        hit.primitive += rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, true);
    hit.barycentrics = rayQueryGetIntersectionBarycentricsEXT(query, true);
    return hit;
}

bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, out Hit hit)
{
    rayQueryEXT query;
    if (!proceed(query, gl_RayFlagsNoneEXT, origin, direction, t_min, t_max)) return false;
    hit = committed(query);
    return true;
}

bool trace_any(vec3 origin, vec3 direction, float t_min, float t_max)
{
    rayQueryEXT query;
    return proceed(query, gl_RayFlagsTerminateOnFirstHitEXT, origin, direction, t_min, t_max);
}

struct Probe {
    vec3 origin;
    vec3 direction;
};

Probe probe(vec3 origin, vec3 direction) { return Probe(origin, direction); }

Hit last_met;

bool meet(Probe ray, float t_min, inout float t, bool nearest, out uvec2 met)
{
    rayQueryEXT query;
    met = uvec2(0u);
    uint flags = nearest ? gl_RayFlagsNoneEXT : gl_RayFlagsTerminateOnFirstHitEXT;
    if (!proceed(query, flags, ray.origin, ray.direction, t_min, t)) return false;
    last_met = committed(query);
    t = last_met.t;
    return true;
}

bool is_sheer(Probe ray, uvec2 met)
{
    uint first = InstanceArray(scene.instances)[last_met.instance].at.first_triangle;
    uint material = TriangleArray(scene.triangles)[first + last_met.primitive].at.material & ~TRIANGLE_MIRRORED;
    return (MaterialArray(scene.materials)[material].at.flags & MATERIAL_SHEER) != 0u;
}

Hit hit_of(Probe ray, uvec2 met, float t) { return last_met; }

#endif
