//! Checks every reference, range and format of a file before anything is read through it.

use std::path::Path;

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::{Checked, Error as Fault, Validate};
use gltf::json::{Accessor, Index, Root};

use super::Limits;
use super::accessor::{Format, Reader};
use super::buffers::Buffers;
use super::document::Document;
use super::notes::Notes;
use super::triangles::attribute;
use crate::error::{Error, Result};

/// Checks all that can be told without the buffers.
pub fn structure(document: &Document, file: &Path, notes: &Notes) -> Result<()> {
    let root = &document.root;
    let refuse = |(object, problem): (String, String)| Error::scene(file, object, problem);
    positions_exist(root).map_err(refuse)?;
    crate_rules(root, notes).map_err(refuse)?;
    node_tree(root).map_err(refuse)?;
    for (index, view) in root.buffer_views.iter().enumerate() {
        buffer_view(root, view).map_err(|problem| refuse((format!("bufferViews[{index}]"), problem)))?;
    }
    for (index, accessor) in root.accessors.iter().enumerate() {
        accessor_ranges(root, accessor)
            .map_err(|problem| refuse((format!("accessors[{index}]"), problem)))?;
    }
    for (index, camera) in root.cameras.iter().enumerate() {
        camera_lens(camera).map_err(|problem| refuse((format!("cameras[{index}]"), problem)))?;
    }
    for (index, image) in root.images.iter().enumerate() {
        if image.uri.is_some() == image.buffer_view.is_some() {
            let problem = "needs either a uri or a bufferView".to_string();
            return Err(refuse((format!("images[{index}]"), problem)));
        }
    }
    for (index, skin) in root.skins.iter().enumerate() {
        skin_matrices(root, skin).map_err(|problem| refuse((format!("skins[{index}]"), problem)))?;
    }
    each_primitive(root, |mesh, number, primitive| {
        attributes(document, primitive).map_err(|(part, problem)| {
            refuse((format!("meshes[{mesh}].primitives[{number}].{part}"), problem))
        })
    })
}

/// Checks what the buffers hold: sparse indices ascend, and indices name vertices that are there.
///
/// Both are read once for each accessor, and no more of them than the triangle limit admits: a primitive
/// that is drawn has its own indices checked again as they are read.
pub fn contents(document: &Document, buffers: &Buffers, file: &Path, limits: &Limits) -> Result<()> {
    let root = &document.root;
    let mut budget = limits.max_triangles.saturating_mul(3);
    for index in 0..root.accessors.len() {
        let Some(sparse) = &root.accessors[index].sparse else { continue };
        let refuse = |problem: String| Error::scene(file, format!("accessors[{index}].sparse"), problem);
        budget = budget
            .checked_sub(sparse.count.0)
            .ok_or_else(|| refuse("too many sparse elements in all; raise --max-triangles N".into()))?;
        let reader = Reader::new(root, buffers, Index::new(index as u32));
        if let Some(position) = reader.and_then(|reader| reader.misplaced_sparse_index()) {
            return Err(refuse(format!("index {position} does not ascend, or lies past the end")));
        }
    }
    let mut highest: Vec<Option<u32>> = vec![None; root.accessors.len()];
    each_primitive(root, |mesh, number, primitive| {
        let positions = attribute(primitive, Semantic::Positions);
        let (Some(indices), Some(positions)) = (primitive.indices, positions) else { return Ok(()) };
        let count = root.accessors[indices.value()].count.0;
        if highest[indices.value()].is_none() && count > 0 && count <= budget {
            budget -= count;
            let reader = Reader::new(root, buffers, indices);
            highest[indices.value()] = reader.and_then(|reader| {
                (0..reader.count()).map(|position| reader.integers::<1>(position)[0]).max()
            });
        }
        let vertices = root.accessors[positions.value()].count.0;
        match highest[indices.value()] {
            Some(index) if u64::from(index) >= vertices => {
                let object = format!("meshes[{mesh}].primitives[{number}].indices");
                Err(Error::scene(file, object, format!("index {index}, but there are {vertices} vertices")))
            }
            _ => Ok(()),
        }
    })
}

type Refusal = (String, String);

fn each_primitive(root: &Root, mut check: impl FnMut(usize, usize, &Primitive) -> Result<()>) -> Result<()> {
    root.meshes.iter().enumerate().try_for_each(|(mesh, content)| {
        content
            .primitives
            .iter()
            .enumerate()
            .try_for_each(|(number, primitive)| check(mesh, number, primitive))
    })
}

