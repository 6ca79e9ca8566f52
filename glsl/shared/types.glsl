// Structures shared with Rust: build.rs reflects them through test/layout.comp and writes their twins, and those of
// the constants here.
// Scalar layout everywhere: no padding but what stands here, for 64-bit alignment.
#ifndef SHARED_TYPES_GLSL
#define SHARED_TYPES_GLSL

#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

struct Instance {
    mat4x3 object_to_world;
    uint first_triangle; // of its mesh, in the triangle array
    float orientation;   // sign of the determinant: −1 flips front and back
};

struct Triangle {
    uvec3 vertices;
    uint material;
};

const uint TRIANGLE_MIRRORED = 0x80000000u; // bit of Triangle.material: merged from a mirrored instance

const uint MATERIAL_DOUBLE_SIDED = 1u; // emission leaves both sides
const uint MATERIAL_UNLIT = 2u;
const uint MATERIAL_ALPHA_MASK = 4u;
const uint MATERIAL_SOLID = 8u; // transmits into a volume; a thin wall otherwise
const uint MATERIAL_ALPHA_BLEND = 16u; // alpha is the share of light that meets the surface
const uint MATERIAL_SHEER = 32u; // may let light straight through: a thin wall that transmits, or partial coverage
const uint MATERIAL_SLAB = 64u; // a thin wall that stands for a slab; `absorption` is its optical depth
const uint NO_TEXTURE = 0xffffffffu;

struct Material {
    vec3 base_color;
    float alpha;
    vec3 emission; // W/(sr m²)
    float roughness;
    vec3 specular_color;
    float specular;
    vec3 absorption; // 1/m, inside a solid; of a slab its thickness (m) times that
    float metallic;
    float ior;
    float transmission;
    float alpha_cutoff;
    uint flags;
    float clearcoat;
    float clearcoat_roughness;
    float normal_scale;
    float clearcoat_normal_scale;
    uint base_color_texture;
    uint metallic_roughness_texture; // roughness green, metalness blue
    uint normal_texture;
    uint emission_texture;
    uint transmission_texture; // red
    uint specular_texture;     // alpha
    uint specular_color_texture;
    uint clearcoat_texture;           // red
    uint clearcoat_roughness_texture; // green
    uint clearcoat_normal_texture;
};

const uint TEXTURE_NEAREST = 1u;
const uint TEXTURE_UV1 = 2u;
const uint TEXTURE_WRAP_U_SHIFT = 2u; // two bits each: 0 repeat, 1 mirrored repeat, 2 clamp to edge
const uint TEXTURE_WRAP_V_SHIFT = 4u;
const uint TEXTURE_WRAP_MIRROR = 1u;
const uint TEXTURE_WRAP_CLAMP = 2u;
const uint TEXTURE_SRGB = 64u; // red, green and blue are to be decoded
const uint TEXTURE_DEEP = 128u; // 16 bits: high bytes of all texels, then low bytes

struct Texture {
    uint64_t texels; // rgba8
    uvec2 size;
    vec3 transform_u; // u' = dot(transform_u, (u, v, 1))
    vec3 transform_v;
    uint flags;
    uint padding0;
};

const uint LIGHT_POINT = 0u;
const uint LIGHT_SPOT = 1u;
const uint LIGHT_DIRECTIONAL = 2u;

struct Light {
    vec3 position;
    uint kind;
    vec3 direction; // it shines along
    float cos_inner;
    vec3 intensity; // W/sr; directional: W/m²
    float cos_outer;
    vec3 flux;        // W, all of what it emits
    float power_cdf;  // share of the lights up to and with this one in the power
};

// What sample_light chooses from, in proportion to power: the lights, then emissive triangles, last the environment. An
// alias table (Vose 1991). Behind it another one of emissive triangles and the environment alone, and one where of the
// environment only what exceeds its mean counts.
struct LightChoice {
    float probability;
    float threshold; // share of this place that is its own; the rest is the alias's
    uint alias;
    uint instance; // of a triangle, as in Hit
    uint primitive;
};

const uint LIGHT_NODE_LEAF = 0x80000000u; // bits of LightNode.child
const uint LIGHT_NODE_TWO_SIDED = 0x40000000u; // the cone holds the opposite directions, too
const uint LIGHT_NODE_DELTA = 0x20000000u; // of leaves: a light without size
const uint LIGHT_NODE_INDEX = 0x1fffffffu;

