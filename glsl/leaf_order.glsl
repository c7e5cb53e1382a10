// Order of the leaves of a draw.
#ifndef LEAF_ORDER_GLSL
#define LEAF_ORDER_GLSL

// Whether they come last first: the instance of the draw is then the sum of its first and of the one after its last.
layout(constant_id = 11) const bool REVERSED = false;

// The leaf of this invocation.
uint leaf_index() {
    uint place = gl_VertexIndex / 3;
    return REVERSED ? gl_InstanceIndex - 1u - place : place;
}

#endif
