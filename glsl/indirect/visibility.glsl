#ifndef INDIRECT_VISIBILITY_GLSL
#define INDIRECT_VISIBILITY_GLSL

#include "trace/boxes.glsl"

// Whether anything hides a VPL from a point, by the kind of visibility asked for.
bool occluded(vec3 vpl, vec3 point)
{
    return trace_any_box(vpl, point - vpl, 0.0, 1.0);
}

#endif
