#version 460
// Positions only: the ID buffer knows faces, not materials.
layout(location = 0) in vec3 position;
layout(push_constant) uniform Push { mat4 clip_from_world; } push;
void main() { gl_Position = push.clip_from_world * vec4(position, 1.0); }
