//! Writing images and reports: whole files or none.

use std::{
    ffi::OsString,
    fs::{OpenOptions, Permissions},
    io::{Cursor, ErrorKind, Write},
    path::{Path, PathBuf, absolute},
    sync::{Mutex, MutexGuard, PoisonError},
};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageFormat};
use serde::Serialize;

use super::{FloatImage, image::srgb_encode, pfm};
use crate::error::{Error, Result};
use crate::memory;

/// Bytes that a pixel takes, at most, while it becomes part of a file: three floats, or of a PNG three bytes, as many in the
/// encoder, and a file that grows by doubling.
pub const FILE_BYTES: u64 = 12;

/// Most symbolic links that lead to a file, as Linux has it.
const MOST_LINKS: u32 = 40;

static WRITING: Mutex<()> = Mutex::new(());

/// Waits for a file that is being written, and keeps any from being begun: for who is about to end the process.
pub fn hold_files() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Formats that an image can be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Eight bits a channel, sRGB-encoded.
    Png,
    /// 32-bit floats, linear.
    Exr,
    /// 32-bit floats, linear, rows from the bottom up.
    Pfm,
}

impl Format {
    /// The format that the extension of `path` names, in lower or upper case.
    ///
    /// # Errors
    /// [`Error::Image`] that names the known extensions.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            Some("pfm") => Ok(Self::Pfm),
            Some(other) => Err(unknown(path, &format!("images are not written as .{other}"))),
            None => Err(unknown(path, "no extension says which image format to write")),
        }
    }
}

fn unknown(path: &Path, problem: &str) -> Error {
    Error::Image { path: path.into(), problem: format!("{problem}; name a .png, .exr or .pfm file") }
}

/// Writes `image` in the format that the extension of `path` names.
///
/// PNG is scaled by 2^`exposure`, clamped and sRGB-encoded; EXR and PFM hold the values untouched.
///
/// # Errors
/// [`Error::Image`] for an unknown extension, [`Error::HostMemory`], [`Error::Io`] if the file cannot be written; then nothing
/// is left behind, and a file that was there before is still there.
pub fn write_image(path: &Path, image: &FloatImage, exposure: f32) -> Result<()> {
    let format = Format::of(path)?;
    memory::check_picture(image.width, image.height, FILE_BYTES)?;
    let bytes = match format {
        Format::Png => {
            encode(path, &srgb_bytes(image, exposure), image, ExtendedColorType::Rgb8, ImageFormat::Png)?
        }
        Format::Exr => {
            let rgb = bytemuck::cast_slice(image.pixels.as_flattened());
            encode(path, rgb, image, ExtendedColorType::Rgb32F, ImageFormat::OpenExr)?
        }
        Format::Pfm => pfm::encode(image),
    };
    write_file(path, &bytes)
}

/// `image` as the bytes of a PNG as small as can be, clamped and sRGB-encoded.
///
/// # Errors
/// [`Error::Image`] with what the encoder says.
pub fn small_png(image: &FloatImage) -> Result<Vec<u8>> {
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive)
        .write_image(&srgb_bytes(image, 0.0), image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(|error| Error::Image { path: "picture".into(), problem: error.to_string() })?;
    Ok(png)
}

fn srgb_bytes(image: &FloatImage, exposure: f32) -> Vec<u8> {
    image.pixels.iter().flatten().map(|&v| to_byte(v * exposure.exp2())).collect()
}

/// A linear value as an sRGB byte; NaN is black.
fn to_byte(linear: f32) -> u8 {
    (srgb_encode(linear.clamp(0.0, 1.0)) * 255.0).round() as u8
}

fn encode(
    path: &Path,
    bytes: &[u8],
    image: &FloatImage,
    color: ExtendedColorType,
    format: ImageFormat,
) -> Result<Vec<u8>> {
    // An OpenEXR file is as long as its pixels and some bytes a row, and by doubling would take up to twice that.
    let rows = 32 * image.height as usize;
    let room = if format == ImageFormat::OpenExr { bytes.len() + rows + (64 << 10) } else { 0 };
    let mut file = Cursor::new(Vec::with_capacity(room));
    image::write_buffer_with_format(&mut file, bytes, image.width, image.height, color, format)
        .map_err(|error| Error::Image { path: path.into(), problem: error.to_string() })?;
    Ok(file.into_inner())
}

