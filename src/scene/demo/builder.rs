//! Builds a scene in code, piece by piece, and checks what it is given.

use std::path::Path;

use glam::{Affine2, DVec3, Vec2, Vec3, Vec4};

use super::Mesh;
use crate::error::{Error, Result};
use crate::scene::classify::{VtRules, classify};
use crate::scene::mesh::MAX_REACH;
use crate::scene::{
    Background, Camera, Geometry, Image, Light, LightKind, Material, Object, Sampler, Scene, Texture,
    TextureSlot,
};

/// A material that a [`SceneBuilder`] has taken in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MaterialId(u32);

/// A scene in the making.
///
/// ```
/// use glam::Vec3;
/// use vertex_tracing::scene::demo::{SceneBuilder, chrome, matte, shape, texture};
/// use vertex_tracing::scene::Camera;
///
/// let mut scene = SceneBuilder::new("ball");
/// let board = scene.texture(texture::chessboard(256));
/// let floor = scene.material(matte("floor").textured(board));
/// let metal = scene.material(chrome("metal", Vec3::splat(0.8)));
/// scene.mesh("floor", shape::plane(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0, 2.0), floor);
/// scene.mesh("ball", shape::sphere(Vec3::Y * 0.5, 0.5, 3), metal);
/// scene.point_light(Vec3::new(2.0, 3.0, 2.0), Vec3::splat(30.0));
/// scene.camera(Camera::look_at(Vec3::new(0.0, 1.0, 3.0), Vec3::Y * 0.5, 0.7));
/// let scene = scene.build()?;
/// assert_eq!(scene.vt_faces(), 1280);
/// # Ok::<(), vertex_tracing::error::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct SceneBuilder {
    scene: Scene,
    problem: Option<(String, String)>,
}

impl SceneBuilder {
    /// An empty scene with a black background.
    pub fn new(name: impl Into<String>) -> Self {
        let scene = Scene {
            name: name.into(),
            origin: DVec3::ZERO,
            geometry: Geometry::default(),
            objects: Vec::new(),
            materials: Vec::new(),
            textures: Vec::new(),
            images: Vec::new(),
            lights: Vec::new(),
            cameras: Vec::new(),
            background: Background::default(),
            ambient: 0.0,
            unread: Vec::new(),
            notes: Vec::new(),
        };
        Self { scene, problem: None }
    }

    /// Takes in an sRGB colour image, repeated and filtered bilinearly without mip levels: as the reference
    /// tracer filters, so that a picture's error is the method's alone.
    pub fn texture(&mut self, image: Image) -> TextureSlot {
        self.sampled_texture(image, Sampler { mip: None, ..Sampler::default() }, true)
    }

    /// Takes in an image with its sampler; `srgb` as in [`Texture::srgb`].
    pub fn sampled_texture(&mut self, image: Image, sampler: Sampler, srgb: bool) -> TextureSlot {
        let texels = u64::from(image.width) * u64::from(image.height);
        if texels == 0 || image.rgba.len() as u64 != 4 * texels {
            self.refuse(format!("image {}", image.name), "its size and its bytes do not agree");
        }
        self.scene.images.push(image);
        let image = self.scene.images.len() as u32 - 1;
        self.scene.textures.push(Texture { image, sampler, srgb });
        let texture = self.scene.textures.len() as u32 - 1;
        TextureSlot { texture, uv_set: 0, transform: Affine2::IDENTITY }
    }

    /// Takes in a material.
    pub fn material(&mut self, material: Material) -> MaterialId {
        let slots = [
            material.base_color_texture,
            material.metallic_roughness_texture,
            material.normal_texture,
            material.emissive_texture,
            material.specular_texture,
            material.specular_color_texture,
            material.transmission_texture,
        ];
        if slots.iter().flatten().any(|slot| slot.texture as usize >= self.scene.textures.len()) {
            self.refuse(format!("material {}", material.name), "its texture is not of this builder");
        }
        self.scene.materials.push(material);
        MaterialId(self.scene.materials.len() as u32 - 1)
    }

    /// Adds an object: a mesh of one material.
    pub fn mesh(&mut self, name: impl Into<String>, mesh: Mesh, material: MaterialId) -> &mut Self {
        let name = name.into();
        match check(&mesh) {
            _ if material.0 as usize >= self.scene.materials.len() => {
                self.refuse(format!("mesh {name}"), "its material is not of this builder");
            }
            Err(problem) => self.refuse(format!("mesh {name}"), problem),
            Ok(()) => self.append(name, mesh, material),
        }
        self
    }

    /// Adds a light.
    pub fn light(&mut self, light: Light) -> &mut Self {
        self.scene.lights.push(light);
        self
    }

    /// Adds a point light without a range; `intensity` in candela.
    pub fn point_light(&mut self, position: Vec3, intensity: Vec3) -> &mut Self {
        let name = format!("light {}", self.scene.lights.len());
        self.light(Light { name, kind: LightKind::Point { position, range: f32::INFINITY }, intensity })
    }

