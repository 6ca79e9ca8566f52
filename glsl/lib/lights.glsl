// Lights: one to ask for light at a point, chosen in proportion to power, and the densities of that choice. Those that
// know the receiver choose by lib/light_sampler.glsl.
//
// Directions point away from the point that is lit and have unit length. The environment is an equirectangular image
// whose centre is +X, a quarter to the right +Z, the top row +Y; bilinear, without mip levels.
#ifndef LIB_LIGHTS_GLSL
#define LIB_LIGHTS_GLSL

#include "lib/receiver.glsl"
#include "lib/sampling.glsl"
#include "lib/surface.glsl"
#include "trace/offset.glsl"

// Share of a spot light's intensity along unit `direction` away from it (KHR_lights_punctual).
float spot_falloff(Light light, vec3 direction) {
    float t = clamp((dot(light.direction, direction) - light.cos_outer) / (light.cos_inner - light.cos_outer), 0.0, 1.0);
    return t * t;
}

bool is_spot(Light light) { return SPOT_LIGHTS && light.kind == LIGHT_SPOT; }
bool is_directional(Light light) { return DIRECTIONAL_LIGHTS && light.kind == LIGHT_DIRECTIONAL; }

struct LightSample {
    vec3 direction;
    float distance;         // only an occluder lies nearer, along the direction from `from` (m)
    vec3 radiance_over_pdf; // of delta lights intensity over squared distance (W/m²) over the probability of the choice
    float pdf;              // by solid angle, the choice included; 0 of delta lights
    bool delta;             // no ray finds it
    bool sky;               // of the environment
};

// Angle from +Y.
float polar_angle(vec3 direction) { return atan(length(direction.xz), direction.y); }

// Column and row of the environment, in texels from the upper left corner.
vec2 environment_position(vec3 direction) {
    vec2 uv = vec2(atan(direction.z, direction.x) / (2.0 * PI) + 0.5, polar_angle(direction) / PI);
    return uv * vec2(scene.environment_size);
}

vec3 environment_texel(int x, int y) {
    ivec2 size = ivec2(scene.environment_size);
    x = x < 0 ? x + size.x : x >= size.x ? x - size.x : x;
    return Vec3Array(scene.environment)[uint(clamp(y, 0, size.y - 1) * size.x + x)].at;
}

// W/(sr·m²) from infinitely far away; black without an environment.
vec3 environment_radiance(vec3 direction) {
    if (scene.environment == 0UL) return vec3(0.0);
    vec2 position = environment_position(direction) - 0.5;
    vec2 corner = floor(position);
    vec2 f = position - corner;
    ivec2 i = ivec2(corner);
    return mix(mix(environment_texel(i.x, i.y), environment_texel(i.x + 1, i.y), f.x),
               mix(environment_texel(i.x, i.y + 1), environment_texel(i.x + 1, i.y + 1), f.x), f.y);
}

float cumulative(FloatArray cdf, uint i) { return i == 0u ? 0.0 : cdf[i - 1u].at; }

// The first whose cumulative probability is more than u.
uint invert(FloatArray cdf, uint count, float u) {
    uint low = 0u, high = count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (cdf[middle].at > u) high = middle;
        else low = middle + 1u;
    }
    return low;
}

// A table of choices among lights.
struct LightTable {
    uint first; // in all choices
    uint count;
    uint deltas; // lights without size, which come first
    float inverse_power; // 1/W, of all that it holds
    // Cumulative probabilities in the environment, which is the last choice if there are any.
    uint64_t rows;
    uint64_t columns;
};

LightTable table_of_all() {
    return LightTable(0u, scene.light_choice_count, scene.light_count, scene.inverse_power, scene.environment_rows,
                      scene.environment_columns);
}

// Those that have a size: emissive triangles and the environment.
LightTable table_of_area_lights() {
    return LightTable(scene.light_choice_count, scene.light_choice_count - scene.light_count, 0u, scene.inverse_area_power,
                      scene.environment_rows, scene.environment_columns);
}

// Those for points whose lobes are sampled as well: of the environment only what exceeds its mean (MIS compensation;
// Karlík et al. 2019). It may hold nothing.
LightTable table_beside_lobes() {
    return LightTable(scene.excess_choices, scene.excess_choice_count, 0u, scene.inverse_excess_power, scene.excess_rows,
                      scene.excess_columns);
}

