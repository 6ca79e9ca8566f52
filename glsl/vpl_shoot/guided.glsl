// Density of starts of paths from infinitely far away: a quarter of them plainly, anywhere on the disc that faces the scene's
// bounding sphere, the others towards a guide, in one of three resolutions, so that no place that matters is left to the plain
// ones alone. Flux is divided by the density of all ways together (the balance heuristic; Veach 1997, §9.2): whatever the
// guides are, the mean is the same. Three of four that a guide started also leave its place the way that the pilot came.
#ifndef VPL_SHOOT_GUIDED_GLSL
#define VPL_SHOOT_GUIDED_GLSL

const float PLAIN_SHARE = 0.25;
const uint LEVELS = 3u;
// Directions to the environment, as the numbers that choose one in proportion to radiance, in squares of equal power …
const float LEVEL_CELLS[LEVELS] = float[LEVELS](32.0, 8.0, 2.0);
// … and discs around the guide, of radii in units of its own.
const float LEVEL_RADII[LEVELS] = float[LEVELS](1.0, 3.0, 9.0);

const float AIMED_SHARE = 0.75;

struct Choice {
    Guide guide;
    uint level;
};

// Where a path starts and why.
struct GuidedStart {
    Guide guide; // its source NO_SOURCE: plainly
    vec3 at; // on the line that it starts along
    vec3 direction;
    vec2 v; // numbers that chose the direction
    uint source;
    float density; // by area across the direction (1/m²) and in the unit square of those numbers
    float spread;  // of what it stands for, a squared radius (m²)
};

GuidedStart no_start() {
    GuidedStart start;
    start.source = NO_SOURCE;
    start.spread = 0.0;
    return start;
}

// Wider where the guide is far from what made it matter: guides are sparser there.
float radius_of(Guide guide, uint level) { return LEVEL_RADII[level] * max(guides.radius, 0.25 * guide.edge); }

float beam_area() { return PI * scene.scene_radius * scene.scene_radius; }

// Source NO_SOURCE: plainly.
Choice pick_guide(uint path, uint source) {
    uint bits = hash(scene.seed, 0x67756964u, path);
    Choice c;
    c.guide.source = NO_SOURCE;
    c.level = 0u;
    if (guides.count == 0u || unit_float(bits) < PLAIN_SHARE) return c;
    bits = hash(bits);
    c.level = min(uint(unit_float(hash(bits)) * float(LEVELS)), LEVELS - 1u);
    c.guide = guides.data[min(uint(unit_float(bits) * float(guides.count)), guides.count - 1u)];
    if (c.guide.source != source) c.guide.source = NO_SOURCE;
    return c;
}

vec2 within_cell(Choice c, vec2 v) {
    if (c.guide.source == NO_SOURCE) return v;
    float cells = LEVEL_CELLS[c.level];
    // Rounding must leave it in the cell.
    return (floor(c.guide.v * cells) + min(v, vec2(0.99999))) / cells;
}

// Across a line along unit `direction`.
vec3 across(vec3 v, vec3 direction) { return v - dot(v, direction) * direction; }

// Of the plain way.
float plain_density(vec3 at, vec3 direction) {
    vec3 off = across(at - scene.scene_center, direction);
    return dot(off, off) <= 1.0001 * scene.scene_radius * scene.scene_radius ? 1.0 / beam_area() : 0.0;
}

// Of a guide's way; y: by area alone, whatever the direction.
vec2 density_by(Guide guide, GuidedStart start, float plain) {
    if (guide.source != start.source) return vec2(plain);
    vec3 d = across(start.at - guide.position, start.direction);
    float distance2 = dot(d, d);
    vec2 sum = vec2(0.0);
    for (uint level = 0u; level < LEVELS; ++level) {
        float radius = radius_of(guide, level), cells = LEVEL_CELLS[level];
        if (distance2 > radius * radius) continue;
        float share = 1.0 / (float(LEVELS) * PI * radius * radius);
        sum.y += share;
        if (start.source != ENVIRONMENT_SOURCE) sum.x += share;
        else if (floor(guide.v * cells) == floor(start.v * cells)) sum.x += cells * cells * share;
    }
    return sum;
}

