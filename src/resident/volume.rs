//! The samples of a grid as images on the device, and the memory that a grid takes.

use std::borrow::Cow;
use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::gpu::shader::PAGE_TEXELS;
use crate::gpu::{Commands, Gpu, Image, ImageDesc};
use crate::num::{self, f32_of};
use crate::resident::bricks::{brick_bytes, normalised};
use crate::resident::mips;
use crate::scene::grid::turned;
use crate::scene::{Grid, Rescale, SampleKind, Samples};

/// Least bytes of device memory that techniques allocate for a grid.
///
/// Devices pad images; and on a device that filters 8-bit samples too coarsely they are stored in 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridBytes {
    /// Samples as one 3D image: `slices-3d`, `slabs`, `raycast`.
    pub volume: u64,
    /// Samples as one stack of 2D slices: `slices-2d` and `shear-warp`.
    pub stack: u64,
    /// All three stacks, as `stacks=all` keeps them.
    pub stacks: u64,
    /// Ranges of bricks, and which bricks are visible: with `empty-space`.
    pub bricks: u64,
}

impl GridBytes {
    /// Computes the bytes of a grid.
    #[must_use]
    pub fn of(grid: &Grid) -> Self {
        let product = |extents: [u32; 3]| extents.iter().fold(1_u64, |n, &e| n.saturating_mul(u64::from(e)));
        let volume = product(grid.dims()).saturating_mul(num::wide(grid.samples().sample_bytes()));
        Self { volume, stack: volume, stacks: volume.saturating_mul(3), bricks: brick_bytes(grid.dims()) }
    }
}

/// The kind of image that holds samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Layout {
    /// One 3D image.
    Volume,
    /// An array of 2D slices perpendicular to an axis; the other two follow it cyclically.
    Stack(usize),
}

/// The texel format of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Encoding {
    /// 8-bit normalised.
    R8,
    /// 16-bit normalised; 8-bit samples are widened, signed ones shifted.
    R16,
    /// 32-bit float.
    R32f,
}

/// The form in which a device holds samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Form {
    encoding: Encoding,
    layout: Layout,
    levels: u32,
}

impl Form {
    /// Chooses the form for exact fetches or for the sampler's filter, with mip levels or without.
    pub(crate) fn new(gpu: &Gpu, grid: &Grid, layout: Layout, for_filter: bool, mip: bool) -> Result<Self> {
        let encoding = encoding_on(gpu, grid.samples(), for_filter, mip)?;
        let (dims, along) = layout.texels(grid);
        Ok(Self { encoding, layout, levels: if mip { mips::levels(dims, along) } else { 1 } })
    }

    /// Chooses the form of pages of the grid, of which techniques of stacks have a copy for each axis.
    pub(crate) fn of_pages(gpu: &Gpu, grid: &Grid, layout: Layout, for_filter: bool) -> Result<Self> {
        let layout = if layout == Layout::Volume { layout } else { Layout::Stack(0) };
        Self::new(gpu, grid, layout, for_filter, false)
    }

    /// Returns how many copies of its pages a grid has: copy i is turned as the stack of axis i.
    pub(crate) fn copies(self) -> u32 {
        if self.layout == Layout::Volume { 1 } else { 3 }
    }

    /// Returns the axis that is last in a copy.
    fn axis_of(self, copy: u32) -> usize {
        if self.layout == Layout::Volume { 2 } else { num::index(copy) }
    }

    /// Returns the place of a page along the axes of its texels in a copy.
    pub(crate) fn turned_place(self, place: [u32; 3], copy: u32) -> [u32; 3] {
        turned(place, self.axis_of(copy))
    }

