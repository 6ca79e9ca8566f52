// Places that light from infinitely far away reaches and that matter to the picture.
#ifndef VPL_SHOOT_GUIDES_GLSL
#define VPL_SHOOT_GUIDES_GLSL

#extension GL_EXT_scalar_block_layout : require

const uint NO_SOURCE = 0xffffffffu;
const uint ENVIRONMENT_SOURCE = 0xfffffffeu;

struct Guide {
    vec3 position;
    uint source; // index of a directional light, or one of the above
    vec2 v;      // numbers that chose the direction to the environment
    vec3 before; // where the pilot's path came from
    float edge;  // how far from there (m); 0 where the camera sees it
    float reach; // from what the camera sees to what is next along a random ray (m); 0: nothing
};

#endif
