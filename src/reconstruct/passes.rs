//! The colour draws of a frame: one multi-texture pass, or blended passes over the same leaves
//! (paper §4.1, §4.2; Eq. 3 and 4).

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::Pod;

use super::bank::Bank;
use super::frame_block::FrameBlock;
use super::leaves::{GROUPS, GpuLeaf, GpuVertex, Leaves};
use super::table::{SceneTable, Texel};
use crate::constants::*;
use crate::error::Result;
use crate::gpu::{
    Binding, Blend, ColorTarget, Commands, Cull, DepthMode, DepthTarget, DescriptorSet, DeviceBuffer, Draws,
    Format, Gpu, GraphicsDesc, GraphicsPipeline, Image, ImageDesc, ReadbackBuffer, ReadbackChoice, Resource,
    SetLayout, Shader, StencilMode, Targets, Timing, Uploads,
};
use crate::options::{Equation, Mode};
use crate::report::image::FloatImage;
use crate::spirv;

/// Bindings of set 0: what all draws of a scene read.
pub const SCENE_BINDINGS: [Binding; 4] = [
    Binding::uniform("frame"),
    Binding::texels("scene_table"),
    Binding::textures("bank", MAX_BANK_ARRAYS),
    Binding::textures("environment", 1),
];

/// Bindings of set 1: what one list of leaves reads.
pub const LEAF_BINDINGS: [Binding; 3] =
    [Binding::storage("vertices"), Binding::storage("leaves"), Binding::texels("node_table")];

mod base_image;

const UPLOAD_BYTES: u64 = 16 << 20;

/// One colour draw: its name and the components of Eq. 3 that it adds up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ColorPass {
    /// Name in the stats.
    pub name: &'static str,
    /// Bits of `COMPONENT_…`.
    pub components: u32,
}

/// The colour passes of a mode and equation, everything included.
pub fn color_passes(mode: Mode, equation: Equation) -> &'static [ColorPass] {
    const ALL: [ColorPass; 1] = [ColorPass {
        name: "multi-texture",
        components: COMPONENT_PRIMARY
            | COMPONENT_REFLECTED
            | COMPONENT_TRANSMITTED
            | COMPONENT_REFLECTED_COMB
            | COMPONENT_TRANSMITTED_COMB,
    }];
    const FIVE: [ColorPass; 5] = [
        ColorPass { name: "primary", components: COMPONENT_PRIMARY },
        ColorPass { name: "reflected", components: COMPONENT_REFLECTED },
        ColorPass { name: "reflected combined", components: COMPONENT_REFLECTED_COMB },
        ColorPass { name: "transmitted", components: COMPONENT_TRANSMITTED },
        ColorPass { name: "transmitted combined", components: COMPONENT_TRANSMITTED_COMB },
    ];
    const THREE: [ColorPass; 3] = [
        ColorPass { name: "primary", components: COMPONENT_PRIMARY },
        ColorPass { name: "reflected", components: COMPONENT_REFLECTED | COMPONENT_REFLECTED_COMB },
        ColorPass { name: "transmitted", components: COMPONENT_TRANSMITTED | COMPONENT_TRANSMITTED_COMB },
    ];
    match (mode, equation) {
        (Mode::MultiTexture, _) => &ALL,
        (Mode::MultiPass, Equation::Three) => &FIVE,
        (Mode::MultiPass, Equation::Four) => &THREE,
    }
}

/// What a pipeline is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct PipelineKey {
    leaves: u32,
    components: u32,
    blend: PassBlend,
    cull: bool,
    mark: Mark,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum PassBlend {
    First,
    Later,
    Coverage,
}

/// What a draw has to do with the mark on pixels of faces that need samples (single-pass visibility).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Mark {
    /// Nothing.
    Ignored,
    /// Sets it, or not, where it draws.
    Set(bool),
    /// Draws where it is set.
    Needed,
}

/// How the image is drawn, apart from the scene and its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct PassOptions {
    /// Colour passes, in order; the first draws faces without samples too.
    pub passes: Vec<ColorPass>,
    /// Eq. 3 or Eq. 4.
    pub equation: Equation,
    /// Coverage samples a pixel: 1 or 4.
    pub samples: u32,
    /// Shaded samples a pixel: 1, 4 or 16.
    pub shaded: u32,
    /// Whether any material has textures beyond base colour and emission.
    pub detail_textures: bool,
    /// Whether the faces without samples are drawn before the samples are known, with those that need
    /// samples among them: see [`Painter::draw_base`].
    pub single_pass: bool,
    /// Number of lights.
    pub lights: u32,
    /// Whether any material shows highlights.
    pub highlights: bool,
}

