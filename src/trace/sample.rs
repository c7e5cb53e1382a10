//! Samples: the specular paths that leave a mesh vertex, kept as texture coordinates (paper §4; design §4).
//!
//! No primary ray is traced: the path starts at the vertex. What it meets is kept as a list of nodes, each
//! with the identity of its path, so that the same path can be recognised in the samples of neighbouring
//! vertices and interpolated between them without ever looking at a texel.

use glam::{Vec2, Vec3, Vec4};

use super::cone::Filtering;
use super::optics::{self, BranchKind};
use super::pyramid::Pyramids;
use super::shade::{self, Local};
use super::{Appearance, Rays, Settings, Surface, Tracer};
use crate::scene::mesh::unit;
use crate::scene::patch::{ENVIRONMENT, TargetId, Targets};
use crate::scene::{Geometry, View};

/// What every sample is traced with.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// The scene and its bounding volume hierarchy.
    pub tracer: &'a Tracer<'a>,
    /// Patches and charts of the scene.
    pub targets: &'a Targets,
    /// Depth, shadows and cut-offs.
    pub settings: &'a Settings,
    /// The frame's view.
    pub view: &'a View,
    /// Mip levels of its textures, if they are used: for pixels, not for samples.
    pub pyramids: Option<&'a Pyramids>,
}

impl<'a> Context<'a> {
    /// How textures are filtered for pixels that are traced. Call it before parallel work, not in it: the first call makes mip
    /// levels on all cores (see [`Pyramids::filtering`]).
    pub fn filtering(&self) -> Option<Filtering<'a>> {
        self.pyramids.map(|pyramids| pyramids.filtering(self.tracer.scene(), self.view))
    }
}

/// Part of the way to the middle of its face from which the rays of a vertex on a flat surface start: where such surfaces meet,
/// walls of a room or a mirror and its frame, rays from the very edge would meet the other one at once.
const INWARD: f32 = 1.0 / 32768.0;

/// Cosine between the normals of a face's corners and its own from which it is flat.
const FLAT: f32 = 0.99999;

/// A mesh vertex as the tracer sees it.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Position relative to the scene's origin.
    pub position: Vec3,
    /// Shading normal, any length.
    pub normal: Vec3,
    /// Geometric normal on the side of the shading normal, any length.
    pub geometric: Vec3,
    /// Whether the surface is seen from behind, against its normals.
    pub back: bool,
    /// Both sets of texture coordinates.
    pub uv: [Vec2; 2],
    /// Linear vertex colour.
    pub color: Vec4,
    /// A face of the scene that the vertex lies on.
    pub face: u32,
}

/// The local component at the vertex itself: C_prim of Eq. 3.
#[derive(Debug, Clone, Copy, Default)]
pub struct Primary {
    /// Lights that are not hidden, a bit each.
    pub lit: u32,
    /// Local component under those lights.
    pub local: Local,
    /// Linear texel of the base colour.
    pub texel: Vec3,
    /// Attenuation of the reflected and of the transmitted branch: α_r and α_t of Eq. 3.
    pub attenuation: [Vec3; 2],
}

/// What a specular path meets at one of its hits.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// Identity of the path up to the last branch: the decisions taken and the specular targets passed.
    pub path: u32,
    /// Where the path meets its end.
    pub target: TargetId,
    /// The branch that it took at the vertex.
    pub first: BranchKind,
    /// Number of branches from the vertex to here, at least 1.
    pub bounces: u8,
    /// Whether bodies on the way absorb: `throughput` is less than the attenuations' product, and no fragment can tell.
    pub absorbed: bool,
    /// Lights that are not hidden from the target, a bit each.
    pub lit: u32,
    /// Coordinates of the base colour texture at the target, texture transform included.
    pub uv: Vec2,
    /// Product of the attenuations along the path, and of what the bodies that it runs through let pass.
    pub throughput: Vec3,
    /// Local component at the target, base colour texture kept apart: C_refl or C_trans of Eq. 3.
    pub local: Local,
    /// What shadows take from it.
    pub shadowed: Local,
    /// Linear base colour texel there.
    pub texel: Vec3,
    /// Origin of the last segment.
    pub origin: Vec3,
    /// Unit direction of the last segment.
    pub direction: Vec3,
    /// Length of the last segment; infinite for the environment.
    pub length: f32,
    /// Length of the path from the eye to the last branch.
    pub to_branch: f32,
    /// Length of the path from the vertex to the target.
    pub after: f32,
}