FloatArray environment_column_cdf(LightTable lights, uint row) {
    return FloatArray(lights.columns) + row * scene.environment_size.x;
}

// Probability of a texel over its solid angle.
float environment_density(LightTable lights, uvec2 cell) {
    FloatArray rows = FloatArray(lights.rows), columns = environment_column_cdf(lights, cell.y);
    float probability = (rows[cell.y].at - cumulative(rows, cell.y)) * (columns[cell.x].at - cumulative(columns, cell.x));
    vec2 size = vec2(scene.environment_size);
    float solid_angle = (4.0 * PI / size.x) * sin(PI * (float(cell.y) + 0.5) / size.y) * sin(0.5 * PI / size.y);
    return probability / solid_angle;
}

float environment_probability(LightTable lights) {
    return LightChoiceArray(scene.light_choices)[lights.first + lights.count - 1u].at.probability;
}

// Density by solid angle of choosing a direction to the environment.
float environment_pdf(LightTable lights, vec3 direction) {
    if (lights.rows == 0UL) return 0.0;
    uvec2 cell = min(uvec2(environment_position(direction)), scene.environment_size - 1u);
    return environment_probability(lights) * environment_density(lights, cell);
}

vec3 sample_environment(LightTable lights, vec2 u, out uvec2 cell) {
    uvec2 size = scene.environment_size;
    FloatArray rows = FloatArray(lights.rows);
    cell.y = invert(rows, size.y, u.y);
    float before = cumulative(rows, cell.y);
    float v = (u.y - before) / (rows[cell.y].at - before);
    FloatArray columns = environment_column_cdf(lights, cell.y);
    cell.x = invert(columns, size.x, u.x);
    before = cumulative(columns, cell.x);
    float azimuth = 2.0 * PI * ((float(cell.x) + (u.x - before) / (columns[cell.x].at - before)) / float(size.x) - 0.5);
    // Uniform in cosθ, counted from the nearer pole, where 1 − cosθ keeps its digits.
    bool south = 2u * cell.y >= size.y;
    uint from_pole = south ? size.y - 1u - cell.y : cell.y;
    if (south) v = 1.0 - v;
    float sine = sin(0.5 * PI * float(from_pole) / float(size.y));
    float height = 2.0 * sin(PI * (float(from_pole) + 0.5) / float(size.y)) * sin(0.5 * PI / float(size.y));
    float k = 2.0 * sine * sine + v * height;
    float radius = sqrt(max(0.0, k * (2.0 - k)));
    return vec3(radius * cos(azimuth), south ? k - 1.0 : 1.0 - k, radius * sin(azimuth));
}

// Density by area of points taken on a triangle that is chosen in proportion to power; of what, `inverse_power` says.
float emitter_density(uint triangle, float inverse_power) {
    return FloatArray(scene.emission_weights)[triangle].at * inverse_power;
}

// A point of an emissive triangle.
struct EmitterPoint {
    vec3 position;
    vec3 normal; // unit length, of the front
    uint index;  // of the triangle, in all arrays
    Triangle triangle;
    vec3 weights;
};

EmitterPoint point_of(LightChoice choice, vec3 weights) {
    EmitterPoint p;
    Instance instance = InstanceArray(scene.instances)[choice.instance].at;
    p.index = instance.first_triangle + choice.primitive;
    p.triangle = TriangleArray(scene.triangles)[p.index].at;
    p.weights = weights;
    point_on(instance, choice.instance == 0u, p.triangle, p.weights, p.position, p.normal);
    return p;
}

// Uniform by area.
vec3 weights_by_area(vec2 u) {
    float root = sqrt(u.x);
    return vec3(1.0 - root, root * (1.0 - u.y), root * u.y);
}

EmitterPoint point_of(LightChoice choice, vec2 u) { return point_of(choice, weights_by_area(u)); }

Material material_of(EmitterPoint p) {
    return MaterialArray(scene.materials)[p.triangle.material & ~TRIANGLE_MIRRORED].at;
}

