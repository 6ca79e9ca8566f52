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

bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, out Hit hit)
{
    rayQueryEXT query;
    if (!proceed(query, gl_RayFlagsNoneEXT, origin, direction, t_min, t_max)) return false;
    hit.t = rayQueryGetIntersectionTEXT(query, true);
    hit.instance = INSTANCED ? uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true)) : 0u;
    hit.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
    if (ALPHA_MASK && rayQueryGetIntersectionGeometryIndexEXT(query, true) > 0)
        hit.primitive += rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, true);
    hit.barycentrics = rayQueryGetIntersectionBarycentricsEXT(query, true);
    return true;
}

bool trace_any(vec3 origin, vec3 direction, float t_min, float t_max)
{
    rayQueryEXT query;
    return proceed(query, gl_RayFlagsTerminateOnFirstHitEXT, origin, direction, t_min, t_max);
}

#endif
