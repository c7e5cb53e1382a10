#version 460
// One triangle over the whole image: instance 0 as far away as can be, 1 as near.
void main() {
    vec2 corner = vec2(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, float(gl_InstanceIndex), 1.0);
}
