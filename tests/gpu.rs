//! What the passes build upon, apart from them: copies, blending, multisampling, stencil, textures.

mod common;

use std::sync::Arc;

use bytemuck::Zeroable;
use glam::{Mat4, Vec3};
use half::f16;
use vertex_tracing::{
    gpu::{
        Access, Blend, ColorTarget, Commands, DepthMode, DepthTarget, DescriptorSet, DeviceBuffer, Format,
        Gpu, GraphicsDesc, GraphicsPipeline, Image, ImageDesc, ReadbackBuffer, ReadbackChoice, ReadbackRing,
        Resource, SetLayout, StencilMode, Targets, Uploads,
    },
    spirv,
    visibility::face_draw::{FACE_BINDINGS, Push},
};

use common::TestGpu;

const SIZE: u32 = 16;

/// Triangles drawn by the ID buffer's shaders: face `n` of code 255 has the colour ((n + 1) / 255, 0, 0, 1).
struct Triangles {
    layout: SetLayout,
    set: DescriptorSet,
}

impl Triangles {
    /// Each three corners in clip coordinates.
    fn new(gpu: &Arc<Gpu>, corners: &[[f32; 3]]) -> Self {
        let mut uploads = Uploads::new(gpu, "uploads", 64).unwrap();
        let count = corners.len() as u32 / 3;
        let faces: Vec<[u32; 3]> = (0..count).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
        let entries: Vec<u32> = (0..count).map(|face| 255 << 24 | face).collect();
        let layout = SetLayout::new(gpu, "triangles", &FACE_BINDINGS).unwrap();
        let set = layout
            .set(
                "triangles",
                &[
                    ("positions", Resource::Buffer(&uploads.buffer("positions", corners).unwrap())),
                    ("faces", Resource::Buffer(&uploads.buffer("faces", &faces).unwrap())),
                    ("entries", Resource::Buffer(&uploads.buffer("entries", &entries).unwrap())),
                    ("mask_vertices", Resource::Buffer(&uploads.buffer::<u32>("none", &[]).unwrap())),
                ],
            )
            .unwrap();
        uploads.flush().unwrap();
        Self { layout, set }
    }

    fn pipeline(&self, gpu: &Arc<Gpu>, desc: GraphicsDesc<'_>) -> GraphicsPipeline {
        let sets = [&self.layout];
        GraphicsPipeline::new(
            gpu,
            &GraphicsDesc { sets: &sets, push_bytes: size_of::<Push>() as u32, ..desc },
        )
        .unwrap()
    }
}

fn desc<'a>(name: &'a str, colors: &'a [(Format, Blend)]) -> GraphicsDesc<'a> {
    GraphicsDesc { colors, ..GraphicsDesc::opaque(name, spirv!("id_buffer.vert"), spirv!("id_buffer.frag")) }
}

/// Clip coordinates as they are.
fn identity() -> Push {
    Push { clip_from_eye_relative: Mat4::IDENTITY, eye: Vec3::ZERO, ..Push::zeroed() }
}

/// A triangle that covers everything left of `x` (in −1..=1) at depth `z`.
fn left_of(x: f32, z: f32) -> [[f32; 3]; 3] {
    [[x, -9.0, z], [x, 9.0, z], [-99.0, 0.0, z]]
}

fn read<T: bytemuck::Pod>(gpu: &Arc<Gpu>, image: &Image) -> Vec<T> {
    let mut commands = Commands::new(gpu, "read", 0).unwrap();
    let mut staging = ReadbackBuffer::new(gpu, "read", image.bytes(), ReadbackChoice::Best).unwrap();
    let mut recording = commands.begin().unwrap();
    recording.read_image(image, &mut staging);
    recording.submit_and_wait().unwrap();
    staging.read(image.bytes() as usize / size_of::<T>()).unwrap().to_vec()
}

