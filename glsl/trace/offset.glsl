// Ray origins leave their surface by scene.ray_epsilon, so many units in the last place of the scene's
// largest coordinate (OFFSET_ULPS in accel/mod.rs), which covers the rounding of the point, of a placement's
// transform and of both backends' triangle tests. There is no absolute term: it would be wrong for small
// scenes (Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems 2019,
// has one).
#ifndef TRACE_OFFSET_GLSL
#define TRACE_OFFSET_GLSL

// Where rays start that leave the surface point p on the side to which the unit geometric normal n points.
vec3 offset_origin(vec3 p, vec3 n)
{
    return p + scene.ray_epsilon * n;
}

#endif
