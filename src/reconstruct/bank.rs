//! The texture bank: the scene's textures packed into a few array textures (design §5).
//!
//! Vulkan 1.3 alone cannot index sampled images dynamically, but it can choose a layer. Textures of one
//! size, encoding and sampler share an array; a shader names a texture by array and layer.

use half::f16;
use image::{RgbaImage, imageops};

use crate::constants::{MAX_BANK_ARRAYS, NO_TEXTURE};
use crate::error::Result;
use crate::gpu::{AddressMode, Format, Image, ImageDesc, SamplerDesc, TexelFilter, Uploads};
use crate::options::FilterMode;
use crate::scene::{Background, Environment, Sampler, Scene, Texture, TextureSlot};
use crate::visibility::sampler;

/// What textures of one array have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Kind {
    size: (u32, u32),
    srgb: bool,
    sampler: SamplerDesc,
}

/// Where each texture goes, before anything is uploaded.
#[derive(Debug)]
struct Packing {
    kinds: Vec<Kind>,
    /// Array and layer of each texture.
    places: Vec<(usize, usize)>,
    /// Textures by array.
    members: Vec<Vec<usize>>,
}

/// Which textures of a scene are uploaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// Whether each texture is.
    pub textures: Vec<bool>,
    /// Whether they have mip levels even where no sampler asks for them.
    pub all_mips: bool,
}

impl Wanted {
    /// Those that are, by index.
    pub fn of<'s>(&self, scene: &'s Scene) -> impl Iterator<Item = (usize, &'s Texture)> {
        scene.textures.iter().enumerate().filter(|&(index, _)| self.textures[index])
    }

    fn mipped(&self, kind: &Kind) -> bool {
        self.all_mips || kind.sampler.mip.is_some()
    }

    /// Bytes that the bank's textures will take on the device, all levels included.
    pub fn bytes(&self, scene: &Scene, filter: FilterMode) -> u64 {
        let (packing, _) = pack(scene, &self.textures, filter);
        let array = |(kind, members): (&Kind, &Vec<usize>)| {
            let (layers, mipped) = (members.len() as u32, self.mipped(kind));
            ImageDesc::texture(TEXTURES, kind.format(), kind.size, layers, mipped).bytes()
        };
        packing.kinds.iter().zip(&packing.members).map(array).sum()
    }
}

impl Kind {
    fn format(&self) -> Format {
        if self.srgb { Format::Rgba8Srgb } else { Format::Rgba8 }
    }
}

/// Debug name of the bank's arrays.
pub const TEXTURES: &str = "texture bank";

/// Bytes of a scene's panorama on the device.
pub fn panorama_bytes(scene: &Scene) -> u64 {
    match &scene.background {
        Background::Environment(panorama) => size_of::<[u16; 4]>() as u64 * panorama.radiance.len() as u64,
        Background::Color(_) => 0,
    }
}

/// Bytes of the staging buffer through which `bytes` of texels are uploaded.
pub fn staging_bytes(bytes: u64) -> u64 {
    bytes.clamp(16, TEXTURE_STAGING).next_multiple_of(16)
}

const TEXTURE_STAGING: u64 = 32 << 20;

/// All textures of a scene on the device.
#[derive(Debug)]
pub struct Bank {
    arrays: Vec<(Image, SamplerDesc)>,
    references: Vec<u32>,
    environment: (Image, SamplerDesc),
    /// Bytes of texels uploaded, without mip levels.
    pub bytes: u64,
    /// What could not be kept as the file has it.
    pub notes: Vec<String>,
}

impl Bank {
    /// Uploads the textures that are `wanted`, with the filters of `filter`.
    ///
    /// # Errors
    /// A texture larger than the device can hold; no memory left.
    pub fn new(uploads: &mut Uploads, scene: &Scene, wanted: &Wanted, filter: FilterMode) -> Result<Self> {
        let (packing, notes) = pack(scene, &wanted.textures, filter);
        let mut references = vec![NO_TEXTURE; scene.textures.len()];
        for (texture, &(array, layer)) in packing.places.iter().enumerate() {
            if wanted.textures[texture] {
                references[texture] = (layer as u32) << 8 | array as u32;
            }
        }
        let mut arrays = Vec::new();
        let mut bytes = 0;
        for (kind, members) in packing.kinds.iter().zip(&packing.members) {
            let layers: Vec<Vec<u8>> =
                members.iter().map(|&texture| texels(scene, texture, kind.size)).collect();
            let slices: Vec<&[u8]> = layers.iter().map(Vec::as_slice).collect();
            bytes += slices.iter().map(|layer| layer.len() as u64).sum::<u64>();
            let mipped = wanted.mipped(kind);
            let image = uploads.texture(TEXTURES, kind.format(), kind.size, &slices, mipped)?;
            arrays.push((image, kind.sampler));
        }
        let any = sampler::sampler(&Sampler::default());
        if arrays.is_empty() {
            let white = uploads.texture("no texture", Format::Rgba8, (1, 1), &[&[255; 4]], false)?;
            arrays.push((white, any));
        }
        let environment = match &scene.background {
            Background::Environment(panorama) => panorama_image(uploads, panorama)?,
            Background::Color(_) => arrays[0].clone(),
        };
        uploads.flush()?;
        Ok(Self { arrays, references, environment, bytes, notes })
    }

    /// The reference by which shaders name the texture of `slot`: array in the low byte, layer above.
    pub fn reference(&self, slot: Option<TextureSlot>) -> u32 {
        slot.map_or(NO_TEXTURE, |slot| self.references[slot.texture as usize])
    }

