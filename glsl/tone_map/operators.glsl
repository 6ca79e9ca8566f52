#ifndef TONE_MAP_OPERATORS_GLSL
#define TONE_MAP_OPERATORS_GLSL

const uint OPERATOR_NEUTRAL = 0u;
const uint OPERATOR_REINHARD = 1u;
const uint OPERATOR_ACES = 2u;
const uint OPERATOR_LINEAR = 3u;

#endif
