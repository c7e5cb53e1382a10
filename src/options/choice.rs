//! Options that are one of a few named ways.

use std::{fmt, str::FromStr};

use crate::constants::ANISOTROPY;
use crate::scene::{Filter, Sampler};

/// An option that takes one of a few names.
pub trait Choice: Copy + PartialEq + 'static {
    /// Every value with its name on the command line and what it means.
    const ALL: &'static [(Self, &'static str, &'static str)];

    /// The name of this value.
    fn name(self) -> &'static str {
        let entry = Self::ALL.iter().find(|(value, ..)| *value == self);
        entry.map_or("", |(_, name, _)| name)
    }
}

/// A name that is none of a [`Choice`]'s.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{given:?} is none of {}", .known.join(", "))]
pub struct UnknownChoice {
    given: String,
    known: Vec<&'static str>,
}

macro_rules! choices {
    ($($(#[$doc:meta])* $type:ident { $($(#[$attribute:meta])* $value:ident = $name:literal: $help:literal,)* })*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        pub enum $type {
            $($(#[$attribute])* #[doc = $help] $value,)*
        }

        impl Choice for $type {
            const ALL: &'static [(Self, &'static str, &'static str)] = &[$((Self::$value, $name, $help)),*];
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.name())
            }
        }

        impl FromStr for $type {
            type Err = UnknownChoice;

            fn from_str(given: &str) -> Result<Self, UnknownChoice> {
                let entry = Self::ALL.iter().find(|(_, name, _)| *name == given);
                entry.map(|(value, ..)| *value).ok_or_else(|| UnknownChoice {
                    given: given.into(),
                    known: Self::ALL.iter().map(|(_, name, _)| *name).collect(),
                })
            }
        }

        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }
    )*};
}

choices! {
    /// How the colour contributions of a face reach the image (paper §4).
    Mode {
        #[default]
        MultiTexture = "multi-texture": "one pass that samples all textures of a face",
        MultiPass = "multi-pass": "one blended pass for each contribution",
    }
    /// Which of the paper's equations combines the contributions.
    Equation {
        #[default]
        Three = "3": "the combined local colours of deeper hits are added apart from the texture",
        Four = "4": "the texture multiplies the combined local colours too",
    }
    /// What is interpolated between the vertices of a leaf (design §5).
    Reconstruction {
        #[default]
        Exact = "exact": "the geometry of the secondary hit, intersected at every fragment",
        Paper = "paper": "texture coordinates and colours, as in the paper",
    }
    /// How the visible faces are found (paper §3.1, §5; design §3).
    VisibilityWay {
        #[default]
        IdBuffer = "id-buffer": "a pass of its own that draws face IDs, read back and scanned",
        SinglePass = "single-pass": "the base image, with a primary-face code in alpha, read back and scanned",
        Device = "device": "faces counted on the device, only the counts read back",
        Auto = "auto": "the fastest exact way on this device",
    }
    /// Which surfaces receive shadows (design §2).
    Shadows {
        #[default]
        All = "all": "all surfaces",
        Vt = "vt": "specular objects and what is seen in them",
        None = "none": "no surface",
    }
    /// How textures are filtered.
    FilterMode {
        #[default]
        File = "file": "as the samplers of the file say",
        Trilinear = "trilinear": "trilinearly, whatever the file says",
        Aniso8 = "aniso8": "anisotropically, up to a ratio of 8",
    }
    /// Samples of a pixel that share one shading.
    Msaa {
        #[default]
        One = "1": "no multisampling",
        Four = "4": "four coverage samples, shaded once",
    }
    /// Samples of a pixel that are each shaded.
    Ss {
        #[default]
        One = "1": "no supersampling",
        Four = "4": "four shaded samples",
        Sixteen = "16": "sixteen shaded samples",
    }
    /// Most samples of a pixel that differs from one beside it: they are traced once the picture is drawn.
    PixelSamples {
        #[default]
        One = "1": "none, all pixels stay as they were drawn",
        Four = "4": "four where it differs from a pixel beside it",
        Sixteen = "16": "sixteen where these four differ",
        SixtyFour = "64": "sixty-four where these sixteen differ",
    }
    /// A picture of the method's data in place of the rendered image.
    Show {
        #[default]
        Faces = "faces": "leaves, coloured by whether they are defined",
        Samples = "samples": "refined vertices",
        Error = "error": "predicted displacement of what is reflected",
        Depth = "depth": "number of specular bounces",
        Ids = "ids": "the ID buffer",
        VtMask = "vt-mask": "pixels of specular VT objects, white; a mask for compare",
    }
}

impl FilterMode {
    /// How a texture of `sampler` is read.
    pub fn sampler(self, sampler: &Sampler) -> Sampler {
        match self {
            Self::File => *sampler,
            Self::Trilinear | Self::Aniso8 => {
                let linear = Filter::Linear;
                Sampler { mag: linear, min: linear, mip: Some(linear), ..*sampler }
            }
        }
    }

    /// Greatest ratio of the axes of what a lookup covers.
    pub fn anisotropy(self) -> u8 {
        match self {
            Self::File | Self::Trilinear => 1,
            Self::Aniso8 => ANISOTROPY as u8,
        }
    }
}

impl Ss {
    /// Shaded samples a pixel.
    pub fn samples(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Four => 4,
            Self::Sixteen => 16,
        }
    }
}

impl Msaa {
    /// Coverage samples a pixel.
    pub fn samples(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Four => 4,
        }
    }
}

impl PixelSamples {
    /// Samples of a pixel at most; 1 where pixels stay as they were drawn.
    pub fn samples(self) -> usize {
        match self {
            Self::One => 1,
            Self::Four => 4,
            Self::Sixteen => 16,
            Self::SixtyFour => 64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse_back_and_unknown_ones_list_the_known() {
        for &(value, name, _) in VisibilityWay::ALL {
            assert_eq!(name.parse::<VisibilityWay>().unwrap(), value);
            assert_eq!(value.to_string(), name);
        }
        let error = "5".parse::<Ss>().unwrap_err();
        assert_eq!(error.to_string(), "\"5\" is none of 1, 4, 16");
    }
}