impl Node {
    /// Whether a fragment can follow the path by itself: one bounce, and nothing absorbs.
    pub fn is_followed(&self) -> bool {
        self.bounces == 1 && !self.absorbed
    }

    /// Whether its target shows nothing.
    pub fn is_dark(&self) -> bool {
        !shows(self.local)
    }

    /// Radiance that reaches the eye by this node.
    pub fn radiance(&self) -> Vec3 {
        self.throughput * self.local.radiance(self.texel)
    }
}

/// Traces the sample of one vertex, appending its nodes in depth-first order, reflection first.
pub fn trace(context: &Context, start: &Start, nodes: &mut Vec<Node>, rays: &mut Rays) -> Primary {
    let direction = context.view.direction_to(start.position);
    let from_eye = context.view.distance_to(start.position);
    trace_surface(context, &start.surface(context.tracer), direction, from_eye, nodes, rays)
}

impl Start {
    /// The vertex as a surface that a view ray arrives at.
    pub fn surface(&self, tracer: &Tracer) -> Surface {
        let scene = tracer.scene();
        let object = scene.geometry.face_objects[self.face as usize];
        let sign = if self.back { -1.0 } else { 1.0 };
        let geometric = unit(self.geometric).unwrap_or(Vec3::Y) * sign;
        let Geometry { faces, normals, .. } = &scene.geometry;
        let faced = geometric * sign;
        let is_flat = faces[self.face as usize].iter().all(|&v| normals[v as usize].dot(faced) > FLAT);
        let inward = if is_flat {
            let middle = scene.geometry.corners(self.face).into_iter().sum::<Vec3>() / 3.0;
            (middle - self.position) * INWARD
        } else {
            Vec3::ZERO
        };
        Surface {
            face: self.face,
            object,
            material: scene.objects[object as usize].material,
            vt: scene.objects[object as usize].vt,
            outside: !self.back,
            position: self.position + inward,
            ng: geometric,
            n: self.normal.normalize_or(faced) * sign,
            uvs: self.uv,
            color: self.color,
            offset: tracer.record(self.face).offset,
        }
    }
}

/// As [`trace`], from a point of a face instead of a mesh vertex.
pub fn trace_surface(
    context: &Context,
    surface: &Surface,
    direction: Vec3,
    from_eye: f32,
    nodes: &mut Vec<Node>,
    rays: &mut Rays,
) -> Primary {
    let scene = context.tracer.scene();
    let appearance = Appearance::new(scene, surface);
    let lit = lights(context, surface, &appearance, 0, rays);
    let mut primary = Primary {
        lit,
        local: shade::local(scene, surface, &appearance, direction, lit),
        texel: appearance.base_texel,
        attenuation: [Vec3::ZERO; 2],
    };
    if surface.vt {
        let material = &scene.materials[surface.material as usize];
        for branch in optics::branches(context.settings, material, &appearance, surface, direction)
            .into_iter()
            .flatten()
        {
            primary.attenuation[branch.kind.index()] = branch.attenuation;
        }
        let start = Path {
            identity: 0,
            first: None,
            bounces: 0,
            absorbed: false,
            throughput: Vec3::ONE,
            from_eye,
            after: 0.0,
        };
        Walk { context, nodes, rays }.branch(surface, &appearance, direction, start);
    }
    primary
}

/// Lights that are not hidden from a vertex, a bit each: [`Primary::lit`] alone.
pub fn lights_at(context: &Context, start: &Start, rays: &mut Rays) -> u32 {
    let surface = start.surface(context.tracer);
    let appearance = Appearance::new(context.tracer.scene(), &surface);
    lights(context, &surface, &appearance, 0, rays)
}

fn lights(
    context: &Context,
    surface: &Surface,
    appearance: &Appearance,
    bounces: u32,
    rays: &mut Rays,
) -> u32 {
    if context.settings.shadows.apply(surface.vt, bounces) {
        shade::visible_lights(context.tracer, surface, appearance, rays)
    } else {
        shade::ALL_LIT
    }
}

/// The path so far, as it arrives at a specular surface.
#[derive(Clone, Copy)]
struct Path {
    identity: u32,
    first: Option<BranchKind>,
    bounces: u8,
    absorbed: bool,
    throughput: Vec3,
    from_eye: f32,
    after: f32,
}

