// Media that solids are filled with. A path knows the one it runs in, by what it absorbs (1/m).
#ifndef LIB_MEDIA_GLSL
#define LIB_MEDIA_GLSL

#include "lib/fresnel.glsl"

// What the medium on the other side of a surface absorbs, which is met on its front or its back.
vec3 absorption_behind(Material material, bool front, vec3 absorption) {
    if (!is_solid(material)) return absorption;
    return front ? material.absorption : vec3(0.0);
}

// Share of light that a stretch of a medium (m) lets through.
vec3 transmittance(vec3 absorption, float length) { return VOLUMES ? exp(-absorption * length) : vec3(1.0); }

#endif