/// The crate's validation indexes with this number before it has checked it.
fn positions_exist(root: &Root) -> Result<(), Refusal> {
    for (mesh, content) in root.meshes.iter().enumerate() {
        for (number, primitive) in content.primitives.iter().enumerate() {
            let positions = attribute(primitive, Semantic::Positions).map_or(0, |accessor| accessor.value());
            if positions >= root.accessors.len() && attribute(primitive, Semantic::Positions).is_some() {
                let object = format!("meshes[{mesh}].primitives[{number}].attributes.POSITION");
                return Err((object, format!("accessor {positions} does not exist")));
            }
        }
    }
    Ok(())
}

/// Runs the crate's own validation: every index in range, every enumerant known.
///
/// What it refuses although glTF allows it, or although nothing here depends on it, passes.
fn crate_rules(root: &Root, notes: &Notes) -> Result<(), Refusal> {
    let mut first = None;
    root.validate(root, gltf::json::Path::new, &mut |path, fault| {
        if first.is_some() {
            return;
        }
        let path = path();
        let path = path.as_str();
        let harmless = match fault {
            // Accessors without data are zeros (§3.6.2.1); positions may come from an extension (§3.7.2.1);
            // bounds are computed, not believed.
            Fault::Missing => {
                [".bufferView", "[\"POSITION\"]", ".min", ".max"].iter().any(|end| path.ends_with(end))
            }
            Fault::Invalid => {
                [".min", ".max"].iter().any(|end| path.ends_with(end))
                    || (path.starts_with("extensions.khrLightsPunctual") && path.ends_with(".type"))
            }
            _ => false,
        };
        if fault == Fault::Invalid && path.contains("<invalid semantic name>") {
            notes.add("attributes", || format!("{}: an unknown attribute is ignored", path_head(path)));
        } else if !harmless {
            first = Some((path.to_string(), words(fault).to_string()));
        }
    });
    first.map_or(Ok(()), Err)
}

fn path_head(path: &str) -> &str {
    path.split(".attributes").next().unwrap_or(path)
}

fn words(fault: Fault) -> &'static str {
    match fault {
        Fault::IndexOutOfBounds => "index of an object that does not exist",
        Fault::Invalid => "invalid value",
        Fault::Missing => "missing",
        Fault::Oversize => "too large for this machine",
        Fault::Unsupported => "not supported",
    }
}

/// Nodes form trees: one parent at most, no cycles, and scenes list roots, each once (§3.5.2).
fn node_tree(root: &Root) -> Result<(), Refusal> {
    let mut parents: Vec<Option<usize>> = vec![None; root.nodes.len()];
    for (parent, node) in root.nodes.iter().enumerate() {
        for child in node.children.iter().flatten().map(|child| child.value()) {
            if let Some(other) = parents[child].replace(parent) {
                let problem = format!("child of both nodes[{other}] and nodes[{parent}]");
                return Err((format!("nodes[{child}]"), problem));
            }
        }
    }
    let mut reached: Vec<bool> = parents.iter().map(Option::is_none).collect();
    let mut stack: Vec<usize> = (0..parents.len()).filter(|&node| reached[node]).collect();
    while let Some(node) = stack.pop() {
        for child in root.nodes[node].children.iter().flatten().map(|child| child.value()) {
            reached[child] = true;
            stack.push(child);
        }
    }
    if let Some(node) = reached.iter().position(|&reached| !reached) {
        return Err((
            format!("nodes[{node}]"),
            "part of a cycle, or below one: it is its own ancestor".into(),
        ));
    }
    for (index, scene) in root.scenes.iter().enumerate() {
        let mut listed: Vec<usize> = scene.nodes.iter().map(|node| node.value()).collect();
        listed.sort_unstable();
        if let Some(pair) = listed.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err((format!("scenes[{index}].nodes"), format!("lists nodes[{}] twice", pair[0])));
        }
        if let Some(node) = listed.iter().find(|&&node| parents[node].is_some()) {
            return Err((
                format!("scenes[{index}].nodes"),
                format!("nodes[{node}] is not a root: it has a parent"),
            ));
        }
    }
    Ok(())
}

fn buffer_view(root: &Root, view: &View) -> Result<(), String> {
    let length = root.buffers[view.buffer.value()].byte_length.0;
    let start = view.byte_offset.map_or(0, |offset| offset.0);
    match start.checked_add(view.byte_length.0) {
        Some(end) if end <= length => Ok(()),
        _ => Err(format!("bytes {start} + {} lie past the buffer's {length}", view.byte_length.0)),
    }
}

