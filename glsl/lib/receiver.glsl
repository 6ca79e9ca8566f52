// A point that light falls on.
#ifndef LIB_RECEIVER_GLSL
#define LIB_RECEIVER_GLSL

#include "lib/surface.glsl"

struct Receiver {
    vec3 position;
    vec3 normal;
    vec3 geometric_normal;
};

Receiver receiver_at(Surface surface) {
    return Receiver(surface.position, surface.normal, surface.geometric_normal);
}

#endif
