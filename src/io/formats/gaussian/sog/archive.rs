//! Files of a zip archive, stored or deflated.

use std::io::Read as _;

use flate2::read::DeflateDecoder;
use rawzip::{CompressionMethod, ReaderAt, ZipArchive, ZipArchiveEntryWayfinder};

use crate::error::{Error, Result};
use crate::io::file::budget::Budget;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text::{plain, shown};
use crate::io::formats::gaussian::sog::meta::META;
use crate::num;

/// The beginning of an archive that is not empty.
const MAGIC: &[u8] = b"PK\x03\x04";
/// Size of a header before the name of a file, in bytes.
const HEADER: usize = 30;
/// The limit on entries.
const MOST: usize = 1024;
/// The rule of names.
pub(super) const INSIDE: &str = "must be the name of a file beside meta.json";

/// Whether a file is an archive whose first entry is one of splats.
pub(super) fn begins_one(source: &Source) -> bool {
    let head = source.head();
    if source.is_gzip() || !head.starts_with(MAGIC) {
        return false;
    }
    let length = head.get(26..28).and_then(|bytes| <[u8; 2]>::try_from(bytes).ok()).map(u16::from_le_bytes);
    let name = length.and_then(|length| head.get(HEADER..HEADER + usize::from(length)));
    let ends = |ending: &[u8]| name.is_some_and(|name| name.ends_with(ending));
    let path = source.path().extension();
    ends(b"meta.json") || ends(b".webp") || path.is_some_and(|ending| ending.eq_ignore_ascii_case("sog"))
}

impl ReaderAt for &Source {
    fn read_at(&self, buffer: &mut [u8], offset: u64) -> std::io::Result<usize> {
        self.read_some(offset, buffer)
    }
}

/// An archive and its entries.
pub(super) struct Archive<'a> {
    source: &'a Source,
    archive: ZipArchive<&'a Source>,
    entries: Vec<Entry>,
    /// The folder of `meta.json` in the archive, with the `/` behind it.
    folder: String,
}

struct Entry {
    name: String,
    method: CompressionMethod,
    place: ZipArchiveEntryWayfinder,
}

impl<'a> Archive<'a> {
    /// Lists the entries.
    pub(super) fn open(source: &'a Source) -> Result<Self> {
        let broken = |error: rawzip::Error| no_archive(source, &error);
        let mut buffer = vec![0; rawzip::RECOMMENDED_BUFFER_SIZE];
        let archive = rawzip::ZipLocator::new()
            .locate_in_reader(source, &mut buffer, source.len())
            .map_err(|(_, error)| broken(error))?;
        let mut entries: Vec<Entry> = Vec::new();
        let mut listed = archive.entries(&mut buffer);
        while let Some(entry) = listed.next_entry().map_err(broken)? {
            if entry.is_dir() {
                continue;
            }
            let bytes = entry.file_path();
            let name = String::from_utf8_lossy(bytes.as_bytes()).into_owned();
            let wrong = |rule: &str| source.error(format!("entry \"{}\"", shown(&name)), rule);
            if name.split(['/', '\\']).any(|part| part == "..") || name.starts_with(['/', '\\']) {
                return Err(wrong("must lie within the archive"));
            }
            if entry.flags().is_encrypted() {
                return Err(wrong("is encrypted"));
            }
            if entries.len() == MOST {
                return Err(source.error("entries", format!("more than {MOST}")));
            }
            if entries.iter().any(|other| other.name == name) {
                return Err(wrong("is there twice"));
            }
            let (method, place) = (entry.compression_method(), entry.wayfinder());
            entries.push(Entry { name, method, place });
        }
        let folder = |entry: &Entry| {
            let folder = entry.name.strip_suffix(META)?;
            (folder.is_empty() || folder.ends_with('/')).then(|| folder.to_owned())
        };
        let mut folders: Vec<String> = entries.iter().filter_map(folder).collect();
        folders.sort_by_key(String::len);
        let Some(folder) = folders.into_iter().next() else {
            return Err(source.error("entries", "there is no meta.json"));
        };
        Ok(Self { source, archive, entries, folder })
    }

    /// Reads a file beside `meta.json`, within the memory that the budget grants.
    pub(super) fn read(&self, name: &str, budget: &mut Budget, most: u64) -> Result<Vec<u8>> {
        let source = self.source;
        let wrong = |rule: String| source.error(format!("entry \"{}\"", shown(name)), rule);
        let path = format!("{}{name}", self.folder);
        let Some(entry) = self.entries.iter().find(|entry| entry.name == path) else {
            return Err(wrong(format!("is missing: {INSIDE}")));
        };
        let [size, packed] = [entry.place.uncompressed_size_hint(), entry.place.compressed_size_hint()];
        let encoding = match entry.method {
            CompressionMethod::STORE => Encoding::Raw,
            CompressionMethod::DEFLATE => Encoding::Zlib,
            _ => return Err(wrong("must be stored or deflated".to_owned())),
        };
        if packed > source.len() || size > encoding.most(packed) || size > most {
            let rule = format!("{size} bytes, packed in {packed}: more than fits, or than {most}");
            return Err(wrong(rule));
        }
        budget.take(name, size)?;
        let place = self.archive.get_entry(entry.place).map_err(|error| no_archive(source, &error))?;
        let stored = place.reader();
        let plain_bytes: Box<dyn std::io::Read> = match encoding {
            Encoding::Raw => Box::new(stored),
            _ => Box::new(DeflateDecoder::new(stored)),
        };
        let mut bytes = Vec::new();
        let limit = size.saturating_add(1);
        bytes
            .try_reserve_exact(usize::try_from(limit).unwrap_or(usize::MAX))
            .map_err(|_| wrong("memory is full".to_owned()))?;
        // Checks size and checksum at the end.
        let mut checked = place.verifying_reader(plain_bytes.take(limit));
        checked.read_to_end(&mut bytes).map_err(|error| match error.downcast::<Error>() {
            Ok(ours) => ours,
            Err(error) => wrong(format!("is damaged: {}", plain(&error.to_string()))),
        })?;
        if num::wide(bytes.len()) != size {
            return Err(wrong(format!("{} bytes: the archive announces {size}", bytes.len())));
        }
        Ok(bytes)
    }
}

fn no_archive(source: &Source, error: &rawzip::Error) -> Error {
    source.error("zip archive", plain(&error.to_string()))
}
