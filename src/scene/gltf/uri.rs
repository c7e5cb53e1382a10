//! Resolves URIs: data URIs, and relative paths that stay in the model's folder.

use std::cell::Cell;
use std::fs::File;
use std::path::{Component, Path, PathBuf};

use super::container::{open_regular, read_capped};

/// Bytes that a file counts for at least: opening a million empty ones takes its time, too.
const LEAST_COST: u64 = 16 << 10;

/// Reads what URIs of one file name, within one budget of bytes.
///
/// All failures are texts for the caller to attach to the object that held the URI.
pub struct Resolver {
    /// Without symbolic links.
    folder: Option<PathBuf>,
    bytes_left: Cell<u64>,
}

impl Resolver {
    /// For URIs relative to `folder`; without one, only data URIs resolve.
    pub fn new(folder: Option<&Path>, budget: u64) -> Self {
        let folder = folder.and_then(|folder| folder.canonicalize().ok());
        Self { folder, bytes_left: Cell::new(budget) }
    }

    /// All bytes that `uri` stands for.
    pub fn read(&self, uri: &str) -> Result<Vec<u8>, String> {
        if let Some(data) = data_uri(uri) {
            return data;
        }
        let (mut file, path) = self.open(uri)?;
        let bytes = read_capped(&mut file, self.bytes_left.get())
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let cost = (bytes.len() as u64).max(LEAST_COST);
        self.bytes_left.set(self.bytes_left.get().saturating_sub(cost));
        Ok(bytes)
    }

    fn open(&self, uri: &str) -> Result<(File, PathBuf), String> {
        let relative = relative_path(uri)?;
        let folder =
            self.folder.as_ref().ok_or("there is no folder to look in; embed the data in the file")?;
        let named = |error: std::io::Error| format!("{}: {error}", relative.display());
        let path = folder.join(&relative).canonicalize().map_err(named)?;
        // Symbolic links are followed, but not out of the folder.
        if !path.starts_with(folder) {
            return Err(format!("{} lies outside of the model's folder; move it there", relative.display()));
        }
        Ok((open_regular(&path).map_err(named)?, relative))
    }
}

/// The path that `uri` means, if it means one that is read.
pub fn relative_path_of(uri: &str) -> Option<PathBuf> {
    relative_path(uri).ok()
}

/// The path that a relative reference (RFC 3986 §4.2) means, percent escapes decoded once.
fn relative_path(uri: &str) -> Result<PathBuf, String> {
    let shown: String = uri.chars().take(80).collect();
    let refuse = |why: &str| format!("URI {shown:?} {why}");
    if uri.split('/').next().is_some_and(|first| first.contains(':')) {
        return Err(refuse("has a scheme; only data URIs and paths in the model's folder are read"));
    }
    let decoded =
        urlencoding::decode(uri).map_err(|_| refuse("is not UTF-8 once its escapes are decoded"))?;
    if decoded.is_empty() || decoded.contains('\0') {
        return Err(refuse("is not a file name"));
    }
    let path = Path::new(decoded.as_ref());
    let mut depth = 0_usize;
    for component in path.components() {
        depth = match component {
            Component::Normal(_) => depth + 1,
            Component::CurDir => depth,
            Component::ParentDir => depth
                .checked_sub(1)
                .ok_or_else(|| refuse("leaves the model's folder; move the file there"))?,
            Component::RootDir | Component::Prefix(_) => {
                return Err(refuse("is absolute; only paths in the model's folder are read"));
            }
        };
    }
    Ok(path.to_path_buf())
}

/// The bytes of a data URI (RFC 2397); `None` if `uri` is not one.
fn data_uri(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let body = uri.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("data:")).map(|_| &uri[5..])?;
    let Some((head, payload)) = body.split_once(',') else {
        return Some(Err("data URI without a comma".into()));
    };
    let plain = urlencoding::decode_binary(payload.as_bytes());
    Some(if head.to_ascii_lowercase().ends_with(";base64") {
        let config = base64::STANDARD.decode_allow_trailing_bits(true);
        base64::decode_config(plain.as_ref(), config).map_err(|error| format!("data URI: {error}"))
    } else {
        Ok(plain.into_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris() {
        assert_eq!(data_uri("data:application/octet-stream;base64,AAECAw==").unwrap().unwrap(), [0, 1, 2, 3]);
        assert_eq!(data_uri("data:;base64,AAECAw%3D%3D").unwrap().unwrap(), [0, 1, 2, 3]);
        assert_eq!(data_uri("data:text/plain,a%20b").unwrap().unwrap(), b"a b");
        assert!(data_uri("data:;base64,@@@@").unwrap().is_err());
        assert!(data_uri("data:nothing").unwrap().is_err());
        assert!(data_uri("database.bin").is_none());
    }

    #[test]
    fn paths_stay_inside() {
        assert_eq!(relative_path("a%20b/%C3%BC.bin").unwrap(), Path::new("a b/ü.bin"));
        assert_eq!(relative_path("100%.bin").unwrap(), Path::new("100%.bin"));
        assert_eq!(relative_path("%2541.bin").unwrap(), Path::new("%41.bin"), "decoded once");
        assert!(relative_path("maps/../a.bin").is_ok());
        for uri in
            ["", ":", "/etc/passwd", "file:///etc/passwd", "../a.bin", "a/../../b", "%2e%2e/a", "%ff.bin"]
        {
            assert!(relative_path(uri).is_err(), "{uri}");
        }
        for uri in ["%2Fetc/passwd", "a%00.bin", "http://a/b.bin", "C:/a.bin"] {
            assert!(relative_path(uri).is_err(), "{uri}");
        }
    }
}
