// What a ray found: position, normals and material at a hit.
#ifndef LIB_SURFACE_GLSL
#define LIB_SURFACE_GLSL

#include "shared/profile.glsl"
#include "shared/scene.glsl"
#include "trace/hit.glsl"
#include "trace/offset.glsl"

struct Surface {
    vec3 position;
    vec3 geometric_normal; // unit length, on the front side until facing() turns it
    vec3 normal;           // shading normal, unit length, on the geometric normal's side
    vec3 clearcoat_normal; // of the layer on top, as `normal`
    // Of the surface that a facet stands for: its normal, which says what lies above it, and how high (m) it may be over
    // the facet, on the geometric normal's side and behind. The geometric normal and 0 where it is the facet.
    vec3 side_normal;
    vec2 lifts;
    Material material;     // its textures and the vertex colour multiplied in
};

// Compilers copy what is below to wherever a texture is asked for: short code, and few places that ask, make kernels that
// drivers compile in seconds.

vec3 srgb_to_linear(vec3 v) {
    return mix(pow((v + 0.055) / 1.055, vec3(2.4)), v / 12.92, lessThanEqual(v, vec3(0.04045)));
}

// Columns or rows, as the texture has them.
uvec2 wrap_texels(ivec2 i, uint size, uint mode) {
    int n = int(size);
    if (mode == TEXTURE_WRAP_CLAMP) return uvec2(clamp(i, 0, n - 1));
    int period = mode == TEXTURE_WRAP_MIRROR ? 2 * n : n;
    ivec2 m = i % period;
    m = mix(m, m + period, lessThan(m, ivec2(0)));
    return uvec2(mix(2 * n - 1 - m, m, lessThan(m, ivec2(n))));
}

vec4 texel(Texture tex, uint i) {
    vec4 v = unpackUnorm4x8(TexelArray(tex.texels)[i].at);
    if (DEEP_TEXTURES && (tex.flags & TEXTURE_DEEP) != 0u) {
        v = (256.0 * v + unpackUnorm4x8(TexelArray(tex.texels)[tex.size.x * tex.size.y + i].at)) / 257.0;
    }
    if ((tex.flags & TEXTURE_SRGB) != 0u) v.rgb = srgb_to_linear(v.rgb);
    return v;
}

// Both sets at a point.
struct TextureCoordinates {
    vec2 uv0;
    vec2 uv1;
};

// Level 0 only: nearest, or bilinear in linear light.
vec4 sample_texture(uint index, TextureCoordinates at) {
    Texture tex = TextureArray(scene.textures)[index].at;
    vec2 uv = UV1 && (tex.flags & TEXTURE_UV1) != 0u ? at.uv1 : at.uv0;
    uv = vec2(dot(tex.transform_u, vec3(uv, 1.0)), dot(tex.transform_v, vec3(uv, 1.0)));
    // Wrapping in integers needs coordinates they can hold.
    vec2 position = clamp(uv, -1e4, 1e4) * vec2(tex.size);
    bool nearest = (tex.flags & TEXTURE_NEAREST) != 0u;
    if (!nearest) position -= 0.5;
    vec2 corner = floor(position);
    vec2 f = nearest ? vec2(0.0) : position - corner;
    ivec2 i = ivec2(corner);
    uvec2 x = wrap_texels(ivec2(i.x, i.x + 1), tex.size.x, (tex.flags >> TEXTURE_WRAP_U_SHIFT) & 3u);
    uvec2 y = wrap_texels(ivec2(i.y, i.y + 1), tex.size.y, (tex.flags >> TEXTURE_WRAP_V_SHIFT) & 3u) * tex.size.x;
    return mix(mix(texel(tex, y.x + x.x), texel(tex, y.x + x.y), f.x),
               mix(texel(tex, y.y + x.x), texel(tex, y.y + x.y), f.x), f.y);
}

vec2 interpolate_uv(uint64_t array, uvec3 v, vec3 w) {
    Vec2Array uv = Vec2Array(array);
    return w.x * uv[v.x].at + w.y * uv[v.y].at + w.z * uv[v.z].at;
}

TextureCoordinates texture_coordinates(uvec3 v, vec3 w) {
    return TextureCoordinates(scene.uv0 != 0UL ? interpolate_uv(scene.uv0, v, w) : vec2(0.0),
                              UV1 && scene.uv1 != 0UL ? interpolate_uv(scene.uv1, v, w) : vec2(0.0));
}

