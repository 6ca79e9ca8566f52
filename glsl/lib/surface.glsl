// What a ray found: position, normals and material at a hit.
#ifndef LIB_SURFACE_GLSL
#define LIB_SURFACE_GLSL

#include "shared/profile.glsl"
#include "shared/scene.glsl"
#include "trace/hit.glsl"

const uint TRIANGLE_MIRRORED = 0x80000000u; // bit of Triangle.material: merged from a mirrored instance

struct Surface {
    vec3 position;
    vec3 geometric_normal; // unit length, on the front side until facing() turns it
    vec3 normal;           // shading normal, unit length, on the geometric normal's side
    Material material;     // base colour and alpha with texture and vertex colour multiplied in
};

float srgb_to_linear(float v) {
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

uint wrap_texel(int i, uint size, uint mode) {
    int n = int(size);
    if (mode == 2u) return uint(clamp(i, 0, n - 1));
    int period = mode == 1u ? 2 * n : n;
    int m = i % period;
    if (m < 0) m += period;
    return uint(m < n ? m : 2 * n - 1 - m);
}

vec4 texel(Texture tex, int x, int y) {
    uint column = wrap_texel(x, tex.size.x, (tex.flags >> TEXTURE_WRAP_U_SHIFT) & 3u);
    uint row = wrap_texel(y, tex.size.y, (tex.flags >> TEXTURE_WRAP_V_SHIFT) & 3u);
    vec4 v = unpackUnorm4x8(TexelArray(tex.texels)[row * tex.size.x + column].at);
    return vec4(srgb_to_linear(v.r), srgb_to_linear(v.g), srgb_to_linear(v.b), v.a);
}

// Level 0 only: nearest, or bilinear in linear light.
vec4 sample_texture(uint index, vec2 uv0, vec2 uv1) {
    Texture tex = TextureArray(scene.textures)[index].at;
    vec2 uv = UV1 && (tex.flags & TEXTURE_UV1) != 0u ? uv1 : uv0;
    uv = vec2(dot(tex.transform_u, vec3(uv, 1.0)), dot(tex.transform_v, vec3(uv, 1.0)));
    // Wrapping in integers needs coordinates they can hold.
    vec2 position = clamp(uv, -1e4, 1e4) * vec2(tex.size);
    if ((tex.flags & TEXTURE_NEAREST) != 0u) {
        return texel(tex, int(floor(position.x)), int(floor(position.y)));
    }
    position -= 0.5;
    vec2 corner = floor(position);
    vec2 f = position - corner;
    ivec2 i = ivec2(corner);
    return mix(mix(texel(tex, i.x, i.y), texel(tex, i.x + 1, i.y), f.x),
               mix(texel(tex, i.x, i.y + 1), texel(tex, i.x + 1, i.y + 1), f.x), f.y);
}

vec2 interpolate_uv(uint64_t array, uvec3 v, vec3 w) {
    Vec2Array uv = Vec2Array(array);
    return w.x * uv[v.x].at + w.y * uv[v.y].at + w.z * uv[v.z].at;
}

vec4 base_color(Material material, uvec3 v, vec3 w) {
    vec4 color = vec4(material.base_color, material.alpha);
    if (VERTEX_COLORS && scene.colors != 0UL) {
        Vec4Array colors = Vec4Array(scene.colors);
        color *= w.x * colors[v.x].at + w.y * colors[v.y].at + w.z * colors[v.z].at;
    }
    if (TEXTURES && material.base_color_texture != NO_TEXTURE) {
        vec2 uv0 = scene.uv0 != 0UL ? interpolate_uv(scene.uv0, v, w) : vec2(0.0);
        vec2 uv1 = UV1 && scene.uv1 != 0UL ? interpolate_uv(scene.uv1, v, w) : vec2(0.0);
        color *= sample_texture(material.base_color_texture, uv0, uv1);
    }
    return color;
}

vec3 weights(vec2 barycentrics) {
    return vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics);
}

