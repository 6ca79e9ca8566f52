// Light from virtual point lights (Marques & Santos 2010, eq. 1). Expects `vpls`.
#ifndef INDIRECT_VPLS_GLSL
#define INDIRECT_VPLS_GLSL

#include "indirect/bounding.glsl"
#include "lib/glossy.glsl"
#include "lib/receiver.glsl"
#include "lib/sampling.glsl"
#include "lib/visibility.glsl"
#include "trace/boxes.glsl"

// Squared distance to a VPL (m²), or to the rim of the disc that it stands for, where that is wider than bounding reaches.
float to_rim(Vpl vpl, float distance2, float min_distance) {
    return distance2 + max(vpl.spread - min_distance * min_distance, 0.0);
}

// W/m² from a VPL if nothing is between; 0 behind the plane of either.
vec3 unshadowed(Vpl vpl, Receiver x, float min_distance) {
    vec3 to_vpl = vpl.position - x.position;
    float cos_x = dot(x.normal, to_vpl);
    float cos_k = -dot(vpl.normal, to_vpl);
    if (cos_x <= 0.0 || cos_k <= 0.0 || dot(x.geometric_normal, to_vpl) <= 0.0) return vec3(0.0);
    float distance2 = dot(to_vpl, to_vpl);
    float g = (cos_x / distance2) * (cos_k / to_rim(vpl, distance2, min_distance));
    if (min_distance > 0.0) {
        float f = bounded(sqrt(distance2), min_distance);
        if (f == 0.0) return vec3(0.0); // before 0 · ∞ where they all but touch
        g *= f;
    }
    return vpl.flux * (g / PI);
}

// W/m² across the direction to a VPL, if nothing is between; bounded as irradiance is.
vec3 perpendicular(Vpl vpl, vec3 position, float min_distance, out vec3 direction) {
    vec3 to_vpl = vpl.position - position;
    float distance2 = dot(to_vpl, to_vpl);
    float inverse = inversesqrt(distance2);
    direction = inverse * to_vpl;
    float cos_k = -dot(vpl.normal, direction);
    if (!(cos_k > 0.0)) return vec3(0.0);
    float share = 1.0;
    if (min_distance > 0.0) {
        share = bounded(sqrt(distance2), min_distance);
        if (share == 0.0) return vec3(0.0);
    }
    return vpl.flux * (share * cos_k / (to_rim(vpl, distance2, min_distance) * PI));
}

// Light that arrives if nothing is between the ends of a shadow ray: W/m², or W/(sr·m²) that a glossy surface sends on.
struct Connection {
    vec3 light;
    vec3 from;
    vec3 to;
};

// From VPL k to the receiver: rays that start together stay together, 8 % faster than the other way on a large GPU. It is lit
// as the facet it is: the curve that it stands for would cost 4 % there.
Connection connect_vpl(uint k, Receiver x, float min_distance) {
    Vpl vpl = vpls.data[k];
    return Connection(unshadowed(vpl, x, min_distance), offset_origin(vpl.position, vpl.normal), target(x));
}

// Across the direction it comes from.
Connection connect_vpl(uint k, Receiver x, float min_distance, out vec3 direction) {
    Vpl vpl = vpls.data[k];
    vec3 light = perpendicular(vpl, x.position, min_distance, direction);
    return Connection(light, offset_origin(vpl.position, vpl.normal), target(x));
}

// Of a VPL's light or, unless `is_vpl`, of another's, which boxes never block.
vec3 arriving(vec3 light, vec3 from, vec3 along, float reach, bool is_vpl, inout uint rays) {
    if (VISIBILITY == VISIBILITY_EXACT || !is_vpl) return arriving(light, from, along, reach, rays);
    ++rays;
    return trace_any_box(from, along, 0.0, reach) ? vec3(0.0) : light;
}

vec3 arriving_vpl(Connection c, inout uint rays) {
    return c.light == vec3(0.0) ? vec3(0.0) : arriving(c.light, c.from, c.to - c.from, 1.0, true, rays);
}

// Every `step`th VPL of a range.
struct Walk {
    uint first;
    uint last;
    uint step;
};

// W/m² from them.
vec3 irradiance_from_vpls(Walk walk, Receiver x, float min_distance, inout uint rays) {
    vec3 sum = vec3(0.0);
    for (uint k = walk.first; k < walk.last; k += walk.step) sum += arriving_vpl(connect_vpl(k, x, min_distance), rays);
    return sum;
}

// W/(sr·m²) that lobes send on of their light.
vec3 radiance_from_vpls(Walk walk, GlossySurface g, uint lobes, float min_distance, inout uint rays) {
    Receiver x = receiver_at(g.surface);
    vec3 sum = vec3(0.0);
    for (uint k = walk.first; k < walk.last; k += walk.step) {
        vec3 direction;
        Connection c = connect_vpl(k, x, min_distance, direction);
        if (c.light == vec3(0.0)) continue;
        c.light *= scattered(g, direction, lobes);
        sum += arriving_vpl(c, rays);
    }
    return sum;
}

#endif
