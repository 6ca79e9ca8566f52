#version 460
#extension GL_GOOGLE_include_directive : require
// Joint bilateral upsampling (Kopf et al. 2007; Marques & Santos 2010, eq. 2): a Gaussian on the grid of samples times
// the cosine between full-resolution normals. PLANE also asks that samples continue the pixel's plane, and lists pixels
// that no sample fits; otherwise those take the nearest.
layout(local_size_x = 8, local_size_y = 8) in;
#include "indirect/edges.glsl"
#include "indirect/grid.glsl"
#include "indirect/missing.glsl"

layout(constant_id = 4) const bool PLANE = false;

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D gathered;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D normal_depth;
layout(set = 1, binding = 2, rgba32f) uniform readonly image2D position;
layout(set = 1, binding = 3, rgba32f) uniform writeonly image2D out_irradiance;
layout(set = 1, binding = 4, scalar) writeonly buffer List { uint pixels[]; } list;
layout(set = 1, binding = 5, scalar) buffer Args { MissingArgs at; } args;
layout(push_constant) uniform Params { float sigma; float reach; float least_cosine; } params;

#include "indirect/list_missing.glsl"

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_irradiance)))) return;
    vec4 here = imageLoad(normal_depth, pixel);
    vec3 irradiance = vec3(0.0);
    if (here.w != 0.0) {
        Point p = Point(here.xyz, here.w, PLANE ? imageLoad(position, pixel).xyz : vec3(0.0));
        float reach = params.reach * footprint(p.depth) * float(DOWNSAMPLE);
        vec2 centre = grid_position(pixel) - vec2(first_cell());
        ivec2 nearest = ivec2(floor(centre + 0.5)); // round() may go either way, by where a crop begins
        ivec2 size = imageSize(gathered);
        float weights = 0.0;
        for (int y = -2; y <= 2; ++y) {
            for (int x = -2; x <= 2; ++x) {
                ivec2 at = nearest + ivec2(x, y);
                if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
                ivec2 other = sample_pixel(first_cell() + uvec2(at));
                vec4 there = imageLoad(normal_depth, other);
                vec2 away = vec2(at) - centre;
                float weight = exp(-dot(away, away) / (2.0 * params.sigma * params.sigma));
                if (PLANE) {
                    Point q = Point(there.xyz, there.w, imageLoad(position, other).xyz);
                    weight *= same_plane(p, q, reach, params.least_cosine);
                } else {
                    weight *= max(0.0, dot(p.normal, there.xyz));
                }
                irradiance += weight * imageLoad(gathered, at).rgb;
                weights += weight;
            }
        }
        if (weights > 1e-3) {
            irradiance /= weights;
        } else if (PLANE) {
            irradiance = vec3(0.0);
            list_missing(pixel);
        } else {
            irradiance = imageLoad(gathered, clamp(nearest, ivec2(0), size - 1)).rgb;
        }
    }
    imageStore(out_irradiance, pixel, vec4(irradiance, 1.0));
}
