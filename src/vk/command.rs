//! Command buffers, submission, and timing on the device.

use ash::vk;

use super::queue::Recording;
use super::{Device, Error};

/// A command buffer being recorded. Dropped unsubmitted, its commands are discarded.
#[derive(Debug)]
pub struct CommandBuffer {
    device: Device,
    recording: Recording,
    name: String,
}

impl CommandBuffer {
    pub(crate) fn raw(&self) -> vk::CommandBuffer {
        self.recording.raw
    }
}

impl Drop for CommandBuffer {
    fn drop(&mut self) {
        // Reset when it is taken again.
        self.device.0.queue.free().push(self.recording);
    }
}

/// Work handed to the device. Dropping it waits for the work to end.
#[derive(Debug)]
#[must_use = "dropping a submission waits for it and forgets errors"]
pub struct Submission {
    commands: CommandBuffer,
    value: u64,
}

impl Submission {
    /// Waits until the work has ended.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`], or what the driver said.
    pub fn wait(&self) -> Result<(), Error> {
        let device = &self.commands.device.0;
        let (semaphores, values) = ([device.queue.timeline], [self.value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the timeline lives as long as the device.
        unsafe { device.raw.wait_semaphores(&info, u64::MAX) }
            .map_err(Error::vulkan("vkWaitSemaphores", &self.commands.name))
    }

    /// Whether the work has ended.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`], or what the driver said.
    pub fn has_ended(&self) -> Result<bool, Error> {
        let device = &self.commands.device.0;
        // SAFETY: the timeline lives as long as the device.
        unsafe { device.raw.get_semaphore_counter_value(device.queue.timeline) }
            .map(|reached| reached >= self.value)
            .map_err(Error::vulkan("vkGetSemaphoreCounterValue", &self.commands.name))
    }
}

impl Drop for Submission {
    fn drop(&mut self) {
        // Its command buffer is about to be used again. Errors come back from the next call on the device.
        let _ = self.wait();
    }
}

impl Device {
    /// Begins a command buffer; `name` labels it in tools and in errors.
    ///
    /// # Errors
    ///
    /// What the driver said.
    pub fn commands(&self, name: &str) -> Result<CommandBuffer, Error> {
        let raw = self.raw();
        let free = self.0.queue.free().pop();
        let recording = match free {
            Some(recording) => {
                // SAFETY: a recording in the free list is neither in flight nor used by another thread.
                unsafe { raw.reset_command_pool(recording.pool, vk::CommandPoolResetFlags::empty()) }
                    .map_err(Error::vulkan("vkResetCommandPool", name))?;
                recording
            }
            None => self.create_recording(name)?,
        };
        let commands = CommandBuffer { device: self.clone(), recording, name: name.to_owned() };
        self.set_name(recording.raw, name);
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is in the initial state.
        unsafe { raw.begin_command_buffer(commands.raw(), &info) }
            .map_err(Error::vulkan("vkBeginCommandBuffer", name))?;
        self.begin_label(commands.raw(), name);
        Ok(commands)
    }

    fn create_recording(&self, name: &str) -> Result<Recording, Error> {
        let raw = self.raw();
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(self.0.queue.family);
        // SAFETY: the family is the device's own.
        let pool = unsafe { raw.create_command_pool(&info, None) }
            .map_err(Error::vulkan("vkCreateCommandPool", name))?;
        self.set_name(pool, "commands");
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool was just made, and is destroyed again where nothing could be allocated from it.
        unsafe {
            match raw.allocate_command_buffers(&info) {
                Ok(buffers) => Ok(Recording { pool, raw: buffers[0] }),
                Err(result) => {
                    raw.destroy_command_pool(pool, None);
                    Err(Error::vulkan("vkAllocateCommandBuffers", name)(result))
                }
            }
        }
    }

    /// Ends a command buffer and hands it to the device. Submissions run in order; commands of one see memory
    /// written by another only behind a barrier.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`], or what the driver said.
    pub fn submit(&self, commands: CommandBuffer) -> Result<Submission, Error> {
        let name = &commands.name;
        self.end_label(commands.raw());
        // SAFETY: the command buffer is being recorded.
        unsafe { self.raw().end_command_buffer(commands.raw()) }
            .map_err(Error::vulkan("vkEndCommandBuffer", name))?;
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands.raw())];
        let mut queue = self.0.queue.lock();
        let value = queue.1 + 1;
        let signals = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.0.queue.timeline)
            .value(value)
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let info = vk::SubmitInfo2::default().command_buffer_infos(&buffers).signal_semaphore_infos(&signals);
        // SAFETY: the queue is locked, the command buffer complete, and the timeline's values rise.
        unsafe { self.raw().queue_submit2(queue.0, &[info], vk::Fence::null()) }
            .map_err(Error::vulkan("vkQueueSubmit2", name))?;
        queue.1 = value;
        drop(queue);
        Ok(Submission { commands, value })
    }

    /// Records with `record`, submits, and waits.
    pub(crate) fn run(&self, name: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<(), Error> {
        let commands = self.commands(name)?;
        record(commands.raw());
        self.submit(commands)?.wait()
    }

    /// A barrier of all memory between two sets of stages.
    pub(crate) fn memory_barrier(
        &self,
        cmd: vk::CommandBuffer,
        from: (vk::PipelineStageFlags2, vk::AccessFlags2),
        to: (vk::PipelineStageFlags2, vk::AccessFlags2),
    ) {
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(from.0)
            .src_access_mask(from.1)
            .dst_stage_mask(to.0)
            .dst_access_mask(to.1)];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: `cmd` is being recorded.
        unsafe { self.raw().cmd_pipeline_barrier2(cmd, &info) };
    }
}