#[test]
fn uploads_larger_than_their_staging_buffer() {
    let gpu = TestGpu::open();
    let data: Vec<u32> = (0..10_007).collect();
    let mut uploads = Uploads::new(&gpu, "uploads", 1000).unwrap();
    let buffer = uploads.buffer("numbers", &data).unwrap();
    uploads.write(&buffer, 40, &[7_u32, 8]).unwrap();
    let mut commands = Commands::new(&gpu, "copy", 1).unwrap();
    let mut staging = ReadbackBuffer::new(&gpu, "back", buffer.size(), ReadbackChoice::Best).unwrap();
    // The last uploads go with the recording that needs them.
    let mut recording = commands.begin().unwrap();
    uploads.record(&mut recording);
    recording.timed("copy", |recording| recording.read_buffer(&buffer, &mut staging, buffer.size()));
    recording.submit_and_wait().unwrap();
    let mut expected = data.clone();
    expected[10..12].copy_from_slice(&[7, 8]);
    assert!(staging.read::<u32>(data.len()).unwrap() == expected);
    let timings = commands.timings().unwrap();
    assert_eq!(timings.iter().map(|timing| timing.name).collect::<Vec<_>>(), ["copy"]);
    drop((uploads, buffer, commands, staging));
    gpu.finish();
}

#[test]
fn a_ring_holds_several_reads_in_flight() {
    let gpu = TestGpu::open();
    let buffer = DeviceBuffer::new(&gpu, "value", 4096).unwrap();
    let mut commands = [0, 1, 2].map(|_| Commands::new(&gpu, "fill", 0).unwrap());
    let mut ring = ReadbackRing::new(&gpu, "ring", 3, 4096, ReadbackChoice::Best).unwrap();
    for frame in 0..20_u32 {
        let mut recording = commands[frame as usize % 3].begin().unwrap();
        recording.fill(&buffer, frame);
        recording.read_buffer(&buffer, ring.advance(), 4096);
        let submission = recording.submit().unwrap();
        if frame >= 2 {
            let oldest = ring.latest(2).read::<u32>(1024).unwrap();
            assert!(oldest.iter().all(|&value| value == frame - 2));
        }
        if frame == 19 {
            submission.wait().unwrap();
        }
    }
    drop((buffer, commands, ring));
    gpu.finish();
}

#[test]
fn a_recording_that_is_dropped_changes_nothing() {
    let gpu = TestGpu::open();
    let mut uploads = Uploads::new(&gpu, "uploads", 64).unwrap();
    let buffer = uploads.buffer("numbers", &[1_u32, 2, 3]).unwrap();
    uploads.flush().unwrap();
    let mut commands = Commands::new(&gpu, "copy", 0).unwrap();
    let mut staging = ReadbackBuffer::new(&gpu, "back", 12, ReadbackChoice::Best).unwrap();
    let mut recording = commands.begin().unwrap();
    recording.fill(&buffer, 9);
    recording.use_buffer(&buffer, Access::ShaderRead);
    drop(recording);
    let mut recording = commands.begin().unwrap();
    recording.read_buffer(&buffer, &mut staging, 12);
    recording.submit_and_wait().unwrap();
    assert_eq!(staging.read::<u32>(3).unwrap(), [1, 2, 3]);
    drop((uploads, buffer, commands, staging));
    gpu.finish();
}

