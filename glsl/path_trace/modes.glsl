// Which light counts, and how it is found.
#ifndef PATH_TRACE_MODES_GLSL
#define PATH_TRACE_MODES_GLSL

const uint TRANSPORT_FULL = 0u;
const uint TRANSPORT_DIRECT = 1u;
const uint TRANSPORT_DIFFUSE_INDIRECT = 2u;
const uint CONNECT_NONE = 0u;
const uint CONNECT_DELTA = 1u; // to lights that no ray finds
const uint CONNECT_ALL = 2u;

#endif