// Of the tree that lights with a place are chosen by; siblings lie side by side, the first in an even place.
struct LightNode {
    vec3 center; // of a sphere around its lights
    float radius;
    vec3 axis; // of a cone around what they face, the normal of one triangle
    float intensity; // share of all lights' greatest intensities (W/sr)
    float cos_spread; // of the cone's half angle
    float cos_reach; // of the angle from what they face within which light leaves
    uint child; // the first of two; of leaves the index of a light, or of a triangle among those that emit; and bits
    uint parent;
};

// Lights to choose from: those of a tree, and in a table of choices what is infinitely far away. There `instance` is the
// index of a directional light; the environment comes last.
struct LightSet {
    uint root;
    float tree_probability;
    uint first; // choice of the table
    uint count;
};

// A virtual point light. Flux 0 marks a slot whose path ended.
struct Vpl {
    vec3 position;
    uint path;
    vec3 normal; // geometric, on the side that was lit
    uint bounce;
    vec3 flux; // W
    float spread; // of what it stands for, a squared radius (m²); 0: a point
};

// One that is kept for so many.
Vpl for_all(Vpl vpl, float number) {
    vpl.flux *= number;
    vpl.spread *= number;
    return vpl;
}

struct Camera {
    vec3 eye;
    uint orthographic;
    vec3 right; // half the width of the image plane at distance 1 (orthographic: in metres)
    vec3 up;
    vec3 forward; // unit length
};

const uint MAX_SPECULAR_DEPTH = 16u;

struct SceneData {
    uint64_t instances;
    uint64_t triangles;
    uint64_t positions;
    uint64_t normals;
    uint64_t uv0;
    uint64_t uv1;
    uint64_t colors;
    uint64_t tangents; // three a triangle
    uint64_t materials;
    uint64_t textures;
    uint64_t lights;
    uint64_t light_choices;
    uint64_t emission_weights; // power of each triangle over its area, W/m²
    uint64_t environment;         // radiance, vec3, rows from +Y down
    uint64_t environment_rows;    // cumulative probability
    uint64_t environment_columns; // of each row, cumulative probability
    uint64_t excess_rows; // the same of what of the environment exceeds its mean; 0 where nothing does
    uint64_t excess_columns;
    uint64_t bvh_nodes;
    uint64_t bvh_triangles;
    uint64_t bvh_top; // nodes over placements, where there are two levels
    uint64_t bvh_placements;
    uint64_t box_nodes; // of the structure over boxes, if there is one
    uint64_t boxes;
    uint64_t box_planes;
    uint64_t ray_counters; // 0: rays are not counted
    uint64_t light_nodes; // 0: lights are chosen by power alone
    uint64_t emitter_leaves; // of each instance where its triangles begin, then leaves of triangles, 0 where one has none
    uint light_count;
    uint triangle_count;
    float ray_epsilon; // unit of ray origin offsets (m)
    vec3 scene_center;
    float scene_radius; // of the bounding sphere (m)
    Camera camera;
    uvec2 full_size;     // of the whole picture, pixels
    uvec2 window_origin; // of the part being rendered
    vec2 pixel_offset;   // sample position in the pixel, 0.5 is its centre
    uint seed;
    uint specular_depth;
    float mirror_roughness;
    float pane_roughness; // up to which thin walls that transmit are panes
    uint energy_conserving; // 0: dielectric and diffuse parts are mixed as published
    uint light_choice_count;
    float inverse_power; // 1/W, of all choices
    uvec2 environment_size;
    float inverse_area_power; // 1/W, of emissive triangles and the environment
    uint light_samples;       // shadow rays to those from a point; 0 where there are none
    uint lobe_samples;        // and rays of its lobes, where they are glossy
    uint excess_choices;      // the first choice of the table that goes with those
    uint excess_choice_count; // 0 where nothing is left to choose
    float inverse_excess_power; // 1/W, of its choices
    uint vpl_share;           // a point behind mirrors and glass is lit by one VPL in so many
    uint asked_lights;          // that a point asks one by one; light_count, or 0 where `light_samples` stand for them
    LightSet all_lights;
    LightSet sampled_lights;      // that light_samples choose from
    LightSet lights_beside_lobes; // the same where lobes are sampled too
    uint padding0;
};

#endif
