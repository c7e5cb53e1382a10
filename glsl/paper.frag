#version 460
// Eq. 3 and Eq. 4 of the paper from interpolated coordinates and colours (§4.1, §4.2).
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
// The textures bound for a draw: the leaves' primary one, then that of the reflected and the transmitted branch,
// each with its own sampler.
#include "bank.glsl"
#include "features.glsl"

// LEAVES_PLAIN: no specular part.
layout(constant_id = 2) const uint LEAVES = LEAVES_NODES;
// Components that this pass adds up: all in one pass, or one group a pass.
layout(constant_id = 3) const uint COMPONENTS = 31;
layout(constant_id = 4) const bool EQUATION_FOUR = false;

layout(location = 0) centroid in vec4 base;
layout(location = 1) centroid in vec3 primary_textured;
layout(location = 2) centroid in vec3 primary_added;
layout(location = 3) centroid in vec3 attenuation[2];
layout(location = 5) centroid in vec3 shade[2];
layout(location = 7) centroid in vec3 comb[2];
layout(location = 9) centroid in vec4 branch_uv;
layout(location = 10) flat in uvec3 textures;

layout(location = 0) out vec4 radiance;

void main() {
    vec4 texel = vec4(1.0);
    if (HAS_BASE_TEXTURES) texel = bound_texel(own_texture, textures.x, base.xy);

    vec3 sum = vec3(0.0);
    if ((COMPONENTS & COMPONENT_PRIMARY) != 0u) sum += primary_textured * texel.rgb + primary_added;
    if (LEAVES != LEAVES_PLAIN) {
        for (uint b = 0u; b < 2u; ++b) {
            bool has_textured = (COMPONENTS & (COMPONENT_REFLECTED << b)) != 0u;
            bool has_comb = (COMPONENTS & (COMPONENT_REFLECTED_COMB << b)) != 0u;
            if (!has_textured && !has_comb) continue;
            vec3 branch_texel = vec3(1.0);
            if (HAS_BASE_TEXTURES && (has_textured || EQUATION_FOUR)) {
                branch_texel = b == 0u
                    ? bound_texel(first_texture, textures.y, branch_uv.xy).rgb
                    : bound_texel(node_texture, textures.z, branch_uv.zw).rgb;
            }
            vec3 branch_sum = vec3(0.0);
            if (has_textured) branch_sum += shade[b] * branch_texel;
            if (has_comb) branch_sum += EQUATION_FOUR ? comb[b] * branch_texel : comb[b];
            sum += attenuation[b] * branch_sum;
        }
    }
    // At the end: gradients need their neighbours.
    if (HAS_ALPHA_TEST && base.z * texel.a < base.w) discard;
    radiance = vec4(clamp(sum, vec3(-MAX_RADIANCE), vec3(MAX_RADIANCE)), 1.0);
}
