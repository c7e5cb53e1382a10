//! A list of leaves on the device, in buffers that are kept from frame to frame.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{DescriptorSet, DeviceBuffer, Gpu, Resource, SetLayout, Uploads};

/// Bytes of a buffer of leaves that is made for `bytes`: room to grow by half without a new one, as far as the device binds
/// `most` bytes.
fn room_for(bytes: u64, most: u64) -> u64 {
    (bytes * 3 / 2).min(most / 16 * 16).max(bytes).max(256).next_multiple_of(16)
}

/// What makes a list smaller that is too large for the device: one that `grows` holds what was sampled, the other the scene's
/// own faces.
fn remedy(grows: bool) -> &'static str {
    if grows { "use fewer samples" } else { "use a smaller scene" }
}

/// A list of leaves on the device: buffers grow, and are kept from frame to frame.
pub(super) struct LeafList {
    buffers: [DeviceBuffer; 3],
    pub(super) set: DescriptorSet,
}

impl LeafList {
    /// For vertices, leaf records and node table of so many `bytes`; with room for more of them if it `grows`.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        layout: &SetLayout,
        (name, grows): (&str, bool),
        bytes: [u64; 3],
    ) -> Result<Self> {
        let (stored, read) = (gpu.most_stored(), gpu.most_texels());
        let make = |what: &str, bytes: u64, most: u64| {
            let size = if grows { room_for(bytes, most) } else { bytes };
            DeviceBuffer::new(gpu, &format!("{name} {what}"), size)
        };
        let [vertices, records, nodes] = bytes;
        let buffers = [
            make("vertices", vertices, stored)?,
            make("records", records, stored)?,
            make("nodes", nodes, read)?,
        ];
        let set = layout
            .set(
                name,
                &[
                    ("vertices", Resource::Buffer(&buffers[0])),
                    ("leaves", Resource::Buffer(&buffers[1])),
                    ("node_table", Resource::Buffer(&buffers[2])),
                ],
            )
            .map_err(|error| error.with_remedy(remedy(grows)))?;
        Ok(Self { buffers, set })
    }

    pub(super) fn fits(&self, bytes: [u64; 3]) -> bool {
        self.buffers.iter().zip(bytes).all(|(buffer, bytes)| buffer.size() >= bytes)
    }

    /// What fills the buffers, by their number, in parts that follow one another.
    pub(super) fn writer<'a>(
        &'a self,
        uploads: &'a mut Uploads,
    ) -> impl FnMut(usize, &[u8]) -> Result<()> + 'a {
        let mut offsets = [0; 3];
        move |buffer, part| {
            if !part.is_empty() {
                uploads.write(&self.buffers[buffer], offsets[buffer], part)?;
                offsets[buffer] += part.len() as u64;
            }
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::room_for;

    #[test]
    fn room_to_grow_does_not_pass_the_devices_limit() {
        assert_eq!(room_for(1000, 1 << 20), 1504);
        assert_eq!(room_for(1000, 1200), 1200);
        // What is too much is refused where it is bound.
        assert_eq!(room_for(2000, 1200), 2000);
        assert_eq!(room_for(0, 1 << 20), 256);
    }
}
