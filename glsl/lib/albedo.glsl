// How much of the light from one direction a surface scatters in all.
#ifndef LIB_ALBEDO_GLSL
#define LIB_ALBEDO_GLSL

#include "lib/bsdf.glsl"

// Of a lobe of GGX with Smith's height-correlated shadowing, single scattering: x with F = 1, y with F = (1 − wo·h)⁵.
// Polynomials in roughness and cosine, fitted to sums over 65 536 visible normals at 19 × 24 places: within 0.002 and
// 0.0004 of the means over a hemisphere, 0.07 at grazing angles. The environment BRDF of Karis ("Physically Based Shading
// on Mobile", 2014) is for another shadowing: it is 0.1 off on average.
vec2 ggx_albedo(float roughness, float cosine) {
    float r = clamp(roughness, 0.1, 1.0), c = clamp(cosine, 0.0, 1.0);
    vec2 p4 = vec2(1.2325, -0.2474);
    vec2 p3 = vec2(-2.9624, 0.7753) + c * vec2(1.3504, -0.2485);
    vec2 p2 = vec2(2.6091, 0.2104) + c * (vec2(-3.6127, -2.5724) + c * vec2(0.0488, 2.0885));
    vec2 p1 = vec2(-0.9604, -1.6901) + c * (vec2(0.2363, 6.4763) + c * (vec2(2.4404, -6.5693) + c * vec2(-0.9975, 1.7798)));
    vec2 p0 = vec2(1.05, 0.964) + c * (vec2(0.0421, -3.5354) + c * (vec2(0.2717, 4.085) +
              c * (vec2(-1.0159, -1.5367) + c * vec2(0.5681, 0.0328))));
    return clamp(p0 + r * (p1 + r * (p2 + r * (p3 + r * p4))), vec2(0.0), vec2(1.0));
}

// Share of light from a direction, `cos_i` from the normal on the side that `front` says, that a surface scatters in lobes
// that no mirror ray follows: diffuse, rough specular and rough clear coat. None from within solids.
vec3 scattered_albedo(Material m, float cos_i, bool front) {
    if ((m.flags & MATERIAL_UNLIT) != 0u || is_solid(m) && is_glass(m) && !front) return vec3(0.0);
    vec3 albedo = diffuse_albedo(m);
    bool mirror = is_mirror(m);
    if (is_glass(m)) {
        Split split = split_interface(m, cos_i, front);
        albedo *= split.base;
        if (!mirror) albedo += split.reflected * ggx_albedo(m.roughness, cos_i).x;
    } else {
        albedo *= mean_dielectric_base(m, cos_i);
        if (!mirror) {
            vec3 f0 = dielectric_f0(m);
            float f90 = mix(dielectric_f90(m, f0), 1.0, m.metallic);
            f0 = mix(f0, m.base_color, m.metallic);
            vec2 lobe = ggx_albedo(m.roughness, cos_i);
            albedo += f0 * (lobe.x - lobe.y) + f90 * lobe.y;
        }
    }
    if (has_coat(m, front)) {
        float coat = coat_share(m, cos_i);
        albedo *= 1.0 - coat;
        if (m.clearcoat_roughness > scene.mirror_roughness) albedo += coat * ggx_albedo(m.clearcoat_roughness, cos_i).x;
    }
    return albedo;
}

// Shares that mirror rays follow, and what is transmitted.
Split followed(Material m, float cos_i, bool front) {
    Split split = split_light(m, cos_i, front);
    if (has_coat(m, front)) {
        float coat = coat_share(m, cos_i);
        split.reflected *= 1.0 - coat;
        split.transmitted *= 1.0 - coat;
        if (m.clearcoat_roughness <= scene.mirror_roughness) split.reflected += coat;
    }
    return split;
}

#endif
