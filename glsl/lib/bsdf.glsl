// Scattering at a surface: glTF 2.0 metallic-roughness as published (appendix B), with KHR_materials_specular, _ior,
// _transmission, _volume and _clearcoat. Lobes of GGX (Walter et al. 2007) with Smith's height-correlated shadowing
// (Heitz 2014), sampled by visible normals (Dupuy & Benyoub 2023).
//
// Both directions point away from the surface, which face() has turned to `wo`; `front` is what face() returned.
//
// - α = roughness²; a lobe with α below DELTA_ALPHA scatters into one direction, which only bsdf_sample finds.
// - The published mix of dielectric and diffuse part takes (1 − F(wo·h)) for the latter; near grazing angles the sum
//   exceeds 1 (1.59 at 85°, roughness 0.05). With scene.energy_conserving it is (1 − F(n·wo))(1 − F(n·wi)) (Shirley et
//   al. 1997), at most 1 and reciprocal too.
// - Transmission without a volume is a thin wall: R' = 2R/(1 + R) on smooth and rough ones, roughness spreads light
//   about the direction straight through; a smooth one is a pane, and what passes it has met no vertex (LOBE_PANE). With
//   one it refracts; radiance is scaled by 1/η² at each boundary, η being the index on wi's side over that on wo's. Light
//   paths, which carry flux, multiply it back.
// - The clear coat takes its share by the angle of its normal with wo, as published: not reciprocal. Emission passes it
//   unchanged. It lies on the outside of solids.
// - Glossy lobes of a surface whose normal wo would see from behind bend the normal towards wo.
#ifndef LIB_BSDF_GLSL
#define LIB_BSDF_GLSL

#include "lib/fresnel.glsl"
#include "lib/sampling.glsl"

const float DELTA_ALPHA = 1e-4;
const float STRAIGHT_IOR = 1.001; // solids of at most this index do not bend light

const uint LOBE_DIFFUSE = 1u;
const uint LOBE_GLOSSY = 2u;
const uint LOBE_DELTA = 4u;
const uint LOBE_TRANSMIT = 8u; // with one of the others
const uint LOBE_PANE = 16u; // straight on through a pane, alone
const uint LOBE_ALL = 31u;

struct BsdfSample {
    vec3 direction;
    vec3 weight; // f·|cosθ|/pdf
    float pdf;   // by solid angle, of all lobes asked for; 0 of a delta lobe
    uint lobe;   // bits of the one it came from
    float eta;   // index on the new side over that on the old; not 1 where a solid refracted
};

// What does not depend on the other direction.
struct Layers {
    mat3 frame; // around the shading normal
    vec3 wo;    // in it
    float alpha;
    float eta;
    bool glass;
    bool solid;
    bool delta;          // the interface reflects into one direction
    bool delta_transmit; // and transmits into one
    uint transmit;       // bits of the lobe that transmits
    vec3 diffuse; // Lambertian albedo beneath the interface
    float base;   // share of wo's light that the interface leaves to the diffuse part
    mat3 coat_frame;
    vec3 coat_wo;
    float coat_alpha;
    float coat; // share that the clear coat reflects
    // Probabilities of sampling; they add up to 1 or are all 0.
    float p_coat;
    float p_diffuse;
    float p_interface;
};

float sum(vec3 v) { return v.x + v.y + v.z; }

bool has_lobe(uint lobes, uint lobe) { return (lobes & lobe) == lobe; }

// Where wo is below or grazes the normal, the normal turned so far that it no longer does.
vec3 towards(vec3 n, vec3 wo) {
    float lift = 1e-3 - dot(n, wo);
    return lift > 0.0 ? normalize(n + lift * wo) : n;
}

bool has_coat(Material material, bool front) {
    bool inside = is_solid(material) && !front;
    return CLEARCOAT && material.clearcoat > 0.0 && !inside;
}

float coat_share(Material material, float cos_o) {
    return material.clearcoat * (0.04 + 0.96 * schlick_weight(cos_o));
}

// Share of light of either direction that goes straight on through a pane.
vec3 pane_share(Surface s, vec3 along) {
    vec3 share = split_interface(s.material, min(abs(dot(s.normal, along)), 1.0), true).transmitted;
    if (has_coat(s.material, true)) share *= 1.0 - coat_share(s.material, abs(dot(s.clearcoat_normal, along)));
    return share;
}