struct Walk<'w, 'a> {
    context: &'w Context<'a>,
    nodes: &'w mut Vec<Node>,
    rays: &'w mut Rays,
}

impl Walk<'_, '_> {
    fn branch(&mut self, surface: &Surface, appearance: &Appearance, direction: Vec3, path: Path) {
        let settings = self.context.settings;
        if u32::from(path.bounces) >= settings.depth {
            return;
        }
        let material = &self.context.tracer.scene().materials[surface.material as usize];
        let branches = optics::branches(settings, material, appearance, surface, direction);
        for branch in branches.into_iter().flatten() {
            let throughput = path.throughput * branch.attenuation;
            if throughput.max_element() < settings.min_throughput {
                continue;
            }
            match branch.kind {
                BranchKind::Reflect => self.rays.reflected += 1,
                BranchKind::Refract => self.rays.transmitted += 1,
            }
            let path = Path {
                identity: mix(path.identity, 1 + branch.kind.index() as u32),
                first: path.first.or(Some(branch.kind)),
                bounces: path.bounces + 1,
                throughput,
                ..path
            };
            self.follow(&branch, path);
        }
    }

    fn follow(&mut self, branch: &optics::Branch, mut path: Path) {
        let tracer = self.context.tracer;
        let scene = tracer.scene();
        let mut node = Node {
            path: path.identity,
            target: ENVIRONMENT,
            first: path.first.unwrap_or(branch.kind),
            bounces: path.bounces,
            absorbed: path.absorbed,
            lit: shade::ALL_LIT,
            uv: Vec2::ZERO,
            throughput: path.throughput,
            local: Local::default(),
            shadowed: Local::default(),
            texel: Vec3::ONE,
            origin: branch.origin,
            direction: branch.direction,
            length: f32::INFINITY,
            to_branch: path.from_eye,
            after: f32::INFINITY,
        };
        let Some(hit) = tracer.closest(branch.origin, branch.direction) else {
            let transmittance = branch.transmittance(None);
            node.throughput *= transmittance;
            node.absorbed |= transmittance != Vec3::ONE;
            node.local.added = shade::background(scene, branch.direction);
            self.push(node, false);
            return;
        };
        path.from_eye += hit.t;
        path.after += hit.t;
        let surface = Surface::new(tracer, hit.face, hit.u, hit.v, branch.direction);
        let transmittance = branch.transmittance(Some(surface.position));
        path.throughput *= transmittance;
        path.absorbed |= transmittance != Vec3::ONE;
        let appearance = Appearance::new(scene, &surface);
        node.target = self.context.targets.of(hit.face);
        node.lit = lights(self.context, &surface, &appearance, u32::from(path.bounces), self.rays);
        node.local = shade::local(scene, &surface, &appearance, branch.direction, node.lit);
        if node.lit != shade::ALL_LIT {
            let lit_by_all = shade::local(scene, &surface, &appearance, branch.direction, shade::ALL_LIT);
            node.shadowed = lit_by_all - node.local;
        }
        node.texel = appearance.base_texel;
        node.throughput = path.throughput;
        node.absorbed = path.absorbed;
        node.length = hit.t;
        node.after = path.after;
        if let Some(slot) = &scene.materials[surface.material as usize].base_color_texture {
            node.uv = slot.transform(surface.uvs[usize::from(slot.uv_set)]);
        }
        let target = node.target;
        self.push(node, scene.materials[surface.material as usize].emissive_texture.is_some());
        if surface.vt {
            path.identity = mix(path.identity, target << 1 | u32::from(surface.outside));
            self.branch(&surface, &appearance, branch.direction, path);
        }
    }

    /// Keeps a node that shows, or whose target would elsewhere: where it is in full shadow, or a texture that `glows` is black,
    /// its path must still match that of its neighbours. After one bounce also one that sees nothing, or what is dark:
    /// something else may stand between it and its neighbours.
    fn push(&mut self, node: Node, glows: bool) {
        if shows(node.local) || shows(node.shadowed) || node.bounces == 1 || glows {
            self.nodes.push(node);
        }
    }
}

fn shows(local: Local) -> bool {
    (local.textured + local.added).max_element() > 0.0
}

/// Folds `value` into a path's identity (the finaliser of MurmurHash3 over the sum).
fn mix(identity: u32, value: u32) -> u32 {
    let mut h =
        identity.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64) ^ value.wrapping_mul(0xcc9e_2d51);
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^ h >> 16
}
