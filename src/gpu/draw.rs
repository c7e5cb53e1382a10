//! Render passes: targets and the draws into them.

use std::ops::Range;

use ash::vk;
use bytemuck::Pod;

use super::{Access, DescriptorSet, GraphicsPipeline, Image, Recording};

/// What a render pass draws into; all of one size.
#[derive(Debug, Clone, Copy)]
pub struct Targets<'a> {
    /// Colour targets, in the order of the pipeline's formats.
    pub colors: &'a [ColorTarget<'a>],
    /// Depth target, with or without stencil.
    pub depth: Option<DepthTarget<'a>>,
}

/// A colour target.
#[derive(Debug, Clone, Copy)]
pub struct ColorTarget<'a> {
    /// The image.
    pub image: &'a Image,
    /// Colour that all pixels get first; `None` keeps what is there.
    pub clear: Option<[f32; 4]>,
    /// Image that gets the mean of each pixel's samples.
    pub resolve: Option<&'a Image>,
}

/// A depth target.
#[derive(Debug, Clone, Copy)]
pub struct DepthTarget<'a> {
    /// The image.
    pub image: &'a Image,
    /// Whether depth and stencil are 0 (far away) first; else what is there is kept.
    pub clear: bool,
}

/// The draws of one render pass.
pub struct Draws<'r, 'a> {
    recording: &'r mut Recording<'a>,
    pipeline: Option<GraphicsPipeline>,
}

impl<'a> Recording<'a> {
    /// Draws into `targets` what `work` records.
    ///
    /// Buffers and textures that the draws read must be in their access before: see
    /// [`use_buffer`](Self::use_buffer).
    ///
    /// # Panics
    /// Without any target.
    pub fn render<T>(&mut self, targets: &Targets<'_>, work: impl FnOnce(&mut Draws<'_, 'a>) -> T) -> T {
        for color in targets.colors {
            self.image_access(&color.image.raw, Access::ColorTarget, color.clear.is_some());
            if let Some(resolve) = color.resolve {
                self.image_access(&resolve.raw, Access::ColorTarget, true);
            }
        }
        if let Some(depth) = targets.depth {
            self.image_access(&depth.image.raw, Access::DepthTarget, depth.clear);
        }
        let colors: Vec<_> = targets.colors.iter().map(color_attachment).collect();
        let depth = targets.depth.map(|depth| depth_attachment(&depth));
        let first =
            targets.colors.first().map(|color| color.image).or(targets.depth.map(|depth| depth.image));
        let size = first.expect("a render pass has a target");
        let area = vk::Rect2D {
            offset: vk::Offset2D::default(),
            extent: vk::Extent2D { width: size.width(), height: size.height() },
        };
        let mut info =
            vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&colors);
        if let (Some(attachment), Some(target)) = (&depth, targets.depth) {
            info = info.depth_attachment(attachment);
            if target.image.format().has_stencil() {
                info = info.stencil_attachment(attachment);
            }
        }
        // Clip space has y down already and depth from 1 (near) to 0.
        let viewport = vk::Viewport {
            width: size.width() as f32,
            height: size.height() as f32,
            max_depth: 1.0,
            ..vk::Viewport::default()
        };
        // SAFETY: recording; the targets are in their layouts and held until the device is done.
        unsafe {
            self.device().cmd_begin_rendering(self.raw(), &info);
            self.device().cmd_set_viewport(self.raw(), 0, &[viewport]);
            self.device().cmd_set_scissor(self.raw(), 0, &[area]);
        }
        let result = work(&mut Draws { recording: self, pipeline: None });
        // SAFETY: begun above.
        unsafe { self.device().cmd_end_rendering(self.raw()) };
        result
    }
}

impl Draws<'_, '_> {
    /// Draws with `pipeline` from now on; sets and push constants have to be given anew.
    pub fn pipeline(&mut self, pipeline: &GraphicsPipeline) -> &mut Self {
        // SAFETY: in a render pass; the pipeline is held until the device is done.
        unsafe {
            self.recording.device().cmd_bind_pipeline(
                self.recording.raw(),
                vk::PipelineBindPoint::GRAPHICS,
                pipeline.raw.handle,
            );
        }
        self.recording.hold(pipeline.raw.clone());
        self.pipeline = Some(pipeline.clone());
        self
    }

