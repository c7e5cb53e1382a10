//! The colour draws of a frame: one multi-texture pass, or blended passes over the same leaves
//! (paper §4.1, §4.2; Eq. 3 and 4).

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use super::bank::Bank;
use super::drawn::Drawn;
use super::frame_block::FrameBlock;
use super::leaves::{self, Group};
use super::readback::{self, PendingImage, PictureRing};
use super::table::SceneTable;
use crate::constants::*;
use crate::error::Result;
use crate::gpu::{
    Binding, Commands, DescriptorSet, DeviceBuffer, Draws, Format, Gpu, GraphicsPipeline, Resource,
    SetLayout, Uploads,
};
use crate::report::image::FloatImage;
use crate::scene::frustum::Frustum;
use crate::visibility::clusters;

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

/// Bindings of set 2: the arrays of one group of leaves.
pub const ARRAY_BINDINGS: [Binding; 3] = [
    Binding::textures("own_texture", 1),
    Binding::textures("first_texture", 1),
    Binding::textures("node_texture", 1),
];

mod background;
mod base_image;
mod describe;
mod list;
mod pipelines;
mod plain;
mod target;

pub use background::clear_color;
pub use describe::{BaseDraw, BaseFaces, ColorPass, Drawing, PassOptions, color_passes};
use list::LeafList;
use pipelines::{PipelineKey, leaf_key};
use plain::{Between, Tile};
use target::Target;
pub use target::TargetDesc;

const UPLOAD_BYTES: u64 = 16 << 20;

/// Bytes of the staging buffer: as many as `fixed`, what never changes, unless leaves are uploaded frame by frame.
pub fn staging_bytes(leaves: bool, fixed: u64) -> u64 {
    let needed = fixed + size_of::<FrameBlock>() as u64;
    if leaves { UPLOAD_BYTES } else { needed.next_multiple_of(16).min(UPLOAD_BYTES) }
}

