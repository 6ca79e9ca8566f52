// Lights chosen by what a receiver can get of them: a tree over those with a place, descended by bounds of irradiance
// (Conty Estevez & Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", 2018), and beside it with a
// fixed probability what is infinitely far away. A triangle is sampled by the solid angle that it shows where it looks
// large, else by its area. Without a tree lights are chosen by power alone, whatever the receiver.
//
// A light has a probability wherever it gives anything: bounds are of spheres and cones and widened by what rounding may
// take, and only an unlit side is certain to get nothing. `through`: of receivers that transmit both sides count.
#ifndef LIB_LIGHT_SAMPLER_GLSL
#define LIB_LIGHT_SAMPLER_GLSL

#include "lib/lights.glsl"

// What is chosen from: by power the whole table; with a tree what is infinitely far away.
struct LightSource {
    LightTable table;
    uint root;
    float tree_probability;
};

bool has_light_tree() { return LIGHT_TREE && scene.light_nodes != 0UL; }

LightSource light_source(LightTable by_power, LightSet set) {
    if (!has_light_tree()) return LightSource(by_power, 0u, 0.0);
    LightTable infinite = LightTable(set.first, set.count, set.count, 0.0, by_power.rows, by_power.columns);
    return LightSource(infinite, set.root, set.tree_probability);
}

LightSource all_lights() { return light_source(table_of_all(), scene.all_lights); }
// Those that are not asked one by one.
LightSource sampled_lights() { return light_source(table_of_area_lights(), scene.sampled_lights); }
LightSource lights_beside_lobes() { return light_source(table_beside_lobes(), scene.lights_beside_lobes); }

// cos(max(0, a − b)) of angles up to π.
float cos_beyond(float cos_a, float cos_b) {
    if (cos_a >= cos_b) return 1.0;
    return cos_a * cos_b + sqrt(max(0.0, 1.0 - cos_a * cos_a) * max(0.0, 1.0 - cos_b * cos_b));
}

// Cosines below this (of what may still be lit) count as this: bounds are loose, and a small chance costs little.
const float LEAST_COSINE = 0.02;

// Bounds the irradiance by what a node holds, but for distance, which is at least its radius.
float importance(LightNode node, Receiver x, bool through) {
    float slack = x.lift + 2.0 * scene.ray_epsilon;
    vec3 to = node.center - x.position;
    float distance2 = dot(to, to);
    float radius = node.radius + slack, radius2 = radius * radius;
    float bound = node.intensity / max(distance2, radius2);
    bool leaf = (node.child & LIGHT_NODE_LEAF) != 0u, two_sided = (node.child & LIGHT_NODE_TWO_SIDED) != 0u;
    bool triangle = leaf && (node.child & LIGHT_NODE_DELTA) == 0u;
    // The back of one triangle is known for certain.
    if (triangle && !two_sided && dot(to, node.axis) >= slack) return 0.0;
    if (distance2 <= radius2) return bound;
    to *= inversesqrt(distance2);
    float cos_size = sqrt(1.0 - radius2 / distance2);
    float facing = -dot(to, node.axis);
    if (two_sided) facing = abs(facing);
    facing = cos_beyond(cos_beyond(facing, node.cos_spread), cos_size);
    if (facing < node.cos_reach) return 0.0;
    float side = dot(x.side_normal, to), cosine = dot(x.normal, to);
    if (through) cosine = abs(cosine);
    else if (cos_beyond(side, cos_size) < -1e-4) return 0.0;
    cosine = cos_beyond(cosine, cos_size);
    return bound * max(facing, LEAST_COSINE) * max(cosine, LEAST_COSINE);
}

LightNode light_node(uint place) { return (LightNodeArray(scene.light_nodes) + place).at; }

// Probability of the first of two siblings, one that numbers in [0, 1) can meet and miss where both give something; false
// where neither does.
bool share_of(LightNode first, LightNode second, Receiver x, bool through, out float p) {
    float a = importance(first, x, through), b = importance(second, x, through);
    p = b > 0.0 ? a > 0.0 ? clamp(a / (a + b), 1e-5, 1.0 - 1e-5) : 0.0 : 1.0;
    return a + b > 0.0;
}

// A leaf, by u in [0, 1), and its probability; false where nothing arrives.
bool descend(uint root, Receiver x, bool through, float u, out LightNode node, out float probability) {
    probability = 1.0;
    node = light_node(root);
    bool lit = importance(node, x, through) > 0.0;
    while (lit && (node.child & LIGHT_NODE_LEAF) == 0u) {
        uint child = node.child & LIGHT_NODE_INDEX;
        LightNode first = light_node(child), second = light_node(child + 1u);
        float p;
        lit = share_of(first, second, x, through, p);
        bool left = u < p;
        u = min(left ? u / p : (u - p) / (1.0 - p), 0.99999994);
        probability *= left ? p : 1.0 - p;
        node = first;
        if (!left) node = second;
    }
    return lit;
}

