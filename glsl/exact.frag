#version 460
// Exact reconstruction of a leaf (design §5): the paths that its corners share are followed per fragment.
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "shading.glsl"
#include "environment.glsl"
#include "leaf_inputs.glsl"
#include "traced.glsl"

// What the leaves of this draw may have: LEAVES_PLAIN no specular part, LEAVES_FIRST at most the patch that the
// view ray meets after one bounce, LEAVES_NODES any number of textures besides, LEAVES_ALL nodes of any kind;
// LEAVES_TRACED nothing but traced pixels.
layout(constant_id = 2) const uint LEAVES = LEAVES_ALL;
// Whether the textures of its nodes all lie in `node_texture`.
layout(constant_id = 9) const bool MIXED_TEXTURES = true;
// Components that this pass adds up: all in one pass, or one group a pass.
layout(constant_id = 3) const uint COMPONENTS = 31;
// Eq. 4 multiplies the combined colour by the first texture of its branch; Eq. 3 adds it.
layout(constant_id = 4) const bool EQUATION_FOUR = false;
// Alpha carries the primary-face code, a half, in place of coverage (single-pass visibility).
layout(constant_id = 10) const bool CODED = false;

layout(location = 0) out vec4 radiance;

vec4 node_floats(uint index) { return uintBitsToFloat(node_words(index)); }

struct Ray { vec3 origin; vec3 direction; };

struct Candidate { float s; vec3 point; vec2 base_uv; vec2 emissive_uv; };

Candidate candidate_on(uint target, Ray ray) {
    vec4 plane = scene_floats(target);
    float s = (plane.w - dot(plane.xyz, ray.origin)) / dot(plane.xyz, ray.direction);
    vec3 point = ray.origin + ray.direction * s;
    vec4 at = vec4(point, 1.0);
    return Candidate(
        s, point,
        vec2(dot(scene_floats(target + 2u), at), dot(scene_floats(target + 3u), at)),
        vec2(dot(scene_floats(target + 4u), at), dot(scene_floats(target + 5u), at)));
}

bool inside_outline(uint target, vec3 point) {
    uint sides = scene_words(target + 1u).y;
    for (uint i = 0u; i < sides; ++i) {
        vec4 side = scene_floats(target + TARGET_OUTLINE + i);
        if (dot(side.xyz, point) > side.w) return false;
    }
    return true;
}

// Radiance of the planar candidate that is hit nearest inside its outline, and the texel that Eq. 4 asks for.
vec3 candidates_radiance(uvec4 head, Ray ray, out vec3 texel) {
    uint count = (head.x >> 4) & 3u;
    uint targets[3] = uint[3](head.y, head.z, head.w);
    Candidate best;
    vec2 base_dx, base_dy, emissive_dx, emissive_dy;
    uint best_target = targets[0];
    bool best_inside = false;
    for (uint k = 0u; k < count; ++k) {
        Candidate candidate = candidate_on(targets[k], ray);
        // Gradients of every candidate's coordinates, before any choice between them.
        vec2 bx = dFdx(candidate.base_uv), by = dFdy(candidate.base_uv);
        vec2 ex = dFdx(candidate.emissive_uv), ey = dFdy(candidate.emissive_uv);
        bool inside = candidate.s > 0.0 && inside_outline(targets[k], candidate.point);
        bool nearer = candidate.s > 0.0 && (best.s <= 0.0 || candidate.s < best.s);
        if (k == 0u || (inside && !best_inside) || (inside == best_inside && nearer)) {
            best = candidate;
            best_target = targets[k];
            best_inside = inside;
            base_dx = bx; base_dy = by; emissive_dx = ex; emissive_dy = ey;
        }
    }
    uint material = scene_words(best_target + 1u).x;
    uvec4 textures = scene_words(material + 4u);
    vec4 base_texel = bank_texel(textures.x, best.base_uv, base_dx, base_dy);
    vec3 emission_texel = vec3(1.0);
    if (HAS_EMISSION_TEXTURES)
        emission_texel = bank_texel(textures.y, best.emissive_uv, emissive_dx, emissive_dy).rgb;
    texel = base_texel.rgb;
    vec4 constants[4];
    material_constants(material, constants);
    Material m = material_from(constants, vec4(1.0), base_texel, emission_texel);
    vec3 n = scene_floats(best_target).xyz;
    vec3 direction = normalize(ray.direction);
    if (dot(n, direction) > 0.0) n = -n;
    // Whether a light is hidden is known of a patch at the corners that see it, not at the others.
    vec3 seen = max(weights, 1e-6) * vec3(equal(uvec3(targets[0], targets[1], targets[2]), uvec3(best_target)));
    seen /= seen.x + seen.y + seen.z;
    return local_radiance(m, best.point, n, direction, head.x >> 8, seen);
}