/// `value` as JSON for people: indented, in the order of its fields, with a line break at the end.
///
/// # Errors
/// [`Error::Option`] if it holds what JSON cannot.
pub fn to_json(value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(value);
    Ok(text.map_err(|error| Error::Option(format!("cannot be written as JSON: {error}")))? + "\n")
}

/// Writes `bytes` beside the file that `path` leads to and renames: the file appears whole or not at all. What is there
/// and is no file, a pipe or a device, is written to as it is, and what is open already, such as /dev/stderr, is added to.
///
/// # Errors
/// [`Error::Io`]; then nothing is left behind.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    let Place::File(target) = place(path)? else {
        // Not held: it may wait for a reader for ever, and whoever ends the process must not wait for it.
        let stream = OpenOptions::new().append(true).open(path);
        return stream.and_then(|mut stream| stream.write_all(bytes)).map_err(Error::io(path));
    };
    let _held = hold_files();
    let mut file = temporary(&target)?;
    // To the file itself: tempfile adds the temporary name to its errors.
    file.as_file_mut().write_all(bytes).map_err(Error::io(path))?;
    file.persist(&target).map_err(|error| Error::Io { path: path.into(), source: error.error })?;
    Ok(())
}

/// Checks that a file can be written at `path`, before the work that fills it.
///
/// # Errors
/// [`Error::Io`] if `path` is a folder, or if its folder is absent or cannot be written to.
pub fn check_writable(path: &Path) -> Result<()> {
    // Opening a pipe would wait for its reader, and closing it again would tell that reader of an end.
    let Place::File(target) = place(path)? else { return Ok(()) };
    let _held = hold_files();
    temporary(&target).map(drop)
}

/// Whether `a` and `b` lead to one file, there already or not yet. Not so of pipes and devices, which take what comes.
pub fn same_file(a: &Path, b: &Path) -> bool {
    leads_to(a).is_some_and(|a| Some(a) == leads_to(b))
}

/// The folder and the name of the file that `path` leads to, there already or not yet; `None` of pipes and devices.
pub fn leads_to(path: &Path) -> Option<(PathBuf, OsString)> {
    let Ok(Place::File(target)) = place(path) else { return None };
    let folder = std::fs::canonicalize(folder_of(&target)).or_else(|_| absolute(folder_of(&target)));
    folder.ok().zip(target.file_name().map(ToOwned::to_owned))
}

/// What a path leads to.
enum Place {
    /// A file, there already or not yet, by the path that no symbolic link follows.
    File(PathBuf),
    /// A pipe, a device, a socket, or whatever this process has open under that number.
    Stream,
}

fn place(path: &Path) -> Result<Place> {
    let refused =
        |kind, problem| Err(Error::Io { path: path.into(), source: std::io::Error::new(kind, problem) });
    match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => {
            return refused(ErrorKind::IsADirectory, "is a folder; name a file in it");
        }
        Ok(found) if !found.is_file() => return Ok(Place::Stream),
        // What is not there yet may still be behind a link, whose folder then decides.
        _ => {}
    }
    let mut target = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let Ok(next) = std::fs::read_link(&target) else { return Ok(Place::File(target)) };
        // A log that the shell opened for us: what stands in it is not ours to replace.
        if std::fs::canonicalize(folder_of(&target)).is_ok_and(|folder| folder.starts_with("/proc")) {
            return Ok(Place::Stream);
        }
        target.pop();
        target.push(next);
    }
    refused(ErrorKind::InvalidInput, "leads through too many symbolic links")
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// An empty file in the folder of `path` that vanishes when dropped.
fn temporary(path: &Path) -> Result<tempfile::NamedTempFile> {
    let folder = folder_of(path);
    let mut builder = tempfile::Builder::new();
    builder.prefix(".vtrace-").suffix(".part");
    #[cfg(unix)] // as any new file, by the umask; tempfile's own choice is 0600
    builder.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|error| {
        // tempfile adds the temporary name to its message: only the cause helps here.
        let kind = error.kind();
        let cause = match kind {
            ErrorKind::NotFound if !folder.exists() => {
                format!("folder {} does not exist; create it first", folder.display())
            }
            ErrorKind::NotADirectory => format!("{} is not a folder", folder.display()),
            _ => format!("cannot write to folder {}: {kind}", folder.display()),
        };
        Error::Io { path: path.into(), source: std::io::Error::new(kind, cause) }
    })
}
