// Material values at a point: the shader's side of the tracer's `Appearance`.
#ifndef MATERIAL_GLSL
#define MATERIAL_GLSL

#include "bank.glsl"
#include "frame.glsl"

// Whether any material has a texture other than base colour and emission, or a normal map.
layout(constant_id = 1) const bool HAS_DETAIL_TEXTURES = true;

struct Material {
    vec3 base;          // factor × vertex colour, without the texture
    vec3 base_texel;
    float alpha;
    vec3 emission;
    float metallic;
    float roughness;
    float transmission;
    vec3 specular;      // reflectance of the dielectric part at normal incidence
    float ior;
    uint flags;
};

// Coordinates of both sets with their screen-space gradients.
struct Coordinates {
    vec2 uv[2];
    vec2 dx[2];
    vec2 dy[2];
};

struct Slot { uint reference; vec2 uv; vec2 dx; vec2 dy; };

Slot material_slot(uint material, uint index, uint reference, Coordinates at) {
    if (reference == NO_TEXTURE) return Slot(NO_TEXTURE, vec2(0.0), vec2(0.0), vec2(0.0));
    vec4 u = scene_floats(material + MATERIAL_SLOTS + 2u * index);
    vec4 v = scene_floats(material + MATERIAL_SLOTS + 2u * index + 1u);
    uint set = floatBitsToUint(u.w);
    mat2 linear = mat2(u.x, v.x, u.y, v.y);
    return Slot(reference, linear * at.uv[set] + vec2(u.z, v.z), linear * at.dx[set], linear * at.dy[set]);
}

vec4 slot_texel(Slot slot) { return bank_texel(slot.reference, slot.uv, slot.dx, slot.dy); }

// Values with the texels of base colour and emission given: a target's come from its patch's maps.
Material material_with(uint material, vec4 color, vec4 base_texel, vec3 emission_texel) {
    vec4 base = scene_floats(material) * color;
    vec4 emission_ior = scene_floats(material + 1u);
    vec4 scalars = scene_floats(material + 2u);
    vec4 specular_color = scene_floats(material + 3u);
    Material m;
    m.base = base.rgb;
    m.base_texel = base_texel.rgb;
    m.alpha = base.a * base_texel.a;
    m.emission = emission_ior.rgb * emission_texel;
    m.ior = emission_ior.w;
    m.metallic = scalars.x;
    m.roughness = scalars.y;
    m.transmission = scalars.w;
    float f0 = (m.ior - 1.0) / (m.ior + 1.0);
    m.specular = specular_color.rgb * (scalars.z * f0 * f0);
    m.flags = scene_words(material + 5u).w;
    return m;
}

Material material_at(uint material, vec4 color, Coordinates at) {
    uvec4 first = scene_words(material + 4u);
    vec4 base_texel = slot_texel(material_slot(material, 0u, first.x, at));
    vec3 emission_texel = slot_texel(material_slot(material, 1u, first.y, at)).rgb;
    Material m = material_with(material, color, base_texel, emission_texel);
    if (HAS_DETAIL_TEXTURES) {
        uvec4 second = scene_words(material + 5u);
        vec4 metallic_roughness = slot_texel(material_slot(material, 2u, first.z, at));
        m.metallic *= metallic_roughness.b;
        m.roughness *= metallic_roughness.g;
        m.specular *= slot_texel(material_slot(material, 4u, second.x, at)).a
            * slot_texel(material_slot(material, 5u, second.y, at)).rgb;
        m.transmission *= slot_texel(material_slot(material, 6u, second.z, at)).r;
    }
    return m;
}

// The shading normal bent by a normal map; unchanged without one.
vec3 mapped_normal(uint material, vec3 n, vec4 tangent, Coordinates at) {
    if (!HAS_DETAIL_TEXTURES) return n;
    Slot slot = material_slot(material, 3u, scene_words(material + 4u).w, at);
    if (slot.reference == NO_TEXTURE) return n;
    vec3 along = tangent.xyz - n * dot(n, tangent.xyz);
    if (dot(along, along) <= 0.0) return n;
    vec3 t = normalize(along);
    vec3 b = cross(n, t) * (tangent.w < 0.0 ? -1.0 : 1.0);
    vec3 texel = slot_texel(slot).xyz * 2.0 - 1.0;
    float scale = scene_floats(material + 3u).w;
    return normalize(mat3(t, b, n) * (texel * vec3(scale, scale, 1.0)));
}

#endif
