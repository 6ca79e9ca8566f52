#ifndef TRACE_DIRECTION_GLSL
#define TRACE_DIRECTION_GLSL

// A zero component becomes so small a one that the ray does not notice and its inverse is finite.
vec3 without_zeros(vec3 direction)
{
    vec3 size = abs(direction);
    float tiny = max(size.x, max(size.y, size.z)) * uintBitsToFloat((127u - 60u) << 23);
    return mix(direction, mix(vec3(tiny), vec3(-tiny), lessThan(direction, vec3(0))), lessThan(size, vec3(tiny)));
}

#endif
