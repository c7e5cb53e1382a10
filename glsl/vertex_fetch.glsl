// Reads vertices of leaves from a buffer of words, as reconstruct/vertex.rs packs them: what no part of the scene
// needs is not there.
#ifndef VERTEX_FETCH_GLSL
#define VERTEX_FETCH_GLSL

layout(constant_id = VERTEX_WORDS_ID) const uint VERTEX_WORDS = 14;
// Words from a vertex's start; 0, where its position is, for what is left out.
layout(constant_id = NORMAL_AT_ID) const uint NORMAL_AT = 3;
layout(constant_id = FIRST_UV_AT_ID) const uint FIRST_UV_AT = 6;
layout(constant_id = SECOND_UV_AT_ID) const uint SECOND_UV_AT = 8;
layout(constant_id = COLOR_AT_ID) const uint COLOR_AT = 10;
layout(constant_id = TANGENT_AT_ID) const uint TANGENT_AT = 12;

layout(set = 1, binding = 0, scalar) readonly buffer Vertices { uint vertices[]; };

struct Vertex {
    vec3 position;
    vec3 normal;        // interpolated linearly, not of unit length
    vec4 uv;            // both sets
    vec4 color;
    vec4 tangent;
};

vec2 vertex_pair(uint word) {
    return vec2(uintBitsToFloat(vertices[word]), uintBitsToFloat(vertices[word + 1u]));
}

vec3 vertex_triple(uint word) { return vec3(vertex_pair(word), uintBitsToFloat(vertices[word + 2u])); }

vec4 vertex_halves(uint word) {
    return vec4(unpackHalf2x16(vertices[word]), unpackHalf2x16(vertices[word + 1u]));
}

vec3 vertex_position(uint index) { return vertex_triple(index * VERTEX_WORDS); }

Vertex fetch_vertex(uint index) {
    uint start = index * VERTEX_WORDS;
    Vertex vertex = Vertex(vertex_triple(start), vec3(0.0, 0.0, 1.0), vec4(0.0), vec4(1.0), vec4(0.0));
    if (NORMAL_AT != 0u) vertex.normal = vertex_triple(start + NORMAL_AT);
    if (FIRST_UV_AT != 0u) vertex.uv.xy = vertex_pair(start + FIRST_UV_AT);
    if (SECOND_UV_AT != 0u) vertex.uv.zw = vertex_pair(start + SECOND_UV_AT);
    if (COLOR_AT != 0u) vertex.color = vertex_halves(start + COLOR_AT);
    if (TANGENT_AT != 0u) vertex.tangent = vertex_halves(start + TANGENT_AT);
    return vertex;
}

#endif
