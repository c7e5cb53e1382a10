//! Shader bindings, named once: one table makes the layout, sizes the pool and checks every write.

use std::sync::Arc;

use ash::vk;

use super::{DeviceBuffer, Gpu, Image, SamplerDesc, buffer::RawBuffer, image::RawImage};
use crate::error::{Error, Result};

/// Bytes of a texel of four words.
pub(super) const TEXEL_BYTES: u64 = 16;

/// One binding of a set; its number is its place in the table, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Binding {
    /// Name of the shader's variable or block instance.
    pub name: &'static str,
    /// What is bound.
    pub kind: BindingKind,
    /// Length of the array; 1 for a single resource.
    pub count: u32,
}

/// What a binding holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BindingKind {
    /// A storage buffer.
    Storage,
    /// A uniform buffer.
    Uniform,
    /// A sampled image with its sampler.
    Texture,
    /// A buffer read as texels of four words. Unlike a storage buffer's, what a fragment shader reads from it
    /// may feed a derivative on every device.
    Texels,
}

impl Binding {
    /// A storage buffer called `name`.
    pub const fn storage(name: &'static str) -> Self {
        Self { name, kind: BindingKind::Storage, count: 1 }
    }

    /// A uniform buffer called `name`.
    pub const fn uniform(name: &'static str) -> Self {
        Self { name, kind: BindingKind::Uniform, count: 1 }
    }

    /// A buffer of texels called `name`.
    pub const fn texels(name: &'static str) -> Self {
        Self { name, kind: BindingKind::Texels, count: 1 }
    }

    /// An array of `count` textures called `name`.
    pub const fn textures(name: &'static str, count: u32) -> Self {
        Self { name, kind: BindingKind::Texture, count }
    }
}

impl BindingKind {
    const ALL: [Self; 4] = [Self::Storage, Self::Uniform, Self::Texture, Self::Texels];

    fn vk(self) -> vk::DescriptorType {
        match self {
            Self::Storage => vk::DescriptorType::STORAGE_BUFFER,
            Self::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
            Self::Texture => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            Self::Texels => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
        }
    }
}

/// What is written to a binding.
#[derive(Debug, Clone, Copy)]
pub enum Resource<'a> {
    /// All of a buffer.
    Buffer(&'a DeviceBuffer),
    /// Images in [`Access::ShaderRead`](super::Access::ShaderRead), as many as the binding's count.
    Textures(&'a [(&'a Image, SamplerDesc)]),
}

/// Layout of a descriptor set, visible to all stages. Clones share it.
#[derive(Clone, Debug)]
pub struct SetLayout {
    pub(super) raw: Arc<RawLayout>,
}

pub(super) struct RawLayout {
    gpu: Arc<Gpu>,
    name: String,
    pub(super) handle: vk::DescriptorSetLayout,
    bindings: Vec<Binding>,
}

impl SetLayout {
    /// A layout with these bindings.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(gpu: &Arc<Gpu>, name: &str, bindings: &[Binding]) -> Result<Self> {
        let entries: Vec<_> = (0..)
            .zip(bindings)
            .map(|(number, binding)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(number)
                    .descriptor_type(binding.kind.vk())
                    .descriptor_count(binding.count)
                    .stage_flags(
                        vk::ShaderStageFlags::VERTEX
                            | vk::ShaderStageFlags::FRAGMENT
                            | vk::ShaderStageFlags::COMPUTE,
                    )
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
        // SAFETY: a live device; `info` is complete.
        let handle = gpu.call("vkCreateDescriptorSetLayout", name, |device| unsafe {
            device.create_descriptor_set_layout(&info, None)
        })?;
        gpu.name(handle, name);
        let raw = RawLayout { gpu: gpu.clone(), name: name.into(), handle, bindings: bindings.to_vec() };
        Ok(Self { raw: Arc::new(raw) })
    }

