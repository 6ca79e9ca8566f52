#version 460
#extension GL_GOOGLE_include_directive : require
// Exposure, one of the tone mapping operators, the sRGB transfer function.
layout(local_size_x = 8, local_size_y = 8) in;
#include "tone_map/operators.glsl"
layout(constant_id = 0) const uint OPERATOR = OPERATOR_NEUTRAL;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D radiance;
layout(set = 1, binding = 1, std430) readonly buffer Exposure { float ev; } exposure;
layout(set = 1, binding = 2, rgba8) uniform writeonly image2D out_display;
layout(push_constant) uniform Params { float white; } params;

// Khronos PBR Neutral (specification of May 2024).
vec3 neutral(vec3 color) {
    const float START = 0.8 - 0.04, DESATURATION = 0.15;
    float x = min(color.r, min(color.g, color.b));
    color -= x < 0.08 ? x - 6.25 * x * x : 0.04;
    float peak = max(color.r, max(color.g, color.b));
    if (peak < START) return color;
    float d = 1.0 - START;
    float new_peak = 1.0 - d * d / (peak + d - START);
    color *= new_peak / peak;
    float g = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    return mix(color, vec3(new_peak), g);
}

// Reinhard et al. 2002, equation 4, on luminance: `white` is the least luminance that comes out as 1.
vec3 reinhard(vec3 color) {
    float luminance = dot(color, vec3(0.2126, 0.7152, 0.0722));
    return color * ((1.0 + luminance / (params.white * params.white)) / (1.0 + luminance));
}

// Stephen Hill's fit of the ACES 1.0 reference rendering and sRGB output transforms (BakingLab, 2016); matrices by
// columns.
vec3 aces(vec3 color) {
    const mat3 TO_RRT = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566, 0.83777);
    const mat3 TO_SRGB = mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367, -0.00605, 1.07602);
    vec3 v = min(TO_RRT * color, vec3(1e6)); // its square is finite
    return TO_SRGB * ((v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081));
}

vec3 tone_mapped(vec3 color) {
    if (OPERATOR == OPERATOR_REINHARD) return reinhard(color);
    if (OPERATOR == OPERATOR_ACES) return aces(color);
    if (OPERATOR == OPERATOR_LINEAR) return color;
    return neutral(color);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(radiance)))) return;
    vec3 c = clamp(tone_mapped(imageLoad(radiance, pixel).rgb * exp2(exposure.ev)), 0.0, 1.0);
    vec3 srgb = mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
    imageStore(out_display, pixel, vec4(srgb, 1.0));
}
