// The irradiance of a cell: rays across it find its surfaces, which lights and VPLs light. Expects `vpls` and `count`.
#ifndef RADIANCE_CACHE_RECORD_GLSL
#define RADIANCE_CACHE_RECORD_GLSL

#include "indirect/vpls.glsl"
#include "lib/light_sampler.glsl"
#include "radiance_cache/cells.glsl"
#include "radiance_cache/rays.glsl"

const uint LANES = 32u;          // that share a record
const uint POINTS_A_CELL = 16u;  // at most
const uint LIGHT_SAMPLES = 32u;  // of a record
const uint VPL_SAMPLES = 64u;    // as well
const uint CANDIDATES = 1024u;   // VPLs that those are chosen from, at most
const float BY_PROMISE = 0.8;    // of them
const float LEAST_FACING = 0.1;  // cosines below this promise as much: a cell has many points and normals

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

// What finds its way to points of a cell.
struct Lit {
    vec3 light; // W/m²
    vec3 near;  // share of their own light that comes back
    vec3 lamps; // W/m² of lamps that rays find by way of mirrors and glass
};

const Lit UNLIT = Lit(vec3(0.0), vec3(0.0), vec3(0.0));

// Such lamps are bright and rare: they count no more than all else that arrives. Light goes to and fro between the cell and
// what is near, too.
vec3 irradiance_of(Lit lit) {
    vec3 lamps = lit.lamps;
    if (sum(lamps) > sum(lit.light)) lamps *= sum(lit.light) / sum(lamps);
    return (lit.light + lamps) / (1.0 - min(lit.near, vec3(0.95)));
}

// Light on its way to a point, W/m² of it if nothing is between.
struct Sent {
    vec3 light;
    vec3 from;
    vec3 along;
    float reach;
};

const Sent NOTHING = Sent(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);

// One sample of the lights, over its probability. `beside_rays`: cosine-distributed rays find the environment as well.
Sent by_light(Receiver x, vec3 u, bool beside_rays) {
    vec3 from;
    LightSample light;
    if (!sample_light(all_lights(), x, false, u, light, from) || dot(x.side_normal, light.direction) <= 0.0) return NOTHING;
    float cosine = dot(x.normal, light.direction);
    if (cosine <= 0.0) return NOTHING;
    if (ENVIRONMENT && beside_rays && light.sky) light.radiance_over_pdf *= light.pdf / (light.pdf + cosine / PI);
    return Sent(cosine * light.radiance_over_pdf, from, light.direction, light.distance);
}

// VPL `k`, chosen with this probability, if fewer than `bounces` diffuse hits have left it: the point's own is one more.
Sent by_vpl(Receiver x, uint k, float probability, float min_distance, uint bounces) {
    if (vpls.data[k].bounce + 1u >= bounces) return NOTHING;
    Connection c = connect_vpl(k, x, min_distance);
    return Sent(c.light / probability, c.from, c.to - c.from, 1.0);
}

// VPLs are chosen from a run that begins anywhere.
uint candidates() { return min(CANDIDATES, count.vpls); }

uint candidate(uint i, uint seed) { return (uint(unit_float(seed) * float(count.vpls)) + i) % count.vpls; }

// Where a cell is lit.
struct Target {
    vec3 position;
    vec3 axis;
    float edge;
    uint bounces;
};

Target target_of(Chosen c, Cell cell, float least, uint bounces) {
    Target t = Target(point_of(findLSB(c.beside)).position, vec3(0.0), edge_of(cell.level, least), bounces);
    t.axis[cell.face >> 2] = (cell.face & 2u) != 0u ? -1.0 : 1.0;
    return t;
}

// About what a candidate brings there, if nothing is between.
float promise(uint i, uint seed, Target t) {
    Vpl vpl = vpls.data[candidate(i, seed)];
    if (vpl.bounce + 1u >= t.bounces) return 0.0;
    vec3 to = vpl.position - t.position;
    float distance2 = max(dot(to, to), t.edge * t.edge), inverse = inversesqrt(distance2);
    vec2 cosines = max(inverse * vec2(dot(t.axis, to), -dot(vpl.normal, to)), LEAST_FACING);
    return sum(vpl.flux) * cosines.x * cosines.y / (distance2 + vpl.spread);
}

// A lane's candidates: first and end.
uvec2 candidates_of(uint lane) { return uvec2(lane, lane + 1u) * candidates() / LANES; }

float promise_of_lane(uint lane, uint seed, Target t) {
    uvec2 range = candidates_of(lane);
    float all = 0.0;
    for (uint i = range.x; i < range.y; ++i) all += promise(i, seed, t);
    return all;
}

// Whoever includes this says what the candidates of each lane promise.
float promised(uint lane);

struct ChosenVpl {
    uint k;
    float probability;
};

// By u in [0, 1): four times of five by its promise, else like any other.
ChosenVpl choose_vpl(float u, uint seed, Target t) {
    float all = 0.0;
    for (uint lane = 0u; lane < LANES; ++lane) all += promised(lane);
    float share = all > 0.0 ? BY_PROMISE : 0.0;
    uint number = candidates(), i = min(uint(max(u - share, 0.0) / (1.0 - share) * float(number)), number - 1u);
    if (u < share) {
        float left = u / share * all;
        uint lane = 0u;
        for (uint l = 0u; l + 1u < LANES; ++l) {
            if (l != lane || left < promised(l)) continue;
            left -= promised(l);
            ++lane;
        }
        uvec2 range = candidates_of(lane);
        i = range.x;
        for (uint j = range.x; j + 1u < range.y; ++j) {
            if (j != i) continue;
            float p = promise(j, seed, t);
            if (left < p) continue;
            left -= p;
            ++i;
        }
    }
    float by_promise = all > 0.0 ? share * promise(i, seed, t) / all : 0.0;
    float in_run = float(number) / float(count.vpls);
    return ChosenVpl(candidate(i, seed), in_run * (by_promise + (1.0 - share) / float(number)));
}

