// Layout of leaves, as reconstruct/leaves.rs writes them.
#ifndef LEAF_GLSL
#define LEAF_GLSL

struct Leaf {
    uint vertices[3];
    uint material;      // first texel in the scene table
    uint lit;           // a byte a corner: lights that are not hidden from it
    uint nodes;         // first texel in the node table: combined colours, then nodes or traced pixels
    uint flags;         // LEAF_…, and the number of nodes above
    uint first_target;  // patch that the view ray meets after one bounce, or NO_TARGET
    uint first_lit;     // as `lit`, for that patch; its branch in the top bit
};

#endif