    /// Returns the samples of a page in the order of its texels in a copy.
    pub(crate) fn turned_page(self, samples: &Samples, copy: u32) -> Cow<'_, Samples> {
        match self.axis_of(copy) {
            2 => Cow::Borrowed(samples),
            axis => Cow::Owned(turn_samples(samples, [PAGE_TEXELS; 3], axis)),
        }
    }

    /// Describes an image with so many texels along each axis.
    fn texels(self, extent: [u32; 3]) -> ImageDesc {
        let ([w, h, d], format) = (extent, self.encoding.format());
        match self.layout {
            Layout::Volume => ImageDesc::sampled_volume(format, extent),
            Layout::Stack(_) => ImageDesc::sampled_stack(format, [w, h], d),
        }
    }

    /// Returns the most texels of a pool along each axis.
    pub(crate) fn pool_sides(self, gpu: &Gpu) -> [u32; 3] {
        let limits = gpu.limits();
        match self.layout {
            Layout::Volume => [limits.max_image_dimension3_d; 3],
            Layout::Stack(_) => {
                let side = limits.max_image_dimension2_d;
                [side, side, limits.max_image_array_layers]
            }
        }
    }

    /// Returns the bytes of a page.
    pub(crate) fn page_bytes(self) -> usize {
        num::index(PAGE_TEXELS).pow(3) * self.encoding.texel_bytes()
    }

    /// Writes samples of a grid as texels. `ends` are the first and last scalar of the transfer function, which infinite samples become.
    pub(crate) fn encode(self, grid: &Grid, ends: [f64; 2], samples: &Samples, memory: &mut [u8]) {
        Source { samples, rescale: grid.rescale(), ends, encoding: self.encoding }.encode(0, memory);
    }

    /// Describes the image of a grid, with its name.
    fn image(self, grid: &Grid) -> (String, ImageDesc) {
        let name = match self.layout {
            Layout::Volume => "volume".to_string(),
            Layout::Stack(axis) => format!("stack.{}", ["x", "y", "z"][axis % 3]),
        };
        (name, ImageDesc { levels: self.levels, ..self.texels(self.layout.texels(grid).0) })
    }

    /// Returns whether the device has room for the image of a grid.
    pub(crate) fn fits(self, gpu: &Gpu, grid: &Grid) -> bool {
        let (name, desc) = self.image(grid);
        gpu.check_image(&name, &desc).is_ok()
    }
}

impl Layout {
    /// Returns the texels along each axis of the image, and the axes that mip levels halve.
    fn texels(self, grid: &Grid) -> ([u32; 3], [bool; 3]) {
        match self {
            Self::Volume => (grid.dims(), [true; 3]),
            Self::Stack(axis) => (turned(grid.dims(), axis), [true, true, false]),
        }
    }
}

/// The grid's samples as an image.
#[derive(Debug)]
pub(crate) struct Volume {
    pub(crate) image: Arc<Image>,
    /// Value of a texel: `scale * texel + offset`.
    pub(crate) scale: f32,
    pub(crate) offset: f32,
    /// Whether the device filters the format linearly.
    pub(crate) filterable: bool,
}

impl Volume {
    /// Returns the bytes of a sample on the device.
    pub(crate) fn voxel_bytes(&self) -> u64 {
        self.image.desc().bytes_each()
    }

    /// Uploads the samples of a grid.
    ///
    /// `ends` are the first and last scalar of the transfer function, which infinite samples become.
    pub(crate) fn new(gpu: &Gpu, grid: &Grid, ends: [f64; 2], form: Form) -> Result<Arc<Self>> {
        let Form { encoding, layout, levels } = form;
        let (dims, along) = layout.texels(grid);
        let (name, desc) = form.image(grid);
        // Checked before samples are reordered and averaged, which takes time.
        gpu.check_image(&name, &desc)?;
        let turned_samples;
        let samples = match layout {
            Layout::Stack(axis) if axis != 2 => {
                turned_samples = turn_samples(grid.samples(), grid.dims(), axis);
                &turned_samples
            }
            _ => grid.samples(),
        };
        let source = Source { samples, rescale: grid.rescale(), ends, encoding };
        let smaller = source.smaller_levels(dims, along, levels);
        let image = Image::with_data(gpu, &name, &desc, |level, first, memory| {
            let plane = num::index(desc.level_extent(level)[0]) * num::index(desc.level_extent(level)[1]);
            match num::index(level).checked_sub(1) {
                None => source.encode(first * plane, memory),
                Some(smaller_level) => encoding.put(&smaller[smaller_level][first * plane..], memory),
            }
        })?;
        Ok(Self::of(gpu, grid, encoding, image))
    }

