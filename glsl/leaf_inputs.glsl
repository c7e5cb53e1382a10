// What a fragment of a leaf is handed from its corners, and the place on the leaf that it shows.
#ifndef LEAF_INPUTS_GLSL
#define LEAF_INPUTS_GLSL

// Whether a fragment covers several samples.
layout(constant_id = 7) const bool MULTISAMPLED = false;

// At the pixel's centre even where that is beside the leaf: most edges have a leaf in the same plane behind them, and a centroid
// would move what is looked up, and tear its derivatives, along all of them.
layout(location = 0) in vec3 centre_position;
layout(location = 1) in vec3 centre_normal;
layout(location = 2) in vec4 centre_slot_uv;
layout(location = 3) in vec3 centre_weights;
layout(location = 4) in vec4 centre_color;
layout(location = 5) in vec3 centre_comb_reflected;
layout(location = 6) in vec3 centre_comb_transmitted;
layout(location = 7) in vec4 centre_uv;
layout(location = 8) in vec4 centre_tangent;
layout(location = 9) flat in uvec4 header;
layout(location = 10) flat in uvec4 references;
layout(location = 11) flat in vec3 facet;
layout(location = 12) flat in vec4 own[4];
layout(location = 16) flat in vec4 first[7];
// The first two weights of a place that is surely on the leaf.
layout(location = 23) centroid in vec2 covered;

// At the place that is shown.
vec3 position;
vec3 normal;
vec4 slot_uv;
vec3 weights;
vec4 color;
vec3 comb_reflected;
vec3 comb_transmitted;
vec4 uv;
vec4 tangent;

// So far beside the leaf, as a share of it, its plane says nothing of what is on it: at the rim of a curved surface a leaf
// narrower than a pixel may be seen from behind there, or end at infinity.
const float FAR_BESIDE = 0.1;

// Finds the place: the pixel's centre, unless that is far beside the leaf.
void find_place() {
    position = centre_position;
    normal = centre_normal;
    slot_uv = centre_slot_uv;
    weights = centre_weights;
    color = centre_color;
    comb_reflected = centre_comb_reflected;
    comb_transmitted = centre_comb_transmitted;
    uv = centre_uv;
    tangent = centre_tangent;
    if (!MULTISAMPLED) return;

    // All are affine in the weights, exactly, in perspective too: the steps to the neighbours that change the weights as
    // wanted change the rest along.
    vec2 dx = dFdx(weights.xy), dy = dFdy(weights.xy), change = covered - weights.xy;
    float determinant = dx.x * dy.y - dx.y * dy.x;
    vec2 steps = vec2(change.x * dy.y - change.y * dy.x, dx.x * change.y - dx.y * change.x) / determinant;
#define MOVED(value) (value + dFdx(value) * steps.x + dFdy(value) * steps.y)
    vec3 there = MOVED(position), bent = MOVED(normal);
    vec3 reflected = MOVED(comb_reflected), transmitted = MOVED(comb_transmitted);
    vec4 slots = MOVED(slot_uv), colored = MOVED(color), sets = MOVED(uv), along = MOVED(tangent);
#undef MOVED
    bool far = min(min(weights.x, weights.y), weights.z) < -FAR_BESIDE;
    if (far && abs(determinant) > 0.0) {
        position = there;
        normal = bent;
        slot_uv = slots;
        weights = vec3(covered, 1.0 - covered.x - covered.y);
        color = colored;
        comb_reflected = reflected;
        comb_transmitted = transmitted;
        uv = sets;
        tangent = along;
    }
}

#endif
