//! The scene's samplers as the device knows them, in the first room that knows both.

use crate::gpu::{AddressMode, SamplerDesc, TexelFilter};
use crate::scene::{Filter, Sampler, Wrap};

/// The device's sampler for `sampler`, isotropic.
pub fn sampler(sampler: &Sampler) -> SamplerDesc {
    SamplerDesc { min: filter(sampler.min), mip: sampler.mip.map(filter), ..level_0(sampler) }
}

/// The same for level 0 alone, magnified or not.
pub fn level_0(sampler: &Sampler) -> SamplerDesc {
    let (u, v) = (address(sampler.wrap_u), address(sampler.wrap_v));
    let filter = filter(sampler.mag);
    SamplerDesc { u, v, mag: filter, min: filter, mip: None, anisotropy: 1 }
}

fn address(wrap: Wrap) -> AddressMode {
    match wrap {
        Wrap::Repeat => AddressMode::Repeat,
        Wrap::Mirror => AddressMode::Mirror,
        Wrap::Clamp => AddressMode::Clamp,
    }
}

fn filter(filter: Filter) -> TexelFilter {
    match filter {
        Filter::Nearest => TexelFilter::Nearest,
        Filter::Linear => TexelFilter::Linear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_has_its_counterpart() {
        let given = Sampler {
            wrap_u: Wrap::Mirror,
            wrap_v: Wrap::Clamp,
            mag: Filter::Nearest,
            min: Filter::Linear,
            mip: Some(Filter::Nearest),
        };
        let whole = SamplerDesc {
            u: AddressMode::Mirror,
            v: AddressMode::Clamp,
            mag: TexelFilter::Nearest,
            min: TexelFilter::Linear,
            mip: Some(TexelFilter::Nearest),
            anisotropy: 1,
        };
        assert_eq!(sampler(&given), whole);
        assert_eq!(level_0(&given), SamplerDesc { min: TexelFilter::Nearest, mip: None, ..whole });
        assert_eq!(sampler(&Sampler { mip: None, ..given }).mip, None);
    }
}