// Whether an alpha-masked triangle has a hole there. Called by the traversal.
bool alpha_hole(uint instance, uint primitive, vec2 barycentrics) {
    Triangle triangle = TriangleArray(scene.triangles)[InstanceArray(scene.instances)[instance].at.first_triangle + primitive].at;
    Material material = MaterialArray(scene.materials)[triangle.material & ~TRIANGLE_MIRRORED].at;
    if ((material.flags & MATERIAL_ALPHA_MASK) == 0u) return false;
    return base_color(material, triangle.vertices, weights(barycentrics)).a < material.alpha_cutoff;
}

Surface surface_at(Hit hit) {
    Instance instance = InstanceArray(scene.instances)[INSTANCED ? hit.instance : 0u].at;
    Triangle triangle = TriangleArray(scene.triangles)[instance.first_triangle + hit.primitive].at;
    uvec3 v = triangle.vertices;
    vec3 w = weights(hit.barycentrics);

    Vec3Array positions = Vec3Array(scene.positions);
    vec3 a = positions[v.x].at, b = positions[v.y].at, c = positions[v.z].at;
    if (INSTANCED && hit.instance != 0u) {
        a = instance.object_to_world * vec4(a, 1.0);
        b = instance.object_to_world * vec4(b, 1.0);
        c = instance.object_to_world * vec4(c, 1.0);
    }
    Surface surface;
    // Relative to one corner: differences stay exact far from the origin.
    surface.position = a + (w.y * (b - a) + w.z * (c - a));
    float winding = (triangle.material & TRIANGLE_MIRRORED) != 0u ? -1.0 : instance.orientation;
    vec3 across = cross(b - a, c - a);
    // A sliver's square may underflow, or its cross product round to nothing.
    float largest = max(abs(across.x), max(abs(across.y), abs(across.z)));
    surface.geometric_normal = largest > 0.0 ? winding * normalize(across / largest) : vec3(0.0, 0.0, 1.0);

    surface.normal = surface.geometric_normal;
    if (SMOOTH_NORMALS && scene.normals != 0UL) {
        Vec3Array normals = Vec3Array(scene.normals);
        vec3 n = w.x * normals[v.x].at + w.y * normals[v.y].at + w.z * normals[v.z].at;
        if (INSTANCED && hit.instance != 0u) {
            // The cofactor matrix carries normals whatever the scaling.
            mat3 m = mat3(instance.object_to_world);
            n = instance.orientation * (cross(m[1], m[2]) * n.x + cross(m[2], m[0]) * n.y + cross(m[0], m[1]) * n.z);
        }
        float length2 = dot(n, n);
        if (length2 > 0.0) {
            n *= inversesqrt(length2);
            surface.normal = dot(n, surface.geometric_normal) < 0.0 ? -n : n;
        }
    }
    surface.material = MaterialArray(scene.materials)[triangle.material & ~TRIANGLE_MIRRORED].at;
    vec4 color = base_color(surface.material, v, w);
    surface.material.base_color = color.rgb;
    surface.material.alpha = color.a;
    return surface;
}

// Turns both normals to the side of `to_viewer`; returns whether that is the front.
bool face(inout Surface surface, vec3 to_viewer) {
    bool front = dot(surface.geometric_normal, to_viewer) >= 0.0;
    if (!front) {
        surface.geometric_normal = -surface.geometric_normal;
        surface.normal = -surface.normal;
    }
    return front;
}

vec3 emitted_radiance(Material material, bool front) {
    vec3 emission = (material.flags & MATERIAL_UNLIT) != 0u ? material.base_color : material.emission;
    return front || (material.flags & (MATERIAL_DOUBLE_SIDED | MATERIAL_UNLIT)) != 0u ? emission : vec3(0.0);
}

// Share of the light a surface scatters as a Lambertian, before any mirror takes its part.
vec3 diffuse_albedo(Material material) {
    if ((material.flags & MATERIAL_UNLIT) != 0u) return vec3(0.0);
    return material.base_color * ((1.0 - material.metallic) * (1.0 - material.transmission));
}

#endif
