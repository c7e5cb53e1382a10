// The texture bank: every texture of the scene, as a layer of one of a few array textures.
//
// Vulkan 1.3 alone cannot index sampled images dynamically, but it can choose a layer. Draws are grouped so that
// the arrays of nearly all look-ups are bound for the draw; where they are not, every array in use is sampled,
// since software devices execute both sides of a branch; there gradients are explicit, so that branches do no harm.
#ifndef BANK_GLSL
#define BANK_GLSL

layout(set = 0, binding = 2) uniform sampler2DArray bank[MAX_BANK_ARRAYS];

// The arrays of a draw: its own texture's, the first target's, and its nodes'.
layout(set = 2, binding = 0) uniform sampler2DArray own_texture;
layout(set = 2, binding = 1) uniform sampler2DArray first_texture;
layout(set = 2, binding = 2) uniform sampler2DArray node_texture;

// Whether textures are filtered anisotropically.
layout(constant_id = 6) const bool ANISOTROPIC = false;

// Texel of a layer of `array` for explicit gradients.
vec4 graded_texel(sampler2DArray array, vec3 at, vec2 dx, vec2 dy) {
    if (ANISOTROPIC) {
        // Beyond so many texels a pixel the last level alone is looked up, which is one texel: where does not matter. But
        // software devices visit every texel between the places of fragments that are shaded together, and those of rays
        // nearly parallel to what they meet are as far apart as numbers can be. A NaN is beyond, too.
        vec2 size = vec2(textureSize(array, 0).xy);
        vec2 whole = max(size.x, size.y) / size;
        if (!all(lessThanEqual(max(abs(dx), abs(dy)), float(ANISOTROPY) * whole))) {
            at.xy = vec2(0.5);
            dx = vec2(whole.x, 0.0);
            dy = vec2(0.0, whole.y);
        }
    }
    return textureGrad(array, at, dx, dy);
}

// Layer of `bound`, the array of `reference`, or white for NO_TEXTURE. Gradients are implicit, which is cheaper: to be
// called where all fragments of a primitive come, or none.
vec4 bound_texel(sampler2DArray bound, uint reference, vec2 uv) {
    vec3 at = vec3(uv, float((reference >> 8) & 0xffffu));
    vec4 texel;
    if (ANISOTROPIC) texel = graded_texel(bound, at, dFdx(uv), dFdy(uv));
    else texel = texture(bound, at);
    return reference == NO_TEXTURE ? vec4(1.0) : texel;
}

// Number of arrays in use: later ones are compiled out.
layout(constant_id = 0) const uint BANK_ARRAYS = MAX_BANK_ARRAYS;

// Texel of texture `reference` (array in the low byte, layer above), or white for NO_TEXTURE.
vec4 bank_texel(uint reference, vec2 uv, vec2 dx, vec2 dy) {
    if (reference == NO_TEXTURE) return vec4(1.0);
    vec3 at = vec3(uv, float(reference >> 8));
    uint array = reference & 0xffu;
    if (BANK_ARRAYS > 1u && array == 1u) return graded_texel(bank[1], at, dx, dy);
    if (BANK_ARRAYS > 2u && array == 2u) return graded_texel(bank[2], at, dx, dy);
    if (BANK_ARRAYS > 3u && array == 3u) return graded_texel(bank[3], at, dx, dy);
    if (BANK_ARRAYS > 4u && array == 4u) return graded_texel(bank[4], at, dx, dy);
    if (BANK_ARRAYS > 5u && array == 5u) return graded_texel(bank[5], at, dx, dy);
    if (BANK_ARRAYS > 6u && array == 6u) return graded_texel(bank[6], at, dx, dy);
    if (BANK_ARRAYS > 7u && array == 7u) return graded_texel(bank[7], at, dx, dy);
    if (BANK_ARRAYS > 8u && array == 8u) return graded_texel(bank[8], at, dx, dy);
    if (BANK_ARRAYS > 9u && array == 9u) return graded_texel(bank[9], at, dx, dy);
    if (BANK_ARRAYS > 10u && array == 10u) return graded_texel(bank[10], at, dx, dy);
    if (BANK_ARRAYS > 11u && array == 11u) return graded_texel(bank[11], at, dx, dy);
    return graded_texel(bank[0], at, dx, dy);
}

#endif
