// Pixels that were traced one by one, as the node table holds them: a block for each leaf that they cover.
#ifndef TRACED_GLSL
#define TRACED_GLSL

#include "frame.glsl"

layout(set = 1, binding = 2) uniform usamplerBuffer node_table;

uvec4 node_words(uint index) { return texelFetch(node_table, int(index)); }

// Where in its block the pixel under a fragment is.
struct TracedPixel {
    bool inside;    // whether it is there at all
    uint index;
    uint pixels;    // of the block
    uint block;     // first texel of the block
};

TracedPixel traced_pixel(uint block) {
    uvec4 corner_and_size = node_words(block);
    uvec2 cell = (uvec2(gl_FragCoord.xy) >> frame.halvings) - corner_and_size.xy;
    // Beside the block they wrap around, and so may the helpers of a fragment that is in it.
    bool inside = all(lessThan(cell, corner_and_size.zw));
    uint index = inside ? cell.y * corner_and_size.z + cell.x : 0u;
    return TracedPixel(inside, index, corner_and_size.z * corner_and_size.w, block);
}

// Its radiance: false where it was not traced.
bool traced_radiance(TracedPixel pixel, out vec3 traced) {
    // Two to a texel, as halves.
    uvec4 pair = node_words(pixel.block + 1u + pixel.index / 2u);
    uvec2 halves = (pixel.index & 1u) == 0u ? pair.xy : pair.zw;
    vec2 last = unpackHalf2x16(halves.y);
    traced = vec3(unpackHalf2x16(halves.x), last.x);
    return pixel.inside && last.y != 0.0;
}

// Its place in the depth image, in the block of a picture that has one for each pixel: four to a texel.
float traced_depth(TracedPixel pixel) {
    uint first = pixel.block + 1u + (pixel.pixels + 1u) / 2u;
    return uintBitsToFloat(node_words(first + pixel.index / 4u)[pixel.index % 4u]);
}

#endif
