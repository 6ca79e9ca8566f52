// Which neighbours lie on the same surface.
#ifndef INDIRECT_EDGES_GLSL
#define INDIRECT_EDGES_GLSL

#include "shared/scene.glsl"

// What the G-buffer holds of a pixel.
struct Point {
    vec3 normal;
    float depth; // m, along the viewing direction; 0: nothing was hit
    vec3 position;
};

// Edge of a pixel (m) where a surface facing the camera has this depth.
float footprint(float depth) {
    float side = 2.0 * length(scene.camera.up) / float(scene.full_size.y);
    return scene.camera.orthographic != 0u ? side : side * depth;
}

// 1 where q continues the plane at p, 0 where its distance (m) from that plane reaches `reach` or the cosine between
// the normals falls to `least_cosine`.
float same_plane(Point p, Point q, float reach, float least_cosine) {
    if (q.depth == 0.0) return 0.0;
    float away = dot(p.normal, q.position - p.position) / reach;
    float bent = (dot(p.normal, q.normal) - least_cosine) / (1.0 - least_cosine);
    return max(0.0, 1.0 - away * away) * clamp(bent, 0.0, 1.0);
}

#endif