fn accessor_ranges(root: &Root, accessor: &Accessor) -> Result<(), String> {
    let format = Format::of(accessor).ok_or("unknown component type or type")?;
    let size = format.size() as u64;
    if u32::try_from(accessor.count.0).is_err() {
        return Err(format!("{} elements; at most {} are supported", accessor.count.0, u32::MAX));
    }
    let count = accessor.count.0;
    if let Some(index) = accessor.buffer_view {
        let view = &root.buffer_views[index.value()];
        let stride = view.byte_stride.map_or(size, |stride| stride.0 as u64);
        if stride < size {
            return Err(format!("elements of {size} bytes overlap: the byteStride is {stride}"));
        }
        in_view(view, accessor.byte_offset.map_or(0, |offset| offset.0), stride, size, count)?;
    }
    let Some(sparse) = &accessor.sparse else { return Ok(()) };
    if sparse.count.0 > count {
        return Err(format!("{} sparse elements, but only {count} in all", sparse.count.0));
    }
    let Checked::Valid(index_type) = sparse.indices.component_type else {
        return Err("unknown type of sparse indices".into());
    };
    let index_size = index_type.0.size() as u64;
    let (indices, values) = (&sparse.indices, &sparse.values);
    let view = |index: Index<View>| &root.buffer_views[index.value()];
    in_view(view(indices.buffer_view), indices.byte_offset.0, index_size, index_size, sparse.count.0)?;
    in_view(view(values.buffer_view), values.byte_offset.0, size, size, sparse.count.0)
}

/// `count` elements of `size` bytes, `stride` apart from `offset` on, lie inside the view.
fn in_view(view: &View, offset: u64, stride: u64, size: u64, count: u64) -> Result<(), String> {
    let Some(steps) = count.checked_sub(1) else { return Ok(()) };
    let end = stride.checked_mul(steps).and_then(|span| span.checked_add(size)?.checked_add(offset));
    match end {
        Some(end) if end <= view.byte_length.0 => Ok(()),
        _ => {
            Err(format!("{count} elements from byte {offset} on lie past its view's {}", view.byte_length.0))
        }
    }
}

fn camera_lens(camera: &gltf::json::Camera) -> Result<(), String> {
    use gltf::json::camera::Type;
    match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(Type::Perspective), Some(lens), _) => {
            if !(lens.yfov > 0.0 && lens.yfov < std::f32::consts::PI) {
                return Err(format!("yfov is {} and must lie between 0 and π", lens.yfov));
            }
            let near = lens.znear;
            match lens.zfar {
                Some(far) if near > 0.0 && far > near => Ok(()),
                None if near > 0.0 => Ok(()),
                Some(far) => Err(format!(
                    "znear is {near} and zfar {far}: the one must be above 0, the other beyond it"
                )),
                None => Err(format!("znear is {near} and must be above 0")),
            }
        }
        (Checked::Valid(Type::Orthographic), _, Some(lens)) => {
            let usable = |magnitude: f32| magnitude != 0.0 && magnitude.is_finite();
            if !usable(lens.xmag) || !usable(lens.ymag) {
                return Err(format!("xmag {} and ymag {} must be finite and not 0", lens.xmag, lens.ymag));
            }
            if !(lens.znear >= 0.0 && lens.zfar > lens.znear) {
                let (near, far) = (lens.znear, lens.zfar);
                return Err(format!(
                    "znear is {near} and zfar {far}: the one must be 0 or more, the other beyond it"
                ));
            }
            Ok(())
        }
        _ => Err("has no lens of the type that it names".into()),
    }
}

fn skin_matrices(root: &Root, skin: &gltf::json::Skin) -> Result<(), String> {
    if skin.joints.is_empty() {
        return Err("has no joints".into());
    }
    let Some(matrices) = skin.inverse_bind_matrices else { return Ok(()) };
    let accessor = &root.accessors[matrices.value()];
    let matrix = Format { component: ComponentType::F32, kind: Type::Mat4, normalized: false };
    if Format::of(accessor) != Some(matrix) {
        return Err("inverseBindMatrices must be MAT4 of floats".into());
    }
    if accessor.count.0 < skin.joints.len() as u64 {
        return Err(format!("{} inverse bind matrices for {} joints", accessor.count.0, skin.joints.len()));
    }
    Ok(())
}