Layers layers_of(Surface s, bool front, vec3 wo, uint lobes) {
    Material m = s.material;
    Layers l;
    l.frame = basis_around(towards(s.normal, wo));
    l.wo = wo * l.frame;
    l.alpha = m.roughness * m.roughness;
    l.glass = is_glass(m);
    l.solid = l.glass && is_solid(m);
    l.eta = !l.solid ? 1.0 : front ? m.ior : 1.0 / m.ior;
    l.delta = l.alpha < DELTA_ALPHA;
    l.delta_transmit = l.delta || l.solid && m.ior <= STRAIGHT_IOR;
    l.transmit = is_pane(m) ? LOBE_PANE : LOBE_TRANSMIT | (l.delta_transmit ? LOBE_DELTA : LOBE_GLOSSY);
    l.diffuse = diffuse_albedo(m);
    l.coat = 0.0;
    l.coat_alpha = 1.0;
    l.coat_frame = l.frame;
    l.coat_wo = l.wo;
    if (has_coat(m, front)) {
        l.coat_frame = basis_around(towards(s.clearcoat_normal, wo));
        l.coat_wo = wo * l.coat_frame;
        l.coat_alpha = m.clearcoat_roughness * m.clearcoat_roughness;
        l.coat = coat_share(m, l.coat_wo.z);
    }
    bool coat_wanted = has_lobe(lobes, l.coat_alpha < DELTA_ALPHA ? LOBE_DELTA : LOBE_GLOSSY);
    Split split = split_interface(m, l.wo.z, front);
    l.base = split.base;
    float p_interface = 0.0;
    if (has_lobe(lobes, l.delta ? LOBE_DELTA : LOBE_GLOSSY)) p_interface += sum(split.reflected);
    if (has_lobe(lobes, l.transmit)) {
        // Beyond the critical angle facets may still transmit.
        p_interface += l.delta ? sum(split.transmitted) : m.transmission * (1.0 - m.metallic) * sum(m.base_color);
    }
    l.p_coat = coat_wanted ? 3.0 * l.coat : 0.0;
    l.p_interface = (1.0 - l.coat) * p_interface;
    l.p_diffuse = has_lobe(lobes, LOBE_DIFFUSE) ? (1.0 - l.coat) * sum(l.diffuse) : 0.0;
    float total = l.p_coat + l.p_interface + l.p_diffuse;
    float scale = total > 0.0 ? 1.0 / total : 0.0;
    l.p_coat *= scale;
    l.p_interface *= scale;
    l.p_diffuse *= scale;
    return l;
}

// Probability that a facet chosen reflects rather than transmits.
float reflect_probability(Layers l, Split split, uint lobes) {
    if (!l.glass) return 1.0;
    float r = has_lobe(lobes, l.delta ? LOBE_DELTA : LOBE_GLOSSY) ? sum(split.reflected) : 0.0;
    float t = has_lobe(lobes, l.transmit) ? sum(split.transmitted) : 0.0;
    return r + t > 0.0 ? r / (r + t) : 1.0;
}

// Normals' density by solid angle, in their frame.
float ggx(vec3 h, float alpha) {
    vec2 slope = h.xy / alpha;
    float t = dot(slope, slope) + h.z * h.z;
    return 1.0 / (PI * alpha * alpha * t * t);
}

float smith_lambda(vec3 w, float alpha) {
    return 0.5 * (sqrt(1.0 + alpha * alpha * dot(w.xy, w.xy) / (w.z * w.z)) - 1.0);
}

vec3 sample_visible_normal(vec3 wo, float alpha, vec2 u) {
    vec3 v = normalize(vec3(alpha * wo.xy, wo.z));
    float z = (1.0 - u.y) * (1.0 + v.z);
    float c = z - v.z; // of a point on the cap that v sees
    vec2 h = sqrt(clamp(1.0 - c * c, 0.0, 1.0)) * vec2(cos(2.0 * PI * u.x), sin(2.0 * PI * u.x)) + v.xy;
    return normalize(vec3(alpha * h, z));
}

// D·G₂/(4 cosθ_o), to be multiplied by F: f·cosθ_i; and the density of mirroring in a visible normal.
vec2 mirror_lobe(vec3 wo, vec3 wi, vec3 h, float alpha) {
    float d = ggx(h, alpha) / (4.0 * wo.z);
    float lambda_o = smith_lambda(wo, alpha);
    return vec2(d / (1.0 + lambda_o + smith_lambda(wi, alpha)), d / (1.0 + lambda_o));
}

float diffuse_factor(Surface s, Layers l, Split split, vec3 wi, bool front) {
    if (scene.energy_conserving == 0u) return split.base;
    return l.base * split_interface(s.material, clamp(dot(s.normal, wi), 0.0, 1.0), front).base;
}

