// Set 0: the scene, reached by device address.
#ifndef SHARED_SCENE_GLSL
#define SHARED_SCENE_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#include "shared/types.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer InstanceArray { Instance at; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer TriangleArray { Triangle at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer MaterialArray { Material at; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer TextureArray { Texture at; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LightArray { Light at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer LightChoiceArray { LightChoice at; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LightNodeArray { LightNode at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer UintArray { uint at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer FloatArray { float at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Vec2Array { vec2 at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Vec3Array { vec3 at; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Vec4Array { vec4 at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer TexelArray { uint at; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer CounterArray { uint at; };

layout(set = 0, binding = 0, scalar) uniform SceneBlock { SceneData scene; };

#endif
