//! Where a primitive's vertices come to lie: morphed at the default weights, then skinned or placed by node.

use glam::{DAffine3, DMat3, DVec3, DVec4, Vec3};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::{Index, Node, Root, Skin};

use super::accessor::Reader;
use super::buffers::Buffers;
use super::nodes::Nodes;
use super::triangles::attribute;

/// A transform, and how it carries normals.
#[derive(Clone, Copy)]
pub struct Frame {
    /// Mesh space to world space.
    pub affine: DAffine3,
    /// The inverse transpose up to a positive factor: it exists for singular matrices, too.
    normals: DMat3,
    /// −1 if the transform mirrors.
    pub sign: f64,
}

impl Frame {
    fn new(affine: DAffine3) -> Self {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = affine.matrix3;
        let sign = if x.cross(y).dot(z) < 0.0 { -1.0 } else { 1.0 };
        let normals = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign;
        Self { affine, normals, sign }
    }

    /// Unit world normal; `None` for one without direction.
    pub fn normal(&self, normal: DVec3) -> Option<Vec3> {
        (self.normals * normal).try_normalize().map(DVec3::as_vec3)
    }

    /// Unit world tangent and its handedness; `None` for one without direction.
    pub fn tangent(&self, tangent: DVec4) -> Option<glam::Vec4> {
        let direction = (self.affine.matrix3 * tangent.truncate()).try_normalize()?.as_vec3();
        Some(direction.extend((tangent.w.signum() * self.sign) as f32))
    }
}

/// The vertices of one primitive under one node.
pub struct Vertices<'a> {
    positions: Reader<'a>,
    normals: Option<Reader<'a>>,
    tangents: Option<Reader<'a>>,
    targets: Vec<Target<'a>>,
    motion: Motion<'a>,
}

struct Target<'a> {
    weight: f64,
    positions: Option<Reader<'a>>,
    normals: Option<Reader<'a>>,
    tangents: Option<Reader<'a>>,
}

enum Motion<'a> {
    Rigid(Frame),
    Skinned { joints: &'a [DAffine3], influences: Vec<(Reader<'a>, Reader<'a>)> },
}

impl<'a> Vertices<'a> {
    /// The vertices of `primitive`, placed by `world`, or by `joints` if it is skinned.
    pub fn new(
        root: &Root,
        buffers: &'a Buffers,
        primitive: &Primitive,
        weights: &[f32],
        world: DAffine3,
        joints: Option<&'a [DAffine3]>,
    ) -> Option<Self> {
        let reader = |accessor| Reader::new(root, buffers, accessor);
        let read = |semantic| attribute(primitive, semantic).and_then(reader);
        let targets = primitive.targets.iter().flatten().zip(weights).filter(|(_, weight)| **weight != 0.0);
        let targets = targets.map(|(target, &weight)| Target {
            weight: f64::from(weight),
            positions: target.positions.and_then(reader),
            normals: target.normals.and_then(reader),
            tangents: target.tangents.and_then(reader),
        });
        let influences: Vec<_> = (0..)
            .map_while(|set| Some((read(Semantic::Joints(set))?, read(Semantic::Weights(set))?)))
            .collect();
        Some(Self {
            positions: read(Semantic::Positions)?,
            normals: read(Semantic::Normals),
            tangents: read(Semantic::Tangents),
            targets: targets.collect(),
            motion: match joints {
                Some(joints) if !influences.is_empty() => Motion::Skinned { joints, influences },
                _ => Motion::Rigid(Frame::new(world)),
            },
        })
    }

    /// Number of vertices.
    pub fn count(&self) -> usize {
        self.positions.count()
    }

    /// Whether the primitive brings normals.
    pub fn has_normals(&self) -> bool {
        self.normals.is_some()
    }

    /// Whether the primitive brings tangents that count: without normals they are to be ignored.
    pub fn has_tangents(&self) -> bool {
        self.normals.is_some() && self.tangents.is_some()
    }

