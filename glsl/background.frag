#version 460
// The panorama along a view ray.
#extension GL_GOOGLE_include_directive : require
#include "environment.glsl"

layout(location = 0) noperspective in vec3 direction;
layout(location = 0) out vec4 radiance;

// No alpha: in a single pass it is the code of no face.
void main() { radiance = vec4(environment_radiance(normalize(direction)), 0.0); }
