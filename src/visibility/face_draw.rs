//! Draws every face's ID: what the ways to read it back share.

use std::{ops::Range, sync::Arc};

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

use super::{
    Class, Clusters, DrawList,
    draw_list::{Batch, FACE_BITS},
    mask,
};
use crate::{
    error::Result,
    gpu::{
        Binding, Blend, ColorTarget, Cull, DepthTarget, DescriptorSet, Draws, Format, Gpu, GraphicsDesc,
        GraphicsPipeline, Image, ImageDesc, Recording, Resource, SetLayout, Targets, Uploads,
    },
    scene::{AlphaMode, Scene, View, frustum::Frustum},
    spirv,
};

/// Bindings of set 0: what every face needs.
pub const FACE_BINDINGS: [Binding; 4] = [
    Binding::storage("positions"),
    Binding::storage("faces"),
    Binding::storage("entries"),
    Binding::storage("mask_vertices"),
];
/// Bindings of set 1: what faces with holes need besides.
pub const MASK_BINDINGS: [Binding; 1] = [Binding::textures("alpha_map", 1)];

/// Push constants of `face_fetch.glsl`.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Push {
    /// Clip coordinates from positions relative to the eye.
    pub clip_from_eye_relative: Mat4,
    /// Eye, relative to the scene's origin.
    pub eye: Vec3,
    /// Least alpha that counts, for masked faces.
    pub alpha_cutoff: f32,
}

/// The faces of one scene on the device, with their pipelines.
pub struct FaceDraw {
    draws: Vec<BatchDraw>,
    face_set: DescriptorSet,
    /// Number of faces of the scene.
    pub face_count: usize,
    /// Faces of VT objects, by object.
    pub vt_faces: Vec<Range<u32>>,
    /// Faces of shadow receivers, by object.
    pub shadow_faces: Vec<Range<u32>>,
}

struct BatchDraw {
    batch: Batch,
    clusters: Clusters,
    pipeline: GraphicsPipeline,
    mask: Option<(DescriptorSet, f32)>,
}

impl FaceDraw {
    /// Uploads what the ID buffer of `scene` needs; `classes` has one entry for each object.
    ///
    /// # Errors
    /// More faces than IDs; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene, classes: &[Class]) -> Result<Self> {
        let list = DrawList::new(scene, classes)?;
        let masked = list.batches.iter().any(|batch| batch.mask.is_some());
        let mask_vertices = if masked { mask::vertices(scene) } else { Vec::new() };
        let bytes = size_of_val(scene.geometry.positions.as_slice())
            + size_of_val(scene.geometry.faces.as_slice())
            + size_of_val(list.entries.as_slice())
            + size_of_val(mask_vertices.as_slice());
        let mut uploads = Uploads::new(gpu, "ID buffer uploads", staging_bytes(bytes as u64))?;
        let face_layout = SetLayout::new(gpu, "ID buffer faces", &FACE_BINDINGS)?;
        let positions = uploads.buffer("ID buffer positions", &scene.geometry.positions)?;
        let faces = uploads.buffer("ID buffer faces", &scene.geometry.faces)?;
        let entries = uploads.buffer("ID buffer entries", &list.entries)?;
        let mask_vertices = uploads.buffer("ID buffer mask vertices", &mask_vertices)?;
        let face_set = face_layout
            .set(
                "ID buffer faces",
                &[
                    ("positions", Resource::Buffer(&positions)),
                    ("faces", Resource::Buffer(&faces)),
                    ("entries", Resource::Buffer(&entries)),
                    ("mask_vertices", Resource::Buffer(&mask_vertices)),
                ],
            )
            .map_err(|error| error.with_remedy("use a smaller scene"))?;
        let mask_layout = SetLayout::new(gpu, "ID buffer mask", &MASK_BINDINGS)?;
        let mut draws: Vec<BatchDraw> = Vec::with_capacity(list.batches.len());
        for batch in list.batches {
            let alike = |draw: &&BatchDraw| {
                draw.batch.cull == batch.cull && draw.batch.mask.is_some() == batch.mask.is_some()
            };
            let pipeline = match draws.iter().find(alike) {
                Some(draw) => draw.pipeline.clone(),
                None => pipeline(gpu, &batch, &face_layout, &mask_layout)?,
            };
            let mask = match batch.mask {
                None => None,
                Some(material) => {
                    let AlphaMode::Mask(cutoff) = scene.materials[material as usize].alpha_mode else {
                        continue;
                    };
                    Some((mask::set(&mut uploads, scene, &mask_layout, material)?, cutoff))
                }
            };
            let Range { start, end } = batch.entries;
            let faces: Vec<u32> =
                list.entries[start as usize..end as usize].iter().map(|entry| entry & FACE_BITS).collect();
            let clusters = Clusters::new(&scene.geometry, start, &faces);
            draws.push(BatchDraw { batch, clusters, pipeline, mask });
        }
        uploads.flush()?;
        Ok(Self {
            draws,
            face_set,
            face_count: scene.geometry.faces.len(),
            vt_faces: faces_of(scene, classes, Class::Vt),
            shadow_faces: faces_of(scene, classes, Class::Shadow),
        })
    }

    /// Draws into the cleared `images`, all of it or, to warm the pipelines up, one pixel.
    pub fn record(&self, recording: &mut Recording<'_>, images: &IdImages, view: &View, one_pixel: bool) {
        let colors = [ColorTarget { image: &images.ids, clear: Some([0.0; 4]), resolve: None }];
        let depth = Some(DepthTarget { image: &images.depth, clear: true });
        recording.render(&Targets { colors: &colors, depth }, |pass| self.draw(pass, view, one_pixel));
    }

    /// Draws in a render pass.
    pub fn draw(&self, pass: &mut Draws<'_, '_>, view: &View, one_pixel: bool) {
        if one_pixel {
            pass.scissor([0, 0, 1, 1]);
        }
        let clip_from_eye_relative = view.clip_from_eye_relative();
        let frustum = Frustum::new(&clip_from_eye_relative, view.eye);
        for BatchDraw { clusters, pipeline, mask, .. } in &self.draws {
            pass.pipeline(pipeline).set(0, &self.face_set);
            if let Some((set, _)) = mask {
                pass.set(1, set);
            }
            pass.push(&Push {
                clip_from_eye_relative,
                eye: view.eye,
                alpha_cutoff: mask.as_ref().map_or(0.0, |mask| mask.1),
            });
            for entries in clusters.draws(&frustum) {
                pass.draw(3 * entries.start..3 * entries.end);
            }
        }
    }
}

