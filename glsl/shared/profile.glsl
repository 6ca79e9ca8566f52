// What the scene needs (src/scene/profile.rs). What is false here costs nothing.
#ifndef SHARED_PROFILE_GLSL
#define SHARED_PROFILE_GLSL

layout(constant_id = 100) const bool ALPHA_MASK = true;
layout(constant_id = 101) const bool INSTANCED = true; // more than the one merged mesh
layout(constant_id = 102) const bool TEXTURES = true;
layout(constant_id = 103) const bool UV1 = true;
layout(constant_id = 104) const bool VERTEX_COLORS = true;
layout(constant_id = 105) const bool SMOOTH_NORMALS = true;
layout(constant_id = 106) const bool MIRRORS = true;
layout(constant_id = 107) const bool GLASS = true;
layout(constant_id = 108) const bool VOLUMES = true;
layout(constant_id = 109) const bool SPOT_LIGHTS = true;
layout(constant_id = 110) const bool DIRECTIONAL_LIGHTS = true;

#endif
