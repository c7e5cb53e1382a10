//! Reads the file and takes a binary glTF apart (glTF 2.0 §4.4).

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use super::notes::Notes;
use crate::error::{Error, Result};
use crate::memory;

const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;
const JSON_CHUNK: &[u8] = b"JSON";
const BIN_CHUNK: &[u8] = b"BIN\0";

/// Reads a regular file of at most `cap` bytes.
pub fn read_file(path: &Path, cap: u64) -> Result<Vec<u8>> {
    let mut file = open_regular(path).map_err(Error::io(path))?;
    read_capped(&mut file, cap).map_err(Error::io(path))
}

/// Opens `path` if it is a regular file: a device has no end, and opening a FIFO waits for ever.
pub fn open_regular(path: &Path) -> io::Result<File> {
    let not_regular = || io::Error::new(io::ErrorKind::InvalidInput, "not a regular file");
    if !fs::metadata(path)?.is_file() {
        return Err(not_regular());
    }
    let file = File::open(path)?;
    // Asked again of the open file: the name may have changed hands in between.
    if file.metadata()?.is_file() { Ok(file) } else { Err(not_regular()) }
}

/// Reads to the end of `file`, or fails once it is longer than `cap` bytes.
pub fn read_capped(file: &mut File, cap: u64) -> io::Result<Vec<u8>> {
    let too_long = || {
        let text = format!("more than {cap} bytes to read in all, which is the limit; split the model");
        io::Error::new(io::ErrorKind::FileTooLarge, text)
    };
    let length = file.metadata()?.len();
    if length > cap {
        return Err(too_long());
    }
    memory::check(length, "its bytes", "split the model")
        .map_err(|error| io::Error::new(io::ErrorKind::OutOfMemory, error.to_string()))?;
    let mut bytes = Vec::with_capacity(usize::try_from(length).map_err(|_| too_long())?);
    file.take(cap.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > cap { Err(too_long()) } else { Ok(bytes) }
}

/// The JSON text, and the binary chunk if there is one.
pub fn split<'a>(bytes: &'a [u8], file: &Path, notes: &Notes) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    if bytes.is_empty() {
        return Err(Error::scene(file, "file", "is empty"));
    }
    if !bytes.starts_with(b"glTF") {
        return match bytes.strip_prefix(b"\xef\xbb\xbf") {
            Some(text) => {
                notes.add("byte order mark", || "the file begins with a byte order mark".into());
                Ok((text, None))
            }
            None => Ok((bytes, None)),
        };
    }
    let broken = |problem: String| Error::scene(file, "GLB header", problem);
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(broken(format!("the file ends after {} of {HEADER} bytes", bytes.len())));
    };
    if version != 2 {
        return Err(broken(format!("container version {version}, but only version 2 is supported")));
    }
    let length = length as usize;
    if length < HEADER || length > bytes.len() {
        return Err(broken(format!("length {length}, but the file has {} bytes", bytes.len())));
    }
    if length < bytes.len() {
        notes.add("trailing bytes", || format!("{} bytes after the end are ignored", bytes.len() - length));
    }
    let (json_type, json, rest) = chunk(&bytes[HEADER..length], 0, file)?;
    if json_type != JSON_CHUNK {
        return Err(Error::scene(file, "GLB chunk 0", "not the JSON chunk"));
    }
    if rest.is_empty() {
        return Ok((json, None));
    }
    // Only the second chunk may be the buffer; unknown chunks are to be ignored.
    let (kind, data, rest) = chunk(rest, 1, file)?;
    let bin = (kind == BIN_CHUNK).then_some(data);
    if bin.is_none() || !rest.is_empty() {
        notes.add("GLB chunks", || "chunks other than the first JSON and BIN are ignored".into());
    }
    Ok((json, bin))
}

/// Type, data and rest of chunk `number`, which is at the head of `bytes`.
fn chunk<'a>(bytes: &'a [u8], number: u32, file: &Path) -> Result<(&'a [u8], &'a [u8], &'a [u8])> {
    let broken = |problem: String| Error::scene(file, format!("GLB chunk {number}"), problem);
    let (header, rest) = bytes.split_at_checked(CHUNK_HEADER).ok_or_else(|| {
        // Which of the lengths before it is the wrong one, nothing tells.
        broken(format!("{} bytes are left, too few for its header: a length before it is wrong", bytes.len()))
    })?;
    let length = u32::from_le_bytes([header[0], header[1], header[2], header[3]]) as usize;
    let (data, rest) = rest
        .split_at_checked(length)
        .ok_or_else(|| broken(format!("{length} bytes long, but {} are left", rest.len())))?;
    Ok((&header[4..], data, rest))
}
