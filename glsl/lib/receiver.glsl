// A point that light falls on.
#ifndef LIB_RECEIVER_GLSL
#define LIB_RECEIVER_GLSL

#include "lib/surface.glsl"

struct Receiver {
    vec3 position;
    vec3 normal;
    vec3 geometric_normal;
    vec3 side_normal; // and a lift, as a surface's
    float lift;
};

Receiver receiver_at(Surface surface) {
    return Receiver(surface.position, surface.normal, surface.geometric_normal, surface.side_normal, surface.lifts.x);
}

// The same where it meets light that comes along the other way of `direction`.
Receiver facing(Receiver x, vec3 direction) {
    if (lifted(x.lift, x.geometric_normal, direction)) x.position += x.lift * x.geometric_normal;
    return x;
}

// Where shadow rays to it end.
vec3 target(Receiver x) { return offset_origin(x.position, x.geometric_normal); }

#endif
