//! Device timestamps around named scopes of a recording.

use std::sync::Arc;

use ash::vk;

use super::Gpu;
use crate::error::Result;

/// Time that the device spent in one scope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// The scope's name.
    pub name: &'static str,
    /// Milliseconds.
    pub ms: f64,
}

/// A query pool with two timestamps a scope.
pub(super) struct Timestamps {
    gpu: Arc<Gpu>,
    pool: vk::QueryPool,
    capacity: u32,
    names: Vec<&'static str>,
}

impl Timestamps {
    /// Room for `capacity` scopes; none on a device without timestamps.
    pub(super) fn new(gpu: &Arc<Gpu>, name: &str, capacity: u32) -> Result<Self> {
        let capacity = if gpu.timestamp_bits > 0 { capacity } else { 0 };
        let mut pool = vk::QueryPool::null();
        if capacity > 0 {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(2 * capacity);
            // SAFETY: a live device; `info` is complete.
            pool = gpu
                .call("vkCreateQueryPool", name, |device| unsafe { device.create_query_pool(&info, None) })?;
            gpu.name(pool, name);
        }
        Ok(Self { gpu: gpu.clone(), pool, capacity, names: Vec::new() })
    }

    /// Forgets all scopes. The device must be done with them, or never get them.
    pub(super) fn reset(&mut self) {
        self.names.clear();
        if self.capacity > 0 {
            // SAFETY: the caller waited for the submission that wrote the queries, or will never submit it.
            unsafe { self.gpu.device.reset_query_pool(self.pool, 0, 2 * self.capacity) };
        }
    }

    /// Number of a new scope; `None` when there is no room.
    pub(super) fn open(&mut self, name: &'static str) -> Option<u32> {
        let scope = self.names.len() as u32;
        (scope < self.capacity).then(|| {
            self.names.push(name);
            scope
        })
    }

    /// Records a timestamp at the scope's begin or end.
    pub(super) fn write(&self, commands: vk::CommandBuffer, scope: u32, end: bool) {
        // Timestamps alone do not order what lies between them: without a barrier software devices
        // run the next scope's work before they write this one's end.
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: `commands` is recording, outside of a render pass; the query is in range and was reset.
        unsafe {
            self.gpu.device.cmd_pipeline_barrier2(commands, &dependency);
            self.gpu.device.cmd_write_timestamp2(
                commands,
                vk::PipelineStageFlags2::ALL_COMMANDS,
                self.pool,
                2 * scope + u32::from(end),
            );
        }
    }

    /// Time of every scope, in the order in which they were opened. The device must be done with them.
    pub(super) fn read(&self) -> Result<Vec<Timing>> {
        if self.names.is_empty() {
            return Ok(Vec::new());
        }
        let mut ticks = vec![0_u64; 2 * self.names.len()];
        // SAFETY: all these queries were written by a submission that is done.
        self.gpu.call("vkGetQueryPoolResults", "timestamps", |device| unsafe {
            device.get_query_pool_results(
                self.pool,
                0,
                &mut ticks,
                vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT,
            )
        })?;
        let mask = u64::MAX >> (64 - self.gpu.timestamp_bits.min(64));
        let period = f64::from(self.gpu.limits.timestamp_period) * 1e-6;
        let timing = |(&name, pair): (_, &[u64])| Timing {
            name,
            ms: (pair[1].wrapping_sub(pair[0]) & mask) as f64 * period,
        };
        Ok(self.names.iter().zip(ticks.chunks_exact(2)).map(timing).collect())
    }
}

impl Drop for Timestamps {
    fn drop(&mut self) {
        // SAFETY: the owner waited for the last submission; null is ignored.
        unsafe { self.gpu.device.destroy_query_pool(self.pool, None) };
    }
}
