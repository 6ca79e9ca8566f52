// The irradiance of a cell: rays across it find its surfaces, which lights and a run of VPLs light. Expects `vpls` and
// `count`.
#ifndef RADIANCE_CACHE_RECORD_GLSL
#define RADIANCE_CACHE_RECORD_GLSL

#include "indirect/vpls.glsl"
#include "lib/albedo.glsl"
#include "lib/light_sampler.glsl"
#include "radiance_cache/cells.glsl"

const uint LANES = 32u;          // that share a record
const uint POINTS_A_CELL = 16u;  // at most
const uint LIGHT_SAMPLES = 32u;  // of a record
const uint RUN = 96u;            // VPLs that light it

// What lanes know of a cell.
struct Probed {
    vec3 position;
    vec3 normal;
    vec3 geometric_normal;
    vec3 side_normal;
    float lift;
    uint found; // surfaces it is one of; 0: none
    bool open;  // nothing lies on it
};

uint record_seed(uvec2 key) { return hash(key.x, key.y, hash(scene.seed, 0x63656c6cu)); }

// A surface of the cell along ray `i` across it, one of those that face its side: any, where there are several.
Probed probe_cell(Cell cell, uint i, uint seed, float least, inout uint rays) {
    float edge = edge_of(cell.level, least);
    uint axis = cell.face >> 2;
    float side = (cell.face & 2u) != 0u ? -1.0 : 1.0;
    vec2 u = sobol(i, hash(seed, 1u));
    vec3 along = vec3(0.0), at = corner_of(cell, edge);
    along[axis] = -side;
    at[(axis + 1u) % 3u] += edge * u.x;
    at[(axis + 2u) % 3u] += edge * u.y;
    // A surface on the border belongs to both cells.
    float margin = 1e-3 * edge;
    at[axis] += side > 0.0 ? edge + margin : -margin;
    float reach = edge + 2.0 * margin;
    Probed probed = Probed(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0u, false);
    bool going = true;
    for (uint met = 0u; met < 12u && going; ++met) {
        Hit hit;
        ++rays;
        going = trace_closest(at, along, 0.0, reach, hit);
        if (!going) continue;
        Surface surface = surface_at(hit);
        bool front = face(surface, -along);
        vec3 there = beyond(surface, along);
        reach -= max(dot(there - at, along), 0.0);
        at = there;
        going = reach > 0.0;
        if (face_of(surface.geometric_normal, front) != cell.face) continue;
        Receiver x = receiver_at(surface);
        ++rays;
        bool open = !trace_any(target(x), x.geometric_normal, 0.0, 0.1 * edge);
        ++probed.found;
        if (unit_float(hash(seed, i, met)) * float(probed.found) >= 1.0) continue;
        probed = Probed(x.position, x.normal, x.geometric_normal, x.side_normal, x.lift, probed.found, open);
    }
    return probed;
}

Receiver receiver_of(Probed p) { return Receiver(p.position, p.normal, p.geometric_normal, p.side_normal, p.lift); }

// Whoever includes this says where the points of a cell are.
Probed point_of(uint i);

// Points of a cell that surfaces were found at, a bit each.
struct Surfaces {
    uint found;
    uint open; // of those
};

Surfaces surfaces_of_cell() {
    Surfaces p = Surfaces(0u, 0u);
    for (uint i = 0u; i < POINTS_A_CELL; ++i) {
        uint bit = 1u << i;
        if (point_of(i).found > 0u) p.found |= bit;
        if (point_of(i).found > 0u && point_of(i).open) p.open |= bit;
    }
    return p;
}

uint first_of(Surfaces p) { return findLSB(p.open != 0u ? p.open : p.found); }

// The bit of point `i`, if the first one sees it.
uint is_seen(Surfaces p, uint i, Cell cell, float least, inout uint rays) {
    if ((p.found >> i & 1u) == 0u) return 0u;
    float edge = edge_of(cell.level, least);
    vec3 from, along;
    uint first = place_in(cell, point_of(first_of(p)).position, edge);
    if (!way_between(cell, place_in(cell, point_of(i).position, edge), first, edge, from, along)) return 1u << i;
    ++rays;
    return trace_any(from, along, 0.0, 1.0) ? 0u : 1u << i;
}

// Points that a record is of, a bit each: those that the first one sees, and those that it does not. What something lies on is
// hardly seen, and left out where it belongs to what is.
struct Chosen {
    uint beside;
    uint behind;
};

Chosen chosen_of(Surfaces p, uint seen) {
    return Chosen(seen & (p.open != 0u ? p.open : p.found), p.found & ~seen);
}

// Samples are taken at the points of either side in turn: one in so many on the side of fewer points.
const uint FEWER = 4u;

bool is_behind(Chosen c, uint i) {
    if (c.behind == 0u) return false;
    return (i % FEWER == 0u) == (bitCount(c.behind) < bitCount(c.beside));
}

// How many of so many samples come before one on its side.
uint dealt(Chosen c, uint samples, bool behind) {
    if (c.behind == 0u) return samples;
    uint fewer = (samples + FEWER - 1u) / FEWER;
    return behind == (bitCount(c.behind) < bitCount(c.beside)) ? fewer : samples - fewer;
}

// Which point sample `i` is taken at.
uint point_for(Chosen c, uint i, bool behind) {
    uint left = behind ? c.behind : c.beside;
    for (uint skip = dealt(c, i, behind) % bitCount(left); skip > 0u; --skip) left &= left - 1u;
    return findLSB(left);
}

