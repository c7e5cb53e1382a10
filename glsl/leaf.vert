#version 460
// One corner of a leaf: three invocations read a leaf record and what it names.
//
// Everything that is the same over a leaf is read here and handed on flat: reading tables per fragment costs
// several times more on software devices.
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "features.glsl"
#include "frame.glsl"
#include "leaf.glsl"
#include "leaf_order.glsl"
#include "material_constants.glsl"
#include "vertex_fetch.glsl"

layout(set = 1, binding = 1, scalar) readonly buffer Leaves { Leaf leaves[]; };
layout(set = 1, binding = 2) uniform usamplerBuffer node_table;

layout(location = 0) out vec3 position;
layout(location = 1) out vec3 normal;
layout(location = 2) out vec4 slot_uv;     // base colour, emission
layout(location = 3) out vec3 weights;
layout(location = 4) out vec4 color;
layout(location = 5) out vec3 comb_reflected;
layout(location = 6) out vec3 comb_transmitted;
layout(location = 7) out vec4 uv;          // both sets
layout(location = 8) out vec4 tangent;
layout(location = 9) flat out uvec4 header;         // material, lit, nodes, flags
layout(location = 10) flat out uvec4 references;    // base colour, emission, first patch's base colour, its lights
layout(location = 11) flat out vec3 facet;
layout(location = 12) flat out vec4 own[4];
layout(location = 16) flat out vec4 first[7];
layout(location = 23) centroid out vec2 covered;    // the first two weights again

invariant gl_Position;

vec2 slot_coordinates(uint material, uint slot, vec4 sets) {
    vec4 u = scene_floats(material + MATERIAL_SLOTS + 2u * slot);
    vec4 v = scene_floats(material + MATERIAL_SLOTS + 2u * slot + 1u);
    vec3 at = vec3(floatBitsToUint(u.w) == 0u ? sets.xy : sets.zw, 1.0);
    return vec2(dot(u.xyz, at), dot(v.xyz, at));
}

// As in exact.frag, which reads no more of the outputs than are written here.
layout(constant_id = 2) const uint LEAVES = LEAVES_ALL;

void main() {
    Leaf leaf = leaves[leaf_index()];
    uint corner = gl_VertexIndex % 3;
    uint vertex_index = leaf.vertices[corner];
    if (LEAVES == LEAVES_TRACED || LEAVES == LEAVES_PICTURE) {
        position = vertex_position(vertex_index);
        gl_Position = frame.clip_from_eye_relative * vec4(position - frame.eye, 1.0);
        header = uvec4(leaf.nodes);
        return;
    }
    Vertex vertex = fetch_vertex(vertex_index);
    gl_Position = frame.clip_from_eye_relative * vec4(vertex.position - frame.eye, 1.0);
    position = vertex.position;
    normal = vertex.normal;
    slot_uv =
        vec4(slot_coordinates(leaf.material, 0u, vertex.uv), slot_coordinates(leaf.material, 1u, vertex.uv));
    weights = vec3(corner == 0u, corner == 1u, corner == 2u);
    covered = weights.xy;
    if (HAS_VERTEX_COLORS) color = vertex.color;
    if ((FEATURES & FEATURE_DETAIL_TEXTURES) != 0u) uv = vertex.uv;
    if (HAS_NORMAL_TEXTURES) tangent = vertex.tangent;
    // What is Gouraud-shaded of reflection and transmission, before α: a texel a corner and branch.
    uint rest = leaf.nodes;
    vec3 comb[2] = vec3[2](vec3(0.0), vec3(0.0));
    if ((leaf.flags & LEAF_COMBINED) != 0u) {
        comb[0] = uintBitsToFloat(texelFetch(node_table, int(rest + 2u * corner)).xyz);
        comb[1] = uintBitsToFloat(texelFetch(node_table, int(rest + 2u * corner + 1u)).xyz);
        rest += COMBINED_TEXELS;
    }

    header = uvec4(leaf.material, leaf.lit, rest, leaf.flags);
    uvec4 textures = scene_words(leaf.material + 4u);
    references = uvec4(textures.x, textures.y, NO_FIRST, leaf.first_lit);
    vec3 a = vertex_position(leaf.vertices[0]);
    facet = cross(vertex_position(leaf.vertices[1]) - a, vertex_position(leaf.vertices[2]) - a);
    material_constants(leaf.material, own);
    if (LEAVES == LEAVES_PLAIN) return;
    comb_reflected = comb[0];
    comb_transmitted = comb[1];
    if (leaf.first_target != NO_TARGET) {
        uint material = scene_words(leaf.first_target + 1u).x;
        vec4 constants[4];
        material_constants(material, constants);
        first[0] = scene_floats(leaf.first_target);
        first[1] = scene_floats(leaf.first_target + 2u);
        first[2] = scene_floats(leaf.first_target + 3u);
        references.z = scene_words(material + 4u).x;
        first[3] = constants[0];
        first[4] = constants[1];
        first[5] = constants[2];
        first[6] = constants[3];
    } else {
        for (uint i = 0u; i < 7u; ++i) first[i] = vec4(0.0);
    }
}
