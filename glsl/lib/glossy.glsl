// Surfaces as the Whitted tree leaves them: lobes and clear coats as smooth as mirrors are mirrors and followed by rays,
// all others are lit from one direction at a time. Rough glass transmits as if it were smooth, and from within a solid
// it reflects so too.
#ifndef LIB_GLOSSY_GLSL
#define LIB_GLOSSY_GLSL

#include "lib/bsdf.glsl"

struct GlossySurface {
    Surface surface;
    bool front;
    vec3 to_viewer;
    Layers layers;
};

const uint LOBES_LIT = LOBE_DIFFUSE | LOBE_GLOSSY;

bool smooth_coat(Material material, bool front) {
    return GLOSSY && has_coat(material, front) && material.clearcoat_roughness <= scene.mirror_roughness;
}

// Share of the light that gets beneath the clear coat.
float beneath_coat(Surface surface, bool front, vec3 to_viewer) {
    if (!GLOSSY || !has_coat(surface.material, front)) return 1.0;
    return 1.0 - coat_share(surface.material, max(dot(surface.clearcoat_normal, to_viewer), 0.0));
}

GlossySurface glossy_surface(Surface surface, bool front, vec3 to_viewer) {
    GlossySurface g;
    Material m = surface.material;
    bool inside = is_solid(m) && !front;
    if (inside || m.roughness <= scene.mirror_roughness) surface.material.roughness = 0.0;
    if (m.clearcoat_roughness <= scene.mirror_roughness) surface.material.clearcoat_roughness = 0.0;
    g.surface = surface;
    g.front = front;
    g.to_viewer = to_viewer;
    g.layers = layers_of(surface, front, to_viewer, LOBES_LIT);
    return g;
}

GlossySurface glossy_surface(Hit hit, vec3 to_viewer) {
    Surface surface = surface_at(hit);
    bool front = face(surface, to_viewer);
    return glossy_surface(surface, front, to_viewer);
}

// Whether any lobe is neither diffuse nor a mirror.
bool has_glossy_lobe(GlossySurface g) {
    Material m = g.surface.material;
    if ((m.flags & MATERIAL_UNLIT) != 0u) return false;
    if (g.layers.coat > 0.0 && g.layers.coat_alpha >= DELTA_ALPHA) return true;
    return !g.layers.delta && (m.metallic > 0.0 || dielectric_f0(m) != vec3(0.0));
}

// f·cosθ, and of LOBES_LIT the density with which sample_lit gives the direction.
vec3 scattered(GlossySurface g, vec3 direction, uint lobes, out float pdf) {
    vec3 f;
    evaluate(g.surface, g.front, g.to_viewer, direction, lobes, g.layers, f, pdf);
    return f;
}

vec3 scattered(GlossySurface g, vec3 direction, uint lobes) {
    float pdf;
    return scattered(g, direction, lobes, pdf);
}

// bsdf_sample of the lobes that light is asked for.
bool sample_lit(GlossySurface g, vec3 u, out BsdfSample b) {
    return sample_layers(g.surface, g.front, g.to_viewer, u, LOBES_LIT, g.layers, b);
}

#endif