// Share of its own light that a cell gets back from surfaces nearer than bounds VPLs, by cosine-distributed ray `i`, as if they
// were lit as the cell is; and light of the environment that the ray finds, times π.
void share_of_near(Receiver x, uint i, uint seed, float min_distance, out vec3 near, out vec3 sky, inout uint rays) {
    near = sky = vec3(0.0);
    vec3 direction = basis_around(x.normal) * sample_cosine_hemisphere(sobol(i, hash(seed, 4u)));
    if (dot(x.geometric_normal, direction) <= 0.0) return;
    Hit hit;
    ++rays;
    float reach = ENVIRONMENT ? 1.0 / 0.0 : 1.2 * min_distance;
    if (trace_closest(target(x), direction, 0.0, reach, hit)) {
        Surface s = surface_at(hit);
        bool front = face(s, -direction);
        float lost = 1.0 - bounded(distance(x.position, s.position), min_distance);
        if (lost > 0.0) near = lost * scattered_albedo(s.material, clamp(-dot(s.normal, direction), 0.0, 1.0), front);
    } else if (ENVIRONMENT) {
        float by_ray = dot(x.normal, direction) / PI, by_light = environment_pdf(all_lights(), direction);
        sky = environment_radiance(direction) * (PI * by_ray / (by_ray + by_light));
    }
}

// Light that goes to and fro between the cell and those surfaces, too.
vec3 with_near(vec3 light, vec3 near) { return light / (1.0 - min(near, vec3(0.95))); }

// W/m² that arrive along one sample of the lights, over its probability. `beside_rays`: cosine-distributed rays find the
// environment as well.
vec3 arriving_light(Receiver x, vec3 u, bool beside_rays, inout uint rays) {
    vec3 from;
    LightSample light;
    if (!sample_light(all_lights(), x, false, u, light, from) || dot(x.side_normal, light.direction) <= 0.0) return vec3(0.0);
    float cosine = dot(x.normal, light.direction);
    if (cosine <= 0.0) return vec3(0.0);
    if (ENVIRONMENT && beside_rays && light.sky) light.radiance_over_pdf *= light.pdf / (light.pdf + cosine / PI);
    return arriving(cosine * light.radiance_over_pdf, from, light.direction, light.distance, rays);
}

uint run_length() { return min(RUN, count.vpls); }

// VPL `i` of the run, of those that fewer than `bounces` diffuse hits have left: the cell's own is one more.
vec3 share_of_vpl(Receiver x, uint i, uint seed, float min_distance, uint bounces, inout uint rays) {
    uint k = (uint(unit_float(seed) * float(count.vpls)) + i) % count.vpls;
    if (vpls.data[k].bounce + 1u >= bounces) return vec3(0.0);
    Connection c = connect_vpl(k, x, min_distance);
    return arriving_vpl(c, rays) * float(count.vpls);
}

struct Lit {
    vec3 light;
    vec3 near;
};

// What a lane adds to a record: of points beside the first one, and of the others.
struct Sides {
    Lit beside;
    Lit behind;
};

const Sides DARK = Sides(Lit(vec3(0.0), vec3(0.0)), Lit(vec3(0.0), vec3(0.0)));

Sides sum_of(Sides a, Sides b) {
    return Sides(Lit(a.beside.light + b.beside.light, a.beside.near + b.beside.near),
                 Lit(a.behind.light + b.behind.light, a.behind.near + b.behind.near));
}

Sides share_of_lane(Chosen c, uint lane, uint seed, float min_distance, uint bounces, inout uint rays) {
    Sides sides = DARK;
    uint length = run_length(), reach = max(max(LIGHT_SAMPLES, length), LANES);
    for (uint i = lane; i < reach; i += LANES) {
        bool behind = is_behind(c, i);
        Receiver x = receiver_of(point_of(point_for(c, i, behind)));
        Lit lit = Lit(vec3(0.0), vec3(0.0));
        if (i < LANES) {
            vec3 near, sky;
            share_of_near(x, i, seed, min_distance, near, sky, rays);
            lit.near = near / float(dealt(c, LANES, behind));
            lit.light = sky / float(dealt(c, LANES, behind));
        }
        if (i < LIGHT_SAMPLES) {
            vec3 u = vec3(sobol(i, hash(seed, 2u)).x, sobol(i, hash(seed, 3u)));
            lit.light += arriving_light(x, u, true, rays) / float(dealt(c, LIGHT_SAMPLES, behind));
        }
        if (i < length) lit.light += share_of_vpl(x, i, seed, min_distance, bounces, rays) / float(dealt(c, length, behind));
        Sides both = DARK;
        if (behind) both.behind = lit;
        else both.beside = lit;
        sides = sum_of(sides, both);
    }
    return sides;
}

// Of what all lanes have added.
Record record_of(Chosen c, Cell cell, float least, Sides sides) {
    Record r = Record(vec3(-1.0), vec3(0.0), 0u);
    if (c.beside == 0u) return r;
    r.light = with_near(sides.beside.light, sides.beside.near);
    if (c.behind == 0u) return r;
    r.behind = with_near(sides.behind.light, sides.behind.near);
    // Never 0.
    r.first = 1u << 30 | place_in(cell, point_of(findLSB(c.beside)).position, edge_of(cell.level, least));
    return r;
}

#endif
