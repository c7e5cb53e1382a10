//! Shader interfaces against Rust: push constants, buffer elements and bindings, read from the SPIR-V.

use std::{
    collections::{BTreeMap, HashMap},
    mem::offset_of,
};

use vertex_tracing::{
    constants::FEATURE_EVERYTHING,
    gpu::Binding,
    reconstruct::{
        frame_block::{FrameBlock, LightBlock},
        leaves::GpuLeaf,
        paper::{PaperLeaf, PaperVertex},
        passes::{ARRAY_BINDINGS, LEAF_BINDINGS, SCENE_BINDINGS},
        vertex::VertexLayout,
    },
    spirv,
    visibility::{
        MaskVertex, device,
        face_draw::{FACE_BINDINGS, MASK_BINDINGS, Push},
    },
};

/// Names, decorations and types of a SPIR-V module; just what the tests ask for.
#[derive(Default)]
struct Module {
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
    offsets: HashMap<(u32, u32), u32>,
    strides: HashMap<u32, u32>,
    /// Set and binding of each variable.
    places: HashMap<u32, [Option<u32>; 2]>,
    /// Number of each specialization constant, and its value where none is given.
    constant_ids: HashMap<u32, u32>,
    constant_values: HashMap<u32, u32>,
    /// What pointers point to, and arrays consist of.
    inner: HashMap<u32, u32>,
    /// Type of the first member of each struct.
    first_members: HashMap<u32, u32>,
    /// Pointer type of each variable.
    variables: HashMap<u32, u32>,
    /// Those that are inputs.
    inputs: Vec<u32>,
    /// Types of floats.
    floats: Vec<u32>,
    /// What each pointer into a variable points into, what each float was loaded from, and whose bits are read anew.
    chains: HashMap<u32, u32>,
    loads: HashMap<u32, u32>,
    bitcasts: Vec<u32>,
}

impl Module {
    fn read(spirv: &[u8]) -> Self {
        let words: Vec<u32> =
            spirv.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect();
        assert_eq!(words[0], 0x0723_0203, "SPIR-V begins with its magic number");
        let mut module = Self::default();
        let mut at = 5;
        while at < words.len() {
            let (count, opcode) = ((words[at] >> 16) as usize, words[at] & 0xffff);
            let args = &words[at + 1..at + count];
            match (opcode, args) {
                (5, [id, name @ ..]) => drop(module.names.insert(*id, text(name))),
                (6, [id, member, name @ ..]) => drop(module.member_names.insert((*id, *member), text(name))),
                (50, [_, id, value, ..]) => drop(module.constant_values.insert(*id, *value)),
                (71, [id, 1, number]) => drop(module.constant_ids.insert(*id, *number)),
                (71, [id, 6, stride]) => drop(module.strides.insert(*id, *stride)),
                (71, [id, 34, set]) => module.places.entry(*id).or_default()[0] = Some(*set),
                (71, [id, 33, binding]) => module.places.entry(*id).or_default()[1] = Some(*binding),
                (72, [id, member, 35, offset]) => drop(module.offsets.insert((*id, *member), *offset)),
                (28 | 29, [id, element, ..]) => drop(module.inner.insert(*id, *element)),
                (30, [id, first, ..]) => drop(module.first_members.insert(*id, *first)),
                (32, [id, _, target]) => drop(module.inner.insert(*id, *target)),
                (59, [kind, id, class, ..]) => {
                    module.variables.insert(*id, *kind);
                    if *class == 1 {
                        module.inputs.push(*id);
                    }
                }
                (22, [id, ..]) => module.floats.push(*id),
                (61, [kind, id, pointer, ..]) if module.floats.contains(kind) => {
                    module.loads.insert(*id, *pointer);
                }
                (65, [_, id, base, ..]) => drop(module.chains.insert(*id, *base)),
                (124, [_, _, operand]) => module.bitcasts.push(*operand),
                _ => {}
            }
            at += count;
        }
        module
    }

