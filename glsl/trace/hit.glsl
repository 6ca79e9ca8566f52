#ifndef TRACE_HIT_GLSL
#define TRACE_HIT_GLSL

const uint NO_HIT = 0xffffffffu; // as an instance

// The same ids whichever structure answered: instance 0 holds the meshes used once, merged.
struct Hit {
    float t;
    uint instance;
    uint primitive;
    vec2 barycentrics; // weights of the triangle's second and third vertex
};

// How a hit is kept in an rgba32ui image; t follows from the position.
uvec4 pack_hit(Hit hit) {
    return uvec4(hit.instance, hit.primitive, floatBitsToUint(hit.barycentrics));
}

Hit unpack_hit(uvec4 packed) {
    return Hit(0.0, packed.x, packed.y, uintBitsToFloat(packed.zw));
}

#endif