    /// The transform of vertex `vertex`. Fails with the number of a joint that the skin does not have.
    pub fn frame(&self, vertex: usize) -> Result<Frame, u32> {
        let (joints, influences) = match &self.motion {
            Motion::Rigid(frame) => return Ok(*frame),
            Motion::Skinned { joints, influences } => (joints, influences),
        };
        let mut blend = DAffine3::ZERO;
        let mut total = 0.0;
        for (indices, weights) in influences {
            for (joint, weight) in indices.integers::<4>(vertex).into_iter().zip(weights.floats::<4>(vertex))
            {
                let matrix = joints.get(joint as usize).ok_or(joint)?;
                let weight = if weight.is_finite() { f64::from(weight.max(0.0)) } else { 0.0 };
                blend.matrix3 += matrix.matrix3 * weight;
                blend.translation += matrix.translation * weight;
                total += weight;
            }
        }
        Ok(Frame::new(if total > 0.0 {
            DAffine3 { matrix3: blend.matrix3 * total.recip(), translation: blend.translation / total }
        } else {
            joints[0]
        }))
    }

    /// World position.
    pub fn position(&self, vertex: usize, frame: &Frame) -> DVec3 {
        let mut local = vector(&self.positions, vertex);
        for target in &self.targets {
            local += target.positions.as_ref().map_or(DVec3::ZERO, |deltas| vector(deltas, vertex))
                * target.weight;
        }
        frame.affine.transform_point3(local)
    }

    /// Unit world normal; `None` where the file has none or one without direction.
    pub fn normal(&self, vertex: usize, frame: &Frame) -> Option<Vec3> {
        let mut local = vector(self.normals.as_ref()?, vertex);
        for target in &self.targets {
            local +=
                target.normals.as_ref().map_or(DVec3::ZERO, |deltas| vector(deltas, vertex)) * target.weight;
        }
        frame.normal(local)
    }

    /// Unit world tangent and handedness; `None` where the file has none or one without direction.
    pub fn tangent(&self, vertex: usize, frame: &Frame) -> Option<glam::Vec4> {
        let tangent = self.tangents.as_ref()?.floats::<4>(vertex).map(f64::from);
        let mut local = DVec4::from_array(tangent).truncate();
        for target in &self.targets {
            local +=
                target.tangents.as_ref().map_or(DVec3::ZERO, |deltas| vector(deltas, vertex)) * target.weight;
        }
        frame.tangent(local.extend(tangent[3]))
    }
}

fn vector(reader: &Reader, vertex: usize) -> DVec3 {
    Vec3::from_array(reader.floats(vertex)).as_dvec3()
}

/// The weights of a node's morph targets: its own, else those of its mesh, else zeros.
pub fn morph_weights<'a>(root: &'a Root, node: &'a Node) -> &'a [f32] {
    let mesh = node.mesh.map(|mesh| &root.meshes[mesh.value()]);
    node.weights.as_ref().or(mesh.and_then(|mesh| mesh.weights.as_ref())).map_or(&[], Vec::as_slice)
}

/// Matrices of a skin's joints as the nodes stand: world transform · inverse bind matrix (§3.7.3.3).
pub fn joint_matrices(root: &Root, buffers: &Buffers, nodes: &Nodes, skin: Index<Skin>) -> Vec<DAffine3> {
    let skin = &root.skins[skin.value()];
    let inverse_bind = skin.inverse_bind_matrices.and_then(|matrices| Reader::new(root, buffers, matrices));
    let joints = skin.joints.iter().enumerate();
    joints
        .map(|(index, joint)| {
            let world = nodes.world[joint.value()];
            let Some(matrices) = &inverse_bind else { return world };
            let m = matrices.floats::<16>(index).map(f64::from);
            let columns = [0, 4, 8, 12].map(|start| DVec3::new(m[start], m[start + 1], m[start + 2]));
            let matrix3 = DMat3::from_cols(columns[0], columns[1], columns[2]);
            world * DAffine3 { matrix3, translation: columns[3] }
        })
        .collect()
}
