#version 460
// A pixel that was traced beside the mesh, as far away as what it shows: what is blended with it is drawn later.
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "traced.glsl"

layout(location = 9) flat in uvec4 header;

layout(location = 0) out vec4 radiance;

void main() {
    TracedPixel pixel = traced_pixel(header.z);
    vec3 traced;
    if (!traced_radiance(pixel, traced)) discard;
    radiance = vec4(traced, 1.0);
    gl_FragDepth = traced_depth(pixel);
}
