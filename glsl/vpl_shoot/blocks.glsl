#ifndef VPL_SHOOT_BLOCKS_GLSL
#define VPL_SHOOT_BLOCKS_GLSL

const uint BLOCK_SLOTS = 4096u; // that a workgroup closes the gaps of

#endif