    /// Makes an image with room for `slots` pages of a grid along each axis, all zeros.
    pub(crate) fn pool(gpu: &Gpu, grid: &Grid, form: Form, slots: [u32; 3]) -> Result<Arc<Self>> {
        let extent = slots.map(|n| n * PAGE_TEXELS);
        let image = Arc::new(Image::new(gpu, "page pool", &form.texels(extent))?);
        Commands::new(gpu)?.run("page pool", |recorder| {
            recorder.clear_image("page pool", &image, [0.0; 4]);
            recorder.release_image(&image);
        })?;
        Ok(Self::of(gpu, grid, form.encoding, image))
    }

    fn of(gpu: &Gpu, grid: &Grid, encoding: Encoding, image: Arc<Image>) -> Arc<Self> {
        let (scale, offset) = value_map(grid, encoding);
        let linear = vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        let filterable = gpu.image_features(encoding.format()).contains(linear);
        Arc::new(Self { image, scale: f32_of(scale), offset: f32_of(offset), filterable })
    }
}

/// Returns the encoding of samples: their own type where the device has it.
///
/// 8-bit samples are widened where the device's filter rounds to 8 bits, and for mip levels, whose means have more
/// digits than samples.
fn encoding_on(gpu: &Gpu, samples: &Samples, for_filter: bool, mip: bool) -> Result<Encoding> {
    let own = match samples.kind() {
        SampleKind::U8 if mip => Encoding::R16,
        SampleKind::U8 if for_filter && gpu.filters_in_8_bit()? => Encoding::R16,
        _ => Encoding::own(samples),
    };
    // 16-bit normalised images are optional.
    let sampled = gpu.image_features(own.format()).contains(vk::FormatFeatureFlags::SAMPLED_IMAGE);
    Ok(if sampled { own } else { Encoding::R32f })
}

impl Encoding {
    /// Returns the encoding that keeps samples as they are.
    fn own(samples: &Samples) -> Self {
        match samples.kind() {
            SampleKind::U8 => Self::R8,
            SampleKind::U16 | SampleKind::I16 => Self::R16,
            SampleKind::F32 => Self::R32f,
        }
    }

    fn format(self) -> vk::Format {
        match self {
            Self::R8 => vk::Format::R8_UNORM,
            Self::R16 => vk::Format::R16_UNORM,
            Self::R32f => vk::Format::R32_SFLOAT,
        }
    }

    /// Writes numbers as a shader reads them (0 to 1 where the format is normalised), until `memory` is full.
    fn put(self, texels: &[f32], memory: &mut [u8]) {
        match self {
            Self::R8 => put(texels, memory, |x| [num::u8_code(f64::from(x) * 255.0)]),
            Self::R16 => put(texels, memory, |x| num::u16_code(f64::from(x) * 65535.0).to_ne_bytes()),
            Self::R32f => put(texels, memory, f32::to_ne_bytes),
        }
    }

    /// Returns texels as a shader reads them.
    fn texels(self, memory: &[u8]) -> Vec<f32> {
        let of = |size: usize, value: fn(&[u8]) -> f32| memory.chunks_exact(size).map(value).collect();
        match self {
            Self::R8 => of(1, |b| f32::from(b[0]) / 255.0),
            Self::R16 => of(2, |b| f32::from(bytemuck::pod_read_unaligned::<u16>(b)) / 65535.0),
            Self::R32f => of(4, bytemuck::pod_read_unaligned),
        }
    }

