//! Texture references of materials: which image, how it is sampled, and where its coordinates come from.

use std::collections::{BTreeSet, HashMap};

use glam::{Affine2, Vec2};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::{Info, MagFilter, MinFilter, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};

use super::notes::Notes;
use crate::scene::{Filter, Sampler, Texture, TextureSlot, Wrap};

/// Textures met so far, one for each image, sampler and colour space.
#[derive(Default)]
pub struct Textures {
    list: Vec<Texture>,
    known: HashMap<Texture, u32>,
    /// The file's images, in order of first use: [`Texture::image`] counts in this list.
    images: Vec<usize>,
    known_images: HashMap<usize, u32>,
    in_file: BTreeSet<usize>,
}

/// A texture reference of a material, in whichever of the crate's types it came.
pub struct Reference {
    texture: Index<gltf::json::Texture>,
    uv_set: u32,
    transform: Option<TextureTransform>,
}

impl From<&Info> for Reference {
    fn from(info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|all| all.texture_transform.clone());
        Self { texture: info.index, uv_set: info.tex_coord, transform }
    }
}

impl From<&NormalTexture> for Reference {
    fn from(info: &NormalTexture) -> Self {
        // The crate leaves this slot's extensions unread.
        let others = info.extensions.as_ref().map(|all| &all.others);
        let transform = others.and_then(|all| all.get("KHR_texture_transform"));
        let transform = transform.and_then(|value| serde_json::from_value(value.clone()).ok());
        Self { texture: info.index, uv_set: info.tex_coord, transform }
    }
}

impl Textures {
    /// Registers the texture of `reference`; `None`, with a note, if it has no image that can be read.
    pub fn slot(
        &mut self,
        root: &Root,
        reference: Reference,
        srgb: bool,
        owner: &str,
        notes: &Notes,
    ) -> Option<TextureSlot> {
        let source = &root.textures[reference.texture.value()];
        let Some(image) = image_of(root, source) else {
            notes.add("textures", || {
                let index = reference.texture.value();
                format!("{owner}: textures[{index}] has no PNG, JPEG or WebP image: left out")
            });
            return None;
        };
        self.in_file.insert(reference.texture.value());
        let image = *self.known_images.entry(image).or_insert_with(|| {
            self.images.push(image);
            self.images.len() as u32 - 1
        });
        let sampler =
            source.sampler.map_or_else(Sampler::default, |index| convert(&root.samplers[index.value()]));
        let texture = Texture { image, sampler, srgb };
        let texture = *self.known.entry(texture).or_insert_with(|| {
            self.list.push(texture);
            self.list.len() as u32 - 1
        });
        let moved_set = reference.transform.as_ref().and_then(|transform| transform.tex_coord);
        let uv_set = match moved_set.unwrap_or(reference.uv_set) {
            set @ 0..=1 => set as u8,
            set => {
                notes.add("uv sets", || format!("{owner}: texture coordinates {set} are taken as set 0"));
                0
            }
        };
        let transform = reference.transform.as_ref().map_or(Affine2::IDENTITY, matrix);
        if !transform.is_finite() {
            notes.add("textures", || format!("{owner}: a texture transform is not finite: left out"));
        }
        let transform = if transform.is_finite() { transform } else { Affine2::IDENTITY };
        Some(TextureSlot { texture, uv_set, transform })
    }

    /// The file's images that are in use, in the order that [`Texture::image`] counts.
    pub fn images(&self) -> &[usize] {
        &self.images
    }

    /// The file's textures that are in use.
    pub fn in_file(&self) -> &BTreeSet<usize> {
        &self.in_file
    }

    /// The textures, as slots refer to them.
    pub fn into_list(self) -> Vec<Texture> {
        self.list
    }
}

/// Index of the image of a texture: EXT_texture_webp's, else its own.
pub fn image_of(root: &Root, texture: &gltf::json::Texture) -> Option<usize> {
    let webp = texture.extensions.as_ref().and_then(|all| all.others.get("EXT_texture_webp"));
    let webp = webp.and_then(|webp| webp.get("source")?.as_u64()).map(|index| index as usize);
    [webp, Some(texture.source.value())].into_iter().flatten().find(|&index| index < root.images.len())
}

fn convert(sampler: &gltf::json::texture::Sampler) -> Sampler {
    let wrap = |mode: &Checked<WrappingMode>| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    };
    let default = Sampler::default();
    let (min, mip) = match sampler.min_filter {
        Some(Checked::Valid(filter)) => match filter {
            MinFilter::Nearest => (Filter::Nearest, None),
            MinFilter::Linear => (Filter::Linear, None),
            MinFilter::NearestMipmapNearest => (Filter::Nearest, Some(Filter::Nearest)),
            MinFilter::LinearMipmapNearest => (Filter::Linear, Some(Filter::Nearest)),
            MinFilter::NearestMipmapLinear => (Filter::Nearest, Some(Filter::Linear)),
            MinFilter::LinearMipmapLinear => (Filter::Linear, Some(Filter::Linear)),
        },
        Some(Checked::Invalid) | None => (default.min, default.mip),
    };
    let mag = match sampler.mag_filter {
        Some(Checked::Valid(MagFilter::Nearest)) => Filter::Nearest,
        Some(Checked::Valid(MagFilter::Linear) | Checked::Invalid) | None => default.mag,
    };
    Sampler { wrap_u: wrap(&sampler.wrap_s), wrap_v: wrap(&sampler.wrap_t), mag, min, mip }
}

/// The matrix of KHR_texture_transform: translation · rotation · scale.
///
/// The rotation is counter-clockwise as the texture is seen, where v points down: hence the minus.
fn matrix(transform: &TextureTransform) -> Affine2 {
    let (scale, offset) = (Vec2::from_array(transform.scale.0), Vec2::from_array(transform.offset.0));
    Affine2::from_scale_angle_translation(scale, -transform.rotation.0, offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transform_as_the_extension_writes_it() {
        let json = r#"{"offset":[0.5,0.25],"rotation":1.5707963267948966,"scale":[2,3]}"#;
        let matrix = matrix(&serde_json::from_str(json).unwrap());
        // Scaled to (2, 3), then a quarter turn counter-clockwise with v down: (u, v) -> (v, -u).
        let uv = matrix.transform_point2(Vec2::ONE);
        assert!((uv - Vec2::new(3.5, -1.75)).length() < 1e-6, "{uv}");
    }

    #[test]
    fn filters() {
        let sampler: gltf::json::texture::Sampler =
            serde_json::from_str(r#"{"minFilter":9985,"magFilter":9728,"wrapS":33071,"wrapT":33648}"#)
                .unwrap();
        let expected = Sampler {
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Mirror,
            mag: Filter::Nearest,
            min: Filter::Linear,
            mip: Some(Filter::Nearest),
        };
        assert_eq!(convert(&sampler), expected);
    }
}
