// Whether a box blocks a segment: the one place that decides, for both backends. Twin: accel::cpu::BoxBruteForce.
//
// It does if the segment enters and leaves it, both strictly between the segment's ends; a box that holds an end, on
// its surface too, does not. Intervals of a line that overlap pairwise have a point in common, so it is enough that
// the line meets the box, that the ends do not lie on one side of it, and that neither lies in it. The latter two
// compare coordinates and do not round: a flat box blocks as its rectangle does, and no ray that was offset from a
// flat surface finds it again. Without contraction, so that backends agree bit for bit.
#ifndef TRACE_BOX_GLSL
#define TRACE_BOX_GLSL

#include "trace/direction.glsl"

struct Segment {
    vec3 origin;
    vec3 direction;
    vec3 inverse;
    vec3 start;
    vec3 end;
};

Segment segment(vec3 origin, vec3 direction, float t_min, float t_max)
{
    precise vec3 along = without_zeros(direction);
    precise vec3 inverse = 1 / along;
    precise vec3 start = t_min * along;
    start = origin + start;
    precise vec3 end = t_max * along;
    end = origin + end;
    return Segment(origin, along, inverse, start, end);
}

// `passage` is where the line enters and leaves, in ray parameters.
bool box_blocks(Segment ray, vec3 low, vec3 high, out vec2 passage)
{
    precise vec3 a = (low - ray.origin) * ray.inverse;
    precise vec3 b = (high - ray.origin) * ray.inverse;
    vec3 near = min(a, b);
    vec3 far = max(a, b);
    passage = vec2(max(near.x, max(near.y, near.z)), min(far.x, min(far.y, far.z)));
    return passage.x <= passage.y
        && all(lessThanEqual(min(ray.start, ray.end), high)) && all(greaterThanEqual(max(ray.start, ray.end), low))
        && (any(lessThan(ray.start, low)) || any(greaterThan(ray.start, high)))
        && (any(lessThan(ray.end, low)) || any(greaterThan(ray.end, high)));
}

// Thinner boxes are flat: where they end, rounding would decide on which side of the plane.
bool is_flat(vec3 low, vec3 high)
{
    return any(lessThanEqual(high - low, vec3(4 * scene.ray_epsilon)));
}

bool below(vec4 plane, Segment ray, float t)
{
    precise vec3 p = t * ray.direction;
    p = ray.origin + p;
    precise float height = plane.x * p.x + plane.y * p.y + plane.z * p.z;
    return height < plane.w;
}

// Whether the two ends of a passage lie on opposite sides of a plane (unit normal, distance).
bool crosses(Segment ray, vec2 passage, vec4 plane)
{
    return below(plane, ray, passage.x) != below(plane, ray, passage.y);
}

#endif