/// Times intervals of work on the device.
#[derive(Debug)]
pub struct TimestampPool {
    device: Device,
    /// Null where the device has no timestamps.
    raw: vk::QueryPool,
    capacity: u32,
}

impl TimestampPool {
    /// A pool for `capacity` intervals.
    ///
    /// # Errors
    ///
    /// What the driver said. A device without timestamps is no error: the intervals then have no length.
    pub fn new(device: &Device, name: &str, capacity: u32) -> Result<Self, Error> {
        let capacity = capacity.max(1);
        let mut pool = Self { device: device.clone(), raw: vk::QueryPool::null(), capacity };
        if device.info().timestamps {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(capacity * 2);
            // SAFETY: the queue's family has timestamps.
            pool.raw = unsafe { device.raw().create_query_pool(&info, None) }
                .map_err(Error::vulkan("vkCreateQueryPool", name))?;
            device.set_name(pool.raw, name);
            pool.reset();
        }
        Ok(pool)
    }

    /// Intervals it has room for.
    #[must_use]
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Forgets what was recorded; nothing recorded may still be in flight.
    pub fn reset(&mut self) {
        if self.raw != vk::QueryPool::null() {
            // SAFETY: host query reset is enabled; by the rule above no query is in use.
            unsafe { self.device.raw().reset_query_pool(self.raw, 0, self.capacity * 2) };
        }
    }

    /// Begins interval `index` when all earlier work has passed `stage`: the stage of the work to be timed, so
    /// that the tail of what ran before is not charged to it.
    pub(crate) fn begin(&self, cmd: vk::CommandBuffer, index: u32, stage: vk::PipelineStageFlags2) {
        self.write(cmd, index * 2, stage);
    }

    /// Ends interval `index` when all earlier work has passed `stage`.
    pub(crate) fn end(&self, cmd: vk::CommandBuffer, index: u32, stage: vk::PipelineStageFlags2) {
        self.write(cmd, index * 2 + 1, stage);
    }

    fn write(&self, cmd: vk::CommandBuffer, query: u32, stage: vk::PipelineStageFlags2) {
        debug_assert!(query < self.capacity * 2, "timestamp {query} of {}", self.capacity * 2);
        if self.raw != vk::QueryPool::null() {
            // SAFETY: `cmd` is being recorded and the query is in the pool and was reset.
            unsafe { self.device.raw().cmd_write_timestamp2(cmd, stage, self.raw, query) };
        }
    }

    /// Lengths in nanoseconds of the first `count` intervals, all of which have been submitted and waited for;
    /// `None` where the device has no timestamps.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`], or what the driver said.
    pub fn nanoseconds(&self, count: u32) -> Result<Option<Vec<u64>>, Error> {
        if self.raw == vk::QueryPool::null() {
            return Ok(None);
        }
        if count == 0 {
            return Ok(Some(Vec::new()));
        }
        let count = count.min(self.capacity);
        let mut ticks = vec![[0_u64; 2]; count as usize];
        // Without WAIT, an interval that was never recorded is an error and not a hang.
        let flags = vk::QueryResultFlags::TYPE_64;
        // SAFETY: the queries are in the pool and were written by work that has ended.
        unsafe { self.device.raw().get_query_pool_results(self.raw, 0, ticks.as_flattened_mut(), flags) }
            .map_err(Error::vulkan("vkGetQueryPoolResults", "timestamps"))?;
        let limits = &self.device.0.limits;
        let period = f64::from(limits.properties.timestamp_period);
        Ok(Some(ticks.iter().map(|t| interval_ns(*t, limits.timestamp_bits, period)).collect()))
    }
}

/// Length of an interval; counters have `bits` valid bits and wrap.
fn interval_ns([begin, end]: [u64; 2], bits: u32, period: f64) -> u64 {
    let mask = if bits >= 64 { u64::MAX } else { (1 << bits) - 1 };
    ((end.wrapping_sub(begin) & mask) as f64 * period).round() as u64
}

impl Drop for TimestampPool {
    fn drop(&mut self) {
        // SAFETY: whoever recorded into the pool has waited for it.
        unsafe { self.device.raw().destroy_query_pool(self.raw, None) };
    }
}

#[cfg(test)]
mod tests {
    use super::interval_ns;

    #[test]
    fn intervals_scale_by_the_period_and_wrap() {
        assert_eq!(interval_ns([100, 350], 64, 1.0), 250);
        assert_eq!(interval_ns([100, 350], 64, 40.0), 10_000);
        assert_eq!(interval_ns([(1 << 36) - 10, 20], 36, 1.0), 30);
        // Bits beyond the valid ones are noise.
        assert_eq!(interval_ns([(7 << 36) | 5, (3 << 36) | 9], 36, 1.0), 4);
        assert_eq!(interval_ns([u64::MAX, 4], 64, 1.0), 5);
    }
}
