//! Graphics and compute pipelines from small descriptions.

use std::{ffi::CStr, io::Cursor, sync::Arc};

use ash::vk;

use super::{Format, Gpu, SetLayout, census::Kind, descriptor::RawLayout};
use crate::error::{Error, Result};

const ENTRY_POINT: &CStr = c"main";

/// One compiled shader and the values of its specialization constants.
#[derive(Debug, Clone, Copy)]
pub struct Shader<'a> {
    /// SPIR-V: see [`spirv!`](crate::spirv).
    pub spirv: &'a [u8],
    /// Identifier and value of each specialization constant that is set.
    pub constants: &'a [(u32, u32)],
}

impl<'a> Shader<'a> {
    /// A shader without specialization constants.
    pub fn new(spirv: &'a [u8]) -> Self {
        Self { spirv, constants: &[] }
    }
}

/// How a fragment joins what is in the colour target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blend {
    /// It replaces it.
    Replace,
    /// It is added to it where the target's alpha is 1, which becomes 0: of several fragments the first alone is.
    AddOnce,
    /// The same where that is 0, which becomes the fragment's.
    AddOnceMore,
    /// It covers it by its alpha.
    Over,
}

/// Depth test against a reversed-Z target, in which nearer is greater.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthMode {
    /// No test, no write.
    Off,
    /// Passes where as near or nearer, and writes.
    Write,
    /// Passes where as near or nearer, writes nothing.
    Test,
    /// Passes where equal, writes nothing.
    Equal,
    /// Passes everywhere, and writes.
    Replace,
}

/// Use of the stencil.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StencilMode {
    /// None.
    Off,
    /// Where the depth test passes, the stencil becomes this value.
    Mark(u8),
    /// Passes where the stencil is this value.
    Test(u8),
}

/// Which faces are left out. Fronts are counter-clockwise in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cull {
    /// None.
    None,
    /// Those seen from behind.
    Back,
}

/// Description of a [`GraphicsPipeline`] that draws lists of triangles.
#[derive(Debug, Clone, Copy)]
pub struct GraphicsDesc<'a> {
    /// Debug name.
    pub name: &'a str,
    /// Vertex shader.
    pub vertex: Shader<'a>,
    /// Fragment shader.
    pub fragment: Shader<'a>,
    /// Layouts of the descriptor sets, in order.
    pub sets: &'a [&'a SetLayout],
    /// Bytes of push constants, at most 128, for all stages.
    pub push_bytes: u32,
    /// Format and blending of each colour target.
    pub colors: &'a [(Format, Blend)],
    /// Format of the depth target.
    pub depth_format: Option<Format>,
    /// Depth test.
    pub depth: DepthMode,
    /// Stencil.
    pub stencil: StencilMode,
    /// Faces left out.
    pub cull: Cull,
    /// Samples a pixel, 1 or 4.
    pub samples: u32,
}

impl<'a> GraphicsDesc<'a> {
    /// A pipeline that draws opaque triangles with a reversed-Z depth test.
    pub fn opaque(name: &'a str, vertex: &'a [u8], fragment: &'a [u8]) -> Self {
        Self {
            name,
            vertex: Shader::new(vertex),
            fragment: Shader::new(fragment),
            sets: &[],
            push_bytes: 0,
            colors: &[],
            depth_format: Some(Format::Depth32f),
            depth: DepthMode::Write,
            stencil: StencilMode::Off,
            cull: Cull::None,
            samples: 1,
        }
    }
}

/// A graphics pipeline for dynamic rendering; viewport and scissor are set by the recording.
#[derive(Clone, Debug)]
pub struct GraphicsPipeline {
    pub(super) raw: Arc<RawPipeline>,
}

/// A compute pipeline.
#[derive(Clone, Debug)]
pub struct ComputePipeline {
    pub(super) raw: Arc<RawPipeline>,
}

pub(super) struct RawPipeline {
    gpu: Arc<Gpu>,
    name: String,
    pub(super) handle: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) push_bytes: u32,
    pub(super) push_stages: vk::ShaderStageFlags,
    _sets: Vec<Arc<RawLayout>>,
}