    /// A set of this layout with every binding written, by name. It keeps what it refers to alive.
    ///
    /// # Errors
    /// A buffer larger than the device can bind: the caller knows what makes it smaller; no memory left.
    ///
    /// # Panics
    /// If a name is missing or unknown, or a resource is of the wrong kind or number: mistakes in the
    /// program, not in its input.
    pub fn set(&self, name: &str, resources: &[(&str, Resource<'_>)]) -> Result<DescriptorSet> {
        let layout = &self.raw;
        let gpu = &layout.gpu;
        let sizes: Vec<_> = BindingKind::ALL
            .iter()
            .map(|&kind| {
                let of_kind = layout.bindings.iter().filter(|binding| binding.kind == kind);
                vk::DescriptorPoolSize::default()
                    .ty(kind.vk())
                    .descriptor_count(of_kind.map(|binding| binding.count).sum())
            })
            .filter(|size| size.descriptor_count > 0)
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: a live device; `info` is complete.
        let pool = gpu.call("vkCreateDescriptorPool", name, |device| unsafe {
            device.create_descriptor_pool(&info, None)
        })?;
        // From here on `set` frees the pool if a later step fails.
        let mut set = RawSet {
            layout: layout.clone(),
            pool,
            handle: vk::DescriptorSet::null(),
            held_buffers: Vec::new(),
            held_images: Vec::new(),
            views: Vec::new(),
        };
        gpu.name(pool, name);
        let layouts = [layout.handle];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool is sized for one set of this layout.
        set.handle = gpu.call("vkAllocateDescriptorSets", name, |device| unsafe {
            device.allocate_descriptor_sets(&info)
        })?[0];
        gpu.name(set.handle, name);
        for (number, binding) in (0..).zip(&layout.bindings) {
            let found = resources.iter().find(|(name, _)| *name == binding.name);
            let (_, resource) =
                found.unwrap_or_else(|| panic!("{name}: binding {} is not written", binding.name));
            set.write(number, binding, resource)?;
        }
        assert_eq!(
            resources.len(),
            layout.bindings.len(),
            "{name}: a resource without a binding in {}",
            layout.name
        );
        Ok(DescriptorSet { raw: Arc::new(set) })
    }
}

impl Drop for RawLayout {
    fn drop(&mut self) {
        // SAFETY: sets and pipelines hold their layouts by `Arc`.
        unsafe { self.gpu.device.destroy_descriptor_set_layout(self.handle, None) };
    }
}

impl std::fmt::Debug for RawLayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "set layout {} {:?}", self.name, self.bindings)
    }
}

/// A written descriptor set. Clones share it.
#[derive(Clone, Debug)]
pub struct DescriptorSet {
    pub(super) raw: Arc<RawSet>,
}

#[derive(Debug)]
pub(super) struct RawSet {
    layout: Arc<RawLayout>,
    pool: vk::DescriptorPool,
    pub(super) handle: vk::DescriptorSet,
    held_buffers: Vec<Arc<RawBuffer>>,
    held_images: Vec<Arc<RawImage>>,
    views: Vec<vk::BufferView>,
}

