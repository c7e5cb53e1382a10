//! Numbers that the tracer and the shaders must agree on.
//!
//! `build.rs` includes this file and hands every constant to the GLSL compiler as a macro of the same
//! name, so that each number is written down once.

macro_rules! shared_constants {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: $type = $value;)*

        /// Every shared constant as a GLSL macro: its name and its value.
        #[allow(dead_code)] // read by build.rs only
        pub fn shader_defines() -> Vec<(&'static str, String)> {
            vec![$((stringify!($name), glsl_literal(&format!("{:?}", $name), stringify!($type))),)*]
        }
    };
}

#[allow(dead_code)] // as above
fn glsl_literal(value: &str, kind: &str) -> String {
    match kind {
        "u32" => format!("{value}u"),
        _ => value.to_owned(),
    }
}

shared_constants! {
    /// Lights whose visibility is interpolated one by one; two `vec4` varyings.
    MAX_LIGHTS: u32 = 8;
    /// Cosine below which a reflected direction is lifted above the facet (design §2: r·n_g < 1e-3).
    REFLECTION_LIFT: f32 = 1e-3;
    /// Reflectance of the diffuse ambient term in a scene without lights of its own.
    DEFAULT_AMBIENT: f32 = 0.3;
    /// Phong exponents above this are a point-like highlight that f32 cannot hold.
    MAX_PHONG_EXPONENT: f32 = 1e6;
    /// Alpha of the ID buffer where no face needs samples: background and plain occluders.
    CODE_NONE: u32 = 0;
    /// Alpha of the ID buffer on diffuse faces that need samples for their shadows alone.
    CODE_SHADOW: u32 = 128;
    /// Alpha of the ID buffer on faces of specular VT objects (paper §3.1: the primary-face code).
    CODE_VT: u32 = 255;
    /// Invocations in a workgroup of the shader that counts pixels per face, side by side.
    COUNT_GROUP: u32 = 64;
    /// Pixels that each of them walks down.
    COUNT_STRIP: u32 = 32;
    /// Largest magnitude that an RGBA16F target holds without overflow to infinity.
    MAX_RADIANCE: f32 = 65504.0;

    /// Array textures that a scene's textures are packed into; with the environment's and a draw's own three, as many as
    /// the 16 samplers that every Vulkan device has.
    MAX_BANK_ARRAYS: u32 = 12;
    /// A texture reference that means white.
    NO_TEXTURE: u32 = 0xffff_ffff;
    /// In place of the texture of the patch that the view ray meets after one bounce: it meets none.
    NO_FIRST: u32 = 0xffff_fffe;
    /// Most samples of anisotropic filters.
    ANISOTROPY: u32 = 8;
    /// Largest finite float.
    MAX_FLOAT: f32 = 3.402_823_5e38;
    /// Texel of a material at which its texture slots' transforms begin, two texels a slot.
    MATERIAL_SLOTS: u32 = 7;
    /// Texels of a material.
    MATERIAL_TEXELS: u32 = 21;
    /// The base colour is the radiance.
    MATERIAL_UNLIT: u32 = 1;
    /// Alpha below the cutoff is discarded.
    MATERIAL_MASK: u32 = 2;
    /// Alpha is coverage.
    MATERIAL_BLEND: u32 = 4;
    /// A solid body, not a thin wall.
    MATERIAL_SOLID: u32 = 8;
    /// Metals follow Schlick's approximation.
    MATERIAL_SCHLICK: u32 = 16;
    /// Objects of the material are specular VT objects.
    MATERIAL_SPECULAR: u32 = 32;
    /// Some material in use has a base colour texture. This and the next six stand in the order of a
    /// material's slots.
    FEATURE_BASE_TEXTURE: u32 = 1;
    /// Some material in use has a texture on its emission.
    FEATURE_EMISSION_TEXTURE: u32 = 2;
    /// Some material in use has a texture on metalness and roughness.
    FEATURE_METALLIC_ROUGHNESS_TEXTURE: u32 = 4;
    /// Some material in use has a normal map.
    FEATURE_NORMAL_TEXTURE: u32 = 8;
    /// Some material in use has a texture on the strength of its highlight.
    FEATURE_SPECULAR_TEXTURE: u32 = 16;
    /// Some material in use has a texture on the colour of its highlight.
    FEATURE_SPECULAR_COLOR_TEXTURE: u32 = 32;
    /// Some material in use has a texture on its transmission.
    FEATURE_TRANSMISSION_TEXTURE: u32 = 64;
    /// The last five of them: any but base colour and emission.
    FEATURE_DETAIL_TEXTURES: u32 = 0x7c;
    /// Some material in use emits.
    FEATURE_EMISSION: u32 = 0x80;
    /// Some material in use shows highlights of lights.
    FEATURE_HIGHLIGHTS: u32 = 0x100;
    /// The scene has vertex colours.
    FEATURE_VERTEX_COLORS: u32 = 0x200;
    /// Some material in use is cut out by alpha.
    FEATURE_ALPHA_TEST: u32 = 0x400;
    /// Some material in use covers by alpha.
    FEATURE_BLENDING: u32 = 0x800;
    /// Some specular object transmits.
    FEATURE_TRANSMISSION: u32 = 0x1000;
    /// Specular paths can end on planar patches.
    FEATURE_PATCHES: u32 = 0x2000;
    /// A panorama surrounds the scene.
    FEATURE_PANORAMA: u32 = 0x4000;
    /// Some light is directional.
    FEATURE_DIRECTIONAL_LIGHTS: u32 = 0x8000;
    /// Some light is a spot.
    FEATURE_SPOT_LIGHTS: u32 = 0x1_0000;
    /// Some light ends at a range.
    FEATURE_LIGHT_RANGES: u32 = 0x2_0000;
    /// Some object is lit or specular.
    FEATURE_NORMALS: u32 = 0x4_0000;
    /// Some texture that shows takes its coordinates from the first set.
    FEATURE_FIRST_UV: u32 = 0x8_0000;
    /// Some texture that shows takes its coordinates from the second set.
    FEATURE_SECOND_UV: u32 = 0x10_0000;
    /// All of the above.
    FEATURE_EVERYTHING: u32 = 0x1f_ffff;
    /// Specialization constant: words of a vertex of leaves.
    VERTEX_WORDS_ID: u32 = 20;
    /// Where its normal lies.
    NORMAL_AT_ID: u32 = 21;
    /// Where its first texture coordinates lie.
    FIRST_UV_AT_ID: u32 = 22;
    /// Where its second texture coordinates lie.
    SECOND_UV_AT_ID: u32 = 23;
    /// Where its colour lies.
    COLOR_AT_ID: u32 = 24;
    /// Where its tangent lies.
    TANGENT_AT_ID: u32 = 25;
    /// Texel of a target at which its outline begins.
    TARGET_OUTLINE: u32 = 6;
    /// Texels of a target.
    TARGET_TEXELS: u32 = 14;
    /// A point light.
    LIGHT_POINT: u32 = 0;
    /// A directional light.
    LIGHT_DIRECTIONAL: u32 = 1;
    /// A spot light.
    LIGHT_SPOT: u32 = 2;
    /// Keeps a material's flags a normal number when they travel as one.
    MATERIAL_NORMAL_NUMBER: u32 = 0x4000_0000;
    /// First bounce onto one of several patches: the view ray itself is reflected or refracted.
    NODE_FIRST_PLANES: u32 = 0;
    /// Deeper bounce onto one of several patches: a weighted bundle of the corners' rays.
    NODE_PLANES: u32 = 1;
    /// First bounce into the environment.
    NODE_FIRST_ENVIRONMENT: u32 = 2;
    /// Deeper bounce into the environment.
    NODE_ENVIRONMENT: u32 = 3;
    /// A texture whose coordinates follow from interpolation: a bundle of rays onto one patch, or projective
    /// coordinates on a chart.
    NODE_TEXTURE: u32 = 4;
    /// Texels of a node: its head, then three of each corner.
    NODE_TEXELS: u32 = 10;
    /// Combined colours come first in the leaf's part of the node table.
    LEAF_COMBINED: u32 = 1;
    /// Texels of combined colours: one a corner and branch.
    COMBINED_TEXELS: u32 = 6;
    /// Pixels of the leaf were traced one by one.
    LEAF_TRACED: u32 = 2;
    /// Where a leaf's flags end and its number of nodes begins, in bits.
    LEAF_COUNT_SHIFT: u32 = 8;
    /// No patch.
    NO_TARGET: u32 = 0xffff_ffff;
    /// Leaves without specular part.
    LEAVES_PLAIN: u32 = 0;
    /// Leaves with at most the patch that the view ray meets after one bounce.
    LEAVES_FIRST: u32 = 1;
    /// Leaves with any number of nodes of kind `NODE_TEXTURE` besides.
    LEAVES_NODES: u32 = 2;
    /// Leaves with nodes of any kind.
    LEAVES_ALL: u32 = 3;
    /// Traced pixels cover them, and nothing cuts holes into them: no shading is left to do.
    LEAVES_TRACED: u32 = 4;
    /// The picture of pixels that were traced beside the mesh, each as far away as what it shows.
    LEAVES_PICTURE: u32 = 5;
    /// Textures of nodes lie in several arrays of the bank.
    MIXED_ARRAYS: u32 = 0xff;
    /// C_prim · CT_prim of Eq. 3.
    COMPONENT_PRIMARY: u32 = 1;
    /// α_r · C_refl · CT_refl.
    COMPONENT_REFLECTED: u32 = 2;
    /// α_t · C_trans · CT_trans.
    COMPONENT_TRANSMITTED: u32 = 4;
    /// α_r · C_r,comb.
    COMPONENT_REFLECTED_COMB: u32 = 8;
    /// α_t · C_t,comb.
    COMPONENT_TRANSMITTED_COMB: u32 = 16;
}