// The probability with which descend() finds a leaf.
float probability_of(uint root, uint leaf, Receiver x, bool through) {
    float probability = 1.0;
    uint place = leaf;
    LightNode node = light_node(place);
    while (place != root && probability > 0.0) {
        LightNode sibling = light_node(place ^ 1u);
        LightNode first = node, second = sibling;
        bool left = (place & 1u) == 0u;
        if (!left) {
            first = sibling;
            second = node;
        }
        float p;
        bool lit = share_of(first, second, x, through, p);
        probability *= !lit ? 0.0 : left ? p : 1.0 - p;
        place = node.parent;
        node = light_node(place);
    }
    return importance(node, x, through) > 0.0 ? probability : 0.0;
}

// Triangles that look larger than the first of these (sr) and smaller than the second are sampled by solid angle: below
// their directions differ too little in 32 bits, above they are nearly a half-space.
const float LEAST_SOLID_ANGLE = 2e-3;
const float MOST_SOLID_ANGLE = 6.2;

// A triangle as it looks from a point.
struct Facet {
    vec3 corners[3]; // from there
    vec3 across; // twice the area long
    vec3 directions[3]; // to the corners
    float volume; // of the parallelepiped that those span
    float solid_angle; // 0 where it is sampled by area
};

Facet facet(uint instance_index, uint primitive, vec3 from) {
    Facet f;
    Instance instance = InstanceArray(scene.instances)[instance_index].at;
    uvec3 v = TriangleArray(scene.triangles)[instance.first_triangle + primitive].at.vertices;
    for (uint i = 0u; i < 3u; ++i) {
        vec3 corner = Vec3Array(scene.positions)[v[i]].at;
        if (INSTANCED && instance_index != 0u) corner = instance.object_to_world * vec4(corner, 1.0);
        f.corners[i] = corner - from;
    }
    f.across = cross(f.corners[1] - f.corners[0], f.corners[2] - f.corners[0]);
    vec3 lengths = vec3(length(f.corners[0]), length(f.corners[1]), length(f.corners[2]));
    for (uint i = 0u; i < 3u; ++i) f.directions[i] = f.corners[i] / lengths[i];
    f.volume = abs(dot(f.corners[0], f.across)) / (lengths.x * lengths.y * lengths.z);
    vec3 cosines = vec3(dot(f.directions[0], f.directions[1]), dot(f.directions[0], f.directions[2]),
                        dot(f.directions[1], f.directions[2]));
    // Van Oosterom & Strackee 1983.
    f.solid_angle = 2.0 * atan(f.volume, 1.0 + cosines.x + cosines.y + cosines.z);
    bool fits = f.solid_angle > LEAST_SOLID_ANGLE && f.solid_angle < MOST_SOLID_ANGLE && dot(f.across, f.across) > 0.0;
    if (!fits) f.solid_angle = 0.0;
    return f;
}

// Barycentric weights of a point on it, uniform by solid angle: a triangle cut off by a great circle through one corner,
// then a point on that circle (Arvo 1995), without inverse trigonometry (Peters, "BRDF Importance Sampling for Polygonal
// Lights", 2021).
vec3 weights_by_solid_angle(Facet f, vec2 u) {
    float half_angle = 0.5 * f.solid_angle * u.x;
    float c = cos(half_angle), s = sin(half_angle);
    vec3 a = f.directions[0], b = f.directions[1];
    float to_c = dot(a, f.directions[2]) + dot(b, f.directions[2]);
    vec3 middle = a * (f.volume * c - to_c * s) + f.directions[2] * ((1.0 + dot(a, b)) * s);
    vec3 end = middle * (2.0 * dot(a, middle) / dot(middle, middle)) - a;
    float whole = dot(b, end), part = mix(1.0, whole, u.y);
    float squared = 1.0 - whole * whole;
    float t = squared > 0.0 ? sqrt(max(0.0, 1.0 - part * part) / squared) : u.y;
    vec3 direction = (part - t * whole) * b + t * end;
    vec3 p = direction * (dot(f.corners[0], f.across) / dot(direction, f.across)) - f.corners[0];
    vec3 e = f.corners[1] - f.corners[0], g = f.corners[2] - f.corners[0];
    vec2 w = vec2(dot(cross(p, g), f.across), dot(cross(e, p), f.across)) / dot(f.across, f.across);
    w = max(w, vec2(0.0));
    w /= max(w.x + w.y, 1.0);
    return vec3(1.0 - w.x - w.y, w);
}

// Of the direction to a point on it; `cosine`: at the triangle.
float facet_pdf(Facet f, float distance2, float cosine) {
    if (f.solid_angle > 0.0) return 1.0 / f.solid_angle;
    return distance2 / (0.5 * length(f.across) * cosine);
}

