//! Which faces the ID buffer draws, with which code, in which batches.

use std::ops::Range;

use crate::{
    constants::{CODE_NONE, CODE_SHADOW, CODE_VT},
    error::{Error, Result},
    scene::{AlphaMode, Scene},
};

/// Most faces that the 24 bits of an ID can tell apart: 0 is no face, and all ones stays free.
pub const MAX_FACES: usize = (1 << 24) - 2;

/// Bits of an entry that hold the face.
pub const FACE_BITS: u32 = (1 << 24) - 1;

/// What an object is to vertex tracing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Needs no samples; only hides what lies behind it.
    Occluder,
    /// A diffuse object that needs samples for its shadows alone (paper §4, footnote).
    Shadow,
    /// A specular VT object.
    Vt,
}

impl Class {
    /// Alpha of the ID buffer on its faces.
    pub fn code(self) -> u8 {
        let code = match self {
            Self::Occluder => CODE_NONE,
            Self::Shadow => CODE_SHADOW,
            Self::Vt => CODE_VT,
        };
        code as u8
    }
}

/// The class of every object of `scene`: VT objects as classified, the others shadow receivers if `shadows`,
/// else occluders. Unlit objects receive no shadow.
pub fn classes(scene: &Scene, shadows: bool) -> Vec<Class> {
    let class = |object: &crate::scene::Object| match object.vt {
        true => Class::Vt,
        false if shadows && !scene.materials[object.material as usize].unlit => Class::Shadow,
        false => Class::Occluder,
    };
    scene.objects.iter().map(class).collect()
}

/// The faces that the ID buffer draws, batch by batch.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawList {
    /// Face in the low 24 bits, code in the high 8, in draw order.
    pub entries: Vec<u32>,
    /// Draws of one pipeline and one texture, without gaps.
    pub batches: Vec<Batch>,
}

/// Consecutive entries that are drawn together.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// Range of [`DrawList::entries`].
    pub entries: Range<u32>,
    /// Whether back faces are left out.
    pub cull: bool,
    /// Material whose alpha cuts holes; `None` for solid faces.
    pub mask: Option<u32>,
}

impl DrawList {
    /// The draw list of `scene` with a class for each object.
    ///
    /// Back faces of single-sided materials are left out, and so are faces with alpha mode BLEND, unless
    /// they are VT objects: one sees through the former, but not past the latter.
    ///
    /// # Errors
    /// [`Error::Option`] for more than [`MAX_FACES`] faces.
    pub fn new(scene: &Scene, classes: &[Class]) -> Result<Self> {
        check_face_count(scene.geometry.faces.len())?;
        let mut objects: Vec<_> = (0..)
            .zip(scene.objects.iter().zip(classes))
            .filter_map(|(index, (object, &class))| {
                let material = &scene.materials[object.material as usize];
                let mask = matches!(material.alpha_mode, AlphaMode::Mask(_)).then_some(object.material);
                let drawn = !material.is_veil(class == Class::Vt);
                drawn.then_some(((mask, !material.double_sided), index, object, class))
            })
            .collect();
        objects.sort_by_key(|&(batch, index, ..)| (batch, index));
        let mut list = Self { entries: Vec::with_capacity(scene.geometry.faces.len()), batches: Vec::new() };
        for ((mask, cull), _, object, class) in objects {
            let start = list.entries.len() as u32;
            let code = u32::from(class.code()) << 24;
            list.entries.extend(object.faces.clone().map(|face| code | face));
            let end = list.entries.len() as u32;
            match list.batches.last_mut() {
                Some(last) if last.mask == mask && last.cull == cull => last.entries.end = end,
                _ => list.batches.push(Batch { entries: start..end, cull, mask }),
            }
        }
        Ok(list)
    }
}

/// Refuses more faces than IDs.
///
/// # Errors
/// [`Error::Option`].
pub fn check_face_count(faces: usize) -> Result<()> {
    if faces <= MAX_FACES {
        return Ok(());
    }
    Err(Error::Option(format!(
        "the scene has {faces} faces; the ID buffer tells at most {MAX_FACES} apart: split or simplify it"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_faces_are_refused() {
        assert!(check_face_count(0).is_ok());
        assert!(check_face_count(MAX_FACES).is_ok());
        let message = check_face_count(MAX_FACES + 1).unwrap_err().to_string();
        assert!(message.contains("16777215") && message.contains("16777214"), "{message}");
    }
}
