//! Parsers of single option values.

use std::path::PathBuf;

use clap::builder::{PathBufValueParser, PossibleValue, PossibleValuesParser, TypedValueParser};
use glam::{DVec3, Vec3};

use crate::{options::Choice, report::output::Format};

/// Largest width and height of an image.
pub const MAX_SIDE: u32 = 16384;

/// An image size in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row, 1..=[`MAX_SIDE`].
    pub width: u32,
    /// Rows, 1..=[`MAX_SIDE`].
    pub height: u32,
}

/// `WxH`.
///
/// # Errors
/// What is wrong with `text`, in words; so for all functions below.
pub fn size(text: &str) -> Result<Size, String> {
    let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
    text.split_once('x')
        .and_then(|(width, height)| Some(Size { width: side(width)?, height: side(height)? }))
        .ok_or_else(|| format!("not a size such as 1280x1024, each side from 1 to {MAX_SIDE}"))
}

/// `X,Y,Z`.
pub fn point(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("not three numbers such as 1,2.5,-3".into()),
    }
}

/// `R,G,B`, linear and not negative.
pub fn color(text: &str) -> Result<Vec3, String> {
    let color = point(text).ok().map(|color| color.as_vec3());
    let color = color.filter(|color| color.min_element() >= 0.0 && color.is_finite());
    color.ok_or_else(|| "not three numbers 0 or more such as 0.2,0.5,1".into())
}

/// A vertical field of view in degrees.
pub fn fov(text: &str) -> Result<f32, String> {
    number(text, "between 0 and 180 degrees", |v| v > 0.0 && v < 180.0)
}

/// A number from 0 on.
pub fn non_negative(text: &str) -> Result<f32, String> {
    number(text, "0 or more", |v| v >= 0.0)
}

/// A whole number from 0 on.
pub fn count(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| "not a whole number 0 or more".into())
}

/// A number from 1 on.
pub fn at_least_one(text: &str) -> Result<f32, String> {
    number(text, "1 or more", |v| v >= 1.0)
}

/// A number from 0 to 1.
pub fn fraction(text: &str) -> Result<f32, String> {
    number(text, "from 0 to 1", |v| (0.0..=1.0).contains(&v))
}

/// An exposure in stops.
pub fn exposure(text: &str) -> Result<f32, String> {
    number(text, "from -64 to 64 stops", |v| (-64.0..=64.0).contains(&v))
}

fn number(text: &str, range: &str, valid: impl Fn(f32) -> bool) -> Result<f32, String> {
    let number = text.parse().ok().filter(|&v: &f32| v.is_finite() && valid(v));
    number.ok_or_else(|| format!("not a number {range}"))
}

/// A file whose extension names an image format; its name need not be Unicode.
pub fn image_file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match Format::of(&path) {
        Ok(_) => Ok(path),
        Err(_) => Err("images are written as .png, .exr or .pfm"),
    })
}

/// One of a [`Choice`]'s names, which help and error messages list.
pub fn choice<T: Choice + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let names = T::ALL.iter().map(|&(_, name, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).try_map(|given| {
        let entry = T::ALL.iter().find(|(_, name, _)| *name == given);
        entry.map(|(value, ..)| *value).ok_or("unknown name")
    })
}

/// `on` or `off`; clap's own parsers of booleans take other words and list none of these.
pub fn on_off() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|given| given == "on")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("640x480"), Ok(Size { width: 640, height: 480 }));
        assert_eq!(size("16384x1"), Ok(Size { width: 16384, height: 1 }));
        for wrong in ["", "640", "0x480", "640x", "-1x5", "16385x1", "640X480x2", "1e3x5", "99999999999x1"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn points_and_numbers() {
        assert_eq!(point("1,-2.5, 3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        for wrong in ["1,2", "1,2,3,4", "a,b,c", "1,2,inf", "NaN,0,0", ""] {
            assert!(point(wrong).is_err(), "{wrong}");
        }
        assert!(color("0.1,0.2,0.3").is_ok() && color("0,-1,0").is_err() && color("1e39,0,0").is_err());
        assert!(fov("179").is_ok() && fov("180").is_err() && fov("0").is_err() && fov("nan").is_err());
    }
}
