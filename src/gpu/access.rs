//! What the device does to a resource, and the barrier that lets one use follow another.

use ash::vk;

const SHADERS: vk::PipelineStageFlags2 = vk::PipelineStageFlags2::from_raw(
    vk::PipelineStageFlags2::VERTEX_SHADER.as_raw()
        | vk::PipelineStageFlags2::FRAGMENT_SHADER.as_raw()
        | vk::PipelineStageFlags2::COMPUTE_SHADER.as_raw(),
);

/// One kind of use of an image or buffer on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Access {
    /// Not used yet, or the content may be thrown away.
    Undefined,
    /// Source of a copy or blit.
    TransferRead,
    /// Target of a copy, blit or fill.
    TransferWrite,
    /// Read by any draw or dispatch: vertex attributes, indices, sampled images, uniform and storage buffers.
    ShaderRead,
    /// Read and written by any shader.
    ShaderWrite,
    /// Colour target or target of a resolve.
    ColorTarget,
    /// Depth and stencil target, tested or written.
    DepthTarget,
    /// Read by the host, once the submission is done.
    HostRead,
}

impl Access {
    const ALL: [Self; 8] = [
        Self::Undefined,
        Self::TransferRead,
        Self::TransferWrite,
        Self::ShaderRead,
        Self::ShaderWrite,
        Self::ColorTarget,
        Self::DepthTarget,
        Self::HostRead,
    ];

    /// The access whose discriminant is `code`.
    pub(super) fn from_code(code: u8) -> Self {
        Self::ALL[usize::from(code)]
    }

    /// Pipeline stages that it happens in.
    pub(super) fn stages(self) -> vk::PipelineStageFlags2 {
        use vk::PipelineStageFlags2 as Stage;
        match self {
            Self::Undefined => Stage::NONE,
            Self::TransferRead | Self::TransferWrite => Stage::ALL_TRANSFER,
            Self::ShaderRead => SHADERS | Stage::VERTEX_INPUT,
            Self::ShaderWrite => SHADERS,
            Self::ColorTarget => Stage::COLOR_ATTACHMENT_OUTPUT,
            Self::DepthTarget => Stage::EARLY_FRAGMENT_TESTS | Stage::LATE_FRAGMENT_TESTS,
            Self::HostRead => Stage::HOST,
        }
    }

    /// Kinds of memory access.
    pub(super) fn mask(self) -> vk::AccessFlags2 {
        use vk::AccessFlags2 as Mask;
        match self {
            Self::Undefined => Mask::NONE,
            Self::TransferRead => Mask::TRANSFER_READ,
            Self::TransferWrite => Mask::TRANSFER_WRITE,
            Self::ShaderRead => {
                Mask::SHADER_READ | Mask::UNIFORM_READ | Mask::VERTEX_ATTRIBUTE_READ | Mask::INDEX_READ
            }
            Self::ShaderWrite => Mask::SHADER_READ | Mask::SHADER_WRITE,
            Self::ColorTarget => Mask::COLOR_ATTACHMENT_READ | Mask::COLOR_ATTACHMENT_WRITE,
            Self::DepthTarget => Mask::DEPTH_STENCIL_ATTACHMENT_READ | Mask::DEPTH_STENCIL_ATTACHMENT_WRITE,
            Self::HostRead => Mask::HOST_READ,
        }
    }

    /// Layout of an image during it.
    pub(super) fn layout(self) -> vk::ImageLayout {
        match self {
            Self::Undefined => vk::ImageLayout::UNDEFINED,
            Self::TransferRead => vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
            Self::TransferWrite => vk::ImageLayout::TRANSFER_DST_OPTIMAL,
            Self::ShaderRead => vk::ImageLayout::READ_ONLY_OPTIMAL,
            Self::ShaderWrite | Self::HostRead => vk::ImageLayout::GENERAL,
            Self::ColorTarget | Self::DepthTarget => vk::ImageLayout::ATTACHMENT_OPTIMAL,
        }
    }