impl GraphicsPipeline {
    /// Compiles the pipeline.
    ///
    /// # Errors
    /// What the driver says.
    pub fn new(gpu: &Arc<Gpu>, desc: &GraphicsDesc<'_>) -> Result<Self> {
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        let mut raw = RawPipeline::new(gpu, desc.name, desc.sets, desc.push_bytes, stages)?;
        let vertex = Stage::new(gpu, desc.name, &desc.vertex)?;
        let fragment = Stage::new(gpu, desc.name, &desc.fragment)?;
        let (vertex_constants, fragment_constants) = (vertex.constants(), fragment.constants());
        let stages = [
            vertex.info(vk::ShaderStageFlags::VERTEX, &vertex_constants),
            fragment.info(vk::ShaderStageFlags::FRAGMENT, &fragment_constants),
        ];

        // Vertex shaders read storage buffers.
        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let rasterization = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(match desc.cull {
                Cull::None => vk::CullModeFlags::NONE,
                Cull::Back => vk::CullModeFlags::BACK,
            })
            .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
            .line_width(1.0);
        let multisample = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::from_raw(desc.samples));
        let depth_stencil = depth_stencil(desc.depth, desc.stencil);
        let blends: Vec<_> = desc.colors.iter().map(|color| blend(color.1)).collect();
        let color_blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
        let dynamic = vk::PipelineDynamicStateCreateInfo::default()
            .dynamic_states(&[vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR]);
        let formats: Vec<_> = desc.colors.iter().map(|color| color.0.vk()).collect();
        let depth_format = desc.depth_format.map_or(vk::Format::UNDEFINED, Format::vk);
        let stencil_format = desc.depth_format.filter(|format| format.has_stencil());
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .color_attachment_formats(&formats)
            .depth_attachment_format(depth_format)
            .stencil_attachment_format(stencil_format.map_or(vk::Format::UNDEFINED, Format::vk));
        let infos = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&rasterization)
            .multisample_state(&multisample)
            .depth_stencil_state(&depth_stencil)
            .color_blend_state(&color_blend)
            .dynamic_state(&dynamic)
            .layout(raw.layout)
            .push_next(&mut rendering)];
        // SAFETY: everything that the description points to lives until after the call.
        raw.handle = gpu.call("vkCreateGraphicsPipelines", desc.name, |device| unsafe {
            device
                .create_graphics_pipelines(vk::PipelineCache::null(), &infos, None)
                .map_err(|(_, code)| code)
        })?[0];
        gpu.name(raw.handle, desc.name);
        gpu.count(Kind::Pipeline, desc.name, 0);
        Ok(Self { raw: Arc::new(raw) })
    }
}

impl ComputePipeline {
    /// Compiles the pipeline.
    ///
    /// # Errors
    /// What the driver says.
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        shader: Shader<'_>,
        sets: &[&SetLayout],
        push_bytes: u32,
    ) -> Result<Self> {
        let mut raw = RawPipeline::new(gpu, name, sets, push_bytes, vk::ShaderStageFlags::COMPUTE)?;
        let stage = Stage::new(gpu, name, &shader)?;
        let constants = stage.constants();
        let infos = [vk::ComputePipelineCreateInfo::default()
            .stage(stage.info(vk::ShaderStageFlags::COMPUTE, &constants))
            .layout(raw.layout)];
        // SAFETY: everything that the description points to lives until after the call.
        raw.handle = gpu.call("vkCreateComputePipelines", name, |device| unsafe {
            device.create_compute_pipelines(vk::PipelineCache::null(), &infos, None).map_err(|(_, code)| code)
        })?[0];
        gpu.name(raw.handle, name);
        gpu.count(Kind::Pipeline, name, 0);
        Ok(Self { raw: Arc::new(raw) })
    }
}

impl RawPipeline {
    /// The layout alone; the pipeline itself is filled in by the caller.
    fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        sets: &[&SetLayout],
        push_bytes: u32,
        push_stages: vk::ShaderStageFlags,
    ) -> Result<Self> {
        let layouts: Vec<_> = sets.iter().map(|set| set.raw.handle).collect();
        let ranges = [vk::PushConstantRange::default().stage_flags(push_stages).size(push_bytes)];
        let ranges = if push_bytes > 0 { &ranges[..] } else { &[] };
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts).push_constant_ranges(ranges);
        // SAFETY: a live device; the set layouts are alive.
        let layout = gpu.call("vkCreatePipelineLayout", name, |device| unsafe {
            device.create_pipeline_layout(&info, None)
        })?;
        gpu.name(layout, name);
        Ok(Self {
            gpu: gpu.clone(),
            name: name.into(),
            handle: vk::Pipeline::null(),
            layout,
            push_bytes,
            push_stages,
            _sets: sets.iter().map(|set| set.raw.clone()).collect(),
        })
    }
}

impl Drop for RawPipeline {
    fn drop(&mut self) {
        // SAFETY: command buffers own the pipelines they use until the device is done; null is ignored.
        unsafe {
            self.gpu.device.destroy_pipeline(self.handle, None);
            self.gpu.device.destroy_pipeline_layout(self.layout, None);
        }
    }
}

