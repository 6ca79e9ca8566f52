// Indirect dispatches of more workgroups than a device takes along an axis: in rows of as many as every device takes.
#ifndef LIB_GROUPS_GLSL
#define LIB_GROUPS_GLSL

const uint ROW_GROUPS = 65535u;

uint groups_along(uint groups) { return min(groups, ROW_GROUPS); }
uint rows_of(uint groups) { return (groups + ROW_GROUPS - 1u) / ROW_GROUPS; }
uint group_at(uint along, uint row) { return row * ROW_GROUPS + along; }

#endif
