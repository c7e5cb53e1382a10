//! The bytes of all buffers, and the slices of them that buffer views name.

use std::borrow::Cow;
use std::path::Path;

use gltf::json::{Index, Root, buffer::View};

use super::uri::Resolver;
use crate::error::{Error, Result};

/// Buffers in the order of the file, each at least as long as it declares.
pub struct Buffers<'a>(Vec<Cow<'a, [u8]>>);

impl<'a> Buffers<'a> {
    /// Reads every buffer; `bin` is the binary chunk, which buffer 0 may be.
    pub fn load(root: &Root, bin: Option<&'a [u8]>, resolver: &Resolver, file: &Path) -> Result<Self> {
        let mut viewed = vec![false; root.buffers.len()];
        root.buffer_views.iter().for_each(|view| viewed[view.buffer.value()] = true);
        let mut buffers = Vec::with_capacity(root.buffers.len());
        for (index, buffer) in root.buffers.iter().enumerate() {
            let refuse = |problem: String| Error::scene(file, format!("buffers[{index}]"), problem);
            let bytes: Cow<[u8]> = match (&buffer.uri, bin) {
                (Some(uri), _) => Cow::Owned(resolver.read(uri).map_err(refuse)?),
                (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
                // A placeholder for an extension that fills it, such as the fallback of EXT_meshopt_compression.
                (None, _) if buffer.extensions.is_some() && !viewed[index] => {
                    buffers.push(Cow::Borrowed(&[][..]));
                    continue;
                }
                (None, _) => return Err(refuse("has no uri, and the file no binary chunk for it".into())),
            };
            if (bytes.len() as u64) < buffer.byte_length.0 {
                let declared = buffer.byte_length.0;
                return Err(refuse(format!("{declared} bytes are declared, but there are {}", bytes.len())));
            }
            buffers.push(bytes);
        }
        Ok(Self(buffers))
    }

    /// The bytes of a buffer view whose range [`validate`](super::validate) has checked.
    pub fn view(&self, root: &Root, view: Index<View>) -> &[u8] {
        let view = &root.buffer_views[view.value()];
        let start = view.byte_offset.map_or(0, |offset| offset.0) as usize;
        &self.0[view.buffer.value()][start..start + view.byte_length.0 as usize]
    }
}