#[test]
fn additive_passes_at_equal_depth() {
    let gpu = TestGpu::open();
    // Face 0 on the left half in front of face 1 everywhere.
    let corners = [left_of(0.0, 0.6), left_of(9.0, 0.3)].concat();
    let triangles = Triangles::new(&gpu, &corners);
    let first = triangles.pipeline(&gpu, desc("first", &[(Format::Rgba16f, Blend::Replace)]));
    let more = |name, blend| {
        let colors = [(Format::Rgba16f, blend)];
        triangles.pipeline(&gpu, GraphicsDesc { depth: DepthMode::Equal, ..desc(name, &colors) })
    };
    let (second, third) = (more("second", Blend::AddOnce), more("third", Blend::AddOnceMore));
    let color = Image::new(&gpu, &ImageDesc::target("color", Format::Rgba16f, SIZE, SIZE)).unwrap();
    let depth = Image::new(&gpu, &ImageDesc::target("depth", Format::Depth32f, SIZE, SIZE)).unwrap();
    let mut commands = Commands::new(&gpu, "draw", 3).unwrap();
    let mut recording = commands.begin().unwrap();
    for (name, pipeline, clear) in
        [("first", &first, true), ("second", &second, false), ("third", &third, false)]
    {
        let colors = [ColorTarget { image: &color, clear: clear.then_some([0.0; 4]), resolve: None }];
        let depth = Some(DepthTarget { image: &depth, clear });
        recording.timed(name, |recording| {
            recording.render(&Targets { colors: &colors, depth }, |draws| {
                // Twice, as if two faces lay on each other: once counts.
                draws.pipeline(pipeline).set(0, &triangles.set).push(&identity()).draw(0..6).draw(0..6);
            });
        });
    }
    recording.submit_and_wait().unwrap();
    let timings = commands.timings().unwrap();
    assert_eq!(timings.iter().map(|timing| timing.name).collect::<Vec<_>>(), ["first", "second", "third"]);
    let pixels = read::<[f16; 4]>(&gpu, &color);
    let at = |x: usize| pixels[5 * SIZE as usize + x].map(f16::to_f32);
    for (x, face) in [(2, 1.0), (12, 2.0)] {
        assert!((at(x)[0] - 3.0 * face / 255.0).abs() < 1e-4, "{:?}", at(x));
        assert_eq!(at(x)[3], 1.0);
    }
    let depths = read::<f32>(&gpu, &depth);
    assert_eq!((depths[2], depths[12]), (0.6, 0.3));
    drop((triangles, first, second, third, color, depth, commands));
    gpu.finish();
}

#[test]
fn samples_are_resolved_to_their_mean() {
    let gpu = TestGpu::open();
    // An edge through the middle of column 8, and one sample a pixel to compare with.
    let triangles = Triangles::new(&gpu, &left_of(1.0 / SIZE as f32, 0.5));
    let target = |name, format| ImageDesc::target(name, format, SIZE, SIZE);
    let many = Image::new(&gpu, &target("samples", Format::Rgba16f).with_samples(4)).unwrap();
    let depth = Image::new(&gpu, &target("depth", Format::Depth32fStencil8).with_samples(4)).unwrap();
    let resolved = Image::new(&gpu, &target("resolved", Format::Rgba16f)).unwrap();
    let colors = [(Format::Rgba16f, Blend::Replace)];
    let pipeline = triangles.pipeline(
        &gpu,
        GraphicsDesc { depth_format: Some(Format::Depth32fStencil8), samples: 4, ..desc("samples", &colors) },
    );
    let mut commands = Commands::new(&gpu, "draw", 0).unwrap();
    let mut recording = commands.begin().unwrap();
    let colors = [ColorTarget { image: &many, clear: Some([0.0; 4]), resolve: Some(&resolved) }];
    let cleared = Some(DepthTarget { image: &depth, clear: true });
    recording.render(&Targets { colors: &colors, depth: cleared }, |draws| {
        draws.pipeline(&pipeline).set(0, &triangles.set).push(&identity()).draw(0..3);
    });
    recording.submit_and_wait().unwrap();
    let alphas: Vec<f32> =
        read::<[f16; 4]>(&gpu, &resolved)[..SIZE as usize].iter().map(|p| p[3].to_f32()).collect();
    assert_eq!(alphas[7..10], [1.0, 0.5, 0.0]);
    drop((triangles, pipeline, commands, many, depth, resolved));
    gpu.finish();
}

