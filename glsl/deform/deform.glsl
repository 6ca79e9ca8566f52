// What brings meshes into shape, and rebuilds nodes over them. Twins by build.rs.
#ifndef DEFORM_DEFORM_GLSL
#define DEFORM_DEFORM_GLSL

#extension GL_EXT_scalar_block_layout : require

// A vertex before it is morphed and skinned. What moves it ends where the next one's begins.
struct DeformVertex {
    vec3 position;
    uint at; // in the scene's vertices
    vec3 normal;
    uint deltas_end;
    uint influences_end;
};

// What a morph target adds by weight.
struct MorphDelta {
    vec3 position;
    uint weight;
    vec3 normal;
};

struct Influence {
    uint joint;
    float weight; // those of a vertex sum to 1
};

// A triangle in leaf order.
struct DeformTriangle {
    uvec3 vertices; // of the scene
    uint name;      // primitive, and in the lowest three bits what a ray must ask of it
};

// Of a node or what a child holds.
struct NodeBox {
    vec3 low;
    vec3 high;
};

float half_area(NodeBox box)
{
    vec3 size = box.high - box.low;
    return size.x * size.y + size.y * size.z + size.z * size.x;
}

#endif
