#version 460
#extension GL_EXT_scalar_block_layout : require
// ID buffer of faces with glTF's alpha mode MASK: holes have no face.
layout(scalar, push_constant) uniform Push {
    mat4 clip_from_eye_relative;
    vec3 eye;
    float alpha_cutoff;
} push;
layout(set = 1, binding = 0) uniform sampler2DArray alpha_map;

layout(location = 0) flat in vec4 id;
layout(location = 1) in vec3 uv_alpha;
layout(location = 0) out vec4 color;

void main() {
    // Level 0, as rays see it.
    float alpha = uv_alpha.z * textureLod(alpha_map, vec3(uv_alpha.xy, 0.0), 0.0).r;
    if (alpha < push.alpha_cutoff) discard;
    color = id;
}