/// Faces that are drawn without samples, by how they are drawn.
#[derive(Debug, Default)]
pub struct BaseFaces {
    /// Leaf records, opaque ones first.
    pub leaves: Vec<GpuLeaf>,
    /// Draws over `leaves`.
    pub draws: Vec<BaseDraw>,
    /// Vertices of the whole scene.
    pub vertices: Vec<GpuVertex>,
}

/// Consecutive faces without samples that are drawn alike.
#[derive(Debug, Clone)]
pub struct BaseDraw {
    /// Range of leaf records.
    pub leaves: std::ops::Range<u32>,
    /// Whether back faces are left out.
    pub cull: bool,
    /// Whether they cover by alpha.
    pub blended: bool,
    /// Whether they need samples, so that leaves will take their place (single-pass visibility).
    pub marked: bool,
}

/// A list of leaves on the device: buffers grow, and are kept from frame to frame.
struct LeafList {
    buffers: [DeviceBuffer; 3],
    set: DescriptorSet,
}

/// Draws the frames of one scene.
pub struct Painter {
    gpu: Arc<Gpu>,
    options: PassOptions,
    bank: Bank,
    commands: Commands,
    uploads: Uploads,
    frame: DeviceBuffer,
    scene_set: DescriptorSet,
    layouts: [SetLayout; 2],
    base: LeafList,
    base_draws: Vec<BaseDraw>,
    dynamic: Option<LeafList>,
    pipelines: HashMap<PipelineKey, GraphicsPipeline>,
    depth_reset: Option<GraphicsPipeline>,
    target: Option<Target>,
    blended_order: Vec<u32>,
}

struct Target {
    color: Image,
    multisampled: Option<Image>,
    depth: Image,
    staging: ReadbackBuffer,
}

