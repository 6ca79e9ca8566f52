#version 460
#extension GL_GOOGLE_include_directive : require
// The discontinuity buffer (Wald et al. 2002; Marques & Santos 2010, §4.3): the mean over the neighbours that have other
// subsets and lie on the same surface. 3×3 samples for tiles of 3; a 1-2-1 tent for tiles of 2, in which every subset
// has the same weight.
layout(local_size_x = 8, local_size_y = 8) in;
#include "indirect/grid.glsl"

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D gathered;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D normal_depth;
layout(set = 1, binding = 2, rgba32f) uniform writeonly image2D out_irradiance;
layout(push_constant) uniform Params { float depth_threshold; float normal_threshold; } params;

void main() {
    ivec2 index = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = imageSize(gathered);
    if (any(greaterThanEqual(index, size))) return;
    vec4 here = imageLoad(normal_depth, sample_pixel(first_cell() + uvec2(index)));
    vec3 sum = vec3(0.0);
    float weights = 0.0;
    if (here.w != 0.0) {
        for (int y = -1; y <= 1; ++y) {
            for (int x = -1; x <= 1; ++x) {
                ivec2 at = index + ivec2(x, y);
                if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
                vec4 there = imageLoad(normal_depth, sample_pixel(first_cell() + uvec2(at)));
                bool centre = x == 0 && y == 0;
                if (!centre && abs(there.w - here.w) >= params.depth_threshold * here.w) continue;
                if (!centre && dot(there.xyz, here.xyz) <= params.normal_threshold) continue;
                float weight = INTERLEAVE == 2u ? float((2 - abs(x)) * (2 - abs(y))) : 1.0;
                sum += weight * imageLoad(gathered, at).rgb;
                weights += weight;
            }
        }
        sum /= weights;
    }
    imageStore(out_irradiance, index, vec4(sum, 1.0));
}