// f·|cosθ| of lobes other than delta ones, and the density of sampling them.
void evaluate(Surface s, bool front, vec3 wo, vec3 wi, uint lobes, Layers l, out vec3 f, out float pdf) {
    f = vec3(0.0);
    pdf = 0.0;
    float side_o = dot(s.geometric_normal, wo), side_i = dot(s.side_normal, wi);
    if (side_o <= 0.0 || side_i == 0.0 || (s.material.flags & MATERIAL_UNLIT) != 0u) return;
    float beneath = 1.0 - l.coat;
    vec3 i = wi * l.frame;
    bool glossy = has_lobe(lobes, LOBE_GLOSSY), reflects = side_i > 0.0;
    bool transmits = !reflects && l.glass && glossy && has_lobe(lobes, LOBE_TRANSMIT) && !l.delta_transmit && i.z < 0.0;
    if (!reflects && !transmits) return;
    bool refracts = transmits && l.solid;
    vec3 mirrored = vec3(i.xy, -i.z);
    // In the frame of the layers but where light is reflected: coats have another.
    vec3 h = normalize(reflects ? wo + wi : refracts ? l.wo + l.eta * i : l.wo + mirrored);
    if (refracts && h.z < 0.0) h = -h;
    float cos_o = dot(reflects ? wo : l.wo, h);
    if (refracts && (cos_o <= 0.0 || dot(i, h) >= 0.0)) return;
    Split split = split_interface(s.material, cos_o, front);
    if (reflects) {
        float cos_d = dot(s.normal, wi);
        if (has_lobe(lobes, LOBE_DIFFUSE) && cos_d > 0.0) {
            f += (beneath * diffuse_factor(s, l, split, wi, front) * cos_d / PI) * l.diffuse;
            pdf += l.p_diffuse * cos_d / PI;
        }
        if (glossy && !l.delta && i.z > 0.0) {
            vec2 lobe = mirror_lobe(l.wo, i, normalize(l.wo + i), l.alpha);
            f += beneath * lobe.x * split.reflected;
            pdf += l.p_interface * reflect_probability(l, split, lobes) * lobe.y;
        }
        vec3 c = wi * l.coat_frame;
        if (l.coat > 0.0 && glossy && l.coat_alpha >= DELTA_ALPHA && c.z > 0.0) {
            vec2 lobe = mirror_lobe(l.coat_wo, c, normalize(l.coat_wo + c), l.coat_alpha);
            f += vec3(l.coat * lobe.x);
            pdf += l.p_coat * lobe.y;
        }
    } else if (!refracts) {
        vec2 lobe = mirror_lobe(l.wo, mirrored, h, l.alpha);
        f = beneath * lobe.x * split.transmitted;
        pdf = l.p_interface * (1.0 - reflect_probability(l, split, lobes)) * lobe.y;
    } else {
        float cos_i = dot(i, h);
        float t = l.eta * cos_i + cos_o;
        // Walter et al. 2007, eqs. 17 and 21.
        float jacobian = -cos_i * l.eta * l.eta / (t * t);
        float d = ggx(h, l.alpha) * cos_o / l.wo.z * jacobian;
        float lambda_o = smith_lambda(l.wo, l.alpha);
        f = (beneath * d / (1.0 + lambda_o + smith_lambda(i, l.alpha)) / (l.eta * l.eta)) * split.transmitted;
        pdf = l.p_interface * (1.0 - reflect_probability(l, split, lobes)) * d / (1.0 + lambda_o);
    }
}

// f·|cosθ_i| of the lobes asked for (LOBE_ bits) but delta ones; 0 below the surface but for transmission. `pdf` is the
// density by solid angle with which bsdf_sample, asked for the same lobes, gives wi from another than a delta one.
vec3 bsdf_evaluate(Surface s, bool front, vec3 wo, vec3 wi, uint lobes, out float pdf) {
    vec3 f;
    evaluate(s, front, wo, wi, lobes, layers_of(s, front, wo, lobes), f, pdf);
    return f;
}

vec3 bsdf_evaluate(Surface s, bool front, vec3 wo, vec3 wi, uint lobes) {
    float pdf;
    return bsdf_evaluate(s, front, wo, wi, lobes, pdf);
}

float bsdf_pdf(Surface s, bool front, vec3 wo, vec3 wi, uint lobes) {
    float pdf;
    bsdf_evaluate(s, front, wo, wi, lobes, pdf);
    return pdf;
}

