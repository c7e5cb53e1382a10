// The panorama at infinity.
#ifndef ENVIRONMENT_GLSL
#define ENVIRONMENT_GLSL

layout(set = 0, binding = 3) uniform sampler2DArray environment;

// Radiance from a unit direction: the panorama's centre is -z, up is +y. The seam of atan has no gradient, so that none is
// used.
vec3 environment_radiance(vec3 direction) {
    const float TURN = 6.28318530717959;
    float u = 0.5 + atan(direction.x, -direction.z) / TURN;
    float v = 2.0 * acos(clamp(direction.y, -1.0, 1.0)) / TURN;
    return textureLod(environment, vec3(u, v, 0.0), 0.0).rgb;
}

#endif
