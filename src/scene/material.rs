//! Materials in the terms of glTF 2.0 and its KHR extensions, defaults filled in.

use glam::{Affine2, Vec2, Vec3, Vec4};

/// A glTF material. Factors are linear; textures multiply them.
#[derive(Debug, Clone)]
pub struct Material {
    /// Its name, or `material 3`.
    pub name: String,
    /// Linear RGBA.
    pub base_color: Vec4,
    /// sRGB texture that multiplies `base_color`.
    pub base_color_texture: Option<TextureSlot>,
    /// 0 to 1; the texture's blue channel multiplies it.
    pub metallic: f32,
    /// 0 to 1; the texture's green channel multiplies it.
    pub roughness: f32,
    /// Metalness in blue, roughness in green, linear.
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Tangent-space normals.
    pub normal_texture: Option<TextureSlot>,
    /// Factor of the x and y components of `normal_texture`.
    pub normal_scale: f32,
    /// Linear radiance, KHR_materials_emissive_strength multiplied in.
    pub emissive: Vec3,
    /// sRGB texture that multiplies `emissive`.
    pub emissive_texture: Option<TextureSlot>,
    /// KHR_materials_specular: 0 to 1; the texture's alpha multiplies it.
    pub specular: f32,
    /// Texture of `specular`, in alpha.
    pub specular_texture: Option<TextureSlot>,
    /// KHR_materials_specular: linear colour of the highlight of a dielectric.
    pub specular_color: Vec3,
    /// sRGB texture that multiplies `specular_color`.
    pub specular_color_texture: Option<TextureSlot>,
    /// KHR_materials_ior: index of refraction, at least 1 (0 in the file means infinite: held as 1e6).
    pub ior: f32,
    /// KHR_materials_transmission: 0 to 1; the texture's red channel multiplies it.
    pub transmission: f32,
    /// Texture of `transmission`, in red.
    pub transmission_texture: Option<TextureSlot>,
    /// KHR_materials_volume with a thickness above 0: a solid body; `None` is a thin wall.
    pub volume: Option<Volume>,
    /// What alpha means.
    pub alpha_mode: AlphaMode,
    /// Whether back faces are rasterised; rays hit both sides whatever this says.
    pub double_sided: bool,
    /// KHR_materials_unlit: the base colour is the radiance.
    pub unlit: bool,
    /// `extras: {"vt": …}` of the material.
    pub vt_extra: Option<bool>,
}

/// Absorption inside a solid body (Beer's law).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// Linear colour that white light has after `attenuation_distance`.
    pub attenuation_color: Vec3,
    /// World units; infinite for no absorption.
    pub attenuation_distance: f32,
}

impl Volume {
    /// Transmittance over `length` world units.
    pub fn transmittance(&self, length: f32) -> Vec3 {
        if self.attenuation_distance.is_finite() {
            self.attenuation_color.powf((length / self.attenuation_distance).max(0.0))
        } else {
            Vec3::ONE
        }
    }
}

/// What the alpha of the base colour means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AlphaMode {
    /// Nothing.
    Opaque,
    /// A hit counts where alpha is at least the cutoff.
    Mask(f32),
    /// Coverage on camera rays, opaque elsewhere.
    Blend,
}

/// A texture as one material slot uses it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureSlot {
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub texture: u32,
    /// Which of the two sets of texture coordinates: 0 or 1.
    pub uv_set: u8,
    /// KHR_texture_transform.
    pub transform: Affine2,
}

impl TextureSlot {
    /// The slot's coordinates for the mesh's coordinates `uv`.
    pub fn transform(&self, uv: Vec2) -> Vec2 {
        self.transform.transform_point2(uv)
    }
}

impl Material {
    /// Whether lights can show on it: not where it is unlit, a perfect mirror or clear glass.
    pub fn scatters(&self) -> bool {
        let textured = self.metallic_roughness_texture.is_some() || self.transmission_texture.is_some();
        let smooth = self.roughness == 0.0 && (self.metallic == 1.0 || self.transmission == 1.0);
        !self.unlit && (textured || !smooth)
    }

    /// Whether the rasteriser leaves out a face of geometric normal `normal`, of any length, that a view ray along
    /// `direction` meets: the back of a one-sided face.
    pub fn culls(&self, normal: Vec3, direction: Vec3) -> bool {
        !self.double_sided && normal.dot(direction) > 0.0
    }

    /// Whether what lies behind it shows in part where it is drawn, not traced: BLEND, but of `specular` VT objects, which show
    /// as they are reconstructed, whole.
    pub fn is_veil(&self, specular: bool) -> bool {
        self.alpha_mode == AlphaMode::Blend && !specular
    }
}

impl Default for Material {
    /// glTF's default material: white, fully metallic and rough unless a file says otherwise, except that
    /// metallic is 0 here so that scenes made in code start as plain diffuse.
    fn default() -> Self {
        Self {
            name: "default".into(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            volume: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            vt_extra: None,
        }
    }
}