    /// Byte offset of each member of the struct called `name`.
    fn offsets(&self, name: &str) -> BTreeMap<String, usize> {
        let members = |id: u32| {
            self.offsets
                .iter()
                .filter(move |((owner, _), _)| *owner == id)
                .map(|(key, offset)| (self.member_names[key].clone(), *offset as usize))
        };
        let found =
            self.names.iter().filter(|(_, known)| *known == name).map(|(id, _)| members(*id).collect());
        found.max_by_key(BTreeMap::len).unwrap_or_else(|| panic!("no struct {name}"))
    }

    /// Byte distance of the elements of each block's array, by the array's name.
    fn strides(&self) -> BTreeMap<&str, usize> {
        let blocks = self.variables.values().filter_map(|pointer| self.inner.get(pointer));
        let stride = |block: &u32| {
            let name = self.member_names.get(&(*block, 0))?;
            Some((name.as_str(), *self.strides.get(self.first_members.get(block)?)? as usize))
        };
        blocks.filter_map(stride).collect()
    }

    /// Value of each specialization constant of a number where none is given, by its number.
    fn constants(&self) -> BTreeMap<u32, u32> {
        let value = |(id, number): (&u32, &u32)| Some((*number, *self.constant_values.get(id)?));
        self.constant_ids.iter().filter_map(value).collect()
    }

    /// Set and binding of every resource: a block without a name goes by its first member.
    fn bindings(&self) -> BTreeMap<&str, (u32, u32)> {
        let name = |variable: &u32| {
            let block = self.inner[&self.variables[variable]];
            let own = self.names.get(variable).filter(|name| !name.is_empty());
            own.unwrap_or_else(|| &self.member_names[&(block, 0)]).as_str()
        };
        let places =
            self.places.iter().filter_map(|(variable, place)| Some((variable, (place[0]?, place[1]?))));
        places.map(|(variable, place)| (name(variable), place)).collect()
    }
}

fn text(words: &[u32]) -> String {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0);
    String::from_utf8(bytes.collect()).expect("names are UTF-8")
}

/// Holds `found` against a table in which a binding's place is its number.
fn assert_bindings(found: &BTreeMap<&str, (u32, u32)>, tables: &[&[Binding]]) {
    for (name, &(set, binding)) in found {
        let entry = tables.get(set as usize).and_then(|table| table.get(binding as usize));
        assert_eq!(entry.map(|entry| entry.name), Some(*name), "set {set}, binding {binding}");
    }
}

#[test]
fn push_constants() {
    let expected = BTreeMap::from([
        ("clip_from_eye_relative".to_owned(), offset_of!(Push, clip_from_eye_relative)),
        ("eye".to_owned(), offset_of!(Push, eye)),
        ("alpha_cutoff".to_owned(), offset_of!(Push, alpha_cutoff)),
    ]);
    for shader in
        [&spirv!("id_buffer.vert")[..], spirv!("id_buffer_mask.vert"), spirv!("id_buffer_mask.frag")]
    {
        assert_eq!(Module::read(shader).offsets("Push"), expected);
    }
    assert!(size_of::<Push>() <= 128, "what every device has room for");
}

#[test]
fn buffer_elements() {
    let module = Module::read(spirv!("id_buffer_mask.vert"));
    let expected = BTreeMap::from([
        ("uv".to_owned(), offset_of!(MaskVertex, uv)),
        ("alpha".to_owned(), offset_of!(MaskVertex, alpha)),
    ]);
    assert_eq!(module.offsets("MaskVertex"), expected);
    let expected = BTreeMap::from([
        ("positions", size_of::<glam::Vec3>()),
        ("faces", size_of::<[u32; 3]>()),
        ("entries", size_of::<u32>()),
        ("mask_vertices", size_of::<MaskVertex>()),
    ]);
    assert_eq!(module.strides(), expected);
}