    /// Adds a camera; the first one is the default.
    pub fn camera(&mut self, camera: Camera) -> &mut Self {
        self.scene.cameras.push(camera);
        self
    }

    /// Sets what a ray meets that leaves the scene.
    pub fn background(&mut self, background: Background) -> &mut Self {
        self.scene.background = background;
        self
    }

    /// The finished scene, its specular objects marked by [`classify`] with default rules, and its origin
    /// amid what lies far from zero ([`Scene::recentre`]).
    ///
    /// # Errors
    /// [`Error::Scene`] for the first image, material or mesh that was not valid: sizes that do not agree, an
    /// index out of range, a number that is not finite, a zero normal, a degenerate face.
    pub fn build(mut self) -> Result<Scene> {
        if let Some((object, problem)) = self.problem {
            return Err(Error::scene(Path::new(&self.scene.name), object, problem));
        }
        self.scene.recentre();
        classify(&mut self.scene, &VtRules::default())?;
        Ok(self.scene)
    }

    fn refuse(&mut self, object: String, problem: impl Into<String>) {
        self.problem.get_or_insert((object, problem.into()));
    }

    fn append(&mut self, name: String, mesh: Mesh, material: MaterialId) {
        let Scene { geometry, objects, .. } = &mut self.scene;
        let object = objects.len() as u32;
        let (vertex, face) = (geometry.positions.len() as u32, geometry.faces.len() as u32);
        geometry.positions.extend_from_slice(&mesh.positions);
        geometry.normals.extend(mesh.normals.iter().map(|normal| normal.normalize()));
        if !mesh.uvs.is_empty() {
            geometry.uvs[0].resize(vertex as usize, Vec2::ZERO);
            geometry.uvs[0].extend_from_slice(&mesh.uvs);
        } else if !geometry.uvs[0].is_empty() {
            geometry.uvs[0].resize(geometry.positions.len(), Vec2::ZERO);
        }
        geometry.faces.extend(mesh.faces.iter().map(|corners| corners.map(|v| vertex + v)));
        geometry.face_objects.resize(geometry.faces.len(), object);
        objects.push(Object {
            mesh_name: Some(name.clone()),
            name,
            material: material.0,
            faces: face..geometry.faces.len() as u32,
            vertices: vertex..geometry.positions.len() as u32,
            vt_extra: None,
            vt: false,
        });
    }
}

/// What a [`Scene`] promises of every mesh.
fn check(mesh: &Mesh) -> Result<(), String> {
    let count = mesh.positions.len();
    if mesh.normals.len() != count || !(mesh.uvs.is_empty() || mesh.uvs.len() == count) {
        return Err("positions, normals and texture coordinates differ in number".into());
    }
    if let Some(v) = mesh.positions.iter().position(|position| !position.is_finite()) {
        return Err(format!("position {v} is not finite"));
    }
    if let Some(v) = mesh.positions.iter().position(|position| position.abs().max_element() > MAX_REACH) {
        return Err(format!("position {v} is not within {MAX_REACH:e} units of the origin"));
    }
    if let Some(v) = mesh.normals.iter().position(|normal| normal.try_normalize().is_none()) {
        return Err(format!("normal {v} is zero or not finite"));
    }
    if let Some(v) = mesh.uvs.iter().position(|uv| !uv.is_finite()) {
        return Err(format!("texture coordinate {v} is not finite"));
    }
    for (face, corners) in mesh.faces.iter().enumerate() {
        if corners.iter().any(|&v| v as usize >= count) {
            return Err(format!("face {face} names a vertex that is not there"));
        }
        let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
        if (b - a).cross(c - a).try_normalize().is_none() {
            return Err(format!("face {face} is degenerate"));
        }
    }
    Ok(())
}

/// A diffuse material of white reflectance without any gloss.
pub fn matte(name: impl Into<String>) -> Material {
    Material { name: name.into(), specular: 0.0, ..Material::default() }
}

/// A perfectly smooth metal that reflects `k_r` (linear RGB, 0 to 1; paper Eq. 1) and nothing diffuse.
pub fn chrome(name: impl Into<String>, k_r: Vec3) -> Material {
    Material {
        name: name.into(),
        base_color: k_r.extend(1.0),
        metallic: 1.0,
        roughness: 0.0,
        ..Material::default()
    }
}

/// Clear glass with the index of refraction `ior`: a thin wall unless the material is given a volume.
pub fn glass(name: impl Into<String>, ior: f32) -> Material {
    Material { name: name.into(), roughness: 0.0, transmission: 1.0, ior, ..Material::default() }
}

impl Material {
    /// The material with a base-colour texture.
    pub fn textured(self, texture: TextureSlot) -> Self {
        Self { base_color_texture: Some(texture), ..self }
    }

    /// The material with an opaque base colour, linear RGB.
    pub fn colored(self, rgb: Vec3) -> Self {
        Self { base_color: Vec4::from((rgb, 1.0)), ..self }
    }
}
