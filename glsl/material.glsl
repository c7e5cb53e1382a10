// Material values at a point: the shader's side of the tracer's `Appearance`.
#ifndef MATERIAL_GLSL
#define MATERIAL_GLSL

#include "bank.glsl"
#include "features.glsl"
#include "frame.glsl"
#include "material_constants.glsl"


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

// A material from constants that were read before, with the texels of base colour and emission.
Material material_from(vec4 constants[4], vec4 color, vec4 base_texel, vec3 emission_texel) {
    vec4 base = HAS_VERTEX_COLORS ? constants[0] * color : constants[0];
    Material m;
    m.base = base.rgb;
    m.base_texel = base_texel.rgb;
    m.alpha = base.a * base_texel.a;
    m.emission = HAS_EMISSION ? constants[1].rgb * emission_texel : vec3(0.0);
    m.ior = constants[1].w;
    m.specular = constants[2].rgb;
    m.roughness = constants[2].w;
    m.metallic = constants[3].x;
    m.transmission = constants[3].y;
    m.flags = floatBitsToUint(constants[3].w);
    return m;
}

// Factors that textures other than base colour and emission put on a material.
void apply_detail_textures(inout Material m, uint material, Coordinates at) {
    uvec4 second = scene_words(material + 5u);
    if (HAS_METALLIC_ROUGHNESS_TEXTURES) {
        uint reference = scene_words(material + 4u).z;
        vec4 metallic_roughness = slot_texel(material_slot(material, 2u, reference, at));
        m.metallic *= metallic_roughness.b;
        m.roughness *= metallic_roughness.g;
    }
    if (HAS_SPECULAR_TEXTURES) m.specular *= slot_texel(material_slot(material, 4u, second.x, at)).a;
    if (HAS_SPECULAR_COLOR_TEXTURES) m.specular *= slot_texel(material_slot(material, 5u, second.y, at)).rgb;
    if (HAS_TRANSMISSION_TEXTURES) m.transmission *= slot_texel(material_slot(material, 6u, second.z, at)).r;
}

// The shading normal bent by a normal map; unchanged without one.
vec3 mapped_normal(uint material, vec3 n, vec4 tangent, Coordinates at) {
    Slot slot = material_slot(material, 3u, scene_words(material + 4u).w, at);
    if (slot.reference == NO_TEXTURE) return n;
    vec3 along = tangent.xyz - n * dot(n, tangent.xyz);
    if (dot(along, along) <= 0.0) return n;
    vec3 t = normalize(along);
    vec3 b = cross(n, t) * (tangent.w < 0.0 ? -1.0 : 1.0);
    vec3 texel = slot_texel(slot).xyz * 2.0 - 1.0;
    float scale = scene_floats(material + 3u).w;
    vec3 bent = mat3(t, b, n) * (texel * vec3(scale, scale, 1.0));
    // Without a length that a float holds, it has no direction.
    float squared = dot(bent, bent);
    return squared > 0.0 && squared <= MAX_FLOAT ? normalize(bent) : n;
}

#endif
