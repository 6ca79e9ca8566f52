// Specular reflection and transmission at smooth surfaces.
#ifndef LIB_FRESNEL_GLSL
#define LIB_FRESNEL_GLSL

#include "lib/surface.glsl"

// Unpolarised reflectance of a dielectric boundary; eta = n_transmitted / n_incident. 1 under total reflection.
float fresnel_dielectric(float cos_i, float eta) {
    float sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if (sin2_t >= 1.0) return 1.0;
    float cos_t = sqrt(1.0 - sin2_t);
    float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

bool is_glass(Material material) {
    return GLASS && material.transmission > 0.0 && material.metallic < 1.0 && (material.flags & MATERIAL_UNLIT) == 0u;
}

bool is_solid(Material material) { return VOLUMES && (material.flags & MATERIAL_SOLID) != 0u; }

bool is_mirror(Material material) {
    bool any = MIRRORS; // a variable: the build's reflection evaluates no operators between constants
    if (GLASS) any = true;
    return any && material.roughness <= scene.mirror_roughness && (material.flags & MATERIAL_UNLIT) == 0u;
}

// What an opaque surface mirrors: Schlick's approximation as glTF 2.0 appendix B and KHR_materials_specular say.
vec3 schlick(Material material, float cos_i) {
    float r = (material.ior - 1.0) / (material.ior + 1.0);
    vec3 f0 = min(r * r * material.specular_color, vec3(1.0)) * material.specular;
    // No boundary, no reflection: also not at grazing angles, where the published formula has one.
    float f90 = mix(f0 == vec3(0.0) ? 0.0 : material.specular, 1.0, material.metallic);
    float c = clamp(1.0 - cos_i, 0.0, 1.0);
    float c5 = c * c * c * c * c;
    f0 = mix(f0, material.base_color, material.metallic);
    return f0 + (vec3(f90) - f0) * c5;
}

// Shares of the light that are mirrored and transmitted by a smooth surface; the rest is the diffuse part's.
struct Split {
    vec3 reflected;
    vec3 transmitted;
};

// `front` is the side light comes from: behind the front of a solid, eta turns round.
Split split_light(Material material, float cos_i, bool front) {
    bool mirrors = is_mirror(material);
    if (!is_glass(material)) return Split(mirrors ? schlick(material, cos_i) : vec3(0.0), vec3(0.0));
    float dielectric = 1.0 - material.metallic;
    float eta = is_solid(material) && !front ? 1.0 / material.ior : material.ior;
    float r = fresnel_dielectric(cos_i, eta);
    // Both faces of a thin wall and all that goes back and forth between them.
    if (!is_solid(material)) r = 2.0 * r / (1.0 + r);
    else if (r == 1.0) return Split(vec3(1.0), vec3(0.0));
    float strength = material.specular * dielectric;
    vec3 metal = material.base_color + (1.0 - material.base_color) * pow(clamp(1.0 - cos_i, 0.0, 1.0), 5.0);
    vec3 reflected = strength * min(r * material.specular_color, vec3(1.0)) + material.metallic * metal;
    // A rough reflection is left out; what enters a rough glass goes on as through a smooth one.
    if (!mirrors) reflected = vec3(0.0);
    vec3 transmitted = (1.0 - r * material.specular) * dielectric * material.transmission * material.base_color;
    return Split(reflected, transmitted);
}

// Mirrored direction; a bent normal can send it below the surface, from where it is lifted.
vec3 reflect_above(vec3 direction, vec3 normal, vec3 geometric_normal) {
    vec3 reflected = reflect(direction, normal);
    float above = dot(reflected, geometric_normal);
    return above > 0.0 ? reflected : normalize(reflected + (1e-3 - above) * geometric_normal);
}

// Direction through a surface whose normal faces against `direction`.
vec3 transmit(Material material, vec3 direction, vec3 normal, bool front) {
    if (!is_solid(material)) return direction;
    vec3 refracted = refract(direction, normal, front ? 1.0 / material.ior : material.ior);
    // At the critical angle rounding may leave nothing: then it grazes.
    return refracted != vec3(0.0) ? refracted : normalize(direction - dot(direction, normal) * normal);
}

// Share of light the diffuse part gets once a mirror has taken its own.
vec3 diffuse_share(Material material, float cos_i, bool front) {
    if (!is_mirror(material) && !is_glass(material)) return diffuse_albedo(material);
    return diffuse_albedo(material) * (1.0 - split_light(material, cos_i, front).reflected);
}

#endif