// W/(sr·m²) that leave it on one side.
vec3 emitted_at(EmitterPoint p, bool front) {
    Material material = material_of(p);
    TextureCoordinates at = texture_coordinates(p.triangle.vertices, p.weights);
    material.emission = emission_at(material, at);
    vec3 radiance = emitted_radiance(material, front);
    float alpha = base_color(material, p.triangle.vertices, p.weights, at).a;
    if (ALPHA_MASK && (material.flags & MATERIAL_ALPHA_MASK) != 0u && alpha < material.alpha_cutoff) return vec3(0.0);
    material.alpha = alpha;
    return radiance * coverage(material);
}

// To a point of an emitter.
struct EmitterWay {
    vec3 to;
    float distance2;
    float cosine; // at the emitter
    vec3 radiance;
};

// False: no light comes along it.
bool way_to(EmitterPoint p, vec3 from, out EmitterWay way) {
    vec3 normal = p.normal;
    bool front = dot(normal, from - p.position) >= 0.0;
    if (!front) normal = -normal;
    way.to = offset_origin(p.position, normal) - from;
    way.distance2 = dot(way.to, way.to);
    way.cosine = -dot(normal, way.to) * inversesqrt(way.distance2);
    if (!(way.cosine > 0.0)) return false;
    way.radiance = emitted_at(p, front);
    return way.radiance != vec3(0.0);
}

LightSample sample_along(EmitterWay way, float pdf) {
    float distance = sqrt(way.distance2);
    return LightSample(way.to / distance, distance, way.radiance / pdf, pdf, false, false);
}

bool sample_sky(LightTable lights, vec2 u, LightChoice choice, out LightSample s) {
    uvec2 cell;
    s.direction = sample_environment(lights, u, cell);
    s.distance = 4.0 * scene.scene_radius;
    s.pdf = choice.probability * environment_density(lights, cell);
    s.radiance_over_pdf = environment_radiance(s.direction) / s.pdf;
    s.delta = false;
    s.sky = true;
    return s.radiance_over_pdf != vec3(0.0);
}

// A light without size; by what it is chosen with `probability`.
bool sample_delta(vec3 from, uint i, float probability, out LightSample s) {
    Light light = LightArray(scene.lights)[i].at;
    s.pdf = 0.0;
    s.delta = true;
    s.sky = false;
    vec3 arriving = light.intensity / probability;
    if (is_directional(light)) {
        s.direction = -light.direction;
        s.distance = 4.0 * scene.scene_radius;
    } else {
        vec3 to = light.position - from;
        float distance2 = dot(to, to);
        if (distance2 == 0.0) return false;
        s.distance = sqrt(distance2);
        s.direction = to / s.distance;
        arriving /= distance2;
        if (is_spot(light)) arriving *= spot_falloff(light, -s.direction);
    }
    s.radiance_over_pdf = arriving;
    return arriving != vec3(0.0);
}

// One of the choices, by u in [0, 1); which one is returned.
uint choose(LightTable lights, float u, out LightChoice choice) {
    LightChoiceArray choices = LightChoiceArray(scene.light_choices) + lights.first;
    float place = u * float(lights.count);
    uint i = min(uint(place), lights.count - 1u);
    choice = choices[i].at;
    if (place - float(i) >= choice.threshold) {
        i = choice.alias;
        choice = choices[i].at;
    }
    return i;
}

bool is_environment(LightTable lights, uint i) {
    return ENVIRONMENT && lights.rows != 0UL && i == lights.count - 1u;
}

// Density by solid angle of choosing the direction of a ray of unit length that found this surface `distance` away; 0
// where the side that it shows does not emit. `s` faces `wo`, against the ray.
float light_pdf(LightTable lights, Hit hit, Surface s, bool front, vec3 wo, float distance) {
    if (scene.emission_weights == 0UL || (!front && (s.material.flags & MATERIAL_DOUBLE_SIDED) == 0u)) return 0.0;
    uint index = InstanceArray(scene.instances)[INSTANCED ? hit.instance : 0u].at.first_triangle + hit.primitive;
    float cosine = dot(s.geometric_normal, wo);
    return cosine > 0.0 ? emitter_density(index, lights.inverse_power) * distance * distance / cosine : 0.0;
}

// Weight of the sampling method with density p beside one with q (Veach 1997, §9.2).
float power_heuristic(float p, float q) {
    float r = q / p;
    return 1.0 / (1.0 + r * r);
}

#endif
