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

// Whether what it transmits goes straight through: a thin wall, and smooth.
bool is_pane(Material material) {
    return PANES && is_glass(material) && !is_solid(material) && material.roughness <= scene.pane_roughness;
}

bool is_mirror(Material material) {
    bool any = MIRRORS; // a variable: the build's reflection evaluates no operators between constants
    if (GLASS) any = true;
    return any && material.roughness <= scene.mirror_roughness && (material.flags & MATERIAL_UNLIT) == 0u;
}

float schlick_weight(float cos_i) {
    float c = clamp(1.0 - cos_i, 0.0, 1.0);
    return c * c * c * c * c;
}

// Reflectance of an opaque dielectric at normal incidence (KHR_materials_specular).
vec3 dielectric_f0(Material material) {
    float r = (material.ior - 1.0) / (material.ior + 1.0);
    return min(r * r * material.specular_color, vec3(1.0)) * material.specular;
}

// No boundary, no reflection: also not at grazing angles, where the published formula has one.
float dielectric_f90(Material material, vec3 f0) { return f0 == vec3(0.0) ? 0.0 : material.specular; }

// What an opaque surface mirrors: Schlick's approximation as glTF 2.0 appendix B and KHR_materials_specular say.
vec3 schlick(Material material, float cos_i) {
    vec3 f0 = dielectric_f0(material);
    float f90 = mix(dielectric_f90(material, f0), 1.0, material.metallic);
    f0 = mix(f0, material.base_color, material.metallic);
    return f0 + (vec3(f90) - f0) * schlick_weight(cos_i);
}

float max_component(vec3 v) { return max(v.x, max(v.y, v.z)); }

// What the diffuse part is left with.
float dielectric_base(Material material, float cos_i) {
    vec3 f0 = dielectric_f0(material);
    return 1.0 - max_component(f0 + (vec3(dielectric_f90(material, f0)) - f0) * schlick_weight(cos_i));
}

// Shares of the light that are mirrored and transmitted by a smooth surface, or a facet of a rough one, and the factor
// on the diffuse part beneath.
struct Split {
    vec3 reflected;
    vec3 transmitted;
    float base;
};

// Of a slab with all that goes to and fro in it, r at each face; `material` has its colour of both faces together.
Split split_slab(Material material, float cos_i) {
    float r = fresnel_dielectric(cos_i, material.ior);
    float cos_t = sqrt(1.0 - (1.0 - cos_i * cos_i) / (material.ior * material.ior));
    vec3 along = exp(-material.absorption / cos_t);
    vec3 across = (1.0 - r) * (1.0 - r) * along * material.base_color / (1.0 - r * r * along * along);
    return Split(r + r * along * across, across, 0.0);
}

// `front` is the side light comes from: behind the front of a solid, eta turns round.
Split split_interface(Material material, float cos_i, bool front) {
    if (!is_glass(material)) return Split(schlick(material, cos_i), vec3(0.0), dielectric_base(material, cos_i));
    if (PANES && (material.flags & MATERIAL_SLAB) != 0u) return split_slab(material, cos_i);
    float dielectric = 1.0 - material.metallic;
    float eta = is_solid(material) && !front ? 1.0 / material.ior : material.ior;
    float r = fresnel_dielectric(cos_i, eta);
    // Both faces of a thin wall and all that goes back and forth between them.
    if (!is_solid(material)) r = 2.0 * r / (1.0 + r);
    else if (r == 1.0) return Split(vec3(1.0), vec3(0.0), 0.0);
    vec3 color = min(r * material.specular_color, vec3(1.0));
    float strength = material.specular * dielectric;
    vec3 metal = material.base_color + (1.0 - material.base_color) * pow(clamp(1.0 - cos_i, 0.0, 1.0), 5.0);
    vec3 reflected = strength * color + material.metallic * metal;
    float base = 1.0 - max_component(color) * material.specular;
    vec3 transmitted = base * dielectric * material.transmission * material.base_color;
    return Split(reflected, transmitted, base);
}

// The same of a surface whose rough reflection is left out, and where what enters a rough glass goes on as through a
// smooth one.
Split split_light(Material material, float cos_i, bool front) {
    bool mirrors = is_mirror(material);
    if (!mirrors && !is_glass(material)) return Split(vec3(0.0), vec3(0.0), 1.0);
    Split split = split_interface(material, cos_i, front);
    bool total = is_solid(material) && split.base == 0.0;
    if (!mirrors && !total) split = Split(vec3(0.0), split.transmitted, 1.0);
    return split;
}

// Mirrored direction; a bent normal can send it below the surface, from where it is lifted.
vec3 reflect_above(vec3 direction, vec3 normal, vec3 side_normal) {
    vec3 reflected = reflect(direction, normal);
    float above = dot(reflected, side_normal);
    return above > 0.0 ? reflected : normalize(reflected + (1e-3 - above) * side_normal);
}

// Direction through a surface whose normal faces against `direction`.
vec3 transmit(Material material, vec3 direction, vec3 normal, bool front) {
    if (!is_solid(material)) return direction;
    vec3 refracted = refract(direction, normal, front ? 1.0 / material.ior : material.ior);
    // At the critical angle rounding may leave nothing: then it grazes.
    return refracted != vec3(0.0) ? refracted : normalize(direction - dot(direction, normal) * normal);
}

// Share of light that a VPL gives back where it lies; none lie on solid or rough glass.
vec3 vpl_albedo(Material material, float cos_i, bool front) {
    if (!is_glass(material)) return diffuse_albedo(material);
    return is_pane(material) ? diffuse_albedo(material) * split_interface(material, cos_i, front).base : vec3(0.0);
}

// Share of light the diffuse part gets once a mirror has taken its own.
vec3 diffuse_share(Material material, float cos_i, bool front) {
    return diffuse_albedo(material) * split_light(material, cos_i, front).base;
}

#endif
