#ifndef LIB_CAMERA_GLSL
#define LIB_CAMERA_GLSL

#include "shared/scene.glsl"

struct Ray {
    vec3 origin;
    vec3 direction; // unit length
};

// The ray through a pixel of the window being rendered, at `offset_in_pixel` from its upper left corner.
Ray camera_ray(uvec2 pixel, vec2 offset_in_pixel) {
    vec2 position = (vec2(pixel + scene.window_origin) + offset_in_pixel) / vec2(scene.full_size);
    vec2 plane = vec2(2.0, -2.0) * position + vec2(-1.0, 1.0);
    Camera camera = scene.camera;
    vec3 offset = plane.x * camera.right + plane.y * camera.up;
    if (camera.orthographic != 0u) return Ray(camera.eye + offset, camera.forward);
    return Ray(camera.eye, normalize(camera.forward + offset));
}

Ray camera_ray(uvec2 pixel) { return camera_ray(pixel, scene.pixel_offset); }

vec3 direction_to_camera(vec3 position) {
    return scene.camera.orthographic != 0u ? -scene.camera.forward : normalize(scene.camera.eye - position);
}

#endif
