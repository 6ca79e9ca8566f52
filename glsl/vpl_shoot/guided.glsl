// Density of starts of paths from infinitely far away: a quarter of them plainly, anywhere on the disc that faces the scene's
// bounding sphere, the others towards a guide, in one of three resolutions, so that no place that matters is left to the plain
// ones alone. Flux is divided by the density of all ways together (the balance heuristic; Veach 1997, §9.2): whatever the
// guides are, the mean is the same.
#ifndef VPL_SHOOT_GUIDED_GLSL
#define VPL_SHOOT_GUIDED_GLSL

const float PLAIN_SHARE = 0.25;
const uint LEVELS = 3u;
// Directions to the environment, as the numbers that choose one in proportion to radiance, in squares of equal power …
const float LEVEL_CELLS[LEVELS] = float[LEVELS](32.0, 8.0, 2.0);
// … and discs around the guide, of radii in units of its own.
const float LEVEL_RADII[LEVELS] = float[LEVELS](1.0, 3.0, 9.0);

struct Choice {
    Guide guide;
    uint level;
};

struct GuidedStart {
    vec3 origin;
    float density; // by area across the direction (1/m²) and in the unit square of numbers that choose it
};

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

float start_density(uint source, vec2 v, vec3 at, vec3 direction) {
    vec3 off = across(at - scene.scene_center, direction);
    float plain = dot(off, off) <= 1.0001 * scene.scene_radius * scene.scene_radius ? 1.0 / beam_area() : 0.0;
    if (guides.count == 0u) return plain;
    float sum = 0.0;
    for (uint i = 0u; i < guides.count; ++i) {
        Guide guide = guides.data[i];
        if (guide.source != source) {
            sum += plain;
            continue;
        }
        vec3 d = across(at - guide.position, direction);
        float distance2 = dot(d, d);
        for (uint level = 0u; level < LEVELS; ++level) {
            float radius = radius_of(guide, level), cells = LEVEL_CELLS[level];
            if (distance2 > radius * radius) continue;
            if (source != ENVIRONMENT_SOURCE) cells = 1.0;
            else if (floor(guide.v * cells) != floor(v * cells)) continue;
            sum += cells * cells / (float(LEVELS) * PI * radius * radius);
        }
    }
    return PLAIN_SHARE * plain + (1.0 - PLAIN_SHARE) * sum / float(guides.count);
}

float spread_of(GuidedStart start, float paths_here) { return 1.0 / (PI * paths_here * start.density); }

// A path along unit `direction`, by the numbers `place`; `v` those that chose the direction.
GuidedStart guided_start(Choice c, uint source, vec2 v, vec2 place, vec3 direction) {
    bool plain = c.guide.source == NO_SOURCE;
    float radius = plain ? scene.scene_radius : radius_of(c.guide, c.level);
    vec3 centre = plain ? scene.scene_center : c.guide.position;
    // A hair inside, so that rounding leaves the start in the disc that it is from.
    vec3 at = centre + basis_around(direction) * vec3(0.9999 * radius * sample_disc(place), 0.0);
    float back = scene.scene_radius + dot(at - scene.scene_center, direction);
    return GuidedStart(at - back * direction, start_density(source, v, at, direction));
}

#endif