impl RawSet {
    fn write(&mut self, number: u32, binding: &Binding, resource: &Resource<'_>) -> Result<()> {
        let gpu = self.layout.gpu.clone();
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.handle)
            .dst_binding(number)
            .descriptor_type(binding.kind.vk());
        match (binding.kind, resource) {
            (BindingKind::Storage | BindingKind::Uniform, Resource::Buffer(buffer)) => {
                check_size(&gpu.limits, binding.kind, &buffer.raw.name, buffer.size())?;
                let infos =
                    [vk::DescriptorBufferInfo::default().buffer(buffer.raw.handle).range(vk::WHOLE_SIZE)];
                self.held_buffers.push(buffer.raw.clone());
                // SAFETY: a fresh set, used by no command yet; the buffer is kept alive by it.
                unsafe { gpu.device.update_descriptor_sets(&[write.buffer_info(&infos)], &[]) };
            }
            (BindingKind::Texture, Resource::Textures(textures)) => {
                assert_eq!(textures.len(), binding.count as usize, "{}: number of textures", binding.name);
                let mut infos = Vec::with_capacity(textures.len());
                for (image, sampler) in *textures {
                    infos.push(
                        vk::DescriptorImageInfo::default()
                            .image_view(image.raw.view)
                            .sampler(gpu.sampler(*sampler)?)
                            .image_layout(super::Access::ShaderRead.layout()),
                    );
                    self.held_images.push(image.raw.clone());
                }
                // SAFETY: as above, for the images; samplers live as long as the device.
                unsafe { gpu.device.update_descriptor_sets(&[write.image_info(&infos)], &[]) };
            }
            (BindingKind::Texels, Resource::Buffer(buffer)) => {
                check_size(&gpu.limits, binding.kind, &buffer.raw.name, buffer.size())?;
                let texels = buffer.size() / TEXEL_BYTES;
                let info = vk::BufferViewCreateInfo::default()
                    .buffer(buffer.raw.handle)
                    .format(vk::Format::R32G32B32A32_UINT)
                    .range(texels * TEXEL_BYTES);
                // SAFETY: a live buffer with the usage for it, kept alive by the set.
                let view = gpu.call("vkCreateBufferView", &buffer.raw.name, |device| unsafe {
                    device.create_buffer_view(&info, None)
                })?;
                gpu.name(view, &buffer.raw.name);
                self.views.push(view);
                self.held_buffers.push(buffer.raw.clone());
                let views = [view];
                // SAFETY: as above; the view lives as long as the set.
                unsafe { gpu.device.update_descriptor_sets(&[write.texel_buffer_view(&views)], &[]) };
            }
            _ => panic!("binding {} is a {:?}", binding.name, binding.kind),
        }
        Ok(())
    }
}

/// Refuses a buffer of `bytes` that a device with these `limits` cannot bind; who binds it knows the remedy.
fn check_size(limits: &vk::PhysicalDeviceLimits, kind: BindingKind, name: &str, bytes: u64) -> Result<()> {
    let (size, most, unit) = match kind {
        BindingKind::Uniform => (bytes, limits.max_uniform_buffer_range, "bytes; the device binds at most"),
        BindingKind::Texels => {
            (bytes / TEXEL_BYTES, limits.max_texel_buffer_elements, "texels; the device reads at most")
        }
        _ => (bytes, limits.max_storage_buffer_range, "bytes; the device binds at most"),
    };
    if size <= u64::from(most) {
        return Ok(());
    }
    Err(Error::DeviceMemory { object: format!("buffer {name}"), problem: format!("{size} {unit} {most}") })
}

impl Drop for RawSet {
    fn drop(&mut self) {
        // SAFETY: command buffers own the sets they use until the device is done; frees the set too, which
        // alone used the views.
        unsafe {
            self.layout.gpu.device.destroy_descriptor_pool(self.pool, None);
            for &view in &self.views {
                self.layout.gpu.device.destroy_buffer_view(view, None);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_held_against_the_limit_of_their_kind() {
        // What every device has.
        let limits = vk::PhysicalDeviceLimits {
            max_uniform_buffer_range: 16_384,
            max_storage_buffer_range: 1 << 27,
            max_texel_buffer_elements: 65_536,
            ..Default::default()
        };
        for (kind, most) in [
            (BindingKind::Uniform, 16_384),
            (BindingKind::Storage, 1 << 27),
            (BindingKind::Texels, 65_536 * TEXEL_BYTES),
        ] {
            assert!(check_size(&limits, kind, "table", most).is_ok());
            let refused = check_size(&limits, kind, "table", most + TEXEL_BYTES).unwrap_err();
            let message = refused.with_remedy("use less").to_string();
            assert!(
                message.starts_with("device memory for buffer table: ") && message.ends_with(": use less")
            );
        }
        let refused = check_size(&limits, BindingKind::Texels, "table", 70_000 * TEXEL_BYTES).unwrap_err();
        assert!(refused.to_string().contains("70000 texels; the device reads at most 65536"), "{refused}");
    }
}
