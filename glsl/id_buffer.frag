#version 460
// ID buffer (design §3).
layout(location = 0) flat in vec4 id;
layout(location = 0) out vec4 color;

void main() { color = id; }
