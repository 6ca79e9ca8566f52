#version 460
// Variance of the mean of all samples by the means of two independent halves of them, w: how many: Var(A − B) =
// σ² (1/a + 1/b), of which a b / (a + b)² is the mean's σ² / (a + b).
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0, rgba32f) uniform readonly image2D half_a;
layout(set = 1, binding = 1, rgba32f) uniform readonly image2D half_b;
layout(set = 1, binding = 2, rgba32f) uniform writeonly image2D out_variance;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(half_a)))) return;
    vec4 a = imageLoad(half_a, pixel), b = imageLoad(half_b, pixel);
    float count = a.w + b.w;
    vec3 difference = a.rgb - b.rgb;
    imageStore(out_variance, pixel, vec4(difference * difference * (a.w / count * (b.w / count)), 1.0));
}
