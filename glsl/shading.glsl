// Light and optics: the shader's side of trace/shade.rs and trace/optics.rs, term by term.
#ifndef SHADING_GLSL
#define SHADING_GLSL

#include "frame.glsl"
#include "material.glsl"

// Lights of the scene: loops unroll.
layout(constant_id = 5) const uint LIGHTS = MAX_LIGHTS;

const float PI = 3.14159265358979;

struct Incident { vec3 to_light; vec3 irradiance; };

Incident incident(Light light, vec3 point) {
    if (HAS_DIRECTIONAL_LIGHTS && light.kind == LIGHT_DIRECTIONAL) return Incident(-light.direction, light.intensity);
    vec3 to = light.position - point;
    float squared = dot(to, to);
    float inverse = squared > 0.0 ? inversesqrt(squared) : 0.0;
    float falloff = inverse * inverse;
    vec3 to_light = to * inverse;
    if (HAS_LIGHT_RANGES) {
        float ratio = squared / (light.range * light.range);
        falloff *= clamp(1.0 - ratio * ratio, 0.0, 1.0);
    }
    if (HAS_SPOT_LIGHTS && light.kind == LIGHT_SPOT) {
        float cone = clamp((-dot(to_light, light.direction) - light.outer_cos) * light.cone_scale, 0.0, 1.0);
        falloff *= cone * cone;
    }
    return Incident(to_light, light.intensity * falloff);
}

// Share of light `i` that is not hidden, from a byte of bits a corner and the corners' weights.
float light_share(uint masks, uint i, vec3 weights) {
    uvec3 seen = uvec3(masks >> i, masks >> (i + 8u), masks >> (i + 16u)) & 1u;
    return dot(weights, vec3(seen));
}

// Radiance without mirror images towards a viewer who looks along `direction`, under the lights that `masks`
// and `weights` show: design §2, "Local component".
vec3 local_radiance(Material m, vec3 position, vec3 n, vec3 direction, uint masks, vec3 weights) {
    vec3 base = m.base * m.base_texel;
    if ((m.flags & MATERIAL_UNLIT) != 0u) return base;
    float diffuse = (1.0 - m.metallic) * (1.0 - m.transmission);
    bool highlights = HAS_HIGHLIGHTS && m.roughness > 0.0;
    vec3 scattered = base * (diffuse / PI);
    vec3 k_s = vec3(0.0);
    float exponent = 0.0;
    if (highlights) {
        float r2 = m.roughness * m.roughness;
        exponent = clamp(2.0 / (r2 * r2) - 2.0, 0.0, MAX_PHONG_EXPONENT);
        k_s = mix(m.specular, base, m.metallic) * ((exponent + 2.0) / (2.0 * PI));
    }
    float scattering = (m.flags & MATERIAL_SPECULAR) != 0u ? diffuse : 1.0;
    vec3 radiance = m.emission + base * (frame.ambient * scattering);
    for (uint i = 0u; i < LIGHTS; ++i) {
        Incident light = incident(frame.lights[i], position);
        float cosine = max(dot(light.to_light, n), 0.0);
        vec3 response = scattered;
        if (highlights) {
            vec3 mirrored = n * (2.0 * cosine) - light.to_light;
            // 0 to the 0 is 1 in the tracer, and undefined here.
            float lobe = exponent > 0.0 ? pow(max(-dot(mirrored, direction), 0.0), exponent) : 1.0;
            response += k_s * lobe;
        }
        radiance += light.irradiance * (cosine * light_share(masks, i, weights)) * response;
    }
    return radiance;
}

// `d` mirrored at `n`, lifted above the facet with normal `ng` (design §2).
vec3 lifted_reflection(vec3 d, vec3 n, vec3 ng) {
    vec3 r = d - n * (2.0 * dot(d, n));
    float above = dot(r, ng);
    return above < REFLECTION_LIFT ? normalize(r + ng * (REFLECTION_LIFT - above)) : r;
}

// Fresnel's reflectance; `refracted` is zero in total internal reflection.
float dielectric(vec3 d, vec3 n, float eta, out vec3 refracted) {
    float cos_in = clamp(-dot(d, n), 0.0, 1.0);
    float sin_out_squared = eta * eta * (1.0 - cos_in * cos_in);
    if (sin_out_squared >= 1.0) {
        refracted = vec3(0.0);
        return 1.0;
    }
    float cos_out = sqrt(1.0 - sin_out_squared);
    float s = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    float p = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    refracted = normalize(d * eta + n * (eta * cos_in - cos_out));
    return clamp(0.5 * (s * s + p * p), 0.0, 1.0);
}

struct Branches { vec3 reflected; vec3 refracted; vec3 attenuation[2]; };

// Directions and attenuations α_r, α_t at the primary surface, with n and ng on the viewer's side.
Branches branches_at(Material m, vec3 n, vec3 ng, vec3 d, bool outside) {
    Branches b;
    vec3 base = m.base * m.base_texel;
    float glass = (1.0 - m.metallic) * m.transmission;
    vec3 reflectance = base * m.metallic;
    if ((m.flags & MATERIAL_SCHLICK) != 0u) {
        vec3 f0 = mix(m.specular, base, m.metallic);
        float c = clamp(1.0 + dot(d, n), 0.0, 1.0);
        reflectance = (f0 + (1.0 - f0) * (c * c * c * c * c)) * (1.0 - glass);
    }
    b.reflected = lifted_reflection(d, n, ng);
    b.refracted = d;
    b.attenuation[1] = vec3(0.0);
    if (HAS_TRANSMISSION && glass > 0.0) {
        bool solid = (m.flags & MATERIAL_SOLID) != 0u;
        float eta = solid && !outside ? m.ior : 1.0 / m.ior;
        vec3 bent;
        float interface_reflectance = dielectric(d, n, eta, bent);
        float r = solid ? interface_reflectance : 2.0 * interface_reflectance / (1.0 + interface_reflectance);
        if (solid) b.refracted = bent;
        reflectance += vec3(glass * r);
        b.attenuation[1] = base * (glass * (1.0 - r));
    }
    b.attenuation[0] = reflectance;
    return b;
}

#endif
