//! Arrays in chunks, which the crate `zarrs` decodes.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use zarrs::array::chunk_cache::{
    ChunkCache, ChunkCacheDecodedLruSizeLimit, ChunkCachePartialDecoderLruChunkLimit,
};
use zarrs::array::{ArrayBytes, ArrayShardedExt, ArraySubset, CodecOptions};
use zarrs::filesystem::FilesystemStore;
use zarrs::plugin::{ExtensionName, ZarrVersion};
use zarrs::storage::ReadableStorageTraits;

use crate::error::{Error, Result};
use crate::io::file::decode::{Layout, Values, append};
use crate::io::file::sample_type::{Pick, SampleType};
use crate::io::formats::zarr::metadata::Level;
use crate::io::options::ReadOptions;
use crate::num;
use crate::scene::{OVERVIEW, Overview, SampleSource, Samples};

/// Bytes of decoded chunks that are kept, because a box of samples meets chunks that the next one meets too.
const KEPT: u64 = 256 << 20;

/// Shards whose index is kept.
const SHARDS: u64 = 1024;

/// The limit on the samples of a coarser level that is an overview.
const MOST_OVERVIEW: u64 = 64 << 20;

/// The names of the types that are read.
const TYPES: [(&str, SampleType); 10] = [
    ("uint8", SampleType::U8),
    ("int8", SampleType::I8),
    ("uint16", SampleType::U16),
    ("int16", SampleType::I16),
    ("uint32", SampleType::U32),
    ("int32", SampleType::I32),
    ("uint64", SampleType::U64),
    ("int64", SampleType::I64),
    ("float32", SampleType::F32),
    ("float64", SampleType::F64),
];

type Stored = zarrs::array::Array<dyn ReadableStorageTraits>;

/// An array of numbers of one type.
pub(super) struct Array {
    path: PathBuf,
    stored: Arc<Stored>,
    kind: SampleType,
    /// Samples of a chunk along z.
    depth: u64,
}

impl fmt::Debug for Array {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Array").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Array {
    /// Opens an array, and checks that a chunk fits into memory.
    pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let failed = |error: &dyn fmt::Display| Error::file(path, "array", one_line(error));
        let store = Arc::new(FilesystemStore::new(path).map_err(|error| failed(&error))?);
        let stored: Arc<Stored> = Arc::new(
            zarrs::array::Array::open(store as Arc<dyn ReadableStorageTraits>, "/")
                .map_err(|error| failed(&error))?,
        );
        let name = stored.data_type().name(ZarrVersion::V3).unwrap_or_default();
        let Some(&(_, kind)) = TYPES.iter().find(|(own, _)| *own == name) else {
            let names = TYPES.map(|(own, _)| own).join(", ");
            return Err(Error::file(path, "data type", format!("\"{name}\": must be one of {names}")));
        };
        let whole = stored.chunk_shape(&vec![0; stored.dimensionality()]).map_err(|error| failed(&error))?;
        // Of a shard, only the chunks in it that a box meets are decoded.
        let shape = stored.subchunk_shape().unwrap_or(whole);
        let count = shape.iter().try_fold(kind.bytes(), |n, extent| n.checked_mul(extent.get()));
        if count.is_none_or(|bytes| bytes > options.max_bytes) {
            let shape: Vec<u64> = shape.iter().map(|extent| extent.get()).collect();
            let rule = format!(
                "chunks of {shape:?} samples are larger than the limit of {} bytes",
                options.max_bytes
            );
            return Err(Error::file(path, "chunk shape", rule));
        }
        let depth = shape.len().checked_sub(3).map_or(1, |z| shape[z].get());
        Ok(Self { path: path.to_owned(), stored, kind, depth })
    }

    /// Returns an error that names the array.
    pub(super) fn error(&self, place: impl Into<String>, rule: impl Into<String>) -> Error {
        Error::file(&self.path, place, rule)
    }

    pub(super) fn shape(&self) -> &[u64] {
        self.stored.shape()
    }

    /// Returns the samples along x, y and z, which are the last three axes in reverse.
    pub(super) fn dims(&self) -> Result<[u32; 3]> {
        let shape = self.shape();
        let extent = |back: usize| {
            let extent = shape.len().checked_sub(back).map_or(0, |at| shape[at]);
            let rule = || format!("{extent} samples along an axis: must be at most {}", u32::MAX);
            u32::try_from(extent).map_err(|_| self.error("shape", rule()))
        };
        Ok([extent(1)?, extent(2)?, extent(3)?])
    }

    pub(super) fn kind(&self) -> SampleType {
        self.kind
    }

    /// Returns the names of the axes, where all have one.
    pub(super) fn names(&self) -> Option<Vec<&str>> {
        self.stored.dimension_names().as_ref()?.iter().map(|name| name.as_deref()).collect()
    }
}

