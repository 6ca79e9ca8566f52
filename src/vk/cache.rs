//! The pipeline cache on disk.
//!
//! The file is a hint: whatever is wrong with it, the pipelines are compiled again.

use std::path::{Path, PathBuf};

use super::DeviceInfo;
use super::select::Limits;
use crate::{files, read};

/// Largest file read (bytes); the largest seen were a few million.
const MOST: u64 = 1 << 28;

const MAGIC: &[u8; 8] = b"PHLPIPE1";
/// Magic, checksum, length.
const HEADER: usize = 24;

/// What a driver writes at the start of its pipeline cache data.
#[derive(Clone, Copy, Debug)]
pub(super) struct Owner {
    vendor: u32,
    device: u32,
    uuid: [u8; 16],
}

impl Owner {
    pub(super) fn new(info: &DeviceInfo, limits: &Limits) -> Self {
        Self { vendor: info.vendor_id, device: info.device_id, uuid: limits.pipeline_cache_uuid }
    }

    /// Whether `data` starts with this driver's header (Vulkan 1.3, `VkPipelineCacheHeaderVersionOne`).
    fn wrote(&self, data: &[u8]) -> bool {
        let word = |i: usize| data.get(i..i + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        word(0).is_some_and(|length| (32..=data.len()).contains(&(length as usize)))
            && word(4) == Some(1)
            && word(8) == Some(self.vendor)
            && word(12) == Some(self.device)
            && data[16..32] == self.uuid
    }
}

/// Parhelion's folder in the user's cache directory, where there is one.
#[must_use]
pub fn cache_folder() -> Option<PathBuf> {
    let variable = |name| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let directory = variable("XDG_CACHE_HOME").or_else(|| Some(variable("HOME")?.join(".cache")))?;
    Some(directory.join("parhelion"))
}

/// The file for a device and driver.
pub(super) fn default_file(info: &DeviceInfo) -> Option<PathBuf> {
    Some(cache_folder()?.join(format!("pipelines-{}-{}.bin", info.uuid, info.driver_version)))
}

/// The driver's data in `file`; nothing where the file is absent, damaged, another driver's, or no file: a pipe, a
/// device, a folder.
pub(super) fn load(file: &Path, owner: &Owner) -> Vec<u8> {
    let bytes = match read::regular(file, MOST) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Vec::new(),
        Err(e) => {
            tracing::warn!("pipeline cache {}: {e}", file.display());
            return Vec::new();
        }
    };
    match unwrap(&bytes) {
        None => tracing::warn!("pipeline cache {} is damaged; ignored", file.display()),
        Some(data) if !owner.wrote(data) => {
            tracing::warn!("pipeline cache {} is another driver's; ignored", file.display());
        }
        Some(data) => return data.to_vec(),
    }
    Vec::new()
}

/// Writes `data` so that no reader sees half of it; not to what is there and is no file.
pub(super) fn save(file: &Path, data: &[u8]) -> std::io::Result<()> {
    files::write_cache(file, &wrap(data))
}

fn wrap(data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + data.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&checksum(data).to_le_bytes());
    bytes.extend_from_slice(&(data.len() as u64).to_le_bytes());
    bytes.extend_from_slice(data);
    bytes
}

fn unwrap(bytes: &[u8]) -> Option<&[u8]> {
    let (header, data) = bytes.split_at_checked(HEADER)?;
    let expected = wrap(data);
    (header == &expected[..HEADER]).then_some(data)
}

/// FNV-1a, 64 bits: finds damage, and nobody attacks a cache of their own.
fn checksum(data: &[u8]) -> u64 {
    data.iter().fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const OWNER: Owner = Owner { vendor: 0x10de, device: 0x2330, uuid: *b"0123456789abcdef" };

    fn driver_data(owner: Owner) -> Vec<u8> {
        let mut data = Vec::new();
        for word in [32, 1, owner.vendor, owner.device] {
            data.extend_from_slice(&word.to_le_bytes());
        }
        data.extend_from_slice(&owner.uuid);
        data.extend_from_slice(b"compiled kernels");
        data
    }

    #[test]
    fn what_was_saved_is_loaded() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/folder/cache.bin");
        assert!(load(&file, &OWNER).is_empty());
        let data = driver_data(OWNER);
        save(&file, &data).unwrap();
        assert_eq!(load(&file, &OWNER), data);
        let others = fs::read_dir(file.parent().unwrap()).unwrap().count();
        assert_eq!(others, 1, "nothing is left beside the file");
    }

    #[test]
    fn what_is_no_file_is_neither_read_nor_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("cache.bin");
        let ignored = || {
            assert!(load(&place, &OWNER).is_empty());
            save(&place, &driver_data(OWNER)).unwrap();
            assert!(!fs::metadata(&place).unwrap().is_file());
        };
        fs::create_dir(&place).unwrap();
        ignored();
        fs::remove_dir(&place).unwrap();
        #[cfg(unix)]
        {
            assert!(std::process::Command::new("mkfifo").arg(&place).status().unwrap().success());
            ignored();
            fs::remove_file(&place).unwrap();
            std::os::unix::fs::symlink("/dev/zero", &place).unwrap();
            ignored();
        }
    }

    #[test]
    fn every_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cache.bin");
        save(&file, &driver_data(OWNER)).unwrap();
        let good = fs::read(&file).unwrap();
        for i in 0..good.len() {
            let mut bad = good.clone();
            bad[i] ^= 0x10;
            fs::write(&file, &bad).unwrap();
            assert!(load(&file, &OWNER).is_empty(), "byte {i} changed");
            fs::write(&file, &good[..i]).unwrap();
            assert!(load(&file, &OWNER).is_empty(), "cut to {i} bytes");
        }
        fs::write(&file, [good.as_slice(), b"x"].concat()).unwrap();
        assert!(load(&file, &OWNER).is_empty(), "a byte too many");
    }

    #[test]
    fn another_drivers_cache_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cache.bin");
        save(&file, &driver_data(OWNER)).unwrap();
        for other in
            [Owner { vendor: 1, ..OWNER }, Owner { device: 1, ..OWNER }, Owner { uuid: [0; 16], ..OWNER }]
        {
            assert!(load(&file, &other).is_empty(), "{other:?}");
        }
    }
}