    /// Binds `set` as set number `index`.
    ///
    /// # Panics
    /// Without a pipeline.
    pub fn set(&mut self, index: u32, set: &DescriptorSet) -> &mut Self {
        let layout = self.bound().layout;
        // SAFETY: in a render pass; the set is held until the device is done.
        unsafe {
            self.recording.device().cmd_bind_descriptor_sets(
                self.recording.raw(),
                vk::PipelineBindPoint::GRAPHICS,
                layout,
                index,
                &[set.raw.handle],
                &[],
            );
        }
        self.recording.hold(set.raw.clone());
        self
    }

    /// Sets all push constants.
    ///
    /// # Panics
    /// Without a pipeline, or if it was made for another size.
    pub fn push<P: Pod>(&mut self, push: &P) -> &mut Self {
        let bytes = bytemuck::bytes_of(push);
        let bound = self.bound();
        assert_eq!(bytes.len(), bound.push_bytes as usize, "size of push constants");
        let (layout, stages) = (bound.layout, bound.push_stages);
        // SAFETY: in a render pass; the range is the layout's.
        unsafe {
            self.recording.device().cmd_push_constants(self.recording.raw(), layout, stages, 0, bytes);
        }
        self
    }

    /// Limits drawing to a rectangle: left, top, width, height.
    pub fn scissor(&mut self, [x, y, width, height]: [u32; 4]) -> &mut Self {
        let area = vk::Rect2D {
            offset: vk::Offset2D { x: x as i32, y: y as i32 },
            extent: vk::Extent2D { width, height },
        };
        // SAFETY: in a render pass.
        unsafe { self.recording.device().cmd_set_scissor(self.recording.raw(), 0, &[area]) };
        self
    }

    /// Draws triangles of these vertices, or nothing if there are none.
    ///
    /// # Panics
    /// Without a pipeline.
    pub fn draw(&mut self, vertices: Range<u32>) -> &mut Self {
        self.draw_instance(vertices, 0)
    }

    /// The same as instance number `instance`.
    ///
    /// # Panics
    /// Without a pipeline.
    pub fn draw_instance(&mut self, vertices: Range<u32>, instance: u32) -> &mut Self {
        self.bound();
        if !vertices.is_empty() {
            // SAFETY: in a render pass with a pipeline bound.
            unsafe {
                self.recording.device().cmd_draw(
                    self.recording.raw(),
                    vertices.end - vertices.start,
                    1,
                    vertices.start,
                    instance,
                );
            }
        }
        self
    }

    fn bound(&self) -> &super::pipeline::RawPipeline {
        &self.pipeline.as_ref().expect("a pipeline is bound first").raw
    }
}

fn color_attachment(target: &ColorTarget<'_>) -> vk::RenderingAttachmentInfo<'static> {
    let mut info = vk::RenderingAttachmentInfo::default()
        .image_view(target.image.raw.view)
        .image_layout(Access::ColorTarget.layout())
        .load_op(if target.clear.is_some() {
            vk::AttachmentLoadOp::CLEAR
        } else {
            vk::AttachmentLoadOp::LOAD
        })
        .store_op(vk::AttachmentStoreOp::STORE)
        .clear_value(vk::ClearValue {
            color: vk::ClearColorValue { float32: target.clear.unwrap_or_default() },
        });
    if let Some(resolve) = target.resolve {
        info = info
            .resolve_mode(vk::ResolveModeFlags::AVERAGE)
            .resolve_image_view(resolve.raw.view)
            .resolve_image_layout(Access::ColorTarget.layout());
    }
    info
}

fn depth_attachment(target: &DepthTarget<'_>) -> vk::RenderingAttachmentInfo<'static> {
    vk::RenderingAttachmentInfo::default()
        .image_view(target.image.raw.view)
        .image_layout(Access::DepthTarget.layout())
        .load_op(if target.clear { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD })
        .store_op(vk::AttachmentStoreOp::STORE)
        .clear_value(vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 } })
}