    fn texel_bytes(self) -> usize {
        match self {
            Self::R8 => 1,
            Self::R16 => 2,
            Self::R32f => 4,
        }
    }
}

/// Returns the scale and offset that convert a texel to a value.
fn value_map(grid: &Grid, encoding: Encoding) -> (f64, f64) {
    let rescale = grid.rescale();
    // The stored number is full * texel + zero.
    let [zero, full] = if encoding == Encoding::R32f { [0.0, 1.0] } else { normalised(grid.samples()) };
    (rescale.slope * full, rescale.slope * zero + rescale.intercept)
}

/// Returns samples in the order of a stack's texels.
fn turn_samples(samples: &Samples, dims: [u32; 3], axis: usize) -> Samples {
    fn turn<T: Copy>(values: &[T], dims: [u32; 3], axis: usize) -> Vec<T> {
        let [nx, ny, _] = dims.map(num::index);
        let [u, v, k] = turned(dims, axis).map(num::index);
        let [du, dv, dk] = turned([1, nx, nx * ny], axis);
        let mut out = Vec::with_capacity(values.len());
        for slice in 0..k {
            for row in 0..v {
                let start = slice * dk + row * dv;
                out.extend((0..u).map(|i| values[start + i * du]));
            }
        }
        out
    }
    match samples {
        Samples::U8(v) => Samples::U8(turn(v, dims, axis)),
        Samples::U16(v) => Samples::U16(turn(v, dims, axis)),
        Samples::I16(v) => Samples::I16(turn(v, dims, axis)),
        Samples::F32(v) => Samples::F32(turn(v, dims, axis)),
        Samples::OnDemand(v) => turn_samples(&v.run(0..v.len()), dims, axis),
    }
}

/// Writes values as texels until `memory` or `values` ends.
fn put<T: Copy, const N: usize>(values: &[T], memory: &mut [u8], bytes: impl Fn(T) -> [u8; N]) {
    for (value, place) in values.iter().zip(memory.chunks_exact_mut(N)) {
        place.copy_from_slice(&bytes(*value));
    }
}

/// Samples on their way to the device.
struct Source<'a> {
    samples: &'a Samples,
    rescale: Rescale,
    /// First and last scalar of the transfer function.
    ends: [f64; 2],
    encoding: Encoding,
}

