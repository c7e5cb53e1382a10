//! Loads glTF 2.0 files (.gltf, .glb) into a flat, valid [`Scene`].
//!
//! The `gltf` crate supplies the types of the JSON. Everything that reads through an index, an offset or a
//! URI of the file is checked here first, because the crate's own readers trust the file (they panic on a
//! wrong component type, recurse along node cycles and open absolute paths). What is broken where it
//! matters is refused by name; what is harmless is repaired and noted in [`Scene::notes`].
//!
//! The order is that of [`load_slice`]'s body: bytes, JSON, references, buffers, world transforms,
//! materials in use, faces, images in use.

mod accessor;
mod buffers;
mod cameras;
mod container;
mod copies;
mod deform;
mod document;
mod images;
mod lights;
mod materials;
mod mesh;
mod nodes;
mod notes;
mod opaque;
mod piece;
mod tangents;
mod textures;
mod triangles;
mod unread;
mod uri;
mod validate;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use super::{Background, Scene};
use crate::constants::DEFAULT_AMBIENT;
use crate::error::{Error, Result};
use document::Document;
use notes::Notes;

/// How much of a file may be loaded, and which of its scenes.
///
/// The counts are checked against the file's own figures before memory is taken, so a small file that
/// multiplies itself (instances, compressed images) is refused early.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limits {
    /// Triangles after instancing; morph targets in use count as often again.
    pub max_triangles: u64,
    /// Bytes of images decoded to RGBA8, and what the decoder needs beside them.
    pub max_texture_bytes: u64,
    /// Nodes of the file.
    pub max_nodes: u64,
    /// Bytes read from disk: the file itself, its buffers and its images together.
    pub max_file_bytes: u64,
    /// Index of the scene to load; the file's default scene, else its first, if `None`.
    pub scene: Option<usize>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_triangles: 20_000_000,
            max_texture_bytes: 2 << 30,
            max_nodes: 1_000_000,
            max_file_bytes: 2 << 30,
            scene: None,
        }
    }
}

/// Loads the glTF file at `path` with the buffers and images that lie in its folder.
///
/// No object is specular yet, and a file without lights is dark: [`Options::load`](crate::options::Options::load) sees to
/// both.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Scene`] if it is broken, needs an unsupported
/// extension, exceeds a limit, refers to files outside its folder, or has nothing to draw.
pub fn load(path: &Path, limits: &Limits) -> Result<Scene> {
    let bytes = container::read_file(path, limits.max_file_bytes)?;
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    load_slice(&bytes, Some(folder), path, limits)
}

/// Files that the glTF file at `path` refers to, with whatever it can be read for: those that [`load`] would read too.
pub fn files_beside(path: &Path, limits: &Limits) -> Vec<PathBuf> {
    let Ok(bytes) = container::read_file(path, limits.max_file_bytes) else { return Vec::new() };
    let json = container::split(&bytes, path, &Notes::default()).map(|(json, _)| json).unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new(""));
    let uris = document::uris(json);
    let relative = uris.iter().filter_map(|uri| uri::relative_path_of(uri));
    relative.map(|relative| folder.join(relative)).collect()
}

/// Loads glTF from memory.
///
/// `folder` is where relative URIs are looked up; without one only data URIs and the binary chunk are
/// read. `name` stands for the file in messages, and its stem names the scene.
///
/// # Errors
/// As for [`load`].
pub fn load_slice(bytes: &[u8], folder: Option<&Path>, name: &Path, limits: &Limits) -> Result<Scene> {
    // The last net under third-party decoders. No input is known to reach it, and the tests hold that the
    // traps of old do not.
    catch_unwind(AssertUnwindSafe(|| read(bytes, folder, name, limits))).unwrap_or_else(|_| {
        Err(Error::scene(name, "file", "internal error in the glTF reader; please report this file"))
    })
}

fn read(bytes: &[u8], folder: Option<&Path>, file: &Path, limits: &Limits) -> Result<Scene> {
    let notes = Notes::default();
    let (json, bin) = container::split(bytes, file, &notes)?;
    let document = Document::parse(json, file, limits, &notes)?;
    validate::structure(&document, file, &notes)?;
    let resolver = uri::Resolver::new(folder, limits.max_file_bytes.saturating_sub(bytes.len() as u64));
    let buffers = buffers::Buffers::load(&document.root, bin, &resolver, file)?;
    validate::contents(&document, &buffers, file, limits)?;

    let nodes = nodes::Nodes::resolve(&document, limits.scene, file, &notes)?;
    let parts = mesh::Parts::count(&document, &nodes, file, limits, &notes)?;
    let mut textures = textures::Textures::default();
    let (materials, material_of) = materials::in_use(&document, &parts, &mut textures, file, &notes)?;
    let reading =
        mesh::Reading { root: &document.root, buffers: &buffers, nodes: &nodes, file, notes: &notes };
    let mut assembly = mesh::assemble(&reading, &parts, &materials, &material_of)?;
    if assembly.objects.is_empty() && !document.root.scenes.is_empty() {
        return Err(Error::scene(file, "scene", parts.nothing_to_draw(assembly.dropped)));
    }
    for (object, node) in assembly.objects.iter_mut().zip(&assembly.nodes) {
        let own = nodes::vt_extra(&document.root.nodes[*node].extras);
        object.vt_extra = own.or(materials[object.material as usize].vt_extra);
    }
    copies::drop_copies(&mut assembly, &materials, &notes);
    let origin = assembly.origin;
    let cameras = cameras::placed(&document, &nodes, origin, &notes);
    let lights = lights::placed(&document, &nodes, origin, &notes);
    let images_in_use = textures.images();
    let unread_bytes = images::check_unused(&document.root, images_in_use, &buffers, &resolver, file)?;
    let images = images::load(&document.root, images_in_use, &buffers, &resolver, file, limits)?;
    let used = unread::Used {
        meshes: parts.meshes(),
        materials: material_of.keys().flatten().copied().collect(),
        textures: textures.in_file().clone(),
        images: images_in_use.iter().copied().collect(),
    };

    let mut scene = Scene {
        name: file.file_stem().map_or_else(|| "scene".into(), |stem| stem.to_string_lossy().into_owned()),
        origin,
        geometry: assembly.geometry,
        objects: assembly.objects,
        materials,
        textures: textures.into_list(),
        images,
        ambient: if lights.is_empty() { DEFAULT_AMBIENT } else { 0.0 },
        lights,
        cameras,
        background: Background::default(),
        unread: unread::list(&document.root, &used, unread_bytes),
        notes: Vec::new(),
    };
    opaque::settle(&mut scene, &notes);
    scene.notes = notes.into_lines();
    Ok(scene)
}
