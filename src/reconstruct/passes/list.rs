//! A list of leaves on the device, in buffers that are kept from frame to frame.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{DescriptorSet, DeviceBuffer, Gpu, Resource, SetLayout, Uploads};

/// Bytes of a buffer of leaves that is made for `bytes`: room to grow by half without a new one.
fn room_for(bytes: u64) -> u64 {
    (bytes * 3 / 2).max(256).next_multiple_of(16)
}

/// A list of leaves on the device: buffers grow, and are kept from frame to frame.
pub(super) struct LeafList {
    buffers: [DeviceBuffer; 3],
    pub(super) set: DescriptorSet,
}

impl LeafList {
    /// `data`: vertices, leaf records, node table, each in parts that follow one another; with room for more of them if it
    /// `grows`.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        layout: &SetLayout,
        (name, grows): (&str, bool),
        uploads: &mut Uploads,
        data: &[Vec<&[u8]>; 3],
    ) -> Result<Self> {
        let make = |what: &str, parts: &[&[u8]]| {
            let bytes = bytes(parts);
            let size = if grows { room_for(bytes) } else { bytes };
            DeviceBuffer::new(gpu, &format!("{name} {what}"), size)
        };
        let buffers = [make("vertices", &data[0])?, make("records", &data[1])?, make("nodes", &data[2])?];
        let set = layout.set(
            name,
            &[
                ("vertices", Resource::Buffer(&buffers[0])),
                ("leaves", Resource::Buffer(&buffers[1])),
                ("node_table", Resource::Buffer(&buffers[2])),
            ],
        )?;
        let list = Self { buffers, set };
        list.write(uploads, data)?;
        Ok(list)
    }

    pub(super) fn fits(&self, data: &[Vec<&[u8]>; 3]) -> bool {
        self.buffers.iter().zip(data).all(|(buffer, parts)| buffer.size() >= bytes(parts))
    }

    pub(super) fn write(&self, uploads: &mut Uploads, data: &[Vec<&[u8]>; 3]) -> Result<()> {
        for (buffer, parts) in self.buffers.iter().zip(data) {
            let mut offset = 0;
            for part in parts.iter().filter(|part| !part.is_empty()) {
                uploads.write(buffer, offset, part)?;
                offset += part.len() as u64;
            }
        }
        Ok(())
    }
}

fn bytes(parts: &[&[u8]]) -> u64 {
    parts.iter().map(|part| part.len() as u64).sum()
}
