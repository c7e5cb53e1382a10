// What every draw of a frame reads: the view, the lights, and the scene's tables.
#ifndef FRAME_GLSL
#define FRAME_GLSL

struct Light {
    vec3 position;      // of a point or spot light
    float range;        // distance at which the falloff window ends
    vec3 direction;     // unit, the way a directional or spot light travels
    uint kind;          // LIGHT_POINT, LIGHT_DIRECTIONAL or LIGHT_SPOT
    vec3 intensity;
    float outer_cos;
    float cone_scale;   // 1 / (inner_cos - outer_cos)
    uint pad[3];        // fills the last 16 bytes
};

layout(set = 0, binding = 0, scalar) uniform Frame {
    mat4 clip_from_eye_relative;
    vec3 eye;
    vec3 forward;
    uint orthographic;
    float ambient;
    Light lights[MAX_LIGHTS];
    uint width;
    uint height;
    uint halvings;      // of a pixel's side: it is 1 << halvings fragments across and high
} frame;

// Materials and targets, fixed for a scene. A texel buffer, not a storage buffer: what it holds feeds
// derivatives, and software devices compute those wrongly from storage buffers.
layout(set = 0, binding = 1) uniform usamplerBuffer scene_table;

vec4 scene_floats(uint index) { return uintBitsToFloat(texelFetch(scene_table, int(index))); }
uvec4 scene_words(uint index) { return texelFetch(scene_table, int(index)); }

// Unit direction of the view ray that arrives at a point.
vec3 view_direction(vec3 position) {
    return frame.orthographic != 0u ? frame.forward : normalize(position - frame.eye);
}

#endif
