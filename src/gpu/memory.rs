//! Kinds of host memory that the device can write for the host to read, and ranges to invalidate.

use ash::vk;

use super::Gpu;
use crate::error::{Error, Result};

/// Kind of memory of a [`ReadbackBuffer`](super::ReadbackBuffer), fastest to read first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadbackMemory {
    /// Host-cached and coherent: read in place.
    CachedCoherent,
    /// Host-cached, not coherent: invalidated, then read in place.
    Cached,
    /// Not cached by the host: copied once in bulk, since scattered reads cost a bus transfer each.
    Uncached,
}

impl ReadbackMemory {
    /// Every kind, in order of preference.
    pub const ALL: [Self; 3] = [Self::CachedCoherent, Self::Cached, Self::Uncached];

    /// Its name in stats and profiles.
    pub fn name(self) -> &'static str {
        match self {
            Self::CachedCoherent => "cached-coherent",
            Self::Cached => "cached",
            Self::Uncached => "uncached",
        }
    }

    /// Whether memory with these properties is of exactly this kind.
    fn suits(self, flags: vk::MemoryPropertyFlags) -> bool {
        use vk::MemoryPropertyFlags as Flags;
        let (cached, coherent) = (flags.contains(Flags::HOST_CACHED), flags.contains(Flags::HOST_COHERENT));
        flags.contains(Flags::HOST_VISIBLE)
            && match self {
                Self::CachedCoherent => cached && coherent,
                Self::Cached => cached && !coherent,
                Self::Uncached => !cached && coherent,
            }
    }
}

/// Which kind of memory a [`ReadbackBuffer`](super::ReadbackBuffer) gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReadbackChoice {
    /// The first of [`ReadbackMemory::ALL`] that the device has.
    #[default]
    Best,
    /// Exactly this kind, or an error.
    Only(ReadbackMemory),
    /// This kind if the device has it, else any memory that the host can see, treated as if it were of this
    /// kind: every path can be tested on every device.
    Treat(ReadbackMemory),
}

impl ReadbackChoice {
    /// Whether `gpu` has any such memory.
    pub fn available(self, gpu: &Gpu) -> bool {
        self.resolve(gpu, u32::MAX, "").is_ok()
    }

    /// Memory type index among those that `bits` allows, and the kind to treat it as.
    pub(super) fn resolve(self, gpu: &Gpu, bits: u32, object: &str) -> Result<(u32, ReadbackMemory)> {
        let exact = |kind: ReadbackMemory| {
            gpu.memory_type(bits, |flags| kind.suits(flags)).map(|found| (found.0, kind))
        };
        let visible = || gpu.memory_type(bits, |flags| flags.contains(vk::MemoryPropertyFlags::HOST_VISIBLE));
        let found = match self {
            Self::Best => ReadbackMemory::ALL.into_iter().find_map(exact),
            Self::Only(kind) => exact(kind),
            Self::Treat(kind) => exact(kind).or_else(|| visible().map(|found| (found.0, kind))),
        };
        found.ok_or_else(|| Error::DeviceMemory {
            object: object.into(),
            problem: match self {
                Self::Only(kind) => format!("the device has no {} memory for the host to read", kind.name()),
                _ => "the device has no memory that the host can read".into(),
            },
        })
    }
}

/// The part of a mapped allocation to invalidate or flush so that bytes `offset..offset + size` are covered:
/// its offset and size are multiples of `atom`, except where it ends with the allocation.
///
/// `atom` is `nonCoherentAtomSize`, a power of two; `offset + size` is at most `allocation`.
pub fn atom_range(offset: u64, size: u64, atom: u64, allocation: u64) -> (u64, u64) {
    let start = offset & !(atom - 1);
    let end = (offset + size).next_multiple_of(atom).min(allocation);
    (start, end - start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_cover_and_align() {
        assert_eq!(atom_range(0, 64, 64, 64), (0, 64));
        assert_eq!(atom_range(1, 1, 64, 256), (0, 64));
        assert_eq!(atom_range(63, 2, 64, 256), (0, 128));
        assert_eq!(atom_range(130, 70, 64, 220), (128, 92));
        for atom in [1, 4, 64, 256] {
            for offset in (0..700).step_by(7) {
                for size in [1, 63, 64, 65, 300] {
                    let allocation = 1003;
                    let (start, length) = atom_range(offset, size, atom, allocation);
                    assert!(start <= offset && start + length >= offset + size);
                    assert_eq!(start % atom, 0);
                    assert!(length % atom == 0 || start + length == allocation);
                    assert!(start + length <= allocation);
                }
            }
        }
    }

    #[test]
    fn kinds_are_told_apart() {
        use vk::MemoryPropertyFlags as Flags;
        let kind = |flags| ReadbackMemory::ALL.into_iter().find(|kind| kind.suits(flags));
        let all = Flags::HOST_VISIBLE | Flags::HOST_COHERENT | Flags::HOST_CACHED;
        assert_eq!(kind(all), Some(ReadbackMemory::CachedCoherent));
        assert_eq!(kind(Flags::HOST_VISIBLE | Flags::HOST_CACHED), Some(ReadbackMemory::Cached));
        assert_eq!(kind(Flags::HOST_VISIBLE | Flags::HOST_COHERENT), Some(ReadbackMemory::Uncached));
        assert_eq!(kind(Flags::DEVICE_LOCAL), None);
    }
}
