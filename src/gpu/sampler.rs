//! Samplers, one of each kind per device.

use ash::vk;

use super::{Gpu, census::Kind, device::lock};
use crate::error::Result;

/// How a texture is filtered and continued beyond its border.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SamplerDesc {
    /// Continuation along u.
    pub u: AddressMode,
    /// Continuation along v.
    pub v: AddressMode,
    /// Filter where a texel covers more than a pixel.
    pub mag: TexelFilter,
    /// Filter where a texel covers less than a pixel.
    pub min: TexelFilter,
    /// Filter between mip levels; `None` reads level 0 alone.
    pub mip: Option<TexelFilter>,
    /// Most samples of anisotropic filtering; 1 for none. Devices without it ignore it.
    pub anisotropy: u8,
}

/// What lies outside the unit square of texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AddressMode {
    /// The texture again.
    Repeat,
    /// The texture again, mirrored every other time.
    Mirror,
    /// Its border texels.
    Clamp,
}

/// Texel filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TexelFilter {
    /// The nearest one.
    Nearest,
    /// Linear interpolation.
    Linear,
}

impl Gpu {
    /// The sampler of this kind; lives as long as the device.
    pub(super) fn sampler(&self, desc: SamplerDesc) -> Result<vk::Sampler> {
        let mut samplers = lock(&self.samplers);
        if let Some(&sampler) = samplers.get(&desc) {
            return Ok(sampler);
        }
        let address = |mode| match mode {
            AddressMode::Repeat => vk::SamplerAddressMode::REPEAT,
            AddressMode::Mirror => vk::SamplerAddressMode::MIRRORED_REPEAT,
            AddressMode::Clamp => vk::SamplerAddressMode::CLAMP_TO_EDGE,
        };
        let filter = |filter| match filter {
            TexelFilter::Nearest => vk::Filter::NEAREST,
            TexelFilter::Linear => vk::Filter::LINEAR,
        };
        let (mip, max_lod) = match desc.mip {
            // One filter, one level: drivers need no level of detail at all.
            None if desc.mag == desc.min => (vk::SamplerMipmapMode::NEAREST, 0.0),
            // The specification's note on emulating samplers without mip maps: below 0.5 the nearest level
            // is level 0, above 0 the minification filter applies.
            None => (vk::SamplerMipmapMode::NEAREST, 0.25),
            Some(TexelFilter::Nearest) => (vk::SamplerMipmapMode::NEAREST, vk::LOD_CLAMP_NONE),
            Some(TexelFilter::Linear) => (vk::SamplerMipmapMode::LINEAR, vk::LOD_CLAMP_NONE),
        };
        let anisotropic = desc.anisotropy > 1 && self.features.sampler_anisotropy == vk::TRUE;
        let info = vk::SamplerCreateInfo::default()
            .address_mode_u(address(desc.u))
            .address_mode_v(address(desc.v))
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .mag_filter(filter(desc.mag))
            .min_filter(filter(desc.min))
            .mipmap_mode(mip)
            .max_lod(max_lod)
            .anisotropy_enable(anisotropic)
            .max_anisotropy(
                f32::from(desc.anisotropy).clamp(1.0, self.limits.max_sampler_anisotropy.max(1.0)),
            );
        // SAFETY: a live device; `info` is complete.
        let sampler =
            self.call("vkCreateSampler", "sampler", |device| unsafe { device.create_sampler(&info, None) })?;
        let name = format!("{desc:?}");
        self.name(sampler, &name);
        self.count(Kind::Sampler, &name, 0);
        samplers.insert(desc, sampler);
        Ok(sampler)
    }
}