impl std::fmt::Debug for RawPipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "pipeline {}", self.name)
    }
}

/// A shader module while its pipeline is compiled.
struct Stage<'a> {
    gpu: &'a Gpu,
    module: vk::ShaderModule,
    entries: Vec<vk::SpecializationMapEntry>,
    values: Vec<u32>,
}

impl<'a> Stage<'a> {
    fn new(gpu: &'a Gpu, name: &str, shader: &Shader<'_>) -> Result<Self> {
        let code = ash::util::read_spv(&mut Cursor::new(shader.spirv)).map_err(Error::io(name))?;
        let info = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: valid SPIR-V, compiled at build time.
        let module = gpu.call("vkCreateShaderModule", name, |device| unsafe {
            device.create_shader_module(&info, None)
        })?;
        gpu.name(module, name);
        let entries = (0..)
            .zip(shader.constants)
            .map(|(index, &(id, _))| vk::SpecializationMapEntry {
                constant_id: id,
                offset: index * 4,
                size: 4,
            })
            .collect();
        Ok(Self {
            gpu,
            module,
            entries,
            values: shader.constants.iter().map(|constant| constant.1).collect(),
        })
    }

    fn constants(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default().map_entries(&self.entries).data(bytemuck::cast_slice(&self.values))
    }

    fn info<'b>(
        &self,
        stage: vk::ShaderStageFlags,
        constants: &'b vk::SpecializationInfo<'b>,
    ) -> vk::PipelineShaderStageCreateInfo<'b> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(stage)
            .module(self.module)
            .name(ENTRY_POINT)
            .specialization_info(constants)
    }
}

impl Drop for Stage<'_> {
    fn drop(&mut self) {
        // SAFETY: a module is needed only while pipelines are created from it.
        unsafe { self.gpu.device.destroy_shader_module(self.module, None) };
    }
}

fn blend(blend: Blend) -> vk::PipelineColorBlendAttachmentState {
    use vk::BlendFactor as Factor;
    let (source, target) = match blend {
        Blend::Replace => (Factor::ONE, Factor::ONE),
        Blend::AddOnce => (Factor::DST_ALPHA, Factor::ONE),
        Blend::AddOnceMore => (Factor::ONE_MINUS_DST_ALPHA, Factor::ONE),
        Blend::Over => (Factor::SRC_ALPHA, Factor::ONE_MINUS_SRC_ALPHA),
    };
    let (source_alpha, target_alpha) = match blend {
        Blend::AddOnce => (Factor::ZERO, Factor::ZERO),
        Blend::AddOnceMore => (Factor::ONE, Factor::ZERO),
        Blend::Replace | Blend::Over => (Factor::ONE, Factor::ONE),
    };
    vk::PipelineColorBlendAttachmentState::default()
        .color_write_mask(vk::ColorComponentFlags::RGBA)
        .blend_enable(blend != Blend::Replace)
        .src_color_blend_factor(source)
        .dst_color_blend_factor(target)
        .color_blend_op(vk::BlendOp::ADD)
        .src_alpha_blend_factor(source_alpha)
        .dst_alpha_blend_factor(target_alpha)
        .alpha_blend_op(vk::BlendOp::ADD)
}

fn depth_stencil(depth: DepthMode, stencil: StencilMode) -> vk::PipelineDepthStencilStateCreateInfo<'static> {
    let (compare, pass, reference) = match stencil {
        StencilMode::Off => (vk::CompareOp::ALWAYS, vk::StencilOp::KEEP, 0),
        StencilMode::Mark(value) => (vk::CompareOp::ALWAYS, vk::StencilOp::REPLACE, value),
        StencilMode::Test(value) => (vk::CompareOp::EQUAL, vk::StencilOp::KEEP, value),
    };
    let face = vk::StencilOpState {
        fail_op: vk::StencilOp::KEEP,
        pass_op: pass,
        depth_fail_op: vk::StencilOp::KEEP,
        compare_op: compare,
        compare_mask: 0xff,
        write_mask: 0xff,
        reference: u32::from(reference),
    };
    vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(depth != DepthMode::Off)
        .depth_write_enable(matches!(depth, DepthMode::Write | DepthMode::Replace))
        .depth_compare_op(match depth {
            DepthMode::Equal => vk::CompareOp::EQUAL,
            DepthMode::Replace => vk::CompareOp::ALWAYS,
            _ => vk::CompareOp::GREATER_OR_EQUAL,
        })
        .stencil_test_enable(stencil != StencilMode::Off)
        .front(face)
        .back(face)
}
