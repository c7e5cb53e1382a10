//! What a plan takes of a device before its first frame, told without a device.

use serde::Serialize;

use super::Plan;
use crate::constants::{MATERIAL_TEXELS, TARGET_TEXELS};
use crate::options::{Options, Reconstruction, Ss, VisibilityWay};
use crate::reconstruct::leaves::GpuLeaf;
use crate::reconstruct::{
    bank, base,
    passes::{self, TargetDesc},
    table::Texel,
};
use crate::scene::{AlphaMode, Object, Scene};
use crate::visibility::{Class, MaskVertex, classes, face_draw};

/// Buffers or images of one purpose.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Resource {
    /// What they hold.
    pub what: &'static str,
    /// Their bytes on the device.
    pub bytes: u64,
    /// Their debug names, under which [`Census`](crate::gpu::Census) counts them.
    #[serde(skip)]
    pub objects: &'static [&'static str],
}

/// What a plan takes: the samples, and the leaves that a frame refines, come on top.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// Colour passes that a frame may draw.
    pub passes: Vec<&'static str>,
    /// Buffers and images that are made before a frame.
    pub resources: Vec<Resource>,
    /// Bytes of all of them.
    pub bytes: u64,
}

impl Plan {
    /// What the plan of `scene` under `options` takes, by the images of the options' size.
    pub fn cost(&self, scene: &Scene, options: &Options) -> Cost {
        let geometry = &scene.geometry;
        let (vertices, faces) = (geometry.positions.len() as u64, geometry.faces.len() as u64);
        let pixels = u64::from(options.view.width) * u64::from(options.view.height);
        let way = options.method.visibility;
        let classes = match self.traces() {
            true => classes(scene, self.receivers),
            false => vec![Class::Occluder; scene.objects.len()],
        };
        let single_pass = self.traces() && way == VisibilityWay::SinglePass;

        let material = |object: &Object| &scene.materials[object.material as usize];
        let base = scene
            .objects
            .iter()
            .zip(&classes)
            .filter(|(object, class)| base::contains(**class, material(object), single_pass))
            .fold([0, 0], |[vertices, records], (object, _)| {
                let vertex = self.vertex_layout().bytes();
                [
                    vertices + object.vertices.len() as u64 * vertex,
                    records + (object.faces.len() * size_of::<GpuLeaf>()) as u64,
                ]
            });
        let texels = scene.materials.len() * MATERIAL_TEXELS as usize
            + self.targets.targets.len() * TARGET_TEXELS as usize;
        let table = buffer((texels * size_of::<Texel>()) as u64);
        let (textures, panorama) =
            (self.textures.bytes(scene, options.method.filter), bank::panorama_bytes(scene));
        let target = TargetDesc {
            width: options.view.width,
            height: options.view.height,
            halvings: 0,
            samples: options.method.msaa.samples(),
            depth: passes::depth_format(single_pass),
            is_plain: false,
        };
        let halved = if options.method.ss == Ss::One { None } else { target.halved() };

        let method = &options.method;
        let anti_aliases = method.has_sub_samples() && method.reconstruction == Reconstruction::Exact;
        let plain = TargetDesc { samples: 1, is_plain: true, ..target };

        let mut resources = vec![
            Resource {
                what: "image, its depth and its way to the host",
                bytes: halved.unwrap_or(target).bytes(),
                objects: &["color", "mean color", "multisampled color", "depth", "image staging"],
            },
            Resource {
                what: "plain picture, if some faces lie between pixels' centres",
                bytes: if self.traces() && anti_aliases { plain.bytes() } else { 0 },
                objects: &[],
            },
            Resource { what: "textures", bytes: textures, objects: &[bank::TEXTURES] },
            Resource { what: "panorama", bytes: panorama, objects: &[] },
            Resource { what: "materials and targets", bytes: table, objects: &["scene table"] },
            Resource {
                what: "vertices of faces drawn without samples",
                bytes: buffer(base[0]),
                objects: &["base vertices"],
            },
            Resource {
                what: "records of faces drawn without samples",
                bytes: buffer(base[1]),
                objects: &["base records"],
            },
            Resource {
                what: "staging of textures",
                bytes: bank::staging_bytes(textures + panorama),
                objects: &["texture uploads"],
            },
            Resource {
                what: "staging of leaves",
                bytes: passes::staging_bytes(self.traces(), base[0] + base[1] + table),
                objects: &["leaf uploads"],
            },
        ];
        if self.traces() && !single_pass {
            let masked = |object: &Object| matches!(material(object).alpha_mode, AlphaMode::Mask(_));
            let masked = scene.objects.iter().any(masked);
            let mask = if masked { vertices * size_of::<MaskVertex>() as u64 } else { 0 };
            let drawn: u64 = scene
                .objects
                .iter()
                .zip(&classes)
                .filter(|(object, class)| !material(object).is_veil(**class == Class::Vt))
                .map(|(object, _)| object.faces.len() as u64)
                .sum();
            let parts = [12 * vertices, 12 * faces, 4 * drawn, mask];
            let times = if way == VisibilityWay::Auto { 2 } else { 1 };
            resources.extend([
                Resource {
                    what: "ID buffer and its depth",
                    bytes: 8 * pixels * times,
                    objects: &["ID buffer", "ID buffer in place", "ID buffer depth"],
                },
                Resource {
                    what: "faces of the ID buffer",
                    bytes: parts.into_iter().map(buffer).sum::<u64>() * times,
                    objects: &[
                        "ID buffer positions",
                        "ID buffer faces",
                        "ID buffer entries",
                        "ID buffer mask vertices",
                    ],
                },
                Resource {
                    what: "staging of the ID buffer's faces",
                    bytes: face_draw::staging_bytes(parts.into_iter().sum()) * times,
                    objects: &["ID buffer uploads"],
                },
            ]);
        }
        resources.retain(|resource| resource.bytes > 0);
        Cost {
            passes: self.passes.iter().map(|pass| pass.name).collect(),
            bytes: resources.iter().map(|resource| resource.bytes).sum(),
            resources,
        }
    }
}

/// Bytes of a device buffer that holds `bytes`: none is empty.
fn buffer(bytes: u64) -> u64 {
    bytes.max(16)
}
