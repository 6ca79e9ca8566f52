#version 460
#extension GL_EXT_scalar_block_layout : require
// Adds one at the place of each invocation: an invocation that runs twice, or not at all, shows.
layout(local_size_x = 4) in;
layout(set = 1, binding = 0, scalar) buffer Counts { uint data[]; } counts;
layout(push_constant) uniform Params { uvec3 size; };

void main() {
    uvec3 id = gl_GlobalInvocationID;
    if (any(greaterThanEqual(id, size))) return;
    counts.data[(id.z * size.y + id.y) * size.x + id.x] += 1u;
}
