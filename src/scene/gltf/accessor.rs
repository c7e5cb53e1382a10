//! Typed reads of accessors: strided, normalised, sparse, element by element.
//!
//! Elements are decoded when asked for, so that a file whose many primitives share one large accessor costs
//! what it draws and not what it declares.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};

use super::buffers::Buffers;

/// A component type and how many of them make an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    /// Type of one component.
    pub component: ComponentType,
    /// SCALAR, VEC3 …
    pub kind: Type,
    /// Whether integers stand for fractions.
    pub normalized: bool,
}

impl Format {
    /// The format of an accessor; `None` if one of its enumerants is unknown.
    pub fn of(accessor: &gltf::json::Accessor) -> Option<Self> {
        match (&accessor.component_type, &accessor.type_) {
            (Checked::Valid(component), Checked::Valid(kind)) => {
                Some(Self { component: component.0, kind: *kind, normalized: accessor.normalized })
            }
            _ => None,
        }
    }

    /// Bytes of one element. Matrices of small components are padded by column, but no accessor that is
    /// read here may have such a format.
    pub fn size(self) -> usize {
        self.component.size() * self.kind.multiplicity()
    }
}

/// Reads the elements of one accessor.
///
/// Built only over accessors that [`validate`](super::validate) has passed: every range lies inside its
/// buffer view and sparse indices ascend.
pub struct Reader<'a> {
    count: usize,
    format: Format,
    dense: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

#[derive(Clone, Copy)]
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

struct Sparse<'a> {
    count: usize,
    index_type: ComponentType,
    indices: &'a [u8],
    values: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A reader of accessor `index`.
    pub fn new(root: &Root, buffers: &'a Buffers, index: Index<gltf::json::Accessor>) -> Option<Self> {
        let accessor = &root.accessors[index.value()];
        let format = Format::of(accessor)?;
        let from = |view, offset: u64| buffers.view(root, view).get(offset as usize..);
        let dense = match accessor.buffer_view {
            Some(view) => Some(Strided {
                bytes: from(view, accessor.byte_offset.map_or(0, |offset| offset.0))?,
                stride: root.buffer_views[view.value()].byte_stride.map_or(format.size(), |stride| stride.0),
            }),
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) if sparse.count.0 > 0 => Some(Sparse {
                count: sparse.count.0 as usize,
                index_type: match sparse.indices.component_type {
                    Checked::Valid(component) => component.0,
                    Checked::Invalid => return None,
                },
                indices: from(sparse.indices.buffer_view, sparse.indices.byte_offset.0)?,
                values: from(sparse.values.buffer_view, sparse.values.byte_offset.0)?,
            }),
            _ => None,
        };
        Some(Self { count: accessor.count.0 as usize, format, dense, sparse })
    }

    /// Number of elements.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Type of the elements.
    pub fn format(&self) -> Format {
        self.format
    }

    /// The first `N` components of element `index`, normalised where the accessor says so.
    pub fn floats<const N: usize>(&self, index: usize) -> [f32; N] {
        let Some(element) = self.element(index) else { return [0.0; N] };
        let size = self.format.component.size();
        std::array::from_fn(|lane| {
            element
                .get(lane * size..)
                .map_or(0.0, |bytes| float(bytes, self.format.component, self.format.normalized))
        })
    }

    /// The first `N` components of element `index` as the unsigned integers that they are.
    pub fn integers<const N: usize>(&self, index: usize) -> [u32; N] {
        let Some(element) = self.element(index) else { return [0; N] };
        let size = self.format.component.size();
        std::array::from_fn(|lane| {
            element.get(lane * size..).map_or(0, |bytes| integer(bytes, self.format.component))
        })
    }

    /// Position of the first sparse index that does not ascend or lies past the end, if any.
    pub fn misplaced_sparse_index(&self) -> Option<usize> {
        let sparse = self.sparse.as_ref()?;
        let mut previous = None;
        (0..sparse.count).find(|&position| {
            let index = sparse.index(position);
            let bad = index as usize >= self.count || previous.is_some_and(|previous| index <= previous);
            previous = Some(index);
            bad
        })
    }

    /// Bytes of element `index`; `None` where the accessor has no data, which means zeros.
    fn element(&self, index: usize) -> Option<&'a [u8]> {
        let size = self.format.size();
        if let Some(position) = self.sparse.as_ref().and_then(|sparse| sparse.find(index)) {
            return self.sparse.as_ref()?.values.get(position * size..(position + 1) * size);
        }
        let dense = self.dense?;
        dense.bytes.get(index * dense.stride..index * dense.stride + size)
    }
}

impl Sparse<'_> {
    fn index(&self, position: usize) -> u32 {
        self.indices
            .get(position * self.index_type.size()..)
            .map_or(0, |bytes| integer(bytes, self.index_type))
    }

    fn find(&self, element: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            match (self.index(middle) as usize).cmp(&element) {
                std::cmp::Ordering::Less => low = middle + 1,
                std::cmp::Ordering::Greater => high = middle,
                std::cmp::Ordering::Equal => return Some(middle),
            }
        }
        None
    }
}

/// The little-endian number of type `component` at the head of `bytes`; glTF 2.0 §3.6.2.2 for fractions.
fn float(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let fraction = |value: f32, largest: f32| if normalized { (value / largest).max(-1.0) } else { value };
    match (component, bytes) {
        (ComponentType::I8, [a, ..]) => fraction(f32::from(*a as i8), 127.0),
        (ComponentType::U8, [a, ..]) => fraction(f32::from(*a), 255.0),
        (ComponentType::I16, [a, b, ..]) => fraction(f32::from(i16::from_le_bytes([*a, *b])), 32767.0),
        (ComponentType::U16, [a, b, ..]) => fraction(f32::from(u16::from_le_bytes([*a, *b])), 65535.0),
        (ComponentType::U32, [a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]) as f32,
        (ComponentType::F32, [a, b, c, d, ..]) => f32::from_le_bytes([*a, *b, *c, *d]),
        _ => 0.0,
    }
}

fn integer(bytes: &[u8], component: ComponentType) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, [a, ..]) => u32::from(*a),
        (ComponentType::U16, [a, b, ..]) => u32::from(u16::from_le_bytes([*a, *b])),
        (ComponentType::U32, [a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_follow_the_specification() {
        assert_eq!(float(&[0x80], ComponentType::I8, true), -1.0);
        assert_eq!(float(&[127], ComponentType::I8, true), 1.0);
        assert_eq!(float(&[51], ComponentType::U8, true), 0.2);
        assert_eq!(float(&[0x00, 0x80], ComponentType::I16, true), -1.0);
        assert_eq!(float(&[0xff, 0xff], ComponentType::U16, true), 1.0);
        assert_eq!(float(&[0x00, 0x80], ComponentType::I16, false), -32768.0);
        assert_eq!(integer(&[1, 2, 3, 4], ComponentType::U32), 0x0403_0201);
    }
}