impl Source<'_> {
    /// Writes samples from `first` on as texels, until `memory` is full.
    fn encode(&self, first: usize, memory: &mut [u8]) {
        // Infinities become the ends of the transfer function, as stored numbers.
        let [low, high] =
            if self.rescale.slope > 0.0 { [0, 1] } else { [1, 0] }.map(|end| self.stored_end(end));
        match (self.samples, self.encoding) {
            (Samples::OnDemand(v), encoding) => {
                let samples = &v.run(first..first + memory.len() / encoding.texel_bytes());
                Source { samples, ..*self }.encode(0, memory);
            }
            (Samples::U8(v), Encoding::R8) => put(&v[first..], memory, |x| [x]),
            (Samples::U8(v), Encoding::R16) => {
                put(&v[first..], memory, |x| (u16::from(x) * 257).to_ne_bytes());
            }
            (Samples::U8(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
            (Samples::U16(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
            (Samples::U16(v), _) => put(&v[first..], memory, u16::to_ne_bytes),
            (Samples::I16(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
            // -32768 becomes 0 and 32767 becomes 65535: flip the sign bit.
            (Samples::I16(v), _) => {
                put(&v[first..], memory, |x| (x.cast_unsigned() ^ 0x8000).to_ne_bytes());
            }
            (Samples::F32(v), _) => put(&v[first..], memory, |x| match x {
                f32::INFINITY => high.to_ne_bytes(),
                f32::NEG_INFINITY => low.to_ne_bytes(),
                x => x.to_ne_bytes(),
            }),
        }
    }

    /// Returns the stored number that the device decodes to an end of the transfer function, or just beyond it.
    fn stored_end(&self, end: usize) -> f32 {
        let Rescale { slope, intercept } = self.rescale;
        let mut stored = f32_of((self.ends[end] - intercept) / slope);
        let reaches = |stored: f32| {
            let scalar = f32_of(slope) * stored + f32_of(intercept);
            if end == 0 { scalar <= f32_of(self.ends[0]) } else { scalar >= f32_of(self.ends[1]) }
        };
        // Rounding may leave the number short of the end by a few units in the last place.
        for _ in 0..64 {
            if reaches(stored) {
                break;
            }
            stored = if (end == 1) == (slope > 0.0) { stored.next_up() } else { stored.next_down() };
        }
        stored
    }

    /// Returns the texels of the levels below the first, each averaged from the one above.
    fn smaller_levels(&self, dims: [u32; 3], along: [bool; 3], levels: u32) -> Vec<Vec<f32>> {
        let mut smaller: Vec<Vec<f32>> = Vec::new();
        if levels > 1 {
            let mut memory = vec![0; self.samples.len() * self.encoding.texel_bytes()];
            self.encode(0, &mut memory);
            let (first, mut dims) = (self.encoding.texels(&memory), dims);
            for _ in 1..levels {
                let (next, next_dims) = mips::halve(smaller.last().unwrap_or(&first), dims, along);
                smaller.push(next);
                dims = next_dims;
            }
        }
        smaller
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Rescale;

    fn texels(grid: &Grid, encoding: Encoding, bytes: usize) -> Vec<u8> {
        let mut memory = vec![0; bytes];
        let source = Source { samples: grid.samples(), rescale: grid.rescale(), ends: [-1.0, 2.0], encoding };
        source.encode(0, &mut memory);
        memory
    }

    #[test]
    fn every_encoding_keeps_every_value() {
        let ends = |samples: Samples| {
            Grid::new([2, 2, 2], samples)
                .unwrap()
                .with_rescale(Rescale { slope: -0.5, intercept: 3.0 })
                .unwrap()
        };
        let u8s = ends(Samples::U8(vec![0, 255, 7, 0, 0, 0, 0, 0]));
        let i16s = ends(Samples::I16(vec![i16::MIN, i16::MAX, -1, 0, 0, 0, 0, 0]));
        let u16s = ends(Samples::U16(vec![0, 65535, 77, 0, 0, 0, 0, 0]));
        for (grid, encoding) in
            [(&u8s, Encoding::R8), (&u8s, Encoding::R16), (&i16s, Encoding::R16), (&u16s, Encoding::R16)]
        {
            let size = if encoding == Encoding::R8 { 1 } else { 2 };
            let memory = texels(grid, encoding, 8 * size);
            let (scale, offset) = value_map(grid, encoding);
            for i in 0..3_usize {
                let code = if size == 1 {
                    f64::from(memory[i]) / 255.0
                } else {
                    f64::from(u16::from_ne_bytes([memory[2 * i], memory[2 * i + 1]])) / 65535.0
                };
                let want = grid.value(num::count(i % 2), num::count(i / 2), 0);
                assert!((scale * code + offset - want).abs() < 1e-9, "{encoding:?} sample {i}");
            }
        }
    }

    #[test]
    fn infinities_become_the_transfer_function_s_ends() {
        let values = vec![f32::INFINITY, f32::NEG_INFINITY, 0.5, 0.0, 0.0, 0.0, 0.0, f32::NAN];
        let grid = Grid::new([2, 2, 2], Samples::F32(values)).unwrap();
        let read = |grid: &Grid| -> Vec<f32> {
            texels(grid, Encoding::R32f, 32)
                .chunks_exact(4)
                .map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]))
                .collect()
        };
        assert_eq!(read(&grid)[..3], [2.0, -1.0, 0.5]);
        assert!(read(&grid)[7].is_nan());
        let flipped = grid.with_rescale(Rescale { slope: -1.0, intercept: 0.0 }).unwrap();
        assert_eq!(read(&flipped)[..2], [1.0, -2.0]);
    }
}
