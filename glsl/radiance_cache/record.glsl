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
const uint RUN = 128u;           // VPLs that light it

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

// A surface of the cell along ray `i` across it, one of those that face its side: any, where there are several;
// what others lie on only where there is nothing else, for that is not seen.
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
    for (uint met = 0u; met < 4u && going; ++met) {
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
        if (probed.open && !open) continue;
        if (open && !probed.open) probed.found = 0u;
        ++probed.found;
        if (unit_float(hash(seed, i, met)) * float(probed.found) >= 1.0) continue;
        probed = Probed(x.position, x.normal, x.geometric_normal, x.side_normal, x.lift, probed.found, open);
    }
    return probed;
}

Receiver receiver_of(Probed p) { return Receiver(p.position, p.normal, p.geometric_normal, p.side_normal, p.lift); }

// Share of its own light that a cell gets back from surfaces nearer than bounds VPLs, by cosine-distributed ray `i`, as if they
// were lit as the cell is.
vec3 share_of_near(Receiver x, uint i, uint seed, float min_distance, inout uint rays) {
    vec3 direction = basis_around(x.normal) * sample_cosine_hemisphere(sobol(i, hash(seed, 4u)));
    if (dot(x.geometric_normal, direction) <= 0.0) return vec3(0.0);
    Hit hit;
    ++rays;
    if (!trace_closest(target(x), direction, 0.0, 1.2 * min_distance, hit)) return vec3(0.0);
    Surface s = surface_at(hit);
    bool front = face(s, -direction);
    float lost = 1.0 - bounded(distance(x.position, s.position), min_distance);
    return lost * scattered_albedo(s.material, clamp(-dot(s.normal, direction), 0.0, 1.0), front);
}

// Light that goes to and fro between the cell and those surfaces, too.
vec3 with_near(vec3 light, vec3 near) { return light / (1.0 - min(near / float(LANES), vec3(0.95))); }

// W/m² that arrive along one sample of the lights, over its probability.
vec3 arriving_light(Receiver x, vec3 u, inout uint rays) {
    vec3 from;
    LightSample light;
    if (!sample_light(all_lights(), x, false, u, light, from) || dot(x.side_normal, light.direction) <= 0.0) return vec3(0.0);
    float cosine = dot(x.normal, light.direction);
    if (cosine <= 0.0) return vec3(0.0);
    return arriving(cosine * light.radiance_over_pdf, from, light.direction, light.distance, rays);
}

uint run_length() { return min(RUN, count.vpls); }

// Light sample `i` of LIGHT_SAMPLES.
vec3 share_of_light(Receiver x, uint i, uint seed, inout uint rays) {
    vec3 u = vec3(sobol(i, hash(seed, 2u)).x, sobol(i, hash(seed, 3u)));
    return arriving_light(x, u, rays) / float(LIGHT_SAMPLES);
}

// VPL `i` of the run, of those that fewer than `bounces` diffuse hits have left: the cell's own is one more.
vec3 share_of_vpl(Receiver x, uint i, uint seed, float min_distance, uint bounces, inout uint rays) {
    uint k = (uint(unit_float(seed) * float(count.vpls)) + i) % count.vpls;
    if (vpls.data[k].bounce + 1u >= bounces) return vec3(0.0);
    Connection c = connect_vpl(k, x, min_distance);
    return arriving_vpl(c, rays) * (float(count.vpls) / float(run_length()));
}

#endif
