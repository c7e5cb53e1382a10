//! The pipelines of colour draws: what tells them apart, and how they are made.

use super::{BaseDraw, ColorPass, Painter, PassOptions};
use crate::constants::*;
use crate::error::Result;
use crate::gpu::{Blend, Cull, DepthMode, Format, GraphicsDesc, GraphicsPipeline, Shader, StencilMode};
use crate::options::{Equation, Reconstruction};
use crate::reconstruct::leaves::Group;
use crate::reconstruct::vertex::VertexLayout;
use crate::spirv;

/// What a pipeline is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct PipelineKey {
    reconstruction: Reconstruction,
    leaves: u32,
    mixed: bool,
    components: u32,
    blend: PassBlend,
    cull: bool,
    mark: Mark,
    /// Coverage samples a pixel.
    samples: u32,
}

/// How a draw meets what was drawn before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum PassBlend {
    First,
    /// By whether its number is even.
    Later(bool),
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

/// The key for leaves of `group` in colour pass number `index`.
pub(super) fn leaf_key(
    options: &PassOptions,
    samples: u32,
    (index, pass): (usize, ColorPass),
    group: Group,
) -> PipelineKey {
    PipelineKey {
        reconstruction: options.reconstruction,
        leaves: group.kind,
        mixed: group.arrays[2] == MIXED_ARRAYS,
        components: pass.components,
        blend: if index == 0 { PassBlend::First } else { PassBlend::Later(index.is_multiple_of(2)) },
        cull: false,
        mark: if options.single_pass && !group.picture { Mark::Needed } else { Mark::Ignored },
        samples,
    }
}

impl Painter {
    /// The key for faces drawn without samples.
    pub(super) fn base_key(&self, draw: &BaseDraw) -> PipelineKey {
        PipelineKey {
            reconstruction: Reconstruction::Exact,
            leaves: LEAVES_PLAIN,
            mixed: false,
            components: self.options.passes.first().map_or(COMPONENT_PRIMARY, |pass| pass.components),
            blend: if draw.blended { PassBlend::Coverage } else { PassBlend::First },
            cull: draw.cull,
            mark: match self.options.single_pass && !draw.blended {
                true => Mark::Set(draw.marked),
                false => Mark::Ignored,
            },
            samples: self.samples,
        }
    }

    /// Makes the pipeline of `key`, unless it is there.
    pub(super) fn pipeline(&mut self, key: PipelineKey) -> Result<()> {
        if self.pipelines.contains_key(&key) {
            return Ok(());
        }
        let mut constants = vec![
            (0, self.bank.arrays()),
            (1, self.options.features),
            (2, key.leaves),
            (3, key.components),
            (4, u32::from(self.options.equation == Equation::Four)),
            (5, self.options.lights),
            (6, u32::from(self.bank.is_anisotropic())),
            (7, u32::from(key.samples > 1)),
            (9, u32::from(key.mixed)),
            (10, u32::from(matches!(key.mark, Mark::Set(_)))),
            (11, u32::from(matches!(key.blend, PassBlend::Later(_)))),
        ];
        constants.extend(VertexLayout::of(self.options.features).constants());
        let stencil = match key.mark {
            Mark::Ignored => StencilMode::Off,
            Mark::Set(marked) => StencilMode::Mark(marked.into()),
            Mark::Needed => StencilMode::Test(1),
        };
        let (blend, depth) = match key.blend {
            PassBlend::First => (Blend::Replace, DepthMode::Write),
            // Of faces that lie on one another one is added: the first leaves of a pass change the alpha that they need.
            PassBlend::Later(false) => (Blend::AddOnce, DepthMode::Equal),
            PassBlend::Later(true) => (Blend::AddOnceMore, DepthMode::Equal),
            PassBlend::Coverage => (Blend::Over, DepthMode::Test),
        };
        let (vertex, fragment): (&[u8], &[u8]) = match (key.reconstruction, key.leaves) {
            (Reconstruction::Exact, LEAVES_PICTURE) => (spirv!("leaf.vert"), spirv!("picture.frag")),
            (Reconstruction::Exact, _) => (spirv!("leaf.vert"), spirv!("exact.frag")),
            (Reconstruction::Paper, _) => (spirv!("paper.vert"), spirv!("paper.frag")),
        };
        let pipeline = GraphicsPipeline::new(
            &self.gpu,
            &GraphicsDesc {
                vertex: Shader { spirv: vertex, constants: &constants },
                fragment: Shader { spirv: fragment, constants: &constants },
                sets: &[&self.layouts[0], &self.layouts[1], &self.layouts[2]],
                colors: &[(Format::Rgba16f, blend)],
                depth_format: Some(self.depth_format()),
                depth,
                stencil,
                cull: if key.cull { Cull::Back } else { Cull::None },
                samples: key.samples,
                ..GraphicsDesc::opaque("leaves", vertex, fragment)
            },
        )?;
        self.pipelines.insert(key, pipeline);
        Ok(())
    }
}
