#version 460
#extension GL_GOOGLE_include_directive : require
// The Whitted tree behind primary hits of a strip of the picture: follows mirrors and glass, sums the emission found on
// the way, and lists the surfaces that scatter light where branches end.
//
// They are lit by a kernel of their own (light.comp): few pixels are specular, and a loop over all VPLs in each of
// them would leave most of a GPU waiting.
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/counters.glsl"
#include "lib/media.glsl"
#include "lib/sheer.glsl"
#include "whitted/reached.glsl"

layout(set = 1, binding = 0, rgba32ui) uniform readonly uimage2D hits;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D albedo;
layout(set = 1, binding = 2, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 3, scalar) readonly buffer Count { uint vpls; } count;
layout(set = 1, binding = 4, rgba32f) uniform writeonly image2D out_emitted;
layout(set = 1, binding = 5, r32ui) uniform writeonly uimage2D out_last;
layout(set = 1, binding = 6, scalar) writeonly buffer Points { Reached data[]; } points;
layout(set = 1, binding = 7, scalar) buffer Args { PointArgs at; } args;
layout(set = 1, binding = 8, scalar) writeonly buffer AllSeen { Seen data[]; } seen; // empty where nothing needs it
layout(push_constant, scalar) uniform Params {
    uint capacity;
    uint range;
    float min_distance;
    uint first_row; // of the strip whose points are listed
    uint end_row;
} params;

layout(constant_id = 0) const bool SENDERS = false; // points send rays

#include "whitted/sources.glsl"

struct Branch {
    vec3 origin;
    vec3 direction;
    vec3 throughput;
    vec3 absorption; // 1/m, of the medium it runs in
    uint depth;
};

// Depth first: every level leaves at most one branch behind, one more where glass has a clear coat and one where surfaces
// are sheer.
const uint MAX_PENDING = SHEER ? 3u * MAX_SPECULAR_DEPTH + 2u : GLOSSY ? 2u * MAX_SPECULAR_DEPTH + 1u : MAX_SPECULAR_DEPTH + 1u;
// Reflections between panes that bring less of their light to the eye are left out: they double with every pane.
const float FAINT = 1e-5;
Branch pending[MAX_PENDING];
uint pending_count = 0u;

void push(Branch branch) {
    if (branch.throughput != vec3(0.0) && pending_count < MAX_PENDING) pending[pending_count++] = branch;
}

// `incoming` points at the surface, which faces against it; `absorption` is that of the medium in front.
void spawn(Surface surface, bool front, vec3 incoming, vec3 throughput, vec3 absorption, uint depth) {
    Material material = surface.material;
    if (SHEER) {
        // Through is no bounce. It comes after all that branches off here: no depth has two of its kind waiting.
        push(Branch(beyond(surface, incoming), incoming, throughput * passing(surface, incoming), absorption, depth));
        throughput *= coverage(material);
    }
    if (depth >= scene.specular_depth) return;
    bool pane = is_pane(material);
    float cos_i = clamp(-dot(surface.normal, incoming), 0.0, 1.0);
    float beneath = beneath_coat(surface, front, -incoming);
    vec3 coated = throughput;
    Split split = split_light(material, cos_i, front);
    if (GLOSSY) {
        throughput *= beneath;
        if (smooth_coat(material, front)) {
            vec3 direction = reflect_above(incoming, surface.clearcoat_normal, surface.side_normal);
            push(Branch(leave(surface, direction), direction,
                        coated * (1.0 - beneath), absorption, depth + 1u));
        }
    }
    if (split.reflected != vec3(0.0) && !(pane && max_component(throughput * split.reflected) < FAINT)) {
        vec3 direction = reflect_above(incoming, surface.normal, surface.side_normal);
        push(Branch(leave(surface, direction), direction,
                    throughput * split.reflected, absorption, depth + 1u));
    }
    if (GLASS && !pane && split.transmitted != vec3(0.0)) {
        push(Branch(offset_origin(surface.position, -surface.geometric_normal),
                    transmit(material, incoming, surface.normal, front), throughput * split.transmitted,
                    absorption_behind(material, front, absorption), depth + 1u));
    }
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, params.first_row);
    if (any(greaterThanEqual(pixel, ivec2(imageSize(hits).x, params.end_row)))) return;
    Hit hit;
    vec3 radiance = vec3(0.0);
    uint rays = 0u, followed = 0u, last = NO_POINT;
    if (imageLoad(albedo, pixel).a != 0.0) {
        hit = unpack_hit(imageLoad(hits, pixel));
        Surface surface = surface_at(hit);
        vec3 direction = -direction_to_camera(surface.position);
        bool front = face(surface, -direction);
        spawn(surface, front, direction, vec3(1.0), vec3(0.0), 0u);
    }
    while (pending_count > 0u) {
        Branch branch = pending[--pending_count];
        ++rays;
        ++followed;
        if (!trace_closest(branch.origin, branch.direction, 0.0, 1.0 / 0.0, hit)) {
            if (ENVIRONMENT) radiance += branch.throughput * environment_radiance(branch.direction);
            continue;
        }
        Surface surface = surface_at(hit);
        bool front = face(surface, -branch.direction);
        vec3 throughput = branch.throughput;
        throughput *= transmittance(branch.absorption, distance(branch.origin, surface.position));
        vec3 covered = throughput;
        if (ALPHA_BLEND) covered *= coverage(surface.material);
        radiance += covered * emitted_radiance(surface.material, front);
        float cos_i = clamp(-dot(surface.normal, branch.direction), 0.0, 1.0);
        vec3 reflected = covered * diffuse_share(surface.material, cos_i, front) / PI;
        Lit lit;
        if (GLOSSY) {
            lit.glossy = glossy_surface(surface, front, -branch.direction);
            bool scatters = has_glossy_lobe(lit.glossy) || lit.glossy.layers.diffuse != vec3(0.0);
            reflected = scatters ? covered : vec3(0.0);
        }
        if (reflected != vec3(0.0)) {
            // Where in the list a point lies never shows: each pixel sums its own in its own order.
            uint index = atomicAdd(args.at.count, 1u);
            lit.seed = hash(area_seed(uvec2(pixel)), followed);
            if (index < params.capacity) {
                if (SENDERS || GLOSSY || SAMPLES_LIGHTS || CURVED) {
                    seen.data[index] = Seen(pack_hit(hit), -branch.direction, lit.seed);
                }
                points.data[index] = Reached(surface.position, surface.normal, surface.geometric_normal, reflected, vec3(0.0), last);
                last = index;
                uint groups = index / POINTS + 1u;
                atomicMax(args.at.light.x, groups_along(groups));
                atomicMax(args.at.light.z, rows_of(groups));
            } else {
                // In the order of light.comp.
                vec3 irradiance = vec3(0.0);
                for (uint first = 0u; first < source_count(); first += params.range) {
                    uint end = min(first + params.range, source_count());
                    irradiance += light_in_groups(receiver_at(surface), lit, first, end, params.min_distance, rays);
                }
                radiance += reflected * irradiance;
            }
        }
        spawn(surface, front, branch.direction, throughput, branch.absorption, branch.depth);
    }
    imageStore(out_emitted, pixel, vec4(radiance, 1.0));
    imageStore(out_last, pixel, uvec4(last));
    count_rays(rays);
}