// Without its texture.
vec4 plain_color(Material material, uvec3 v, vec3 w) {
    vec4 color = vec4(material.base_color, material.alpha);
    if (VERTEX_COLORS && scene.colors != 0UL) {
        Vec4Array colors = Vec4Array(scene.colors);
        color *= w.x * colors[v.x].at + w.y * colors[v.y].at + w.z * colors[v.z].at;
    }
    return color;
}

vec4 base_color(Material material, uvec3 v, vec3 w, TextureCoordinates at) {
    vec4 color = plain_color(material, v, w);
    if (TEXTURES && material.base_color_texture != NO_TEXTURE) {
        color *= sample_texture(material.base_color_texture, at);
    }
    return color;
}

vec3 emission_at(Material material, TextureCoordinates at) {
    vec3 emission = material.emission;
    if (EMISSION_TEXTURES && material.emission_texture != NO_TEXTURE) {
        emission *= sample_texture(material.emission_texture, at).rgb;
    }
    return emission;
}

// Bits, one a member of Material that names a texture, in their order.
const uint BASE_COLOR_TEXTURE = 1u;
const uint METALLIC_ROUGHNESS_TEXTURE = 2u;
const uint NORMAL_TEXTURE = 4u;
const uint EMISSION_TEXTURE = 8u;
const uint TRANSMISSION_TEXTURE = 16u;
const uint SPECULAR_TEXTURE = 32u;
const uint SPECULAR_COLOR_TEXTURE = 64u;
const uint CLEARCOAT_TEXTURE = 128u;
const uint CLEARCOAT_ROUGHNESS_TEXTURE = 256u;
const uint CLEARCOAT_NORMAL_TEXTURE = 512u;

// What maps of normals say, in the tangent space of the vertices' normal, before their scale.
struct Bumps {
    vec3 base;
    vec3 clearcoat;
};

// Multiplies textures into the factors they stand behind.
Bumps apply_textures(inout Material material, TextureCoordinates at) {
    uint left = TEXTURES ? BASE_COLOR_TEXTURE : 0u;
    if (METALLIC_ROUGHNESS_TEXTURES) left |= METALLIC_ROUGHNESS_TEXTURE;
    if (NORMAL_MAPS) left |= NORMAL_TEXTURE;
    if (EMISSION_TEXTURES) left |= EMISSION_TEXTURE;
    if (TRANSMISSION_TEXTURES) left |= TRANSMISSION_TEXTURE;
    if (SPECULAR_TEXTURES) left |= SPECULAR_TEXTURE | SPECULAR_COLOR_TEXTURE;
    if (CLEARCOAT_TEXTURES) left |= CLEARCOAT_TEXTURE | CLEARCOAT_ROUGHNESS_TEXTURE;
    if (NORMAL_MAPS && CLEARCOAT) left |= CLEARCOAT_NORMAL_TEXTURE;
    Bumps bumps = Bumps(vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0));
    while (left != 0u) {
        uint which = left & -left;
        left ^= which;
        uint index = which == BASE_COLOR_TEXTURE ? material.base_color_texture
            : which == METALLIC_ROUGHNESS_TEXTURE ? material.metallic_roughness_texture
            : which == NORMAL_TEXTURE ? material.normal_texture
            : which == EMISSION_TEXTURE ? material.emission_texture
            : which == TRANSMISSION_TEXTURE ? material.transmission_texture
            : which == SPECULAR_TEXTURE ? material.specular_texture
            : which == SPECULAR_COLOR_TEXTURE ? material.specular_color_texture
            : which == CLEARCOAT_TEXTURE ? material.clearcoat_texture
            : which == CLEARCOAT_ROUGHNESS_TEXTURE ? material.clearcoat_roughness_texture
                                                   : material.clearcoat_normal_texture;
        if (index == NO_TEXTURE) continue;
        vec4 v = sample_texture(index, at);
        if (which == BASE_COLOR_TEXTURE) {
            material.base_color *= v.rgb;
            material.alpha *= v.a;
        } else if (which == METALLIC_ROUGHNESS_TEXTURE) {
            material.roughness *= v.g;
            material.metallic *= v.b;
        } else if (which == NORMAL_TEXTURE) {
            bumps.base = 2.0 * v.xyz - 1.0;
        } else if (which == EMISSION_TEXTURE) {
            material.emission *= v.rgb;
        } else if (which == TRANSMISSION_TEXTURE) {
            material.transmission *= v.r;
        } else if (which == SPECULAR_TEXTURE) {
            material.specular *= v.a;
        } else if (which == SPECULAR_COLOR_TEXTURE) {
            material.specular_color *= v.rgb;
        } else if (which == CLEARCOAT_TEXTURE) {
            material.clearcoat *= v.r;
        } else if (which == CLEARCOAT_ROUGHNESS_TEXTURE) {
            material.clearcoat_roughness *= v.g;
        } else {
            bumps.clearcoat = 2.0 * v.xyz - 1.0;
        }
    }
    return bumps;
}

