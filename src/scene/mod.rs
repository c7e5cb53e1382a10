//! What is drawn: faces, materials, textures, lights and cameras, in one flat world-space form.
//!
//! A [`Scene`] is only ever built valid: [`gltf::load`] refuses or repairs what is broken and says so in
//! [`Scene::notes`]. Everything downstream may index without checks.

pub mod camera;
pub mod classify;
pub mod demo;
pub mod environment;
pub mod frustum;
pub mod gltf;
pub mod light;
pub mod material;
pub mod mesh;
pub mod patch;
pub mod texture;
pub mod topology;

pub use camera::{Camera, Projection, View};
pub use light::{Light, LightKind};
pub use material::{AlphaMode, Material, TextureSlot, Volume};
pub use mesh::{Geometry, Object};
pub use texture::{Environment, Filter, Image, Sampler, Texture, Wrap};

use glam::{DVec3, Vec3};

/// A whole scene in world space, valid by construction.
///
/// Node hierarchies are flattened: every instance of a mesh primitive is an [`Object`] with faces of its
/// own. Positions are `f32` relative to [`Scene::origin`], so that a scene far from the world's origin
/// keeps its precision.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The file's stem or the demo's name.
    pub name: String,
    /// World position of the coordinate origin that every `f32` position below is relative to.
    pub origin: DVec3,
    /// Vertices and faces of all objects.
    pub geometry: Geometry,
    /// Instances of mesh primitives, each a contiguous range of faces.
    pub objects: Vec<Object>,
    /// Materials; every object's index is in range.
    pub materials: Vec<Material>,
    /// Pairs of image and sampler that materials refer to.
    pub textures: Vec<Texture>,
    /// Decoded images that textures refer to.
    pub images: Vec<Image>,
    /// Punctual lights. Empty if the file has none, until [`Scene::add_default_lights`].
    pub lights: Vec<Light>,
    /// Cameras of the file, in node order.
    pub cameras: Vec<Camera>,
    /// What a ray that leaves the scene meets.
    pub background: Background,
    /// Ambient radiance, as a factor of base colour; 0 unless the file has no lights.
    pub ambient: f32,
    /// What the file holds besides; none of it was read or decoded.
    pub unread: Vec<Unread>,
    /// What was ignored, repaired or replaced while loading, one line each.
    pub notes: Vec<String>,
}

/// Objects of a file that its scene does not show.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unread {
    /// Their kind, in the plural.
    pub what: &'static str,
    /// Their number.
    pub count: usize,
    /// The number of all of the kind in the file.
    pub of: usize,
    /// Bytes that their positions, normals and faces, or their texels would take, at least.
    pub bytes: u64,
    /// Why they are not shown.
    pub why: &'static str,
}

/// Radiance of a ray that leaves the scene.
#[derive(Debug, Clone)]
pub enum Background {
    /// The same linear radiance in all directions.
    Color(Vec3),
    /// A latitude–longitude panorama at infinity.
    Environment(Environment),
}

impl Default for Background {
    fn default() -> Self {
        Self::Color(Vec3::ZERO)
    }
}

impl Scene {
    /// Smallest and largest corner of the box around all faces; zeros for a scene without faces.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let mut bounds = self.geometry.faces.iter().flatten().map(|&v| self.geometry.positions[v as usize]);
        let Some(first) = bounds.next() else { return (Vec3::ZERO, Vec3::ZERO) };
        bounds.fold((first, first), |(low, high), p| (low.min(p), high.max(p)))
    }

    /// Moves [`Scene::origin`] to the centre of the faces if they lie so far from it that their positions waste
    /// precision; the scene stays where it is in the world.
    ///
    /// Differences of numbers within a factor of two are exact, so that nothing is rounded on the way.
    pub fn recentre(&mut self) {
        let (low, high) = self.bounds();
        let (centre, extent) = ((low + high) * 0.5, (high - low).max_element());
        if !centre.is_finite() || centre.abs().max_element() <= extent {
            return;
        }
        self.origin += centre.as_dvec3();
        self.geometry.positions.iter_mut().for_each(|position| *position -= centre);
        self.cameras.iter_mut().for_each(|camera| camera.position -= centre);
        for light in &mut self.lights {
            match &mut light.kind {
                LightKind::Point { position, .. } | LightKind::Spot { position, .. } => *position -= centre,
                LightKind::Directional { .. } => {}
            }
        }
    }

    /// The material of face `face`.
    pub fn face_material(&self, face: u32) -> &Material {
        let object = self.geometry.face_objects[face as usize];
        &self.materials[self.objects[object as usize].material as usize]
    }

    /// Whether face `face` belongs to a specular VT object (paper §4).
    pub fn is_vt(&self, face: u32) -> bool {
        self.objects[self.geometry.face_objects[face as usize] as usize].vt
    }

    /// Whether what lies behind `object` shows in part where it is drawn, not traced.
    pub fn is_veil(&self, object: &Object) -> bool {
        self.materials[object.material as usize].is_veil(object.vt)
    }

    /// By material: whether a specular VT object has it.
    pub fn specular_materials(&self) -> Vec<bool> {
        let mut specular = vec![false; self.materials.len()];
        self.objects
            .iter()
            .filter(|object| object.vt)
            .for_each(|object| specular[object.material as usize] = true);
        specular
    }

    /// Number of faces that belong to specular VT objects.
    pub fn vt_faces(&self) -> usize {
        self.objects.iter().filter(|object| object.vt).map(|object| object.faces.len()).sum()
    }
}
