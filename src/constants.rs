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
            vec![$((stringify!($name), format!("{:?}", $name)),)*]
        }
    };
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
}
