#version 460
#extension GL_GOOGLE_include_directive : require
// One step of an edge-aware à-trous wavelet filter (Dammertz, Sewtz, Hanika & Lensch 2010) of what rays brought: pixels on the
// same plane, STEP apart, count by a B3 spline, unless light from VPLs says that a shadow's edge lies between: as at the foot
// of a wall without thickness, whose floors are one plane.
layout(local_size_x = 8, local_size_y = 8) in;
#include "indirect/edges.glsl"

layout(constant_id = 0) const int STEP = 1;         // 0: only sums
layout(constant_id = 1) const bool LAST = true;     // of `others` too, and adds what is gathered
layout(constant_id = 2) const bool MIRRORED = true; // of what mirrors and glass bring

layout(set = 1, binding = 0, rgba32f) uniform readonly image2D normal_depth;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D position;
layout(set = 1, binding = 2, rgba32f) uniform readonly image2D mirrored;
layout(set = 1, binding = 3, rgba32f) uniform readonly image2D others;
layout(set = 1, binding = 4, rgba32f) uniform readonly image2D gathered;
layout(set = 1, binding = 5, rgba32f) uniform writeonly image2D out_irradiance;
layout(push_constant) uniform Params { float reach; float least_cosine; } params;

// And 1 where any was asked for.
vec4 light_at(ivec2 pixel) {
    vec4 light = MIRRORED ? imageLoad(mirrored, pixel) : vec4(0.0);
    if (LAST) light = vec4(light.rgb, 0.0) + imageLoad(others, pixel);
    return light;
}

float gathered_at(ivec2 pixel) { return dot(imageLoad(gathered, pixel).rgb, vec3(1.0)); }

// 1 where as much arrives, 0 where a quarter or less of it does.
float alike(float a, float b) { return clamp((4.0 * min(a, b) / max(max(a, b), 1e-30) - 1.0) / 2.0, 0.0, 1.0); }

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(out_irradiance);
    if (any(greaterThanEqual(pixel, size))) return;
    vec4 here = imageLoad(normal_depth, pixel);
    Point p = Point(here.xyz, here.w, imageLoad(position, pixel).xyz);
    vec4 sum = light_at(pixel);
    float asked = sum.w;
    if (STEP > 0 && asked > 0.0) {
        const float spline[3] = float[3](0.375, 0.25, 0.0625);
        float known = gathered_at(pixel);
        float reach = params.reach * footprint(p.depth) * float(2 * STEP);
        sum *= spline[0] * spline[0];
        for (int y = -2; y <= 2; ++y) {
            for (int x = -2; x <= 2; ++x) {
                ivec2 other = pixel + STEP * ivec2(x, y);
                if ((x | y) == 0 || any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, size))) continue;
                vec4 there = imageLoad(normal_depth, other);
                Point q = Point(there.xyz, there.w, imageLoad(position, other).xyz);
                float weight = spline[abs(x)] * spline[abs(y)] * same_plane(p, q, reach, params.least_cosine);
                float there_known = gathered_at(other);
                if (known + there_known > 0.0) weight *= alike(known, there_known);
                if (weight > 0.0) sum += weight * light_at(other);
            }
        }
    }
    vec3 light = asked > 0.0 ? sum.rgb / sum.w : vec3(0.0);
    if (LAST) light += imageLoad(gathered, pixel).rgb;
    imageStore(out_irradiance, pixel, vec4(light, LAST ? 1.0 : asked));
}