/// Format of the depth image; a single pass marks pixels in its stencil.
pub fn depth_format(single_pass: bool) -> Format {
    if single_pass { Format::Depth32fStencil8 } else { Format::Depth32f }
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
    layouts: [SetLayout; 3],
    array_sets: HashMap<[u32; 3], DescriptorSet>,
    base: LeafList,
    base_draws: Vec<BaseDraw>,
    dynamic: Option<LeafList>,
    pipelines: HashMap<PipelineKey, GraphicsPipeline>,
    depth_reset: Option<GraphicsPipeline>,
    /// By coverage samples a pixel.
    panoramas: HashMap<u32, GraphicsPipeline>,
    /// What [`draw_base`](Self::draw_base) was drawn for, if nothing was drawn upon it yet.
    fresh_base: Option<FrameBlock>,
    target: Option<Target>,
    /// That of the plain picture.
    plain_target: Option<Target>,
    /// While it is drawn: where.
    plain_tiles: Option<Vec<Tile>>,
    plain_opening: Option<GraphicsPipeline>,
    /// Coverage samples a pixel of what is drawn now.
    samples: u32,
    between: Option<Between>,
    touch_only: bool,
    /// Of pictures that are read while the next is drawn.
    ring: Option<PictureRing>,
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
        let fixed = size_of_val(table.texels.as_slice())
            + size_of_val(base.vertices.as_slice())
            + size_of_val(base.leaves.as_slice());
        let staging = staging_bytes(options.leaves, fixed as u64);
        let mut uploads = Uploads::new(gpu, "leaf uploads", staging)?;
        let frame = DeviceBuffer::new(gpu, "frame", size_of::<FrameBlock>() as u64)?;
        let texels = uploads.buffer("scene table", &table.texels)?;
        let layouts = [
            SetLayout::new(gpu, "scene", &SCENE_BINDINGS)?,
            SetLayout::new(gpu, "leaves", &LEAF_BINDINGS)?,
            SetLayout::new(gpu, "arrays", &ARRAY_BINDINGS)?,
        ];
        let scene_set = layouts[0]
            .set(
                "scene",
                &[
                    ("frame", Resource::Buffer(&frame)),
                    ("scene_table", Resource::Buffer(&texels)),
                    ("bank", Resource::Textures(&bank.bindings())),
                    ("environment", Resource::Textures(&[bank.environment()])),
                ],
            )
            .map_err(|error| error.with_remedy("use a scene with fewer materials and planar surfaces"))?;
        let base_data: [&[u8]; 2] =
            [bytemuck::cast_slice(&base.vertices), bytemuck::cast_slice(&base.leaves)];
        let [vertices, records] = base_data.map(|data| data.len() as u64);
        let base_list = LeafList::new(gpu, &layouts[1], ("base", false), [vertices, records, 0])?;
        let mut write = base_list.writer(&mut uploads);
        write(0, base_data[0])?;
        write(1, base_data[1])?;
        drop(write);
        uploads.flush()?;
        let depth_reset = options.single_pass.then(|| base_image::depth_reset(gpu)).transpose()?;
        let mut painter = Self {
            gpu: gpu.clone(),
            samples: options.samples,
            options,
            bank,
            commands: Commands::new(gpu, "frame", 16)?,
            uploads,
            frame,
            scene_set,
            layouts,
            array_sets: HashMap::new(),
            base: base_list,
            base_draws: base.draws.clone(),
            dynamic: None,
            pipelines: HashMap::new(),
            depth_reset,
            panoramas: HashMap::new(),
            fresh_base: None,
            target: None,
            plain_target: None,
            plain_tiles: None,
            plain_opening: None,
            between: None,
            touch_only: false,
            ring: None,
        };
        painter.make_panorama()?;
        Ok(painter)
    }

    /// The texture bank, for another painter.
    pub fn into_bank(self) -> Bank {
        self.bank
    }

    /// The texture bank.
    pub fn bank(&self) -> &Bank {
        &self.bank
    }

    /// Hands the leaves of a frame over to the device.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn upload(&mut self, leaves: &mut Drawn) -> Result<()> {
        let bytes = leaves.bytes();
        // Dropped before it is made anew, so that both never exist at once.
        let list = match self.dynamic.take().filter(|list| list.fits(bytes)) {
            Some(list) => list,
            None => LeafList::new(&self.gpu, &self.layouts[1], ("leaves", true), bytes)?,
        };
        leaves.hand_over(self.dynamic.insert(list).writer(&mut self.uploads))?;
        self.uploads.flush()
    }

    /// Lets draws touch a single pixel until this is taken back: what they need is compiled, next to nothing drawn.
    pub fn touch_only(&mut self, touch: bool) {
        self.touch_only = touch;
    }

    /// Draws the frame in `passes`, all or some of the options'; the leaves are those of the last
    /// [`upload`](Self::upload). Returns what was recorded. In a single pass they are drawn upon the last
    /// [`draw_base`](Self::draw_base), which is drawn again only if it was drawn upon already, or for another block.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn draw(
        &mut self,
        block: &FrameBlock,
        leaves: Option<&Drawn>,
        passes: &[ColorPass],
    ) -> Result<Vec<Drawing>> {
        self.make_target(block)?;
        self.make_panorama()?;
        let mut draws = leaves.map_or(Vec::new(), leaf_draws);
        if self.between.as_ref().is_some_and(|between| between.replaces_picture) {
            draws.retain(|draw| !draw.group.picture);
        }
        let base_keys = self.prepare(&draws, passes)?;
        let mut drawings = Vec::new();
        let blended = match leaves {
            Some(leaves) if leaves.veiled() => Vec::new(),
            _ => self.blended_draws(block.eye),
        };
        let frustum = block.frustum();

        self.uploads.write(&self.frame, 0, std::slice::from_ref(block))?;
        let drawn_for = self.fresh_base.take();
        let base_is_fresh =
            drawn_for.is_some_and(|drawn| bytemuck::bytes_of(&drawn) == bytemuck::bytes_of(block));
        let Self {
            options,
            samples,
            between,
            depth_reset,
            plain_tiles,
            plain_opening,
            panoramas,
            commands,
            uploads,
            target,
            pipelines,
            scene_set,
            base,
            base_draws,
            dynamic,
            array_sets,
            touch_only,
            ..
        } = self;
        let limit = |commands: &mut Draws<'_, '_>| {
            if *touch_only {
                commands.scissor([0, 0, 1, 1]);
            }
        };
        let Some(target) = target else { return Ok(Vec::new()) };
        let mut recording = commands.begin()?;
        uploads.record(&mut recording);
        let (panorama, samples) = (panoramas.get(samples), *samples);
        let between = between.as_ref().filter(|between| between.count > 0);
        let record_opaque = |commands: &mut Draws<'_, '_>| {
            limit(commands);
            for (draw, key) in base_draws.iter().zip(&base_keys).filter(|(draw, _)| !draw.blended) {
                let arrays = &array_sets[&[draw.array, 0, 0]];
                record_base(commands, &pipelines[key], [scene_set, &base.set, arrays], draw, &frustum);
            }
            if let Some(pipeline) = panorama {
                commands.pipeline(pipeline).set(0, scene_set).draw(0..3);
            }
        };
        if options.single_pass && !base_is_fresh {
            target.render(&mut recording, Some(options.clear()), record_opaque);
        }
        if let Some(pipeline) = depth_reset {
            target.reset_depth(&mut recording, pipeline);
        }
        let tiles = plain_tiles.as_ref().filter(|_| !*touch_only);
        let opened = plain_opening.as_ref().zip(tiles).map(|(pipeline, tiles)| {
            target.render(&mut recording, Some(options.clear()), |_| {});
            target.open(&mut recording, pipeline, tiles);
        });
        for (index, &pass) in passes.iter().enumerate() {
            let with_base = index == 0 && !options.single_pass;
            let of_leaves = draws.iter().filter(|draw| drawn(index, draw.group.kind));
            let opaque = base_draws.iter().filter(|draw| with_base && !draw.blended);
            let of_between = between.filter(|_| index == 0);
            let count =
                of_leaves.clone().count() + opaque.count() + of_between.map_or(0, |b| b.draws().count());
            drawings.push(Drawing { name: pass.name, ms: 0.0, draws: count as u32 });
            recording.timed(pass.name, |recording| {
                let clear = with_base && opened.is_none();
                target.render(recording, clear.then(|| options.clear()), |commands| {
                    limit(commands);
                    if let Some(list) = dynamic {
                        // The first pass shows the last of leaves that lie on one another; of later passes it is the first.
                        let mut of_leaves: Vec<&LeafDraw> = of_leaves.collect();
                        if index > 0 {
                            of_leaves.reverse();
                        }
                        for draw in of_leaves {
                            let pipeline = &pipelines[&leaf_key(options, samples, (index, pass), draw.group)];
                            commands.pipeline(pipeline).set(0, scene_set).set(1, &list.set);
                            commands.set(2, &array_sets[&bound_arrays(draw.group.arrays)]);
                            let Range { start, end } = draw.leaves;
                            commands
                                .draw_instance(3 * start..3 * end, if index > 0 { start + end } else { 0 });
                        }
                    }
                    if let Some(between) = of_between {
                        let pipeline = &pipelines[&leaf_key(options, samples, (index, pass), Group::BETWEEN)];
                        commands.pipeline(pipeline).set(0, scene_set).set(1, &between.list.set);
                        commands.set(2, &array_sets[&Group::BETWEEN.arrays]);
                        for leaves in between.draws() {
                            commands.draw(3 * leaves.start..3 * leaves.end);
                        }
                    }
                    if with_base {
                        record_opaque(commands);
                    }
                });
            });
        }
        if !blended.is_empty() {
            drawings.push(Drawing { name: "blended", ms: 0.0, draws: blended.len() as u32 });
            recording.timed("blended", |recording| {
                target.render(recording, None, |commands| {
                    limit(commands);
                    for draw in blended {
                        let arrays = &array_sets[&[base_draws[draw].array, 0, 0]];
                        record_base(
                            commands,
                            &pipelines[&base_keys[draw]],
                            [scene_set, &base.set, arrays],
                            &base_draws[draw],
                            &frustum,
                        );
                    }
                });
            });
        }
        if let Some(mean) = &target.mean {
            recording.shrink(&target.color, mean);
        }
        recording.submit_and_wait()?;
        for timing in self.commands.timings()? {
            if let Some(drawing) = drawings.iter_mut().find(|drawing| drawing.name == timing.name) {
                drawing.ms = timing.ms;
            }
        }
        Ok(drawings)
    }

    /// Makes the pipelines and the sets of textures that these draws of leaves and those of the base image need; the keys of the
    /// latter.
    fn prepare(&mut self, draws: &[LeafDraw], passes: &[ColorPass]) -> Result<Vec<PipelineKey>> {
        for LeafDraw { group, .. } in draws {
            for (index, &pass) in passes.iter().enumerate().filter(|&(index, _)| drawn(index, group.kind)) {
                self.pipeline(leaf_key(&self.options, self.samples, (index, pass), *group))?;
            }
            self.array_set(bound_arrays(group.arrays))?;
        }
        if let (Some(Between { count: 1.., .. }), Some(&pass)) = (&self.between, passes.first()) {
            self.pipeline(leaf_key(&self.options, self.samples, (0, pass), Group::BETWEEN))?;
            self.array_set(Group::BETWEEN.arrays)?;
        }
        for index in 0..self.base_draws.len() {
            self.array_set([self.base_draws[index].array, 0, 0])?;
        }
        let base_keys: Vec<PipelineKey> = self.base_draws.iter().map(|draw| self.base_key(draw)).collect();
        for &key in &base_keys {
            self.pipeline(key)?;
        }
        Ok(base_keys)
    }

    /// Blended draws, those farthest from `eye` first.
    fn blended_draws(&self, eye: Vec3) -> Vec<usize> {
        let mut blended: Vec<usize> =
            (0..self.base_draws.len()).filter(|&draw| self.base_draws[draw].blended).collect();
        let distance = |draw: usize| self.base_draws[draw].centre.distance_squared(eye);
        blended.sort_by(|&a, &b| distance(b).total_cmp(&distance(a)));
        blended
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
        let picture = target.picture().clone();
        readback::read_in_bands(commands, &picture, &mut target.staging)
    }

    /// Starts to copy the finished image to the host; `None` if nothing was drawn yet.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn start_reading(&mut self) -> Result<Option<PendingImage>> {
        let Self { ring, target, gpu, .. } = self;
        let Some(target) = target else { return Ok(None) };
        let ring = match ring {
            Some(ring) => ring,
            slot => slot.insert(PictureRing::new(gpu)?),
        };
        ring.start(target.picture()).map(Some)
    }

    /// `block` with four times as many fragments a pixel; `None` if the device has no images of that size, or they had
    /// better be drawn in turns.
    pub fn halved(&self, block: &FrameBlock) -> Option<FrameBlock> {
        let desc = self.target_desc(block).halved().filter(|desc| Target::is_possible(&self.gpu, desc))?;
        Some(FrameBlock { halvings: desc.halvings, ..*block })
    }

    fn make_target(&mut self, block: &FrameBlock) -> Result<()> {
        let desc = self.target_desc(block);
        if self.target.as_ref().is_none_or(|target| target.desc != desc) {
            // Freed before it is made anew, so that both never exist at once.
            self.target = None;
            self.fresh_base = None;
            self.target = Some(Target::new(&self.gpu, desc)?);
        }
        Ok(())
    }

    fn target_desc(&self, block: &FrameBlock) -> TargetDesc {
        let &FrameBlock { width, height, halvings, .. } = block;
        TargetDesc {
            width,
            height,
            halvings,
            samples: self.samples,
            depth: self.depth_format(),
            is_plain: self.plain_tiles.is_some(),
        }
    }

    /// Makes the set of a group's arrays.
    fn array_set(&mut self, arrays: [u32; 3]) -> Result<()> {
        if !self.array_sets.contains_key(&arrays) {
            let bindings = self.bank.bindings();
            let [own, first, node] = arrays.map(|array| [bindings[array as usize]]);
            let set = self.layouts[2].set(
                "arrays",
                &[
                    ("own_texture", Resource::Textures(&own)),
                    ("first_texture", Resource::Textures(&first)),
                    ("node_texture", Resource::Textures(&node)),
                ],
            )?;
            self.array_sets.insert(arrays, set);
        }
        Ok(())
    }

    fn depth_format(&self) -> Format {
        depth_format(self.options.single_pass)
    }
}

