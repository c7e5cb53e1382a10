#version 460
#extension GL_GOOGLE_include_directive : require
// ID buffer of faces with glTF's alpha mode MASK.
#include "face_fetch.glsl"

struct MaskVertex {
    vec2 uv;     // of the base-colour texture, transformed
    float alpha; // base-colour factor times vertex colour
};
layout(scalar, set = 0, binding = 3) readonly buffer MaskVertices { MaskVertex mask_vertices[]; };

layout(location = 0) flat out vec4 id;
layout(location = 1) out vec3 uv_alpha;

void main() {
    uint entry = draw_entry();
    uint vertex = draw_vertex(entry);
    id = id_color(entry);
    uv_alpha = vec3(mask_vertices[vertex].uv, mask_vertices[vertex].alpha);
    gl_Position = clip_position(vertex);
}