    /// Whether it may change the content.
    pub(super) fn writes(self) -> bool {
        matches!(self, Self::TransferWrite | Self::ShaderWrite | Self::ColorTarget | Self::DepthTarget)
    }

    /// Whether `next` has to wait for `self`: only the same read twice does not.
    pub(super) fn needs_barrier(self, next: Self) -> bool {
        // A read after another kind of read waits too, so that it also sees what the first one waited for.
        self != next || self.writes()
    }
}

/// The barrier between two uses of a buffer. Drivers treat a global one and one for a buffer alike.
pub(super) fn memory_barrier(before: Access, after: Access) -> vk::MemoryBarrier2<'static> {
    vk::MemoryBarrier2::default()
        .src_stage_mask(before.stages())
        .src_access_mask(before.mask())
        .dst_stage_mask(after.stages())
        .dst_access_mask(after.mask())
}

/// The barrier between two uses of mip levels `mips` (first, count) of all layers of an image.
///
/// `discard` throws the old content away.
pub(super) fn image_barrier(
    image: vk::Image,
    aspect: vk::ImageAspectFlags,
    mips: (u32, u32),
    (before, after): (Access, Access),
    discard: bool,
) -> vk::ImageMemoryBarrier2<'static> {
    vk::ImageMemoryBarrier2::default()
        .src_stage_mask(before.stages())
        .src_access_mask(before.mask())
        .dst_stage_mask(after.stages())
        .dst_access_mask(after.mask())
        .old_layout(if discard { vk::ImageLayout::UNDEFINED } else { before.layout() })
        .new_layout(after.layout())
        .image(image)
        .subresource_range(vk::ImageSubresourceRange {
            aspect_mask: aspect,
            base_mip_level: mips.0,
            level_count: mips.1,
            base_array_layer: 0,
            layer_count: vk::REMAINING_ARRAY_LAYERS,
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_round_trip() {
        for access in Access::ALL {
            assert_eq!(Access::from_code(access as u8), access);
        }
    }

    #[test]
    fn every_write_is_waited_for() {
        assert!(!Access::ShaderRead.needs_barrier(Access::ShaderRead), "reads do not wait for reads");
        for before in Access::ALL {
            for after in Access::ALL {
                let hazard = before.writes() || after.writes() || before.layout() != after.layout();
                assert!(before.needs_barrier(after) || !hazard, "{before:?} then {after:?}");
            }
            let mask = memory_barrier(before, Access::ShaderRead).src_access_mask;
            let write = vk::AccessFlags2::TRANSFER_WRITE
                | vk::AccessFlags2::SHADER_WRITE
                | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE
                | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE;
            assert_eq!(before.writes(), mask.intersects(write), "{before:?}");
        }
    }

    #[test]
    fn a_colour_target_read_back() {
        let barrier = image_barrier(
            vk::Image::null(),
            vk::ImageAspectFlags::COLOR,
            (0, 1),
            (Access::ColorTarget, Access::TransferRead),
            false,
        );
        assert_eq!(barrier.src_stage_mask, vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT);
        assert_eq!(barrier.dst_access_mask, vk::AccessFlags2::TRANSFER_READ);
        assert_eq!(barrier.old_layout, vk::ImageLayout::ATTACHMENT_OPTIMAL);
        assert_eq!(barrier.new_layout, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    }

    #[test]
    fn discarding_still_waits() {
        let (before, after) = (Access::TransferRead, Access::ColorTarget);
        let barrier =
            image_barrier(vk::Image::null(), vk::ImageAspectFlags::COLOR, (0, 1), (before, after), true);
        assert_eq!(barrier.old_layout, vk::ImageLayout::UNDEFINED);
        assert_eq!(barrier.src_stage_mask, vk::PipelineStageFlags2::ALL_TRANSFER);
    }
}