/// Bytes of the staging buffer through which `bytes` are uploaded.
pub fn staging_bytes(bytes: u64) -> u64 {
    bytes.next_multiple_of(16).clamp(16, 8 << 20)
}

/// Faces of the objects of one class, by object.
pub fn faces_of(scene: &Scene, classes: &[Class], wanted: Class) -> Vec<Range<u32>> {
    let objects = scene.objects.iter().zip(classes).filter(|(_, class)| **class == wanted);
    objects.map(|(object, _)| object.faces.clone()).collect()
}

/// The ID buffer and its depth, of one size.
pub struct IdImages {
    /// Face + 1 in the colour, code in alpha.
    pub ids: Image,
    /// Reversed-Z depth.
    pub depth: Image,
}

impl IdImages {
    /// Images of the size of `view`.
    ///
    /// # Errors
    /// A size that the device does not support; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, view: &View) -> Result<Self> {
        let ids = ImageDesc::target("ID buffer", Format::Rgba8, view.width, view.height);
        Ok(Self { ids: Image::new(gpu, &ids)?, depth: Self::depth(gpu, view)? })
    }

    /// The depth image alone.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn depth(gpu: &Arc<Gpu>, view: &View) -> Result<Image> {
        let depth = ImageDesc::target("ID buffer depth", Format::Depth32f, view.width, view.height);
        Image::new(gpu, &depth)
    }

    /// Whether they have the size of `view`.
    pub fn fit(&self, view: &View) -> bool {
        (self.ids.width(), self.ids.height()) == (view.width, view.height)
    }
}

fn pipeline(gpu: &Arc<Gpu>, batch: &Batch, faces: &SetLayout, mask: &SetLayout) -> Result<GraphicsPipeline> {
    let (name, vertex, fragment, sets): (_, &[u8], &[u8], &[&SetLayout]) = match batch.mask {
        None => ("ID buffer", spirv!("id_buffer.vert"), spirv!("id_buffer.frag"), &[faces]),
        Some(_) => {
            ("ID buffer mask", spirv!("id_buffer_mask.vert"), spirv!("id_buffer_mask.frag"), &[faces, mask])
        }
    };
    let desc = GraphicsDesc {
        sets,
        push_bytes: size_of::<Push>() as u32,
        colors: &[(Format::Rgba8, Blend::Replace)],
        cull: if batch.cull { Cull::Back } else { Cull::None },
        ..GraphicsDesc::opaque(name, vertex, fragment)
    };
    GraphicsPipeline::new(gpu, &desc)
}