// A triangle that the tree has chosen, or the table.
bool sample_emitter(vec3 from, vec2 u, LightChoice choice, bool by_tree, float inverse_power, out LightSample s) {
    Facet f;
    vec3 weights = weights_by_area(u);
    if (by_tree) {
        f = facet(choice.instance, choice.primitive, from);
        if (f.solid_angle > 0.0) weights = weights_by_solid_angle(f, u);
    }
    EmitterPoint p = point_of(choice, weights);
    EmitterWay way;
    if (!way_to(p, from, way)) return false;
    float pdf = by_tree ? choice.probability * facet_pdf(f, way.distance2, way.cosine)
                        : emitter_density(p.index, inverse_power) * way.distance2 / way.cosine;
    s = sample_along(way, pdf);
    return !isinf(pdf);
}

// What the tree or the table has chosen.
struct ChosenLight {
    LightChoice choice; // its probability counts the one of the table
    bool by_tree;
    bool sky;
    bool delta;
    uint light; // of those
};

bool choose_light(LightSource lights, Receiver x, bool through, float u, out ChosenLight chosen) {
    chosen.by_tree = LIGHT_TREE && u < lights.tree_probability;
    if (chosen.by_tree) {
        LightNode leaf;
        float probability;
        if (!descend(lights.root, x, through, u / lights.tree_probability, leaf, probability)) return false;
        chosen.sky = false;
        chosen.delta = (leaf.child & LIGHT_NODE_DELTA) != 0u;
        chosen.light = leaf.child & LIGHT_NODE_INDEX;
        if (!chosen.delta) chosen.choice = LightChoiceArray(scene.light_choices)[scene.light_count + chosen.light].at;
        chosen.choice.probability = probability * lights.tree_probability;
        return true;
    }
    if (lights.table.count == 0u) return false;
    float rest = 1.0 - lights.tree_probability;
    uint i = choose(lights.table, min((u - lights.tree_probability) / rest, 0.99999994), chosen.choice);
    chosen.sky = is_environment(lights.table, i);
    chosen.delta = !chosen.sky && i < lights.table.deltas;
    chosen.light = has_light_tree() ? chosen.choice.instance : i;
    chosen.choice.probability *= rest;
    return true;
}

// Light that arrives at `from`, an origin off the receiver's surface, unless something is between. `u`: three numbers in
// [0, 1), x for the choice. False: nothing arrives.
bool sample_light(LightSource lights, Receiver x, bool through, vec3 from, vec3 u, out LightSample s) {
    s = LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, false, false);
    ChosenLight chosen;
    if (!choose_light(lights, x, through, u.x, chosen)) return false;
    if (chosen.sky) return sample_sky(lights.table, u.yz, chosen.choice, s);
    if (chosen.delta) return sample_delta(from, chosen.light, chosen.choice.probability, s);
    if (!EMISSIVE_TRIANGLES) return false;
    return sample_emitter(from, u.yz, chosen.choice, chosen.by_tree, lights.table.inverse_power, s);
}

// The same, and where shadow rays start.
bool sample_light(LightSource lights, Receiver x, bool through, vec3 u, out LightSample s, out vec3 from) {
    from = target(x);
    // A loop for at most two turns: drivers would inline a second call.
    bool lit, again, moved = false;
    do {
        lit = sample_light(lights, x, through, from, u, s);
        again = !moved && lit && lifted(x.lift, x.geometric_normal, s.direction);
        if (again) from = target(facing(x, s.direction));
        moved = true;
    } while (again);
    return lit;
}

// Density by solid angle of choosing the direction of a ray of unit length from `from` at a receiver that found this
// surface `distance` away; 0 where the side that it shows does not emit. `s` faces `wo`, against the ray.
float light_pdf(LightSource lights, Receiver x, bool through, vec3 from, Hit hit, Surface s, bool front, vec3 wo, float distance) {
    if (!has_light_tree()) return light_pdf(lights.table, hit, s, front, wo, distance);
    if (scene.emitter_leaves == 0UL || (!front && (s.material.flags & MATERIAL_DOUBLE_SIDED) == 0u)) return 0.0;
    uint instance = INSTANCED ? hit.instance : 0u;
    UintArray leaves = UintArray(scene.emitter_leaves);
    uint first = leaves[instance].at;
    if (first == 0u) return 0.0;
    uint leaf = leaves[first + hit.primitive].at;
    float cosine = dot(s.geometric_normal, wo);
    if (leaf == 0u || !(cosine > 0.0)) return 0.0;
    float probability = lights.tree_probability * probability_of(lights.root, leaf, x, through);
    return probability > 0.0 ? probability * facet_pdf(facet(instance, hit.primitive, from), distance * distance, cosine) : 0.0;
}

// The same where it found the environment.
float environment_pdf(LightSource lights, vec3 direction) {
    return (1.0 - lights.tree_probability) * environment_pdf(lights.table, direction);
}

#endif