vec3 arriving_sent(Sent s, bool vpl, inout uint rays) {
    return s.light == vec3(0.0) ? s.light : arriving(s.light, s.from, s.along, s.reach, vpl, rays);
}

// By cosine-distributed ray `i`: the share of its own light that a cell gets back from surfaces nearer than bounds VPLs, as if
// they were lit as the cell is; light of the environment, and of lamps by way of mirrors and glass. `end.bent`: they lead to
// a surface whose light is still to be asked for.
Lit share_of_ray(Receiver x, uint i, uint seed, float min_distance, out End end, inout uint rays) {
    Lit lit = UNLIT;
    end.found = end.bent = false;
    vec3 direction = basis_around(x.normal) * sample_cosine_hemisphere(sobol(i, hash(seed, 4u)));
    if (dot(x.geometric_normal, direction) <= 0.0) return lit;
    end = follow(target(x), direction, false, ENVIRONMENT, min_distance, hash(seed, 5u, i), rays);
    if (ENVIRONMENT) {
        float by_ray = dot(x.normal, direction) / PI, by_light = environment_pdf(all_lights(), direction);
        lit.light = end.sky * (PI * by_ray / (by_ray + by_light));
    }
    lit.lamps = PI * end.radiance;
    if (end.found && !end.bent) lit.near = end.weight;
    return lit;
}

// What a lane adds to a record: of points beside the first one, and of the others.
struct Sides {
    Lit beside;
    Lit behind;
};

const Sides DARK = Sides(UNLIT, UNLIT);

Lit sum_of(Lit a, Lit b) { return Lit(a.light + b.light, a.near + b.near, a.lamps + b.lamps); }

Sides sum_of(Sides a, Sides b) { return Sides(sum_of(a.beside, b.beside), sum_of(a.behind, b.behind)); }

// What a ray's end that mirrors and glass lead to asks: one sample of the lights, and these VPLs.
const uint VPLS_AT_END = 4u;

Sides share_of_lane(Chosen c, Target t, uint lane, uint seed, float min_distance, uint bounces, inout uint rays) {
    Sides sides = DARK;
    uint samples = count.vpls > 0u ? VPL_SAMPLES : 0u, at_ends = count.vpls > 0u ? VPLS_AT_END : 0u;
    uint reach = max(max(LIGHT_SAMPLES, samples), LANES);
    for (uint i = lane; i < reach; i += LANES) {
        bool behind = is_behind(c, i);
        Receiver x = receiver_of(point_of(point_for(c, i, behind))), y = x;
        Lit lit = UNLIT;
        vec3 weight = vec3(0.0);
        bool bent = false;
        if (i < LANES) {
            End end;
            lit = share_of_ray(x, i, seed, min_distance, end, rays);
            float share = 1.0 / float(dealt(c, LANES, behind));
            lit = Lit(share * lit.light, share * lit.near, share * lit.lamps);
            bent = (MIRRORS || GLASS) && end.found && end.bent && bounces > 1u;
            if (bent) {
                weight = share * end.weight;
                y = receiver_at(end.surface);
            }
        }
        // All in one loop, since a copy of what it takes would be as long as the rest.
        uint lights = i < LIGHT_SAMPLES ? 1u : 0u, own = lights + (i < samples ? 1u : 0u);
        uint last = bent ? own + 1u + at_ends : own;
        for (uint j = 0u; j < last; ++j) {
            bool at_end = j >= own;
            bool by_lights = at_end ? j == own : j < lights;
            uint k = at_end ? by_lights ? 0u : j - own - 1u : i;
            uint of = by_lights ? at_end ? 1u : LIGHT_SAMPLES : at_end ? at_ends : samples;
            uint at = at_end ? hash(seed, 6u, i) : seed;
            Receiver z = x;
            if (at_end) z = y;
            Sent sent;
            if (by_lights) sent = by_light(z, vec3(sobol(k, hash(at, 2u)).x, sobol(k, hash(at, 3u))), !at_end);
            else {
                ChosenVpl v = ChosenVpl(candidate(k, at), 1.0 / float(count.vpls));
                if (!at_end) v = choose_vpl((float(k) + unit_float(hash(seed, 7u, k))) / float(samples), seed, t);
                sent = by_vpl(z, v.k, v.probability, min_distance, at_end ? bounces - 1u : bounces);
            }
            vec3 light = arriving_sent(sent, !by_lights, rays);
            lit.light += at_end ? weight * light / float(of) : light / float(dealt(c, of, behind));
        }
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
    r.light = irradiance_of(sides.beside);
    if (c.behind == 0u) return r;
    r.behind = irradiance_of(sides.behind);
    // Never 0.
    r.first = 1u << 30 | place_in(cell, point_of(findLSB(c.beside)).position, edge_of(cell.level, least));
    return r;
}

#endif
