#version 460
// The panorama where nothing else is seen: one triangle over the whole image, as far away as can be.
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"

layout(location = 0) noperspective out vec3 direction;

void main() {
    vec2 corner = vec2(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0);
    // Relative to the eye, on the near plane.
    vec4 point = inverse(frame.clip_from_eye_relative) * vec4(corner, 1.0, 1.0);
    direction = frame.orthographic != 0u ? frame.forward : point.xyz / point.w;
    gl_Position = vec4(corner, 0.0, 1.0);
}
