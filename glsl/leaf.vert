#version 460
// One corner of a leaf: three invocations read a leaf record and the vertices that it names.
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "leaf.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Vertices { Vertex vertices[]; };
layout(set = 1, binding = 1, scalar) readonly buffer Leaves { Leaf leaves[]; };

layout(location = 0) centroid out vec3 position;
layout(location = 1) centroid out vec3 normal;
layout(location = 2) centroid out vec4 uv;
layout(location = 3) centroid out vec3 weights;
layout(location = 4) centroid out vec4 color;
layout(location = 5) centroid out vec4 tangent;
layout(location = 6) centroid out vec3 comb_reflected;
layout(location = 7) centroid out vec3 comb_transmitted;
layout(location = 8) flat out uvec4 header;
layout(location = 9) flat out vec3 facet;

invariant gl_Position;

void main() {
    Leaf leaf = leaves[gl_VertexIndex / 3];
    uint corner = gl_VertexIndex % 3;
    Vertex vertex = vertices[leaf.vertices[corner]];
    position = vertex.position;
    normal = vertex.normal;
    uv = vec4(vertex.uv[0], vertex.uv[1]);
    weights = vec3(corner == 0u, corner == 1u, corner == 2u);
    color = vec4(unpackHalf2x16(vertex.color[0]), unpackHalf2x16(vertex.color[1]));
    tangent = vec4(unpackHalf2x16(vertex.tangent[0]), unpackHalf2x16(vertex.tangent[1]));
    comb_reflected = leaf.comb[corner][0];
    comb_transmitted = leaf.comb[corner][1];
    header = uvec4(leaf.material, leaf.lit, leaf.nodes, leaf.flags);
    vec3 a = vertices[leaf.vertices[0]].position;
    facet = cross(vertices[leaf.vertices[1]].position - a, vertices[leaf.vertices[2]].position - a);
    gl_Position = frame.clip_from_eye_relative * vec4(vertex.position - frame.eye, 1.0);
}