// A shading normal bent by a map, on the side of the geometric normal. `tangent` has the sign of the bitangent in w;
// without one nothing changes.
vec3 mapped_normal(uint map, vec3 v, float scale, vec3 normal, vec4 tangent, vec3 geometric_normal) {
    vec3 t = tangent.xyz - dot(tangent.xyz, normal) * normal;
    float length2 = dot(t, t);
    if (map == NO_TEXTURE || length2 == 0.0) return normal;
    t *= inversesqrt(length2);
    vec3 b = (tangent.w < 0.0 ? -1.0 : 1.0) * cross(normal, t);
    vec3 n = scale * (v.x * t + v.y * b) + v.z * normal;
    float lift = 1e-3 * length(n) - dot(n, geometric_normal);
    if (lift > 0.0) n += lift * geometric_normal;
    length2 = dot(n, n);
    return length2 > 0.0 ? n * inversesqrt(length2) : normal;
}

vec3 weights(vec2 barycentrics) {
    return vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics);
}

// Whether an alpha-masked triangle has a hole there. Called by the traversal.
bool alpha_hole(uint instance, uint primitive, vec2 barycentrics) {
    Triangle triangle = TriangleArray(scene.triangles)[InstanceArray(scene.instances)[instance].at.first_triangle + primitive].at;
    Material material = MaterialArray(scene.materials)[triangle.material & ~TRIANGLE_MIRRORED].at;
    if ((material.flags & MATERIAL_ALPHA_MASK) == 0u) return false;
    vec3 w = weights(barycentrics);
    return base_color(material, triangle.vertices, w, texture_coordinates(triangle.vertices, w)).a < material.alpha_cutoff;
}

// A point on a triangle in the world, and the unit normal of its front.
void point_on(Instance instance, bool merged, Triangle triangle, vec3 w, out vec3 position, out vec3 normal) {
    Vec3Array positions = Vec3Array(scene.positions);
    uvec3 v = triangle.vertices;
    vec3 a = positions[v.x].at, b = positions[v.y].at, c = positions[v.z].at;
    if (!merged) {
        a = instance.object_to_world * vec4(a, 1.0);
        b = instance.object_to_world * vec4(b, 1.0);
        c = instance.object_to_world * vec4(c, 1.0);
    }
    // Relative to one corner: differences stay exact far from the origin.
    position = a + (w.y * (b - a) + w.z * (c - a));
    float winding = (triangle.material & TRIANGLE_MIRRORED) != 0u ? -1.0 : instance.orientation;
    vec3 across = cross(b - a, c - a);
    // A sliver's square may underflow, or its cross product round to nothing.
    float largest = max(abs(across.x), max(abs(across.y), abs(across.z)));
    normal = largest > 0.0 ? winding * normalize(across / largest) : vec3(0.0, 0.0, 1.0);
}

// An interpolated normal, or one of a vertex, in the world.
vec3 placed_normal(Instance instance, bool merged, vec3 n) {
    if (merged) return n;
    // The cofactor matrix carries normals whatever the scaling.
    mat3 m = mat3(instance.object_to_world);
    return instance.orientation * (cross(m[1], m[2]) * n.x + cross(m[2], m[0]) * n.y + cross(m[0], m[1]) * n.z);
}

// Facets stand for what their vertices' normals bend (Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021):
// light is above or below it by the interpolated normal, and rays whose directions lie below the facet but above it start
// where the vertices' tangent planes are on average, over the point. All other rays start at the facet: that height, up to
// twice the curved surface's, would let light beneath what stands on it. Surfaces that transmit have no such side.
void curve(inout Surface s, Instance instance, bool merged, uvec3 v, vec3 w) {
    if (s.material.transmission > 0.0 && s.material.metallic < 1.0) return;
    vec3 g = s.geometric_normal;
    Vec3Array positions = Vec3Array(scene.positions), normals = Vec3Array(scene.normals);
    vec3 n = placed_normal(instance, merged, w.x * normals[v.x].at + w.y * normals[v.y].at + w.z * normals[v.z].at);
    float side = dot(n, g) < 0.0 ? -1.0 : 1.0;
    bool bent = false;
    vec2 lifts = vec2(0.0);
    for (uint i = 0u; i < 3u; ++i) {
        vec3 corner = positions[v[i]].at;
        vec3 normal = placed_normal(instance, merged, normals[v[i]].at);
        float length2 = dot(normal, normal);
        if (length2 == 0.0) continue;
        normal *= side * inversesqrt(length2);
        // A thousandth: what rounding and quantisation leave of a facet's own normal.
        vec3 off = normal - g;
        if (dot(off, off) < 1e-6) continue;
        bent = true;
        if (!merged) corner = instance.object_to_world * vec4(corner, 1.0);
        float height = w[i] * dot(corner - s.position, normal) * dot(normal, g);
        lifts += vec2(max(height, 0.0), max(-height, 0.0));
    }
    if (!bent) return;
    s.side_normal = s.normal;
    s.lifts = lifts;
}

