//! The portable float map: a three-line header, then rows of `f32` from the bottom up.

use super::FloatImage;

/// The bytes of `image` as a colour PFM, little endian.
pub fn encode(image: &FloatImage) -> Vec<u8> {
    let mut bytes = format!("PF\n{} {}\n-1.0\n", image.width, image.height).into_bytes();
    bytes.reserve(image.pixels.len() * 12);
    for row in image.pixels.chunks_exact(image.width.max(1) as usize).rev() {
        bytes.extend(row.iter().flatten().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

/// Reads a colour (`PF`) or grey (`Pf`) file of either byte order.
///
/// # Errors
/// What is wrong with the bytes, in words.
pub fn decode(bytes: &[u8]) -> Result<FloatImage, String> {
    let mut rest = bytes;
    let channels = match token(&mut rest)? {
        "PF" => 3,
        "Pf" => 1,
        other => return Err(format!("PFM starts with {other:?} instead of PF or Pf")),
    };
    let width: u32 = number(&mut rest, "width")?;
    let height: u32 = number(&mut rest, "height")?;
    let scale: f32 = number(&mut rest, "scale")?;
    if width == 0 || height == 0 || scale == 0.0 || !scale.is_finite() {
        return Err(format!("PFM header {width} {height} {scale} describes no image"));
    }
    let expected = u128::from(width) * u128::from(height) * channels as u128 * 4;
    if rest.len() as u128 != expected {
        return Err(format!(
            "PFM of {width}x{height} needs {expected} bytes of pixels, the file has {}",
            rest.len()
        ));
    }
    let from_bytes = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let value = |four: &[u8]| from_bytes([four[0], four[1], four[2], four[3]]);
    let row = |row: &[u8]| -> Vec<[f32; 3]> {
        row.chunks_exact(channels * 4)
            .map(|pixel| std::array::from_fn(|c| value(&pixel[(c % channels) * 4..][..4])))
            .collect()
    };
    let pixels = rest.chunks_exact(width as usize * channels * 4).rev().flat_map(row).collect();
    Ok(FloatImage { width, height, pixels })
}

/// The next word of the header, with the one whitespace byte that ends it.
fn token<'a>(rest: &mut &'a [u8]) -> Result<&'a str, String> {
    let bytes: &'a [u8] = rest;
    let end = bytes.iter().take(32).position(u8::is_ascii_whitespace).ok_or("PFM header ends early")?;
    *rest = &bytes[end + 1..];
    std::str::from_utf8(&bytes[..end]).map_err(|_| "PFM header is not text".into())
}

fn number<T: std::str::FromStr>(rest: &mut &[u8], what: &str) -> Result<T, String> {
    let word = token(rest)?;
    word.parse().map_err(|_| format!("PFM {what} {word:?} is not a number"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_big_endian_rows_from_the_bottom() {
        let mut bytes = b"Pf\n1 2\n1.0\n".to_vec();
        bytes.extend(0.25_f32.to_be_bytes()); // bottom row
        bytes.extend(4.0_f32.to_be_bytes());
        let image = decode(&bytes).unwrap();
        assert_eq!((image.width, image.height), (1, 2));
        assert_eq!(image.pixels, [[4.0; 3], [0.25; 3]]);
    }

    #[test]
    fn broken_headers_are_told_apart() {
        for (bytes, expected) in [
            (&b"PF"[..], "ends early"),
            (b"PF\n2 x\n-1\n", "height \"x\" is not a number"),
            (b"PF\n0 2\n-1\n", "describes no image"),
            (b"PF\n1 1\n-1\n12345678", "needs 12 bytes of pixels, the file has 8"),
            (b"PF\n4000000000 4000000000\n-1\n", "needs 192000000000000000000 bytes"),
        ] {
            let problem = decode(bytes).unwrap_err();
            assert!(problem.contains(expected), "{problem:?} should contain {expected:?}");
        }
    }
}
