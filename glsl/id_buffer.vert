#version 460
#extension GL_GOOGLE_include_directive : require
// ID buffer (design §3). The ID goes through a flat varying: gl_PrimitiveID costs far more on lavapipe.
#include "face_fetch.glsl"

layout(location = 0) flat out vec4 id;

void main() {
    uint entry = draw_entry();
    id = id_color(entry);
    gl_Position = clip_position(draw_vertex(entry));
}
