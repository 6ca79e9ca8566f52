#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/scene.glsl"

// Writes every member of every shared structure, in order, as words: the proof that Rust and GLSL agree
// on where each member lies.
layout(local_size_x = 1) in;
layout(set = 1, binding = 0, scalar) readonly buffer Instances { Instance data[]; } instances;
layout(set = 1, binding = 1, scalar) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 1, binding = 2, scalar) readonly buffer Materials { Material data[]; } materials;
layout(set = 1, binding = 3, scalar) readonly buffer Textures { Texture data[]; } textures;
layout(set = 1, binding = 4, scalar) readonly buffer Lights { Light data[]; } lights;
layout(set = 1, binding = 5, scalar) readonly buffer Vpls { Vpl data[]; } vpls;
layout(set = 1, binding = 6, scalar) readonly buffer Choices { LightChoice data[]; } choices;
layout(set = 1, binding = 7, scalar) readonly buffer Nodes { LightNode data[]; } nodes;
layout(set = 1, binding = 8, scalar) writeonly buffer Words { uint data[]; } words;

uint next = 0u;
void put(uint v) { words.data[next++] = v; }
void put(float v) { put(floatBitsToUint(v)); }
void put(uint64_t v) { put(uint(v & 0xffffffffUL)); put(uint(v >> 32)); }
void put(vec2 v) { put(v.x); put(v.y); }
void put(uvec2 v) { put(v.x); put(v.y); }
void put(vec3 v) { put(v.x); put(v.y); put(v.z); }
void put(uvec3 v) { put(v.x); put(v.y); put(v.z); }
void put(LightSet s) { put(s.root); put(s.tree_probability); put(s.first); put(s.count); }

void main() {
    Instance i = instances.data[1];
    for (uint c = 0u; c < 4u; ++c) put(i.object_to_world[c]);
    put(i.first_triangle); put(i.orientation);
    Triangle t = triangles.data[1];
    put(t.vertices); put(t.material);
    Material m = materials.data[1];
    put(m.base_color); put(m.alpha); put(m.emission); put(m.roughness); put(m.specular_color); put(m.specular);
    put(m.absorption); put(m.metallic); put(m.ior); put(m.transmission); put(m.alpha_cutoff); put(m.flags);
    put(m.clearcoat); put(m.clearcoat_roughness); put(m.normal_scale); put(m.clearcoat_normal_scale);
    put(m.base_color_texture); put(m.metallic_roughness_texture); put(m.normal_texture); put(m.emission_texture);
    put(m.transmission_texture); put(m.specular_texture); put(m.specular_color_texture); put(m.clearcoat_texture);
    put(m.clearcoat_roughness_texture); put(m.clearcoat_normal_texture);
    Texture x = textures.data[1];
    put(x.texels); put(x.size); put(x.transform_u); put(x.transform_v); put(x.flags); put(x.padding0);
    Light l = lights.data[1];
    put(l.position); put(l.kind); put(l.direction); put(l.cos_inner); put(l.intensity); put(l.cos_outer);
    put(l.flux); put(l.power_cdf);
    Vpl v = vpls.data[1];
    put(v.position); put(v.path); put(v.normal); put(v.bounce); put(v.flux); put(v.spread);
    LightChoice c = choices.data[1];
    put(c.probability); put(c.threshold); put(c.alias); put(c.instance); put(c.primitive);
    LightNode n = nodes.data[1];
    put(n.center); put(n.radius); put(n.axis); put(n.intensity); put(n.cos_spread); put(n.cos_reach); put(n.child); put(n.parent);
    SceneData s = scene;
    put(s.instances); put(s.triangles); put(s.positions); put(s.normals); put(s.uv0); put(s.uv1); put(s.colors); put(s.tangents);
    put(s.materials); put(s.textures); put(s.lights); put(s.light_choices); put(s.emission_weights);
    put(s.environment); put(s.environment_rows); put(s.environment_columns); put(s.excess_rows);
    put(s.excess_columns); put(s.bvh_nodes); put(s.bvh_triangles); put(s.bvh_top); put(s.bvh_placements); put(s.box_nodes); put(s.boxes); put(s.box_planes); put(s.ray_counters);
    put(s.light_nodes); put(s.emitter_leaves);
    put(s.light_count); put(s.triangle_count); put(s.ray_epsilon); put(s.scene_center); put(s.scene_radius);
    put(s.camera.eye); put(s.camera.orthographic); put(s.camera.right);
    put(s.camera.up); put(s.camera.forward);
    put(s.full_size); put(s.window_origin); put(s.pixel_offset); put(s.seed); put(s.specular_depth); put(s.mirror_roughness);
    put(s.pane_roughness);
    put(s.energy_conserving); put(s.light_choice_count); put(s.inverse_power); put(s.environment_size);
    put(s.inverse_area_power); put(s.light_samples); put(s.lobe_samples); put(s.excess_choices);
    put(s.excess_choice_count); put(s.inverse_excess_power); put(s.vpl_share); put(s.asked_lights);
    put(s.all_lights); put(s.sampled_lights); put(s.lights_beside_lobes); put(s.padding0);
}
