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

/// The device and driver that a cache belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    pub(crate) vendor: u32,
    pub(crate) device: u32,
    pub(crate) driver: u32,
    pub(crate) uuid: [u8; 16],
}

/// The cache file of one device.
#[derive(Clone, Debug)]
pub(crate) struct PipelineCacheFile {
    path: PathBuf,
    identity: Identity,
}

impl PipelineCacheFile {
    /// Returns the file of a device in `folder`, or in the user's cache folder; `None` where there is no such folder.
    pub(crate) fn locate(folder: Option<&Path>, properties: &vk::PhysicalDeviceProperties) -> Option<Self> {
        let folder = folder.map(Path::to_path_buf).or_else(user_cache_folder)?;
        let identity = Identity {
            vendor: properties.vendor_id,
            device: properties.device_id,
            driver: properties.driver_version,
            uuid: properties.pipeline_cache_uuid,
        };
        let name = format!("pipelines-{:08x}-{:08x}.bin", identity.vendor, identity.device);
        Some(Self { path: folder.join(name), identity })
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

fn header(data: &[u8], identity: &Identity) -> Vec<u8> {
    let mut header = Vec::with_capacity(HEADER);
    header.extend_from_slice(MAGIC);
    for number in [identity.vendor, identity.device, identity.driver] {
        header.extend_from_slice(&number.to_le_bytes());
    }
    header.extend_from_slice(&identity.uuid);
    header.extend_from_slice(&u64::try_from(data.len()).unwrap_or(u64::MAX).to_le_bytes());
    header.extend_from_slice(&hash(data).to_le_bytes());
    header
}

fn wrap(data: &[u8], identity: &Identity) -> Vec<u8> {
    let mut bytes = header(data, identity);
    bytes.extend_from_slice(data);
    bytes
}

/// Returns the data of a file if its header is the one that this device would write for it.
fn unwrap<'a>(bytes: &'a [u8], identity: &Identity) -> Option<&'a [u8]> {
    let (found, data) = bytes.split_at_checked(HEADER)?;
    (found == header(data, identity)).then_some(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity() -> Identity {
        Identity { vendor: 0x10de, device: 7, driver: 99, uuid: *b"0123456789abcdef" }
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
            Identity { vendor: 1, ..identity() },
            Identity { device: 1, ..identity() },
            Identity { driver: 1, ..identity() },
            Identity { uuid: [0; 16], ..identity() },
        ] {
            assert_eq!(unwrap(&bytes, &foreign), None);
        }
    }
}