// bsdf_sample of layers that are known.
bool sample_layers(Surface s, bool front, vec3 wo, vec3 u, uint lobes, Layers l, out BsdfSample b) {
    b = BsdfSample(vec3(0.0), vec3(0.0), 0.0, 0u, 1.0);
    if (dot(s.geometric_normal, wo) <= 0.0 || (s.material.flags & MATERIAL_UNLIT) != 0u) return false;
    float beneath = 1.0 - l.coat;
    if (l.p_coat + l.p_diffuse + l.p_interface <= 0.0) return false;
    if (u.z < l.p_coat) {
        bool delta = l.coat_alpha < DELTA_ALPHA;
        vec3 h = delta ? vec3(0.0, 0.0, 1.0) : sample_visible_normal(l.coat_wo, l.coat_alpha, u.xy);
        b.direction = l.coat_frame * reflect(-l.coat_wo, h);
        b.lobe = delta ? LOBE_DELTA : LOBE_GLOSSY;
        if (delta) {
            b.direction = reflect_above(-wo, l.coat_frame[2], s.side_normal);
            b.weight = vec3(l.coat / l.p_coat);
            return true;
        }
    } else if (u.z < l.p_coat + l.p_diffuse || l.p_interface <= 0.0) {
        b.direction = basis_around(s.normal) * sample_cosine_hemisphere(u.xy);
        b.lobe = LOBE_DIFFUSE;
    } else {
        float v = min((u.z - l.p_coat - l.p_diffuse) / l.p_interface, 0.99999994);
        vec3 h = l.delta ? vec3(0.0, 0.0, 1.0) : sample_visible_normal(l.wo, l.alpha, u.xy);
        Split split = split_interface(s.material, dot(l.wo, h), front);
        float p = reflect_probability(l, split, lobes);
        if (v < p) {
            b.lobe = l.delta ? LOBE_DELTA : LOBE_GLOSSY;
            if (l.delta) {
                b.direction = reflect_above(-wo, l.frame[2], s.side_normal);
                b.weight = split.reflected * (beneath / (l.p_interface * p));
                return b.weight != vec3(0.0);
            }
            b.direction = l.frame * reflect(-l.wo, h);
        } else {
            b.lobe = l.transmit;
            b.eta = l.eta;
            if (b.lobe == LOBE_PANE) {
                b.direction = -wo;
                b.weight = pane_share(s, wo) / (l.p_interface * (1.0 - p));
                return b.weight != vec3(0.0);
            }
            if (l.delta_transmit) {
                b.direction = l.delta ? transmit(s.material, -wo, l.frame[2], front) : -wo;
                b.weight = split.transmitted * (beneath / (l.p_interface * (1.0 - p) * l.eta * l.eta));
                return b.weight != vec3(0.0);
            }
            vec3 wi;
            if (l.solid) {
                wi = refract(-l.wo, h, 1.0 / l.eta);
            } else {
                wi = reflect(-l.wo, h);
                wi.z = -wi.z;
            }
            if (wi.z >= 0.0) return false;
            b.direction = l.frame * wi;
        }
    }
    // On the side the lobe belongs to, of both normals.
    bool transmitted = has_lobe(b.lobe, LOBE_TRANSMIT);
    if (transmitted == (dot(s.side_normal, b.direction) > 0.0)) return false;
    if (b.lobe == LOBE_GLOSSY && dot(u.z < l.p_coat ? l.coat_frame[2] : l.frame[2], b.direction) <= 0.0) return false;
    vec3 f;
    evaluate(s, front, wo, b.direction, lobes, l, f, b.pdf);
    if (b.pdf <= 0.0 || f == vec3(0.0)) return false;
    b.weight = f / b.pdf;
    return true;
}

// Chooses a direction by `u`, three numbers in [0, 1): z the lobe, x and y the direction. False: the light is absorbed.
bool bsdf_sample(Surface s, bool front, vec3 wo, vec3 u, uint lobes, out BsdfSample b) {
    return sample_layers(s, front, wo, u, lobes, layers_of(s, front, wo, lobes), b);
}

// Mean of (1 − wo·h)⁵ over a cosine-distributed wi, a fit within 0.0001.
float mean_schlick_weight(float cosine) {
    return 0.028034 + cosine * (-0.077298 + cosine * (0.074949 - cosine * 0.025735));
}

// What of the diffuse part's light no facet reflects, for light from one direction to all.
float mean_dielectric_base(Material m, float cosine) {
    if (scene.energy_conserving != 0u) {
        return dielectric_base(m, cosine) * (20.0 * dielectric_base(m, 1.0) + dielectric_base(m, 0.0)) / 21.0;
    }
    vec3 f0 = dielectric_f0(m);
    return 1.0 - max_component(f0 + (vec3(dielectric_f90(m, f0)) - f0) * mean_schlick_weight(cosine));
}

// Albedo of the diffuse part for light that comes evenly from all sides. What irradiance is multiplied with where no
// directions are known.
vec3 bsdf_diffuse(Surface s, bool front, vec3 wo) {
    Material m = s.material;
    float cos_o = clamp(dot(s.normal, wo), 0.0, 1.0);
    float share = is_glass(m) ? split_interface(m, cos_o, front).base : mean_dielectric_base(m, cos_o);
    if (has_coat(m, front)) share *= 1.0 - coat_share(m, max(dot(s.clearcoat_normal, wo), 0.0));
    return share * diffuse_albedo(m);
}

#endif
