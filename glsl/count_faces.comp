#version 460
#extension GL_EXT_scalar_block_layout : require
// Pixels of each face, counted on the device from the ID buffer (design §3, `device`).
layout(local_size_x = COUNT_GROUP, local_size_y = 1) in;

layout(set = 0, binding = 0) uniform sampler2D ids;
layout(scalar, set = 0, binding = 1) buffer Counts { uint counts[]; };

void add(uint pixel, uint length) {
    uint face = pixel & 0xffffffu;
    if (face != 0u) atomicAdd(counts[face - 1u], length);
}

// Each invocation walks down a strip of COUNT_STRIP pixels and adds whole runs: neighbours mostly show the
// same face, and an atomic addition for every pixel of a large face would queue up.
void main() {
    ivec2 size = textureSize(ids, 0);
    int x = int(gl_GlobalInvocationID.x);
    if (x >= size.x) return;
    int first = int(gl_WorkGroupID.y) * int(COUNT_STRIP);
    int last = min(first + int(COUNT_STRIP), size.y);
    uint run = 0u, length = 0u;
    for (int y = first; y < last; y++) {
        uint pixel = packUnorm4x8(texelFetch(ids, ivec2(x, y), 0));
        if (pixel != run) {
            add(run, length);
            run = pixel;
            length = 0u;
        }
        length++;
    }
    add(run, length);
}
