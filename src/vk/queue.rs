//! The queue that all work goes through.

use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;

use super::Error;

/// The queue, its timeline, and command buffers to use again.
pub(super) struct Queue {
    pub(super) timeline: vk::Semaphore,
    pub(super) family: u32,
    /// The queue and the value its timeline reaches after the last submission.
    state: Mutex<(vk::Queue, u64)>,
    free: Mutex<Vec<Recording>>,
}

/// A command buffer with a pool of its own, so that threads can record beside each other.
#[derive(Clone, Copy)]
pub(super) struct Recording {
    pub(super) pool: vk::CommandPool,
    pub(super) raw: vk::CommandBuffer,
}

impl std::fmt::Debug for Recording {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.raw.fmt(f)
    }
}

impl Queue {
    pub(super) fn new(queue: vk::Queue, family: u32) -> Self {
        Self {
            timeline: vk::Semaphore::null(),
            family,
            state: Mutex::new((queue, 0)),
            free: Mutex::default(),
        }
    }

    pub(super) fn create_timeline(&mut self, device: &ash::Device) -> Result<(), Error> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: timeline semaphores are enabled on every device.
        self.timeline = unsafe { device.create_semaphore(&info, None) }
            .map_err(Error::vulkan("vkCreateSemaphore", "queue timeline"))?;
        Ok(())
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, (vk::Queue, u64)> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn free(&self) -> MutexGuard<'_, Vec<Recording>> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// # Safety
    ///
    /// The device is idle, and nothing of the queue is used again.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        // SAFETY: by the caller's promise; every command buffer has come back, since each holds the device.
        unsafe {
            for recording in self.free().drain(..) {
                device.destroy_command_pool(recording.pool, None);
            }
            device.destroy_semaphore(self.timeline, None);
        }
    }
}