impl Painter {
    /// Uploads what does not change from frame to frame.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn new(
        gpu: &Arc<Gpu>,
        options: PassOptions,
        bank: Bank,
        table: &SceneTable,
        base: &BaseFaces,
    ) -> Result<Self> {
        let mut uploads = Uploads::new(gpu, "leaf uploads", UPLOAD_BYTES)?;
        let frame = DeviceBuffer::new(gpu, "frame", size_of::<FrameBlock>() as u64)?;
        let texels = uploads.buffer("scene table", &table.texels)?;
        let layouts = [
            SetLayout::new(gpu, "scene", &SCENE_BINDINGS)?,
            SetLayout::new(gpu, "leaves", &LEAF_BINDINGS)?,
        ];
        let scene_set = layouts[0].set(
            "scene",
            &[
                ("frame", Resource::Buffer(&frame)),
                ("scene_table", Resource::Buffer(&texels)),
                ("bank", Resource::Textures(&bank.bindings())),
                ("environment", Resource::Textures(&[bank.environment()])),
            ],
        )?;
        let base_list = LeafList::new(gpu, &layouts[1], "base", &mut uploads, &base.vertices, &base.leaves, &[])?;
        uploads.flush()?;
        let depth_reset = options.single_pass.then(|| base_image::depth_reset(gpu)).transpose()?;
        Ok(Self {
            gpu: gpu.clone(),
            options,
            bank,
            commands: Commands::new(gpu, "frame", 16)?,
            uploads,
            frame,
            scene_set,
            layouts,
            base: base_list,
            base_draws: base.draws.clone(),
            dynamic: None,
            pipelines: HashMap::new(),
            depth_reset,
            target: None,
            blended_order: Vec::new(),
        })
    }

    /// The texture bank.
    pub fn bank(&self) -> &Bank {
        &self.bank
    }

    /// Sets the order in which blended base draws are drawn: far ones first.
    pub fn set_blended_order(&mut self, order: Vec<u32>) {
        self.blended_order = order;
    }

    /// Hands the leaves of a frame to the device.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn upload(&mut self, leaves: &Leaves) -> Result<()> {
        let (gpu, layout) = (&self.gpu, &self.layouts[1]);
        match &mut self.dynamic {
            Some(list) if list.fits(&leaves.vertices, &leaves.leaves, &leaves.nodes) => {
                list.write(&mut self.uploads, &leaves.vertices, &leaves.leaves, &leaves.nodes)?;
            }
            slot => {
                // Replaced before it is made anew, so that both never exist at once.
                *slot = None;
                *slot = Some(LeafList::new(
                    gpu,
                    layout,
                    "leaves",
                    &mut self.uploads,
                    &leaves.vertices,
                    &leaves.leaves,
                    &leaves.nodes,
                )?);
            }
        }
        self.uploads.flush()
    }

    /// Compiles every pipeline that a frame of `options` can use, and draws each once on a single pixel,
    /// since drivers compile at the first draw.
    ///
    /// # Errors
    /// What the driver says; no device memory left.
    pub fn warm_up(&mut self, block: &FrameBlock, has_leaves: bool) -> Result<()> {
        self.make_target(block.width(), block.height())?;
        let groups: &[u32] = if has_leaves { &GROUPS } else { &[] };
        let mut keys: Vec<PipelineKey> = Vec::new();
        for (index, pass) in self.options.passes.iter().enumerate() {
            let blend = if index == 0 { PassBlend::First } else { PassBlend::Later };
            let drawn = groups.iter().filter(|&&leaves| index == 0 || leaves != LEAVES_PLAIN);
            keys.extend(drawn.map(|&leaves| PipelineKey {
                leaves,
                components: pass.components,
                blend,
                cull: false,
                mark: self.leaf_mark(),
            }));
        }
        for draw in &self.base_draws {
            keys.push(self.base_key(draw));
        }
        for key in &keys {
            self.pipeline(*key)?;
        }
        self.uploads.write(&self.frame, 0, std::slice::from_ref(block))?;
        let Self { commands, uploads, target, pipelines, scene_set, base, depth_reset, .. } = self;
        let Some(target) = target else { return Ok(()) };
        let mut recording = commands.begin()?;
        uploads.record(&mut recording);
        target.render(&mut recording, true, |draws| {
            draws.scissor([0, 0, 1, 1]);
            for key in &keys {
                if let Some(pipeline) = pipelines.get(key) {
                    draws.pipeline(pipeline).set(0, scene_set).set(1, &base.set).draw(0..3);
                }
            }
        });
        if let Some(pipeline) = depth_reset {
            target.reset_depth(&mut recording, pipeline);
        }
        recording.submit_and_wait()
    }

    fn base_key(&self, draw: &BaseDraw) -> PipelineKey {
        PipelineKey {
            leaves: LEAVES_PLAIN,
            components: self.options.passes.first().map_or(COMPONENT_PRIMARY, |pass| pass.components),
            blend: if draw.blended { PassBlend::Coverage } else { PassBlend::First },
            cull: draw.cull,
            mark: match self.options.single_pass && !draw.blended {
                true => Mark::Set(draw.marked),
                false => Mark::Ignored,
            },
        }
    }

    fn leaf_mark(&self) -> Mark {
        if self.options.single_pass { Mark::Needed } else { Mark::Ignored }
    }

    /// Draws the frame; the leaves are those of the last [`upload`](Self::upload). Returns the device's time
    /// of each colour pass. In a single pass it draws on top of the last [`draw_base`](Self::draw_base).
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn draw(&mut self, block: &FrameBlock, leaves: Option<&Leaves>) -> Result<Vec<Timing>> {
        self.make_target(block.width(), block.height())?;
        let passes = self.options.passes.clone();
        let (single_pass, mark) = (self.options.single_pass, self.leaf_mark());
        let draws = leaves.map_or(Vec::new(), leaf_draws);
        for (index, pass) in passes.iter().enumerate() {
            for draw in &draws {
                if index == 0 || draw.group != LEAVES_PLAIN {
                    self.pipeline(leaf_key(*pass, index, draw, mark))?;
                }
            }
        }
        let base_keys: Vec<PipelineKey> = self.base_draws.iter().map(|draw| self.base_key(draw)).collect();
        for &key in &base_keys {
            self.pipeline(key)?;
        }
        let blended = self.blended_draws();

        self.uploads.write(&self.frame, 0, std::slice::from_ref(block))?;
        let Self { commands, uploads, target, pipelines, scene_set, base, base_draws, dynamic, depth_reset, .. } =
            self;
        let Some(target) = target else { return Ok(Vec::new()) };
        let mut recording = commands.begin()?;
        uploads.record(&mut recording);
        if let Some(pipeline) = depth_reset {
            target.reset_depth(&mut recording, pipeline);
        }
        for (index, &pass) in passes.iter().enumerate() {
            recording.timed(pass.name, |recording| {
                target.render(recording, index == 0 && !single_pass, |commands| {
                    if let Some(list) = dynamic {
                        for draw in draws.iter().filter(|draw| index == 0 || draw.group != LEAVES_PLAIN) {
                            let pipeline = &pipelines[&leaf_key(pass, index, draw, mark)];
                            commands.pipeline(pipeline).set(0, scene_set).set(1, &list.set);
                            commands.draw(3 * draw.leaves.start..3 * draw.leaves.end);
                        }
                    }
                    if index > 0 || single_pass {
                        return;
                    }
                    let opaque = (0..base_draws.len()).filter(|&draw| !base_draws[draw].blended);
                    for draw in opaque {
                        record_base(commands, &pipelines[&base_keys[draw]], scene_set, base, &base_draws[draw]);
                    }
                });
            });
        }
        if !blended.is_empty() {
            recording.timed("blended", |recording| {
                target.render(recording, false, |commands| {
                    for draw in blended {
                        record_base(commands, &pipelines[&base_keys[draw]], scene_set, base, &base_draws[draw]);
                    }
                });
            });
        }
        recording.submit_and_wait()?;
        self.commands.timings()
    }

    fn blended_draws(&self) -> Vec<usize> {
        let is_blended = |&draw: &usize| self.base_draws.get(draw).is_some_and(|draw| draw.blended);
        if self.blended_order.is_empty() {
            return (0..self.base_draws.len()).filter(is_blended).collect();
        }
        self.blended_order.iter().map(|&draw| draw as usize).filter(is_blended).collect()
    }

    /// Copies the finished image to the host, linear.
    ///
    /// # Errors
    /// A lost device.
    pub fn read_image(&mut self) -> Result<FloatImage> {
        let Self { commands, target, .. } = self;
        let Some(target) = target else {
            return Ok(FloatImage { width: 0, height: 0, pixels: Vec::new() });
        };
        let (width, height) = (target.color.width(), target.color.height());
        let mut recording = commands.begin()?;
        recording.read_image(&target.color, &mut target.staging);
        recording.submit_and_wait()?;
        let halves: &[[half::f16; 4]] = target.staging.read((width * height) as usize)?;
        let pixels = halves.iter().map(|p| [p[0].to_f32(), p[1].to_f32(), p[2].to_f32()]).collect();
        Ok(FloatImage { width, height, pixels })
    }

    fn make_target(&mut self, width: u32, height: u32) -> Result<()> {
        if self.target.as_ref().is_some_and(|t| (t.color.width(), t.color.height()) == (width, height)) {
            return Ok(());
        }
        self.target = None;
        let samples = self.options.samples;
        let gpu = &self.gpu;
        let color = Image::new(gpu, &ImageDesc::target("color", Format::Rgba16f, width, height))?;
        let multisampled = (samples > 1)
            .then(|| {
                let desc = ImageDesc::target("multisampled color", Format::Rgba16f, width, height);
                Image::new(gpu, &desc.with_samples(samples))
            })
            .transpose()?;
        let depth = ImageDesc::target("depth", self.depth_format(), width, height).with_samples(samples);
        let staging = ReadbackBuffer::new(gpu, "image staging", color.bytes(), ReadbackChoice::Best)?;
        self.target = Some(Target { color, multisampled, depth: Image::new(gpu, &depth)?, staging });
        Ok(())
    }

    fn depth_format(&self) -> Format {
        if self.options.single_pass { Format::Depth32fStencil8 } else { Format::Depth32f }
    }

    fn pipeline(&mut self, key: PipelineKey) -> Result<()> {
        if self.pipelines.contains_key(&key) {
            return Ok(());
        }
        let constants = [
            (0, self.bank.arrays()),
            (1, u32::from(self.options.detail_textures)),
            (2, key.leaves),
            (3, key.components),
            (4, u32::from(self.options.equation == Equation::Four)),
            (5, self.options.lights),
            (6, u32::from(self.options.highlights)),
            (7, u32::from(matches!(key.mark, Mark::Set(_)))),
        ];
        let stencil = match key.mark {
            Mark::Ignored => StencilMode::Off,
            Mark::Set(marked) => StencilMode::Mark(marked.into()),
            Mark::Needed => StencilMode::Test(1),
        };
        let (blend, depth) = match key.blend {
            PassBlend::First => (Blend::Replace, DepthMode::Write),
            PassBlend::Later => (Blend::Add, DepthMode::Equal),
            PassBlend::Coverage => (Blend::Over, DepthMode::Test),
        };
        let pipeline = GraphicsPipeline::new(
            &self.gpu,
            &GraphicsDesc {
                fragment: Shader { spirv: spirv!("exact.frag"), constants: &constants },
                sets: &[&self.layouts[0], &self.layouts[1]],
                colors: &[(Format::Rgba16f, blend)],
                depth_format: Some(self.depth_format()),
                depth,
                stencil,
                cull: if key.cull { Cull::Back } else { Cull::None },
                samples: self.options.samples,
                ..GraphicsDesc::opaque("leaves", spirv!("leaf.vert"), spirv!("exact.frag"))
            },
        )?;
        self.pipelines.insert(key, pipeline);
        Ok(())
    }
}

