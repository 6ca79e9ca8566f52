#version 460
#extension GL_GOOGLE_include_directive : require
// One edge-aware filter in place of discontinuity buffer and upsampling. The samples that continue the pixel's plane are
// averaged subset by subset, and the means are added up: wherever each subset has a fitting sample the pixel gets the
// light of all paths, near edges too, where a mean over whatever fits shows the pattern of the tiles.
//
// Weights: the indicator of a tile (irregular tiles: of so many samples that they hold a whole one) convolved with a tent
// one sample wide, so that nothing jumps from pixel to pixel.
layout(local_size_x = 8, local_size_y = 8) in;
#include "indirect/edges.glsl"
#include "indirect/grid.glsl"
#include "indirect/missing.glsl"

layout(constant_id = 4) const bool REGATHER = false;

const float LEAST_WEIGHT = 0.005; // of a subset whose samples all fit
const float BEYOND = 4.0;         // samples that the second attempt looks farther

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D gathered;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D normal_depth;
layout(set = 1, binding = 2, rgba32f) uniform readonly image2D position;
layout(set = 1, binding = 3, rgba32f) uniform writeonly image2D out_irradiance;
layout(set = 1, binding = 4, scalar) writeonly buffer List { uint pixels[]; } list;
layout(set = 1, binding = 5, scalar) buffer Args { MissingArgs at; } args;
layout(set = 1, binding = 6, rgba32f) uniform readonly image2D albedo;
layout(push_constant) uniform Params { float reach; float least_cosine; uint least_found; } params;

#include "indirect/list_missing.glsl"

// How well a pixel continues the plane at p.
float fits(Point p, ivec2 pixel, float reach) {
    vec4 there = imageLoad(normal_depth, pixel);
    return same_plane(p, Point(there.xyz, there.w, imageLoad(position, pixel).xyz), reach, params.least_cosine);
}

// Sum of a subset's samples within `radius` of `centre`, each times its weight for p, and of the weights.
vec4 subset_sum(uint subset, Point p, vec2 centre, float radius, float reach) {
    vec4 sum = vec4(0.0);
    ivec2 size = imageSize(gathered);
    uvec2 first = first_cell();
    ivec2 low = max(ivec2(ceil(centre - radius)), ivec2(0)), high = min(ivec2(floor(centre + radius)), size - 1);
    // The tiles whose sample may lie between; in regular ones it has the same place everywhere.
    const bool shuffled = IRREGULAR && INTERLEAVE > 1u;
    uvec2 place = shuffled ? uvec2(0u) : uvec2(subset % INTERLEAVE, subset / INTERLEAVE);
    uvec2 tile_low = (first + uvec2(low) + (shuffled ? 0u : INTERLEAVE - 1u) - place) / INTERLEAVE;
    uvec2 tile_end = (first + uvec2(high) + INTERLEAVE - place) / INTERLEAVE;
    for (uint y = tile_low.y; y < tile_end.y; ++y) {
        for (uint x = tile_low.x; x < tile_end.x; ++x) {
            uvec2 cell = shuffled ? cell_of(uvec2(x, y), subset) : uvec2(x, y) * INTERLEAVE + place;
            ivec2 at = ivec2(cell - first);
            if (shuffled && (any(lessThan(at, low)) || any(greaterThan(at, high)))) continue;
            vec2 fall = clamp(radius - abs(vec2(at) - centre), 0.0, 1.0);
            float weight = fall.x * fall.y * fits(p, sample_pixel(cell), reach);
            if (weight > 0.0) sum += weight * vec4(imageLoad(gathered, at).rgb, 1.0);
        }
    }
    return sum;
}

// Mean of the samples around, in other tiles, of the subset that the sample at `cell` has, each times its weight for p.
vec4 same_subset(Point p, uvec2 cell, float reach) {
    uvec2 tile = cell / INTERLEAVE, place = cell % INTERLEAVE;
    uint subset = 0u;
    if (IRREGULAR) {
        while (cell_of(tile, subset) != cell) ++subset;
    }
    vec4 sum = vec4(0.0);
    ivec2 first = ivec2(first_cell()), size = imageSize(gathered);
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 other = ivec2(tile) + ivec2(x, y);
            if ((x | y) == 0 || any(lessThan(other, ivec2(0)))) continue;
            ivec2 at = ivec2(IRREGULAR ? cell_of(uvec2(other), subset) : uvec2(other) * INTERLEAVE + place) - first;
            if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
            float weight = fits(p, at, reach);
            if (weight > 0.0) sum += weight * vec4(imageLoad(gathered, at).rgb, 1.0);
        }
    }
    return sum;
}

// A sample knows how unlike its neighbours it is: by what its own subset brings there. What other subsets bring there, a mean
// over `subsets` that counts its own, is unlike it in the same way: shadows and lines keep their edges.
vec3 sharpened(vec3 mean, vec3 own, vec3 around, float subsets) {
    vec3 darker = (own + (subsets * mean - own) * own / max(around, vec3(1e-30))) / subsets;
    vec3 brighter = mean + (own - around) * (subsets - 1.0) / subsets;
    return mix(brighter, darker, lessThan(own, around));
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(out_irradiance)))) return;
    vec4 here = imageLoad(normal_depth, pixel);
    vec3 irradiance = vec3(0.0);
    if (here.w != 0.0) {
        uint subsets = INTERLEAVE * INTERLEAVE;
        Point p = Point(here.xyz, here.w, imageLoad(position, pixel).xyz);
        float reach = params.reach * footprint(p.depth) * float(DOWNSAMPLE * INTERLEAVE);
        vec2 centre = grid_position(pixel) - vec2(first_cell());
        // Half the widths of the indicator and of the tent.
        float radius = 0.5 * float(IRREGULAR ? 2u * INTERLEAVE - 1u : INTERLEAVE) + 0.5;
        uint missing = (1u << subsets) - 1u, found = 0u;
        // Where few fit, on small surfaces and slanted ones, farther ones will do.
        for (uint attempt = 0u; attempt < 2u && 3u * found < subsets; ++attempt) {
            for (uint s = 0u; s < subsets; ++s) {
                if ((missing >> s & 1u) == 0u) continue;
                vec4 sum = subset_sum(s, p, centre, radius, reach);
                if (sum.w <= LEAST_WEIGHT) continue;
                irradiance += sum.rgb / sum.w;
                missing &= ~(1u << s);
                ++found;
            }
            radius += BEYOND;
        }
        // What reflects nothing needs no light of its own.
        if (REGATHER && found < params.least_found && (found == 0u || imageLoad(albedo, pixel).rgb != vec3(0.0))) {
            irradiance = vec3(0.0);
            list_missing(pixel);
        } else if (found > 0u) {
            irradiance /= float(found);
            if (DOWNSAMPLE == 1u && INTERLEAVE > 1u && found > 1u) {
                vec4 around = same_subset(p, uvec2(pixel) + scene.window_origin, reach);
                vec3 own = imageLoad(gathered, pixel).rgb;
                if (around.w > 0.0) irradiance = sharpened(irradiance, own, around.rgb / around.w, float(found));
            }
        } else {
            irradiance = imageLoad(gathered, clamp(ivec2(floor(centre + 0.5)), ivec2(0), imageSize(gathered) - 1)).rgb;
        }
    }
    imageStore(out_irradiance, pixel, vec4(irradiance, 1.0));
}
