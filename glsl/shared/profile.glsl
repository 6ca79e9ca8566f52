// What the scene needs (src/scene/profile.rs). What is false here costs nothing.
#ifndef SHARED_PROFILE_GLSL
#define SHARED_PROFILE_GLSL

layout(constant_id = 100) const bool ALPHA_MASK = true;
layout(constant_id = 101) const bool INSTANCED = true; // more than the one merged mesh
layout(constant_id = 102) const bool TEXTURES = true; // of base colour
layout(constant_id = 103) const bool UV1 = true;
layout(constant_id = 104) const bool VERTEX_COLORS = true;
layout(constant_id = 105) const bool SMOOTH_NORMALS = true;
layout(constant_id = 106) const bool MIRRORS = true;
layout(constant_id = 107) const bool GLASS = true;
layout(constant_id = 108) const bool VOLUMES = true;
layout(constant_id = 109) const bool SPOT_LIGHTS = true;
layout(constant_id = 110) const bool DIRECTIONAL_LIGHTS = true;
layout(constant_id = 120) const bool METALLIC_ROUGHNESS_TEXTURES = true;
layout(constant_id = 121) const bool NORMAL_MAPS = true;
layout(constant_id = 122) const bool SPECULAR_TEXTURES = true;
layout(constant_id = 123) const bool TRANSMISSION_TEXTURES = true;
layout(constant_id = 124) const bool EMISSION_TEXTURES = true;
layout(constant_id = 125) const bool CLEARCOAT = true;
layout(constant_id = 126) const bool CLEARCOAT_TEXTURES = true;
layout(constant_id = 127) const bool ALPHA_BLEND = true;
layout(constant_id = 128) const bool EMISSIVE_TRIANGLES = true;
layout(constant_id = 129) const bool ENVIRONMENT = true;
layout(constant_id = 136) const bool LIGHT_TREE = true; // lights may be chosen by what a point can get of them
// Surfaces that let some of the light straight through: panes, and partial coverage.
layout(constant_id = 131) const bool SHEER = true;
layout(constant_id = 132) const bool PANES = true;
// Clear coats and lobes rougher than a mirror are evaluated, by methods that could leave them out.
layout(constant_id = 130) const bool GLOSSY = true;
layout(constant_id = 135) const bool DEEP_TEXTURES = true; // of 16 bits a channel
// Smooth facets stand for curved surfaces (`shadow_terminator`), and some facet's shading normals leave its own.
layout(constant_id = 133) const bool CURVED = true;

#endif