/// Consecutive leaves of one group.
struct LeafDraw {
    leaves: std::ops::Range<u32>,
    group: u32,
}

fn leaf_draws(leaves: &Leaves) -> Vec<LeafDraw> {
    let mut start = 0;
    let ranges = leaves.groups.iter().zip(GROUPS).map(|(&count, group)| {
        start += count;
        LeafDraw { leaves: start - count..start, group }
    });
    ranges.filter(|draw| !draw.leaves.is_empty()).collect()
}

fn leaf_key(pass: ColorPass, index: usize, draw: &LeafDraw, mark: Mark) -> PipelineKey {
    PipelineKey {
        leaves: draw.group,
        components: pass.components,
        blend: if index == 0 { PassBlend::First } else { PassBlend::Later },
        cull: false,
        mark,
    }
}

fn record_base(
    commands: &mut Draws<'_, '_>,
    pipeline: &GraphicsPipeline,
    scene: &DescriptorSet,
    list: &LeafList,
    draw: &BaseDraw,
) {
    commands.pipeline(pipeline).set(0, scene).set(1, &list.set).draw(3 * draw.leaves.start..3 * draw.leaves.end);
}

impl Target {
    fn render<'a>(
        &self,
        recording: &mut crate::gpu::Recording<'a>,
        clear: bool,
        work: impl FnOnce(&mut Draws<'_, 'a>),
    ) {
        let clear_color = clear.then_some([0.0; 4]);
        let color = match &self.multisampled {
            None => ColorTarget { image: &self.color, clear: clear_color, resolve: None },
            Some(image) => ColorTarget { image, clear: clear_color, resolve: Some(&self.color) },
        };
        let depth = Some(DepthTarget { image: &self.depth, clear });
        recording.render(&Targets { colors: &[color], depth }, work);
    }
}

