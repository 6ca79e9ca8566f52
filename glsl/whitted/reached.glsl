// Diffuse surfaces that specular paths from the camera end at.
#ifndef WHITTED_REACHED_GLSL
#define WHITTED_REACHED_GLSL

#include "lib/receiver.glsl"

const uint NO_POINT = 0xffffffffu;
const uint POINTS = 64u; // of one workgroup of light.comp

struct Reached {
    Receiver receiver;
    vec3 reflected;  // radiance at the pixel for each W/m² there
    vec3 irradiance; // W/m²
    uint previous;   // the same pixel's point before this one
};

#endif
