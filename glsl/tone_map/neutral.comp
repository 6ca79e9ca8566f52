#version 460
// Khronos PBR Neutral tone mapper (specification of May 2024), then the sRGB transfer function.
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D radiance;
layout(set = 1, binding = 1, std430) readonly buffer Exposure { float ev; } exposure;
layout(set = 1, binding = 2, rgba8) uniform writeonly image2D out_display;

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

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(radiance)))) return;
    vec3 c = clamp(neutral(imageLoad(radiance, pixel).rgb * exp2(exposure.ev)), 0.0, 1.0);
    vec3 srgb = mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
    imageStore(out_display, pixel, vec4(srgb, 1.0));
}