impl LeafList {
    fn new(
        gpu: &Arc<Gpu>,
        layout: &SetLayout,
        name: &str,
        uploads: &mut Uploads,
        vertices: &[GpuVertex],
        leaves: &[GpuLeaf],
        nodes: &[Texel],
    ) -> Result<Self> {
        // Room to grow by half without a new buffer.
        let make = |what: &str, bytes: usize| {
            DeviceBuffer::new(gpu, &format!("{name} {what}"), (bytes as u64 * 3 / 2).max(256).next_multiple_of(16))
        };
        let buffers = [
            make("vertices", size_of_val(vertices))?,
            make("records", size_of_val(leaves))?,
            make("nodes", size_of_val(nodes))?,
        ];
        let set = layout.set(
            name,
            &[
                ("vertices", Resource::Buffer(&buffers[0])),
                ("leaves", Resource::Buffer(&buffers[1])),
                ("node_table", Resource::Buffer(&buffers[2])),
            ],
        )?;
        let list = Self { buffers, set };
        list.write(uploads, vertices, leaves, nodes)?;
        Ok(list)
    }

    fn fits(&self, vertices: &[GpuVertex], leaves: &[GpuLeaf], nodes: &[Texel]) -> bool {
        let sizes = [size_of_val(vertices), size_of_val(leaves), size_of_val(nodes)];
        self.buffers.iter().zip(sizes).all(|(buffer, size)| buffer.size() >= size as u64)
    }

    fn write(
        &self,
        uploads: &mut Uploads,
        vertices: &[GpuVertex],
        leaves: &[GpuLeaf],
        nodes: &[Texel],
    ) -> Result<()> {
        fn one<T: Pod>(uploads: &mut Uploads, buffer: &DeviceBuffer, data: &[T]) -> Result<()> {
            if data.is_empty() { Ok(()) } else { uploads.write(buffer, 0, data) }
        }
        one(uploads, &self.buffers[0], vertices)?;
        one(uploads, &self.buffers[1], leaves)?;
        one(uploads, &self.buffers[2], nodes)
    }
}
