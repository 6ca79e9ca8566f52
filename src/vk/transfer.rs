//! Copies between the host and the device's own memory.

use std::ops::Range;

use ash::vk;

use super::{Buffer, Device, Error, MemoryKind};

/// Bytes moved at a time between host and device, so that staging never doubles a large buffer.
const STAGING_BYTES: u64 = 64 << 20;

impl Device {
    /// A [device](MemoryKind::Device) buffer that holds `bytes`. Waits for the copy, which goes through 64 MiB
    /// of mapped memory at most.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfDeviceMemory`], [`Error::DeviceLost`], or what the driver said.
    pub fn upload(&self, name: &str, bytes: &[u8]) -> Result<Buffer, Error> {
        let buffer = self.buffer(name, bytes.len() as u64, MemoryKind::Device)?;
        let mut staging = None;
        for range in pieces(bytes.len() as u64) {
            let staging = match &mut staging {
                Some(staging) => staging,
                None => {
                    let size = range.end - range.start;
                    staging.insert(self.buffer("staging", size, MemoryKind::Upload)?)
                }
            };
            let piece = &bytes[range.start as usize..range.end as usize];
            let mapped = staging.mapped_mut().ok_or_else(|| unmapped(name))?;
            mapped[..piece.len()].copy_from_slice(piece);
            self.copy(name, (staging.raw(), 0), (buffer.raw(), range.start), piece.len() as u64)?;
        }
        Ok(buffer)
    }

    /// The contents of a buffer. Waits for the copy, which goes through 64 MiB of mapped memory at most; work
    /// that writes the buffer must have been submitted.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfDeviceMemory`], [`Error::DeviceLost`], or what the driver said.
    pub fn download(&self, buffer: &Buffer) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::with_capacity(buffer.size() as usize);
        let staging = self.buffer("staging", buffer.size().min(STAGING_BYTES), MemoryKind::Readback)?;
        for range in pieces(buffer.size()) {
            let size = range.end - range.start;
            self.copy(buffer.name(), (buffer.raw(), range.start), (staging.raw(), 0), size)?;
            let mapped = staging.mapped()?.ok_or_else(|| unmapped(buffer.name()))?;
            bytes.extend_from_slice(&mapped[..size as usize]);
        }
        Ok(bytes)
    }

    /// Copies `size` bytes between buffers and offsets, behind all earlier work and before all later.
    fn copy(
        &self,
        name: &str,
        from: (vk::Buffer, u64),
        to: (vk::Buffer, u64),
        size: u64,
    ) -> Result<(), Error> {
        use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
        self.run(name, |cmd| {
            let all = (S::ALL_COMMANDS, A::MEMORY_READ | A::MEMORY_WRITE);
            let transfer = (S::COPY, A::TRANSFER_READ | A::TRANSFER_WRITE);
            self.memory_barrier(cmd, all, transfer);
            let region = vk::BufferCopy { src_offset: from.1, dst_offset: to.1, size };
            // SAFETY: both ranges are inside their buffers, which live until `run` has waited.
            unsafe { self.raw().cmd_copy_buffer(cmd, from.0, to.0, &[region]) };
            self.memory_barrier(cmd, transfer, (S::ALL_COMMANDS | S::HOST, A::MEMORY_READ | A::MEMORY_WRITE));
        })
    }
}

/// `0..size` in pieces of at most [`STAGING_BYTES`].
fn pieces(size: u64) -> impl Iterator<Item = Range<u64>> {
    (0..size.div_ceil(STAGING_BYTES)).map(move |i| {
        let start = i * STAGING_BYTES;
        start..(start + STAGING_BYTES).min(size)
    })
}

fn unmapped(name: &str) -> Error {
    Error::Allocation { what: name.to_owned(), reason: "staging memory is not mapped".to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_everything_once() {
        for size in [0, 1, STAGING_BYTES - 1, STAGING_BYTES, STAGING_BYTES + 1, 3 * STAGING_BYTES + 7] {
            let mut end = 0;
            for piece in pieces(size) {
                assert_eq!(piece.start, end);
                assert!(piece.end > piece.start && piece.end - piece.start <= STAGING_BYTES);
                end = piece.end;
            }
            assert_eq!(end, size);
        }
    }
}