#[test]
fn the_stencil_restricts_what_follows() {
    let gpu = TestGpu::open();
    let triangles = Triangles::new(&gpu, &[left_of(0.0, 0.5), left_of(9.0, 0.3)].concat());
    let format = Format::Depth32fStencil8;
    let colors = [(Format::Rgba8, Blend::Replace)];
    let with = |name, stencil, depth| {
        let desc = GraphicsDesc { depth_format: Some(format), stencil, depth, ..desc(name, &colors) };
        triangles.pipeline(&gpu, desc)
    };
    let mark = with("mark", StencilMode::Mark(3), DepthMode::Write);
    let test = with("test", StencilMode::Test(3), DepthMode::Off);
    let color = Image::new(&gpu, &ImageDesc::target("color", Format::Rgba8, SIZE, SIZE)).unwrap();
    let depth = Image::new(&gpu, &ImageDesc::target("depth", format, SIZE, SIZE)).unwrap();
    let mut commands = Commands::new(&gpu, "draw", 0).unwrap();
    let mut recording = commands.begin().unwrap();
    let colors = [ColorTarget { image: &color, clear: Some([0.0; 4]), resolve: None }];
    let targets = Targets { colors: &colors, depth: Some(DepthTarget { image: &depth, clear: true }) };
    recording.render(&targets, |draws| {
        draws.pipeline(&mark).set(0, &triangles.set).push(&identity()).draw(0..3);
        // Face 1 everywhere, without depth: only the mark holds it back.
        draws.pipeline(&test).set(0, &triangles.set).push(&identity()).draw(3..6);
    });
    recording.submit_and_wait().unwrap();
    let pixels = read::<[u8; 4]>(&gpu, &color);
    assert_eq!((pixels[2], pixels[12]), ([2, 0, 0, 255], [0; 4]));
    drop((triangles, mark, test, color, depth, commands));
    gpu.finish();
}

#[test]
fn array_textures_with_all_mips() {
    let gpu = TestGpu::open();
    let mut uploads = Uploads::new(&gpu, "uploads", 64).unwrap();
    // Columns of two values side by side.
    let columns = |even: u8, odd: u8| -> Vec<u8> {
        (0..14 * 7).flat_map(|texel| [if texel % 2 == 0 { even } else { odd }; 4]).collect()
    };
    let layers = [columns(10, 10), columns(0, 200), columns(0, 255)];
    let mut commands = Commands::new(&gpu, "levels", 0).unwrap();
    // Means of linear values: 200 and 255 are (0.578, 1) of it, and half of that is encoded as (147, 188).
    for (format, means) in [(Format::Rgba8, [10, 100, 128]), (Format::Rgba8Srgb, [10, 147, 188])] {
        let slices = layers.each_ref().map(Vec::as_slice);
        let image = uploads.texture("texture", format, (14, 7), &slices, true).unwrap();
        uploads.flush().unwrap();
        for (layer, (texels, mean)) in layers.iter().zip(means).enumerate() {
            // 14x7, 7x3, 3x1, 1x1.
            for (level, count) in [14 * 7, 7 * 3, 3, 1].into_iter().enumerate() {
                let mut staging =
                    ReadbackBuffer::new(&gpu, "back", 14 * 7 * 4, ReadbackChoice::Best).unwrap();
                let mut recording = commands.begin().unwrap();
                recording.read_level(&image, level as u32, layer as u32, &mut staging);
                recording.submit_and_wait().unwrap();
                let found = staging.read::<[u8; 4]>(count).unwrap().as_flattened();
                if level == 0 {
                    assert!(found == texels, "{format:?}: level 0 of layer {layer}");
                    continue;
                }
                // Alpha is never encoded.
                let alpha = [10, 100, 128][layer];
                for (channel, &value) in found.iter().enumerate() {
                    let expected: u8 = if channel % 4 == 3 { alpha } else { mean };
                    assert!(
                        value.abs_diff(expected) <= 2,
                        "{format:?}: level {level} of layer {layer}: {value} for {expected}"
                    );
                }
            }
        }
    }
    drop((uploads, commands));
    gpu.finish();
}
