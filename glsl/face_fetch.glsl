// Corners of the faces in a draw list, pulled by gl_VertexIndex: three vertices a face, no index buffer.
#extension GL_EXT_scalar_block_layout : require

layout(scalar, set = 0, binding = 0) readonly buffer Positions { vec3 positions[]; };
layout(scalar, set = 0, binding = 1) readonly buffer Faces { uvec3 faces[]; };
// Face in the low 24 bits, code in the high 8.
layout(scalar, set = 0, binding = 2) readonly buffer Entries { uint entries[]; };

layout(scalar, push_constant) uniform Push {
    mat4 clip_from_eye_relative;
    vec3 eye;
    float alpha_cutoff;
} push;

uint draw_entry() { return entries[gl_VertexIndex / 3]; }

uint draw_vertex(uint entry) { return faces[entry & 0xffffffu][gl_VertexIndex % 3]; }

// The subtraction comes first: a matrix that held the eye's position would round far from the origin.
vec4 clip_position(uint vertex) {
    return push.clip_from_eye_relative * vec4(positions[vertex] - push.eye, 1.0);
}

// What the ID buffer holds: face + 1 in the colour where the code is not CODE_NONE, the code in alpha.
vec4 id_color(uint entry) { return (entry >> 24) == CODE_NONE ? vec4(0.0) : unpackUnorm4x8(entry + 1u); }