/// Members and offsets of a struct, as [`Module::offsets`] gives them.
macro_rules! layout {
    ($type:ty { $($member:ident),* $(,)? }) => {
        BTreeMap::from([$((stringify!($member).to_owned(), offset_of!($type, $member))),*])
    };
}

#[test]
fn frame_and_leaves() {
    let vertex = Module::read(spirv!("leaf.vert"));
    let leaf = layout!(GpuLeaf { vertices, material, lit, nodes, flags, first_target, first_lit });
    assert_eq!(vertex.offsets("Leaf"), leaf);
    let strides = BTreeMap::from([("vertices", size_of::<u32>()), ("leaves", size_of::<GpuLeaf>())]);
    assert_eq!(vertex.strides(), strides);
    let frame = layout!(FrameBlock {
        clip_from_eye_relative,
        eye,
        forward,
        orthographic,
        ambient,
        lights,
        width,
        height,
        halvings,
    });
    let light =
        layout!(LightBlock { position, range, direction, kind, intensity, outer_cos, cone_scale, pad });
    for module in [vertex, Module::read(spirv!("exact.frag"))] {
        assert_eq!(module.offsets("Frame"), frame);
        assert_eq!(module.offsets("Light"), light);
    }
    let vertex = Module::read(spirv!("paper.vert"));
    let own = layout!(PaperVertex {
        position,
        uv,
        alpha,
        primary_textured,
        primary_added,
        attenuation,
        textured,
        texel,
        comb,
        branch_uv,
    });
    assert_eq!(vertex.offsets("PaperVertex"), own);
    assert_eq!(vertex.offsets("PaperLeaf"), layout!(PaperLeaf { vertices, textures, cutoff }));
    let strides =
        BTreeMap::from([("vertices", size_of::<PaperVertex>()), ("leaves", size_of::<PaperLeaf>())]);
    assert_eq!(vertex.strides(), strides);
}

#[test]
fn references_do_not_travel_as_floats() {
    // A device may flush a denormal float on its way, and change the bits of a NaN.
    let module = Module::read(spirv!("exact.frag"));
    let varying = |value: &u32| {
        let base = module.chains.get(module.loads.get(value)?)?;
        module.inputs.contains(base).then(|| &module.names[base])
    };
    assert!(module.bitcasts.len() > 10);
    assert_eq!(module.bitcasts.iter().filter_map(varying).collect::<Vec<_>>(), Vec::<&String>::new());
}

#[test]
fn vertices_of_leaves() {
    // Without constants the shader reads every attribute, where the layout of all of them has it.
    let found = Module::read(spirv!("leaf.vert")).constants();
    for (number, value) in VertexLayout::of(FEATURE_EVERYTHING).constants() {
        assert_eq!(found.get(&number), Some(&value), "constant {number}");
    }
}

#[test]
fn bindings() {
    let solid = Module::read(spirv!("id_buffer.vert"));
    let masked = [Module::read(spirv!("id_buffer_mask.vert")), Module::read(spirv!("id_buffer_mask.frag"))];
    assert_eq!(solid.bindings().len(), 3);
    assert_eq!(masked.each_ref().map(|module| module.bindings().len()), [4, 1]);
    for module in masked.iter().chain([&solid]) {
        assert_bindings(&module.bindings(), &[&FACE_BINDINGS, &MASK_BINDINGS]);
    }
    assert_bindings(&Module::read(spirv!("count_faces.comp")).bindings(), &[&device::BINDINGS]);
    for (shader, count) in [
        (&spirv!("leaf.vert")[..], 5),
        (spirv!("exact.frag"), 8),
        (spirv!("picture.frag"), 2),
        (spirv!("paper.vert"), 3),
        (spirv!("paper.frag"), 3),
        (spirv!("background.vert"), 1),
        (spirv!("background.frag"), 1),
    ] {
        let module = Module::read(shader);
        let found = module.bindings();
        assert_eq!(found.len(), count, "{found:?}");
        assert_bindings(&found, &[&SCENE_BINDINGS, &LEAF_BINDINGS, &ARRAY_BINDINGS]);
    }
}
