// The texture bank: every texture of the scene, as a layer of one of a few array textures.
//
// Vulkan 1.3 alone cannot index sampled images dynamically, but it can choose a layer; the array is chosen by
// a branch that is uniform over a leaf. Gradients are explicit, so that the branch does no harm.
#ifndef BANK_GLSL
#define BANK_GLSL

layout(set = 0, binding = 2) uniform sampler2DArray bank_0;
layout(set = 0, binding = 3) uniform sampler2DArray bank_1;
layout(set = 0, binding = 4) uniform sampler2DArray bank_2;
layout(set = 0, binding = 5) uniform sampler2DArray bank_3;
layout(set = 0, binding = 6) uniform sampler2DArray bank_4;
layout(set = 0, binding = 7) uniform sampler2DArray bank_5;
layout(set = 0, binding = 8) uniform sampler2DArray bank_6;
layout(set = 0, binding = 9) uniform sampler2DArray bank_7;

// Number of arrays in use: later ones are compiled out.
layout(constant_id = 0) const uint BANK_ARRAYS = 8;

// Texel of texture `reference` (array in the low byte, layer above), or white for NO_TEXTURE.
vec4 bank_texel(uint reference, vec2 uv, vec2 dx, vec2 dy) {
    if (reference == NO_TEXTURE) return vec4(1.0);
    vec3 at = vec3(uv, float(reference >> 8));
    uint array = reference & 0xffu;
    if (BANK_ARRAYS > 1u && array == 1u) return textureGrad(bank_1, at, dx, dy);
    if (BANK_ARRAYS > 2u && array == 2u) return textureGrad(bank_2, at, dx, dy);
    if (BANK_ARRAYS > 3u && array == 3u) return textureGrad(bank_3, at, dx, dy);
    if (BANK_ARRAYS > 4u && array == 4u) return textureGrad(bank_4, at, dx, dy);
    if (BANK_ARRAYS > 5u && array == 5u) return textureGrad(bank_5, at, dx, dy);
    if (BANK_ARRAYS > 6u && array == 6u) return textureGrad(bank_6, at, dx, dy);
    if (BANK_ARRAYS > 7u && array == 7u) return textureGrad(bank_7, at, dx, dy);
    return textureGrad(bank_0, at, dx, dy);
}

#endif
