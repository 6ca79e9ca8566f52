// Surfaces that specular paths from the camera end at.
#ifndef WHITTED_REACHED_GLSL
#define WHITTED_REACHED_GLSL

#include "lib/groups.glsl"
#include "lib/receiver.glsl"

const uint NO_POINT = 0xffffffffu;
const uint POINTS = 64u; // of a workgroup that lights them or adds up their light
const uint GROUP = 16u;  // sources whose light is summed before it is added to that of others, whoever does it

// VPLs that light a point, of so many.
uint vpl_run(uint vpls) { return (vpls + scene.vpl_share - 1u) / scene.vpl_share; }

// Sources that do.
uint source_count(uint vpls) { return scene.asked_lights + scene.light_samples + vpl_run(vpls) + scene.lobe_samples; }

struct Reached {
    vec3 position;
    vec3 normal;
    vec3 geometric_normal;
    vec3 reflected;  // radiance at the pixel for each W/m² there; of glossy scenes for each W/(sr·m²) it reflects
    vec3 irradiance; // W/m²; of glossy scenes what it reflects
    uint previous;   // the same pixel's point before this one
};

// What more glossy or curved surfaces and sampled lights need to know of it.
struct Seen {
    uvec4 hit; // packed
    vec3 to_viewer;
    uint seed;
};

// What to dispatch on the list of points, and how long it is.
struct PointArgs {
    uvec3 light; // workgroups: of points along a row, of shares of the sources, rows
    uint count;
    uvec3 collect; // of points along a row, rows, 1
    uint share;    // sources that a thread takes
};

#endif