    /// Number of arrays in use.
    pub fn arrays(&self) -> u32 {
        self.arrays.len() as u32
    }

    /// Whether textures are filtered anisotropically.
    pub fn is_anisotropic(&self) -> bool {
        self.arrays.iter().any(|(_, sampler)| sampler.anisotropy > 1)
    }

    /// What the binding `bank` takes: the arrays, the first one again where there are fewer.
    pub fn bindings(&self) -> Vec<(&Image, SamplerDesc)> {
        (0..MAX_BANK_ARRAYS as usize)
            .map(|index| self.arrays.get(index).unwrap_or(&self.arrays[0]))
            .map(|(image, sampler)| (image, *sampler))
            .collect()
    }

    /// What the binding `environment` takes.
    pub fn environment(&self) -> (&Image, SamplerDesc) {
        (&self.environment.0, self.environment.1)
    }
}

/// Groups textures by kind; where there are more kinds than arrays, the rarest sizes are resampled to
/// another size with the same sampler.
fn pack(scene: &Scene, used: &[bool], filter: FilterMode) -> (Packing, Vec<String>) {
    let mut packing = Packing { kinds: Vec::new(), places: Vec::new(), members: Vec::new() };
    for (index, texture) in scene.textures.iter().enumerate() {
        let image = &scene.images[texture.image as usize];
        let kind = Kind {
            size: (image.width, image.height),
            srgb: texture.srgb,
            sampler: filtered(&texture.sampler, filter),
        };
        if !used[index] {
            packing.places.push((0, 0));
            continue;
        }
        let array = packing.kinds.iter().position(|&other| other == kind).unwrap_or_else(|| {
            packing.kinds.push(kind);
            packing.members.push(Vec::new());
            packing.kinds.len() - 1
        });
        packing.places.push((array, packing.members[array].len()));
        packing.members[array].push(index);
    }
    let mut notes = Vec::new();
    while packing.kinds.len() > MAX_BANK_ARRAYS as usize {
        notes.push(merge_rarest(&mut packing));
    }
    (packing, notes)
}

/// Merges the array with the fewest texels into the most similar other one.
fn merge_rarest(packing: &mut Packing) -> String {
    let texels = |array: usize| {
        let (width, height) = packing.kinds[array].size;
        packing.members[array].len() as u64 * u64::from(width) * u64::from(height)
    };
    let from = (0..packing.kinds.len()).min_by_key(|&array| texels(array)).unwrap_or(0);
    let kind = packing.kinds[from];
    let unlikeness = |array: usize| {
        let other = packing.kinds[array];
        let pixels = |size: (u32, u32)| u64::from(size.0) * u64::from(size.1);
        (
            other.srgb != kind.srgb,
            other.sampler != kind.sampler,
            pixels(other.size) < pixels(kind.size),
            pixels(other.size).abs_diff(pixels(kind.size)),
        )
    };
    let into = (0..packing.kinds.len()).filter(|&array| array != from).min_by_key(|&array| unlikeness(array));
    let into = into.unwrap_or(0);
    let (width, height) = packing.kinds[into].size;
    let note = format!(
        "{} textures of {}x{} are resampled to {width}x{height}: the scene has more than \
         {MAX_BANK_ARRAYS} combinations of size and sampler",
        packing.members[from].len(),
        kind.size.0,
        kind.size.1,
    );
    let moved = std::mem::take(&mut packing.members[from]);
    for texture in moved {
        packing.places[texture] = (into, packing.members[into].len());
        packing.members[into].push(texture);
    }
    packing.kinds.remove(from);
    packing.members.remove(from);
    for place in &mut packing.places {
        if place.0 > from {
            place.0 -= 1;
        }
    }
    note
}

fn texels(scene: &Scene, texture: usize, (width, height): (u32, u32)) -> Vec<u8> {
    let image = &scene.images[scene.textures[texture].image as usize];
    if (image.width, image.height) == (width, height) {
        return image.rgba.to_vec();
    }
    match RgbaImage::from_raw(image.width, image.height, image.rgba.to_vec()) {
        Some(whole) => imageops::resize(&whole, width, height, imageops::FilterType::CatmullRom).into_raw(),
        None => vec![255; width as usize * height as usize * 4],
    }
}

fn panorama_image(uploads: &mut Uploads, panorama: &Environment) -> Result<(Image, SamplerDesc)> {
    // Radiance is within what halves hold, and every device filters these.
    let texels: Vec<[u16; 4]> = panorama
        .radiance
        .iter()
        .map(|radiance| radiance.extend(1.0).to_array().map(|value| f16::from_f32(value).to_bits()))
        .collect();
    let size = (panorama.width, panorama.height);
    let bytes = bytemuck::cast_slice(&texels);
    let image = uploads.texture(&panorama.name, Format::Rgba16f, size, &[bytes], false)?;
    let sampler = SamplerDesc {
        u: AddressMode::Repeat,
        v: AddressMode::Clamp,
        mag: TexelFilter::Linear,
        min: TexelFilter::Linear,
        mip: None,
        anisotropy: 1,
    };
    Ok((image, sampler))
}

fn filtered(sampler: &Sampler, filter: FilterMode) -> SamplerDesc {
    SamplerDesc { anisotropy: filter.anisotropy(), ..sampler::sampler(&filter.sampler(sampler)) }
}