/// The samples of an image in chunks.
pub(super) struct InChunks {
    array: Array,
    cache: Option<Box<dyn ChunkCache>>,
    /// The indices on the axes before those of space.
    lead: Vec<u64>,
    /// The axis of channels, and their number.
    channel: Option<(usize, u64)>,
    layout: Layout,
    /// A coarser level, with its first index and its step in the indices of this one.
    overview: Option<Box<(Self, [[f64; 3]; 2])>>,
}

impl fmt::Debug for InChunks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InChunks")
            .field("array", &self.array)
            .field("layout", &self.layout)
            .finish_non_exhaustive()
    }
}

impl InChunks {
    pub(super) fn new(array: Array, lead: Vec<u64>, channel: Option<(usize, u64)>, layout: Layout) -> Self {
        Self { array, cache: None, lead, channel, layout, overview: None }
    }

    /// Keeps decoded chunks from now on, and takes the finest of the coarser levels that is small enough as the overview. `levels` begins with
    /// this one.
    pub(super) fn on_demand(&mut self, levels: &[Level], folder: &Path, options: &ReadOptions) -> Result<()> {
        let stored = Arc::clone(&self.array.stored);
        // Of shards the index is kept.
        self.cache = Some(if stored.is_sharded() {
            Box::new(ChunkCachePartialDecoderLruChunkLimit::new(stored, SHARDS))
        } else {
            Box::new(ChunkCacheDecodedLruSizeLimit::new(stored, KEPT))
        });
        let Some((own, coarser)) = levels.split_first() else { return Ok(()) };
        for (i, level) in coarser.iter().enumerate() {
            let array = Array::open(&level.within(folder), options)?;
            if array.shape().len() != self.array.shape().len() || array.kind != self.array.kind {
                return Err(
                    array.error("array", "must have the type and the number of axes of the finer level")
                );
            }
            let dims = array.dims()?;
            let count = dims.iter().try_fold(1_u64, |n, &extent| n.checked_mul(u64::from(extent)));
            let is_small = dims.iter().all(|&extent| extent <= OVERVIEW);
            let is_last = i + 1 == coarser.len() && count.is_some_and(|count| count <= MOST_OVERVIEW);
            if is_small || is_last {
                let [first, step] = lattice(own, level, self.layout.dims, dims);
                let layout = Layout { dims, ..self.layout };
                let chunks = Self::new(array, self.lead.clone(), self.channel, layout);
                self.overview = Some(Box::new((chunks, [first, step])));
                return Ok(());
            }
        }
        Ok(())
    }

    /// Appends all samples, as many chunks at a time as lie beside each other.
    pub(super) fn append_all(&self, values: &mut Values) -> Result<()> {
        let [width, height, depth] = self.layout.dims;
        let most = u32::try_from(self.array.depth).unwrap_or(u32::MAX).clamp(1, depth.max(1));
        let mut z = 0;
        while z < depth {
            let deep = most.min(depth - z);
            self.append([0, 0, z], [width, height, deep], values)?;
            z += deep;
        }
        Ok(())
    }

