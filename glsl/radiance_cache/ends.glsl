// What is known of a ray's end: first the cell it is in, then the light that it brings.
#ifndef RADIANCE_CACHE_ENDS_GLSL
#define RADIANCE_CACHE_ENDS_GLSL

#include "radiance_cache/cells.glsl"

// Of all in one word.
const uint BY_LOBE = 1u << 31; // a lobe sent the ray
const uint KNOWN = 1u << 30;   // once light is: whether it is
const uint ASKED = 1u << 29;   // whether it was asked for

// Nine bits for each of three with one exponent.
uint pack_weight(vec3 weight) {
    float most = max(max(weight.x, weight.y), weight.z);
    if (!(most > 0.0)) return 0u;
    int exponent = clamp(int(floor(log2(most))) - 8, -24, 7);
    uvec3 digits = uvec3(clamp(weight * exp2(float(-exponent)) + 0.5, vec3(0.0), vec3(511.0)));
    return uint(exponent + 24) << 27 | digits.x << 18 | digits.y << 9 | digits.z;
}

vec3 weight_of(uint packed) {
    vec3 digits = vec3(packed >> 18 & 511u, packed >> 9 & 511u, packed & 511u);
    return digits * exp2(float(int(packed >> 27) - 24));
}

// The cell's key, what its light is to be multiplied with, and the place in it.
uvec4 asking_end(uvec2 key, vec3 weight, bool lobe, uint place) {
    return uvec4(key, pack_weight(weight), (lobe ? BY_LOBE : 0u) | place);
}

// Below 0: none is known.
uvec4 lit_end(uvec4 end, vec3 light) {
    bool known = light.x >= 0.0;
    uint flags = end.w & BY_LOBE | ASKED | (known ? KNOWN : 0u);
    return uvec4(floatBitsToUint(known ? light * weight_of(end.z) : vec3(0.0)), flags);
}

// What rays of a kind bring.
struct Brought {
    vec3 light;
    uint asked;
    uint known;
};

void bring(inout Brought b, uvec4 end) {
    b.light += uintBitsToFloat(end.xyz);
    ++b.asked;
    if ((end.w & KNOWN) != 0u) ++b.known;
}

// Ends in cells whose records found no surface bring what others do.
vec3 light_of(Brought b) { return b.known == b.asked ? b.light : b.light * (float(b.asked) / float(max(b.known, 1u))); }

#endif