// Radiance of the patch that the view ray meets after one bounce: its constants came flat from the vertices.
vec3 first_radiance(vec3 direction, out vec3 texel) {
    vec3 n = first[0].xyz;
    float s = (first[0].w - dot(n, position)) / dot(n, direction);
    vec3 point = position + direction * s;
    vec2 at = vec2(dot(first[1], vec4(point, 1.0)), dot(first[2], vec4(point, 1.0)));
    vec4 base_texel = vec4(1.0);
    if (HAS_BASE_TEXTURES) base_texel = bound_texel(first_texture, references.z, at);
    texel = base_texel.rgb;
    if (s <= 0.0) return vec3(0.0);
    vec4 constants[4] = vec4[4](vec4(first[3].rgb, 1.0), first[4], first[5], first[6]);
    Material m = material_from(constants, vec4(1.0), base_texel, vec3(1.0));
    if (dot(n, direction) > 0.0) n = -n;
    return local_radiance(m, point, n, direction, references.w, weights);
}

vec4 weighted(uint at) {
    return weights.x * node_floats(at) + weights.y * node_floats(at + 1u) + weights.z * node_floats(at + 2u);
}

// What one node adds, before α.
vec3 node_radiance(inout uint at, Branches branches, out uint branch) {
    uvec4 head = node_words(at);
    uint kind = head.x & 7u;
    branch = (head.x >> 3) & 1u;
    vec4 shade = weighted(at + 1u);
    vec4 bundle = weighted(at + 4u);
    vec4 rest = weighted(at + 7u);
    at += NODE_TEXELS;
    // The bundle's ray meets the plane at s; both coordinates are affine in s. On a chart s is 0.
    float s = bundle.x / bundle.y;
    vec2 where = (bundle.zw + s * rest.xy) / shade.w;
    vec3 value = shade.rgb;
    if (MIXED_TEXTURES) value *= bank_texel(head.y, where, dFdx(where), dFdy(where)).rgb;
    else value *= bound_texel(node_texture, head.y, where).rgb;
    if (LEAVES != LEAVES_ALL || kind == NODE_TEXTURE) return value;

    vec3 texel;
    vec3 bounced = branch == 0u ? branches.reflected : branches.refracted;
    if (HAS_PANORAMA && kind == NODE_FIRST_ENVIRONMENT) return environment_radiance(bounced);
    if (HAS_PANORAMA && kind == NODE_ENVIRONMENT) return shade.rgb * environment_radiance(normalize(bundle.xyz));
    if (!HAS_PATCHES) return vec3(0.0);
    if (kind == NODE_FIRST_PLANES) return candidates_radiance(head, Ray(position, bounced), texel);
    return shade.rgb * candidates_radiance(head, Ray(bundle.xyz / shade.w, rest.xyz / shade.w), texel);
}