// A path along unit `direction`, by the numbers `place`; `v` those that chose the direction. `paths_here` is p_light · P.
GuidedStart guided_start(Choice c, uint source, vec2 v, vec2 place, vec3 direction, float paths_here) {
    bool plainly = c.guide.source == NO_SOURCE;
    float radius = plainly ? scene.scene_radius : radius_of(c.guide, c.level);
    vec3 centre = plainly ? scene.scene_center : c.guide.position;
    // A hair inside, so that rounding leaves the start in the disc that it is from.
    vec3 at = centre + basis_around(direction) * vec3(0.9999 * radius * sample_disc(place), 0.0);
    GuidedStart start = GuidedStart(c.guide, at, direction, v, source, 0.0, 0.0);
    float plain = plain_density(at, direction);
    vec2 density = vec2(plain);
    if (guides.count > 0u) {
        vec2 sum = vec2(0.0);
        for (uint i = 0u; i < guides.count; ++i) sum += density_by(guides.data[i], start, plain);
        density = PLAIN_SHARE * plain + (1.0 - PLAIN_SHARE) * sum / float(guides.count);
    }
    start.density = density.x;
    start.spread = 1.0 / (PI * paths_here * density.y);
    return start;
}

// Before anything that could be met.
vec3 origin_of(GuidedStart start) {
    return start.at - (scene.scene_radius + dot(start.at - scene.scene_center, start.direction)) * start.direction;
}

// From `x` to around where the pilot came from; a cosine of 1: it came from here, or from the camera.
vec4 cone_back(Guide guide, vec3 x) {
    vec3 to = guide.before - x;
    float distance2 = dot(to, to), radius = radius_of(guide, 0u);
    if (guide.edge == 0.0 || distance2 <= radius * radius) return vec4(0.0, 0.0, 1.0, 1.0);
    return vec4(to * inversesqrt(distance2), inversesqrt(1.0 + radius * radius / distance2));
}

// By solid angle, of a direction at cosine `cosine` from the normal.
float density_back(Guide guide, vec3 x, vec3 direction, float cosine) {
    vec4 cone = cone_back(guide, x);
    float plain = cosine / PI;
    if (cone.w >= 1.0) return plain;
    float aimed = dot(cone.xyz, direction) >= cone.w ? 1.0 / (2.0 * PI * (1.0 - cone.w)) : 0.0;
    return mix(plain, aimed, AIMED_SHARE);
}

// The way of a path from its first diffuse hit; `weight`: that of diffuse light there over its density.
vec3 guided_bounce(GuidedStart start, vec3 x, vec3 normal, vec2 u, uint bits, out float weight) {
    vec4 cone = vec4(0.0, 0.0, 1.0, 1.0);
    if (start.guide.source != NO_SOURCE && unit_float(bits) < AIMED_SHARE) cone = cone_back(start.guide, x);
    vec3 direction = basis_around(cone.w < 1.0 ? cone.xyz : normal) *
                     (cone.w < 1.0 ? sample_cone(0.9999 * u, cone.w) : sample_cosine_hemisphere(u));
    float cosine = dot(normal, direction);
    weight = cosine > 0.0 ? 1.0 : 0.0;
    if (cosine <= 0.0 || guides.count == 0u) return direction;
    float plain = plain_density(start.at, start.direction), sum = 0.0;
    for (uint i = 0u; i < guides.count; ++i) {
        Guide guide = guides.data[i];
        float by_start = density_by(guide, start, plain).x;
        if (by_start > 0.0) sum += by_start * (guide.source != start.source ? cosine / PI : density_back(guide, x, direction, cosine));
    }
    float density = PLAIN_SHARE * plain * cosine / PI + (1.0 - PLAIN_SHARE) * sum / float(guides.count);
    weight = start.density * cosine / (PI * density);
    return direction;
}

#endif