/// Formats and counts of everything that a primitive refers to; fails with the name of the part.
fn attributes(document: &Document, primitive: &Primitive) -> Result<(), Refusal> {
    let root = &document.root;
    if let Some(indices) = primitive.indices {
        let format = Format::of(&root.accessors[indices.value()]);
        let unsigned = [ComponentType::U8, ComponentType::U16, ComponentType::U32];
        let fits = format.is_some_and(|format| {
            format.kind == Type::Scalar && !format.normalized && unsigned.contains(&format.component)
        });
        if !fits {
            return Err(("indices".into(), format!("{} where unsigned scalars are needed", shown(format))));
        }
    }
    let Some(positions) = attribute(primitive, Semantic::Positions) else { return Ok(()) };
    let count = root.accessors[positions.value()].count.0;
    let check = |part: String, accessor: Index<Accessor>, fits: &dyn Fn(Format) -> bool| {
        let accessor = &root.accessors[accessor.value()];
        let format = Format::of(accessor);
        if !format.is_some_and(fits) {
            return Err((part, format!("{} is not a format for it", shown(format))));
        }
        if accessor.count.0 != count {
            return Err((part, format!("{} elements for {count} positions", accessor.count.0)));
        }
        Ok(())
    };
    for (semantic, &accessor) in &primitive.attributes {
        if let Checked::Valid(semantic) = semantic
            && !matches!(semantic, Semantic::Extras(_))
        {
            check(format!("attributes.{}", semantic.to_string()), accessor, &|format| {
                admissible(semantic, format, document.quantized)
            })?;
        }
    }
    for (number, target) in primitive.targets.iter().flatten().enumerate() {
        let deltas = [
            ("POSITION", target.positions, Semantic::Positions),
            ("NORMAL", target.normals, Semantic::Normals),
            // The handedness of a tangent does not move: deltas have three components.
            ("TANGENT", target.tangents, Semantic::Normals),
        ];
        for (name, accessor, like) in deltas {
            if let Some(accessor) = accessor {
                check(format!("targets[{number}].{name}"), accessor, &|format| {
                    admissible(&like, format, document.quantized)
                })?;
            }
        }
    }
    Ok(())
}

fn shown(format: Option<Format>) -> String {
    format.map_or("an unknown format".into(), |format| {
        let normalized = if format.normalized { "normalised " } else { "" };
        let component = match format.component {
            ComponentType::I8 => "signed bytes",
            ComponentType::U8 => "unsigned bytes",
            ComponentType::I16 => "signed shorts",
            ComponentType::U16 => "unsigned shorts",
            ComponentType::U32 => "unsigned integers",
            ComponentType::F32 => "floats",
        };
        let kind = match format.kind {
            Type::Scalar => "SCALAR",
            Type::Vec2 => "VEC2",
            Type::Vec3 => "VEC3",
            Type::Vec4 => "VEC4",
            Type::Mat2 => "MAT2",
            Type::Mat3 => "MAT3",
            Type::Mat4 => "MAT4",
        };
        format!("{kind} of {normalized}{component}")
    })
}

/// glTF 2.0 §3.7.2.1, and KHR_mesh_quantization where the file uses it.
fn admissible(semantic: &Semantic, format: Format, quantized: bool) -> bool {
    use ComponentType::{F32, I8, I16, U8, U16};
    let float = format.component == F32 && !format.normalized;
    let fraction = format.normalized && matches!(format.component, U8 | U16);
    let small = quantized && matches!(format.component, I8 | U8 | I16 | U16);
    let direction = quantized && format.normalized && matches!(format.component, I8 | I16);
    match semantic {
        Semantic::Positions => format.kind == Type::Vec3 && (float || small),
        Semantic::Normals => format.kind == Type::Vec3 && (float || direction),
        Semantic::Tangents => format.kind == Type::Vec4 && (float || direction),
        Semantic::TexCoords(_) => format.kind == Type::Vec2 && (float || fraction || small),
        Semantic::Colors(_) => matches!(format.kind, Type::Vec3 | Type::Vec4) && (float || fraction),
        Semantic::Joints(_) => {
            format.kind == Type::Vec4 && !format.normalized && matches!(format.component, U8 | U16)
        }
        Semantic::Weights(_) => format.kind == Type::Vec4 && (float || fraction),
        Semantic::Extras(_) => true,
    }
}
