// A radiance cache in the world (instant caching: Debattista et al. 2009). Surfaces are cut into cells: cubes of a grid, one
// for each of six directions that normals are nearest to and for either side of triangles, at edges that double from level
// to level. A record is the mean irradiance of a cell's surfaces, or where a wall divides them of those on either side of it. It depends
// on the cell and the seed alone, so that who asks first never shows.
#ifndef RADIANCE_CACHE_CELLS_GLSL
#define RADIANCE_CACHE_CELLS_GLSL

#extension GL_EXT_scalar_block_layout : require
#include "lib/groups.glsl"
#include "lib/sampling.glsl"
#include "shared/scene.glsl"

const uint LEVELS = 8u;
const int HALF_CELLS = 1 << 17; // on either side of the scene's centre
const uint RECORDS = 2u; // of a workgroup that makes them
const float LIFT = 0.1;  // of points over their surface when they ask whether they see each other, in edges

// What to dispatch on the table, and how full it is.
struct WantedArgs {
    uvec3 record; // workgroups that make the records that are wanted
    uint count;   // of those
    uvec3 forget; // workgroups that empty the table
    uint used;    // slots, but for those of wanted records
};

struct Record {
    vec3 light;  // W/m², of surfaces that the first one sees; below 0 where no surface was found
    vec3 behind; // of the others
    uint first;  // where in the cell that one is; 0: nothing divides it
};

struct Cell {
    ivec3 at;
    uint face; // four times the axis, two more on its negative side, one more where surfaces show their back
    uint level;
};

// Two words, neither of them 0.
uvec2 key_of(Cell cell) {
    uvec3 at = uvec3(cell.at + HALF_CELLS) & 0x3ffffu;
    return 0x80000000u | uvec2(cell.level << 28 | cell.face << 24 | at.x << 6 | at.y >> 12, (at.y & 0xfffu) << 18 | at.z);
}

Cell cell_of(uvec2 key) {
    uvec3 at = uvec3(key.x >> 6 & 0x3ffffu, (key.x & 0x3fu) << 12 | key.y >> 18 & 0xfffu, key.y & 0x3ffffu);
    return Cell(ivec3(at) - HALF_CELLS, key.x >> 24 & 15u, key.x >> 28 & 7u);
}

uint face_of(vec3 normal, bool front) {
    vec3 size = abs(normal);
    uint axis = size.x >= size.y && size.x >= size.z ? 0u : size.y >= size.z ? 1u : 2u;
    return 4u * axis + (normal[axis] < 0.0 ? 2u : 0u) + (front ? 0u : 1u);
}

float edge_of(uint level, float least) { return least * float(1u << level); }

// Walls like to stand at round coordinates: cells begin elsewhere.
const vec3 SHIFT = vec3(0.3819, 0.2764, 0.4271);

vec3 corner_of(Cell cell, float edge) { return scene.scene_center + edge * (vec3(cell.at) - SHIFT); }

// Where a surface lies, in cells of at most `wanted` (m) where there are such.
Cell cell_at(vec3 position, vec3 normal, bool front, float wanted, float least) {
    uint level = uint(clamp(floor(log2(wanted / least)), 0.0, float(LEVELS - 1u)));
    float edge = edge_of(level, least);
    vec3 at = (position - scene.scene_center) / edge + SHIFT;
    return Cell(ivec3(floor(at)), face_of(normal, front), level);
}

const float STEPS_ACROSS = 1023.0;

// Of a point near the cell.
uint place_in(Cell cell, vec3 position, float edge) {
    uvec3 at = uvec3(clamp((position - corner_of(cell, edge)) / edge, 0.0, 1.0) * STEPS_ACROSS + 0.5);
    return at.x << 20 | at.y << 10 | at.z;
}

// A little over the surface there.
vec3 over_place(Cell cell, uint place, float edge) {
    vec3 at = vec3(place >> 20 & 1023u, place >> 10 & 1023u, place & 1023u) / STEPS_ACROSS;
    at[cell.face >> 2] += (cell.face & 2u) != 0u ? -LIFT : LIFT;
    return corner_of(cell, edge) + edge * at;
}

// From one place in a cell to another; false where they are one, which rays cannot tell.
bool way_between(Cell cell, uint a, uint b, float edge, out vec3 from, out vec3 along) {
    const uint PLACE = (1u << 30) - 1u;
    from = over_place(cell, a, edge);
    along = over_place(cell, b, edge) - from;
    return ((a ^ b) & PLACE) != 0u;
}

uint first_slot(uvec2 key, uint slots) { return hash(key.x, key.y) & (slots - 1u); }

#endif
