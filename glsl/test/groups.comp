#version 460
#extension GL_EXT_scalar_block_layout : require
// Arguments of an indirect dispatch.
layout(local_size_x = 1) in;
layout(set = 1, binding = 0, scalar) writeonly buffer Arguments { uint data[]; } arguments;
layout(push_constant) uniform Params { uvec3 groups; };

void main() {
    arguments.data[1] = groups.x;
    arguments.data[2] = groups.y;
    arguments.data[3] = groups.z;
}
