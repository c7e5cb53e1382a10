// Material constants in the form in which they travel from vertex to fragment shader.
#ifndef MATERIAL_CONSTANTS_GLSL
#define MATERIAL_CONSTANTS_GLSL

#include "frame.glsl"

// The constants of a material, read from the table.
void material_constants(uint material, out vec4 constants[4]) {
    constants[0] = scene_floats(material);
    constants[1] = scene_floats(material + 1u);
    vec4 scalars = scene_floats(material + 2u);
    float f0 = (constants[1].w - 1.0) / (constants[1].w + 1.0);
    constants[2] = vec4(scene_floats(material + 3u).rgb * (scalars.z * f0 * f0), scalars.y);
    // A flag that is no part of any mask keeps the word a normal number: denormals may be flushed on the way.
    constants[3] = vec4(
        scalars.x, scalars.w, scene_floats(material + 6u).x,
        uintBitsToFloat(scene_words(material + 5u).w | MATERIAL_NORMAL_NUMBER));
}

#endif
