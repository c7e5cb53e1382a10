#version 460
// One corner of a leaf in the paper's own reconstruction (paper §4): coordinates and colours of the vertex, which
// the rasteriser interpolates.
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "leaf_order.glsl"

// Pairs hold the reflected and the transmitted branch.
struct PaperVertex {
    vec3 position;
    vec2 uv;                // of the primary texture
    float alpha;            // without the texture
    vec3 primary_textured;  // C_prim: what CT_prim multiplies
    vec3 primary_added;     // and what it does not
    vec3 attenuation[2];    // α_r, α_t
    vec3 textured[2];       // C_refl, C_trans
    vec3 texel[2];          // of the texture met there
    vec3 comb[2];           // C_r,comb, C_t,comb
    vec2 branch_uv[2];      // of CT_refl, CT_trans
};

struct PaperLeaf {
    uint vertices[3];
    uint textures[3];       // primary, reflected, transmitted; NO_TEXTURE on undefined faces
    float cutoff;           // alpha below it is discarded
};

// Eq. 4 multiplies the combined colour by the texture too; here, by the texels of undefined faces.
layout(constant_id = 4) const bool EQUATION_FOUR = false;

layout(set = 1, binding = 0, scalar) readonly buffer Vertices { PaperVertex vertices[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Leaves { PaperLeaf leaves[]; };

layout(location = 0) centroid out vec4 base;            // primary coordinates, alpha, cutoff
layout(location = 1) centroid out vec3 primary_textured;
layout(location = 2) centroid out vec3 primary_added;
layout(location = 3) centroid out vec3 attenuation[2];
layout(location = 5) centroid out vec3 shade[2];
layout(location = 7) centroid out vec3 comb[2];
layout(location = 9) centroid out vec4 branch_uv;
layout(location = 10) flat out uvec3 textures;

invariant gl_Position;

void main() {
    PaperLeaf leaf = leaves[leaf_index()];
    PaperVertex vertex = vertices[leaf.vertices[gl_VertexIndex % 3]];
    base = vec4(vertex.uv, vertex.alpha, leaf.cutoff);
    primary_textured = vertex.primary_textured;
    primary_added = vertex.primary_added;
    branch_uv = vec4(vertex.branch_uv[0], vertex.branch_uv[1]);
    textures = uvec3(leaf.textures[0], leaf.textures[1], leaf.textures[2]);
    for (uint b = 0u; b < 2u; ++b) {
        // An undefined face takes the texel at the vertex into the interpolated colour (Fig. 6).
        vec3 texel = leaf.textures[1u + b] == NO_TEXTURE ? vertex.texel[b] : vec3(1.0);
        attenuation[b] = vertex.attenuation[b];
        shade[b] = vertex.textured[b] * texel;
        comb[b] = EQUATION_FOUR ? vertex.comb[b] * texel : vertex.comb[b];
    }
    gl_Position = frame.clip_from_eye_relative * vec4(vertex.position - frame.eye, 1.0);
}
