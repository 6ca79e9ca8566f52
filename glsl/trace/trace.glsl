// What does this ray hit? The same answer from either backend, which build.rs chooses by TRACE_SOFTWARE or
// TRACE_RAY_QUERY. A kernel declares its local size before it includes this file.
//
// bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, out Hit hit);
// bool trace_any(vec3 origin, vec3 direction, float t_min, float t_max);   true: something blocks
//
// For lib/visibility.glsl, which asks sheer surfaces how much light they let straight through:
//
// Probe probe(vec3 origin, vec3 direction);
// bool meet(Probe ray, float t_min, inout float t, bool nearest, out uvec2 met);   before t, which becomes where if nearest
// bool is_sheer(Probe ray, uvec2 met);                                             of what was met last
// Hit hit_of(Probe ray, uvec2 met, float t);
//
// One more function, trace_any_box, is in trace/boxes.glsl.
//
// Directions have any length but zero; t counts in it. A hit has t_min < t < t_max; t_max may be infinite.
// Triangles are hit from both sides. Holes of alpha-masked surfaces are not hit, in either function; what is a
// hole alpha_hole decides, which lib/surface.glsl defines.
#ifndef TRACE_TRACE_GLSL
#define TRACE_TRACE_GLSL

#include "shared/profile.glsl"
#include "shared/scene.glsl"
#include "trace/hit.glsl"

bool alpha_hole(uint instance, uint primitive, vec2 barycentrics);

#ifdef TRACE_RAY_QUERY
#include "trace/ray_query.glsl"
#else
#include "trace/software.glsl"
#endif
#include "trace/offset.glsl"

#endif