void main() {
    if (LEAVES == LEAVES_TRACED) {
        vec3 traced;
        if (!traced_radiance(traced_pixel(header.z), traced)) discard;
        radiance = vec4(traced, 1.0);
        return;
    }
    find_place();
    vec3 d = view_direction(position);
    vec3 n = normalize(normal);
    // Without specular part its side alone matters.
    vec3 ng = LEAVES == LEAVES_PLAIN ? facet : normalize(facet);
    if (dot(n, ng) < 0.0) ng = -ng;

    bool outside = dot(ng, d) < 0.0;
    vec4 base_texel = vec4(1.0);
    vec3 emission_texel = vec3(1.0);
    if (HAS_BASE_TEXTURES) base_texel = bound_texel(own_texture, references.x, slot_uv.xy);
    if (HAS_EMISSION_TEXTURES)
        emission_texel = bank_texel(references.y, slot_uv.zw, dFdx(slot_uv.zw), dFdy(slot_uv.zw)).rgb;
    Material m = material_from(own, color, base_texel, emission_texel);
    if ((FEATURES & FEATURE_DETAIL_TEXTURES) != 0u) {
        Coordinates at;
        at.uv[0] = uv.xy;
        at.uv[1] = uv.zw;
        at.dx[0] = dFdx(uv.xy);
        at.dx[1] = dFdx(uv.zw);
        at.dy[0] = dFdy(uv.xy);
        at.dy[1] = dFdy(uv.zw);
        if (HAS_NORMAL_TEXTURES) n = mapped_normal(header.x, n, tangent, at);
        apply_detail_textures(m, header.x, at);
    }
    if (!outside) { ng = -ng; n = -n; }
    // Discarded at the end: gradients need their neighbours.
    bool cut_out = HAS_ALPHA_TEST && (m.flags & MATERIAL_MASK) != 0u && m.alpha < own[3].z;

    vec3 sum = vec3(0.0);
    if ((COMPONENTS & COMPONENT_PRIMARY) != 0u) sum += local_radiance(m, position, n, d, header.y, weights);
    if (LEAVES != LEAVES_PLAIN) {
        Branches branches = branches_at(m, n, ng, d, outside);
        vec3 textured[2] = vec3[2](vec3(0.0), vec3(0.0));
        vec3 first_texel = vec3(1.0);
        uint first_branch = references.w >> 31;
        if (references.z != NO_FIRST) {
            vec3 bounced = first_branch == 0u ? branches.reflected : branches.refracted;
            textured[first_branch] = first_radiance(bounced, first_texel);
        }
        if (LEAVES >= LEAVES_NODES) {
            uint at_node = header.z;
            for (uint i = header.w >> LEAF_COUNT_SHIFT; i > 0u; --i) {
                uint branch;
                vec3 value = node_radiance(at_node, branches, branch);
                textured[branch] += value;
            }
        }
        vec3 comb[2] = vec3[2](comb_reflected, comb_transmitted);
        for (uint b = 0u; b < 2u; ++b) {
            vec3 branch_sum = vec3(0.0);
            if ((COMPONENTS & (COMPONENT_REFLECTED << b)) != 0u) branch_sum += textured[b];
            if ((COMPONENTS & (COMPONENT_REFLECTED_COMB << b)) != 0u) {
                bool multiplied = EQUATION_FOUR && b == first_branch;
                branch_sum += multiplied ? comb[b] * first_texel : comb[b];
            }
            sum += branches.attenuation[b] * branch_sum;
        }
    }
    if (HAS_ALPHA_TEST && (header.w & LEAF_TRACED) != 0u) {
        vec3 traced;
        if (traced_radiance(traced_pixel(header.z), traced)) sum = (COMPONENTS & COMPONENT_PRIMARY) != 0u ? traced : vec3(0.0);
    }
    if (cut_out) discard;
    // Of specular leaves it tells later passes that nothing was added yet.
    float alpha = HAS_BLENDING && LEAVES == LEAVES_PLAIN && (m.flags & MATERIAL_BLEND) != 0u ? clamp(m.alpha, 0.0, 1.0) : 1.0;
    if (CODED) alpha = unpackHalf2x16(header.z).x;
    radiance = vec4(clamp(sum, vec3(-MAX_RADIANCE), vec3(MAX_RADIANCE)), alpha);
}