    fn append(&self, first: [u32; 3], extent: [u32; 3], values: &mut Values) -> Result<()> {
        let count: usize = extent.iter().map(|&n| num::index(n)).product();
        let Layout { components, pick, .. } = self.layout;
        let channels = match pick {
            Pick::Component(channel) => channel..channel + 1,
            _ => 0..components,
        };
        let several = channels.len();
        let size = num::usize_of_u64(self.layout.kind.bytes());
        let mut tuples = Vec::new();
        for (i, channel) in channels.enumerate() {
            let bytes = self.channel(channel, first, extent)?;
            if bytes.len() != count * size {
                return Err(self
                    .array
                    .error("chunks", format!("{} bytes: {count} samples were asked for", bytes.len())));
            }
            if several == 1 {
                tuples = bytes;
                break;
            }
            tuples.resize(count * size * several, 0);
            for (tuple, sample) in tuples.chunks_exact_mut(size * several).zip(bytes.chunks_exact(size)) {
                tuple[i * size..][..size].copy_from_slice(sample);
            }
        }
        let pick = if let Pick::Component(_) = pick { Pick::Component(0) } else { pick };
        let layout = Layout { components: several, pick, ..self.layout };
        append(&mut tuples.as_slice(), count, &layout, values)
            .map_err(|error| self.array.error("chunks", format!("cannot read: {error}")))
    }

    /// Returns the bytes of a box of one channel, in the byte order of this machine.
    fn channel(&self, channel: usize, first: [u32; 3], extent: [u32; 3]) -> Result<Vec<u8>> {
        let mut lead = self.lead.clone();
        if let Some((axis, _)) = self.channel {
            lead[axis] = num::wide(channel);
        }
        let reversed = |[x, y, z]: [u32; 3]| [z, y, x].map(u64::from);
        let start: Vec<u64> = lead.iter().copied().chain(reversed(first)).collect();
        let shape: Vec<u64> = lead.iter().map(|_| 1).chain(reversed(extent)).collect();
        let place = format!("chunks of the box from {first:?}");
        let failed = |error: &dyn fmt::Display| self.array.error(place.clone(), one_line(error));
        let subset = ArraySubset::new_with_start_shape(start, shape).map_err(|error| failed(&error))?;
        let options = CodecOptions::default();
        let bytes = match &self.cache {
            Some(cache) => {
                let bytes =
                    cache.retrieve_array_subset_bytes(&subset, &options).map_err(|error| failed(&error))?;
                Arc::unwrap_or_clone(bytes)
            }
            None => self
                .array
                .stored
                .retrieve_array_subset_opt::<ArrayBytes<'static>>(&subset, &options)
                .map_err(|error| failed(&error))?,
        };
        Ok(bytes.into_fixed().map_err(|error| failed(&error))?.into_owned())
    }
}

impl SampleSource for InChunks {
    fn read(&self, first: [u32; 3], extent: [u32; 3]) -> Result<Samples> {
        let mut values = Values::none(self.layout.kind, self.layout.components, self.layout.pick);
        self.append(first, extent, &mut values)?;
        Ok(values.into_samples())
    }

    fn overview(&self) -> Result<Option<Overview>> {
        let Some(overview) = &self.overview else { return Ok(None) };
        let (chunks, [first, step]) = &**overview;
        let dims = chunks.layout.dims;
        Ok(Some(Overview { dims, first: *first, step: *step, samples: chunks.read([0; 3], dims)? }))
    }
}

/// Returns the first index and the step of a coarser level in the indices of a finer one; where nothing is said, both cover the same box.
fn lattice(own: &Level, coarser: &Level, dims: [u32; 3], fewer: [u32; 3]) -> [[f64; 3]; 2] {
    let last = |list: &[f64], back: usize| list.len().checked_sub(back).map(|at| list[at]);
    let axis = |a: usize| {
        let place = |level: &Level| Some((last(&level.scale, a + 1)?, last(&level.translation, a + 1)?));
        match (place(own), place(coarser)) {
            (Some((scale, from)), Some((step, to))) => ((to - from) / scale, step / scale),
            _ => {
                let step = f64::from(dims[a]) / f64::from(fewer[a]);
                (0.5 * (step - 1.0), step)
            }
        }
    };
    let [x, y, z] = [0, 1, 2].map(axis);
    [[x.0, y.0, z.0], [x.1, y.1, z.1]]
}

/// Returns the text of an error in one line.
fn one_line(error: &dyn fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