Surface surface_at(Hit hit) {
    bool merged = true;
    if (INSTANCED) merged = hit.instance == 0u;
    Instance instance = InstanceArray(scene.instances)[INSTANCED ? hit.instance : 0u].at;
    Triangle triangle = TriangleArray(scene.triangles)[instance.first_triangle + hit.primitive].at;
    uvec3 v = triangle.vertices;
    vec3 w = weights(hit.barycentrics);
    Surface surface;
    point_on(instance, merged, triangle, w, surface.position, surface.geometric_normal);

    surface.normal = surface.geometric_normal;
    if (SMOOTH_NORMALS && scene.normals != 0UL) {
        Vec3Array normals = Vec3Array(scene.normals);
        vec3 n = w.x * normals[v.x].at + w.y * normals[v.y].at + w.z * normals[v.z].at;
        if (INSTANCED) n = placed_normal(instance, merged, n);
        float length2 = dot(n, n);
        if (length2 > 0.0) {
            n *= inversesqrt(length2);
            surface.normal = dot(n, surface.geometric_normal) < 0.0 ? -n : n;
        }
    }
    surface.material = MaterialArray(scene.materials)[triangle.material & ~TRIANGLE_MIRRORED].at;
    TextureCoordinates at = texture_coordinates(v, w);
    vec4 color = plain_color(surface.material, v, w);
    surface.material.base_color = color.rgb;
    surface.material.alpha = color.a;
    Bumps bumps = apply_textures(surface.material, at);
    surface.side_normal = surface.geometric_normal;
    surface.lifts = vec2(0.0);
    if (CURVED && scene.normals != 0UL) curve(surface, instance, merged, v, w);
    surface.clearcoat_normal = surface.normal;
    if (NORMAL_MAPS && scene.tangents != 0UL) {
        Vec4Array tangents = Vec4Array(scene.tangents);
        uint corner = 3u * (instance.first_triangle + hit.primitive);
        vec4 t = w.x * tangents[corner].at + w.y * tangents[corner + 1u].at + w.z * tangents[corner + 2u].at;
        if (INSTANCED && hit.instance != 0u) {
            t = vec4(mat3(instance.object_to_world) * t.xyz, instance.orientation * t.w);
        }
        Material material = surface.material;
        vec3 normal = surface.normal, geometric_normal = surface.geometric_normal;
        surface.normal =
            mapped_normal(material.normal_texture, bumps.base, material.normal_scale, normal, t, geometric_normal);
        if (CLEARCOAT) {
            surface.clearcoat_normal = mapped_normal(material.clearcoat_normal_texture, bumps.clearcoat,
                                                     material.clearcoat_normal_scale, normal, t, geometric_normal);
        }
    }
    return surface;
}

// Turns all normals to the side of `to_viewer`; returns whether that is the front.
bool face(inout Surface surface, vec3 to_viewer) {
    bool front = dot(surface.geometric_normal, to_viewer) >= 0.0;
    if (!front) {
        surface.geometric_normal = -surface.geometric_normal;
        surface.normal = -surface.normal;
        surface.clearcoat_normal = -surface.clearcoat_normal;
        surface.side_normal = -surface.side_normal;
        surface.lifts = surface.lifts.yx;
    }
    return front;
}

// Whether light from `direction`, of any length, meets the surface that the facet stands for over it.
bool lifted(float lift, vec3 geometric_normal, vec3 direction) {
    return CURVED && lift > 0.0 && dot(geometric_normal, direction) <= 0.0;
}

// Where a ray starts that leaves on the side that face() turned to, or arrives there the other way.
vec3 leave(Surface s, vec3 direction) {
    vec3 from = s.position;
    if (lifted(s.lifts.x, s.geometric_normal, direction)) from += s.lifts.x * s.geometric_normal;
    return offset_origin(from, s.geometric_normal);
}

// Share of light that meets the surface; the rest passes as if it were not there.
float coverage(Material material) {
    return ALPHA_BLEND && (material.flags & MATERIAL_ALPHA_BLEND) != 0u ? material.alpha : 1.0;
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
