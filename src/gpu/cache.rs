//! The pipeline cache on disk.
//!
//! Drivers may crash on foreign or damaged cache data. The file therefore has a header of its own, and a file whose header
//! does not match is ignored and overwritten.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use ash::vk;

const MAGIC: &[u8; 8] = b"VOLRPC01";
/// Size of the header: magic, vendor, device, driver version, cache UUID, length, hash.
const HEADER: usize = 8 + 4 + 4 + 4 + 16 + 8 + 8;
/// Upper bound of the size of a cache; larger files are ignored.
const MAX_BYTES: u64 = 256 << 20;

/// The cache file of one device.
#[derive(Clone, Debug)]
pub(crate) struct PipelineCacheFile {
    path: PathBuf,
    /// The device and driver that the cache belongs to.
    identity: Vec<u8>,
}

impl PipelineCacheFile {
    /// Returns the file of a device in `folder`.
    pub(crate) fn new(folder: &Path, properties: &vk::PhysicalDeviceProperties) -> Self {
        let name = format!("pipelines-{:08x}-{:08x}.bin", properties.vendor_id, properties.device_id);
        Self { path: folder.join(name), identity: identity(properties) }
    }

    /// Returns the cached data if the file is undamaged and belongs to this device and driver.
    pub(crate) fn load(&self) -> Option<Vec<u8>> {
        if std::fs::metadata(&self.path).ok()?.len() > MAX_BYTES {
            return None;
        }
        let bytes = std::fs::read(&self.path).ok()?;
        unwrap(&bytes, &self.identity).map(<[u8]>::to_vec)
    }

    /// Writes the data to a temporary file and renames it. Failures are ignored.
    pub(crate) fn store(&self, data: &[u8]) {
        if self.load().is_some_and(|old| old == data) {
            return;
        }
        let Some(folder) = self.path.parent() else { return };
        if std::fs::create_dir_all(folder).is_ok() {
            let _ =
                crate::replace::replace(&self.path, |writer| writer.write_all(&wrap(data, &self.identity)));
        }
    }
}

/// Returns the user's cache folder for this library; `None` where the environment names none. It may not exist yet.
#[must_use]
pub fn user_cache_folder() -> Option<PathBuf> {
    // The XDG base directory specification ignores paths that are not absolute.
    let set = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    set("XDG_CACHE_HOME")
        .or_else(|| set("LOCALAPPDATA"))
        .or_else(|| Some(set("HOME")?.join(".cache")))
        .map(|cache| cache.join("volraster"))
}

/// Computes FNV-1a with 64 bits. It detects damage, not manipulation by someone who can write the user's files.
fn hash(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Returns vendor, device, driver version and cache UUID.
fn identity(properties: &vk::PhysicalDeviceProperties) -> Vec<u8> {
    let numbers = [properties.vendor_id, properties.device_id, properties.driver_version];
    [numbers.map(u32::to_le_bytes).as_flattened(), &properties.pipeline_cache_uuid].concat()
}

fn header(data: &[u8], identity: &[u8]) -> Vec<u8> {
    let length = crate::num::wide(data.len()).to_le_bytes();
    [MAGIC, identity, &length, &hash(data).to_le_bytes()].concat()
}

fn wrap(data: &[u8], identity: &[u8]) -> Vec<u8> {
    [&header(data, identity), data].concat()
}

/// Returns the data of a file if its header is the one that this device would write for it.
fn unwrap<'a>(bytes: &'a [u8], identity: &[u8]) -> Option<&'a [u8]> {
    let (found, data) = bytes.split_at_checked(HEADER)?;
    (found == header(data, identity)).then_some(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn properties() -> vk::PhysicalDeviceProperties {
        vk::PhysicalDeviceProperties {
            vendor_id: 0x10de,
            device_id: 7,
            driver_version: 99,
            pipeline_cache_uuid: *b"0123456789abcdef",
            ..Default::default()
        }
    }

    fn identity() -> Vec<u8> {
        super::identity(&properties())
    }

    #[test]
    fn round_trip() {
        let bytes = wrap(b"pipelines", &identity());
        assert_eq!(unwrap(&bytes, &identity()), Some(b"pipelines".as_slice()));
    }

    #[test]
    fn every_damaged_byte_every_length_and_every_foreign_device_is_refused() {
        let bytes = wrap(b"pipelines", &identity());
        for i in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[i] ^= 1;
            assert_eq!(unwrap(&damaged, &identity()), None, "byte {i}");
            assert_eq!(unwrap(&bytes[..i], &identity()), None, "length {i}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert_eq!(unwrap(&longer, &identity()), None);
        for foreign in [
            vk::PhysicalDeviceProperties { vendor_id: 1, ..properties() },
            vk::PhysicalDeviceProperties { device_id: 1, ..properties() },
            vk::PhysicalDeviceProperties { driver_version: 1, ..properties() },
            vk::PhysicalDeviceProperties { pipeline_cache_uuid: [0; 16], ..properties() },
        ] {
            assert_eq!(unwrap(&bytes, &super::identity(&foreign)), None);
        }
    }
}