/// Consecutive leaves of one group.
struct LeafDraw {
    leaves: Range<u32>,
    group: Group,
}

fn leaf_draws(leaves: &Drawn) -> Vec<LeafDraw> {
    let mut draws = Vec::new();
    let mut start = 0;
    for &(group, count) in leaves.groups() {
        draws.extend(
            clusters::split(start..start + count, group.cut).map(|leaves| LeafDraw { leaves, group }),
        );
        start += count;
    }
    draws
}

/// Whether leaves of kind `kind` are drawn in colour pass `index`: those without specular part, or with it in their
/// traced pixels, only in the first.
fn drawn(index: usize, kind: u32) -> bool {
    index == 0 || !leaves::is_primary(kind)
}

/// The arrays that are bound for a group: any where it needs none or several.
fn bound_arrays(arrays: [u32; 3]) -> [u32; 3] {
    arrays.map(|array| if array == MIXED_ARRAYS { 0 } else { array })
}

fn record_base(
    commands: &mut Draws<'_, '_>,
    pipeline: &GraphicsPipeline,
    [scene, list, arrays]: [&DescriptorSet; 3],
    draw: &BaseDraw,
    frustum: &Frustum,
) {
    commands.pipeline(pipeline).set(0, scene).set(1, list).set(2, arrays);
    for leaves in draw.clusters.draws(frustum) {
        commands.draw(3 * leaves.start..3 * leaves.end);
    }
}
