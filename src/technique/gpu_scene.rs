//! A scene on the device: uploaded once, in the encodings that techniques ask for.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use ash::vk;

use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Image, ImageDesc};
use crate::num::{self, f32_of};
use crate::optics::DeviceKnots;
use crate::scene::{Grid, Samples, Scene};

/// A scene with what of it lies on the device. Data is uploaded when a technique first needs it, and
/// once.
#[derive(Debug)]
pub struct GpuScene {
    gpu: Gpu,
    scene: Scene,
    volumes: Mutex<Vec<Arc<Volume>>>,
    knots: Mutex<Option<Arc<Knots>>>,
    times: Mutex<UploadTimes>,
}

/// Milliseconds that a scene's way to the device has taken so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct UploadTimes {
    /// Samples.
    pub upload: f64,
    /// Tables of the transfer function.
    pub tables: f64,
}

/// How samples are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    /// 8-bit normalised.
    R8,
    /// 16-bit normalised; 8-bit samples are widened, signed ones shifted.
    R16,
    /// 32-bit float.
    R32f,
}

/// The grid's samples as an image.
#[derive(Debug)]
pub(crate) struct Volume {
    pub(crate) image: Arc<Image>,
    encoding: Encoding,
    /// Value of a texel: `scale * texel + offset`.
    pub(crate) scale: f32,
    pub(crate) offset: f32,
    /// Whether the sampler can filter it.
    pub(crate) filterable: bool,
}

/// The transfer function as a buffer.
#[derive(Debug)]
pub(crate) struct Knots {
    pub(crate) buffer: Arc<Buffer>,
    pub(crate) count: u32,
    pub(crate) walk: u32,
    pub(crate) iterations: u32,
}

impl GpuScene {
    /// Takes a scene for a device. Nothing is uploaded yet.
    #[must_use]
    pub fn new(gpu: &Gpu, scene: Scene) -> Arc<Self> {
        Arc::new(Self {
            gpu: gpu.clone(),
            scene,
            volumes: Mutex::default(),
            knots: Mutex::default(),
            times: Mutex::default(),
        })
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Time that uploads have taken.
    #[must_use]
    pub fn times(&self) -> UploadTimes {
        *self.times.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The volume, encoded for exact fetches or for the sampler's filter.
    pub(crate) fn volume(&self, for_filter: bool) -> Result<Arc<Volume>> {
        let grid = &self.scene.grid;
        let encoding = self.encoding(grid.samples(), for_filter)?;
        let mut volumes = self.volumes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = volumes.iter().find(|volume| volume.encoding == encoding) {
            return Ok(Arc::clone(found));
        }
        let start = Instant::now();
        let desc = ImageDesc::sampled_volume(encoding.format(), grid.dims());
        let ends = self.scene.transfer.domain();
        let plane = num::index(grid.dims()[0]) * num::index(grid.dims()[1]);
        let image = Image::volume_with_data(&self.gpu, "volume", &desc, |first, memory| {
            encode(grid, ends, encoding, first * plane, memory);
        })?;
        let (scale, offset) = value_map(grid, encoding);
        let volume = Arc::new(Volume {
            image,
            encoding,
            scale: f32_of(scale),
            offset: f32_of(offset),
            filterable: self.filterable(encoding),
        });
        volumes.push(Arc::clone(&volume));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).upload +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(volume)
    }

    /// The transfer function.
    pub(crate) fn knots(&self) -> Result<Arc<Knots>> {
        let mut knots = self.knots.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = &*knots {
            return Ok(Arc::clone(found));
        }
        let start = Instant::now();
        let table = DeviceKnots::new(&self.scene.transfer);
        let made = Arc::new(Knots {
            buffer: Buffer::with_data(&self.gpu, "transfer.knots", bytemuck::cast_slice(&table.knots))?,
            count: table.count,
            walk: table.walk,
            iterations: table.iterations(),
        });
        *knots = Some(Arc::clone(&made));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).tables +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(made)
    }

    /// The encoding of samples: their own type where the device has it, widened from 8 bits where the
    /// device's filter would round to them.
    fn encoding(&self, samples: &Samples, for_filter: bool) -> Result<Encoding> {
        let own = match samples {
            Samples::U8(_) if for_filter && self.gpu.filters_in_8_bit()? => Encoding::R16,
            Samples::U8(_) => Encoding::R8,
            Samples::U16(_) | Samples::I16(_) => Encoding::R16,
            Samples::F32(_) => Encoding::R32f,
        };
        // 16-bit normalised images are optional.
        let sampled = self.gpu.image_features(own.format()).contains(vk::FormatFeatureFlags::SAMPLED_IMAGE);
        Ok(if sampled { own } else { Encoding::R32f })
    }

    fn filterable(&self, encoding: Encoding) -> bool {
        self.gpu
            .image_features(encoding.format())
            .contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)
    }
}

impl Encoding {
    fn format(self) -> vk::Format {
        match self {
            Self::R8 => vk::Format::R8_UNORM,
            Self::R16 => vk::Format::R16_UNORM,
            Self::R32f => vk::Format::R32_SFLOAT,
        }
    }
}

/// Scale and offset that turn a texel into a value.
fn value_map(grid: &Grid, encoding: Encoding) -> (f64, f64) {
    let rescale = grid.rescale();
    // The stored number is full * texel + zero.
    let (full, zero) = match (grid.samples(), encoding) {
        (_, Encoding::R32f) => (1.0, 0.0),
        (Samples::U8(_), _) => (255.0, 0.0),
        (Samples::I16(_), _) => (65535.0, -32768.0),
        (Samples::U16(_) | Samples::F32(_), _) => (65535.0, 0.0),
    };
    (rescale.slope * full, rescale.slope * zero + rescale.intercept)
}

/// Writes samples from `first` on as texels, until `memory` is full.
fn encode(grid: &Grid, ends: [f64; 2], encoding: Encoding, first: usize, memory: &mut [u8]) {
    fn put<T: Copy, const N: usize>(values: &[T], memory: &mut [u8], bytes: impl Fn(T) -> [u8; N]) {
        for (value, place) in values.iter().zip(memory.chunks_exact_mut(N)) {
            place.copy_from_slice(&bytes(*value));
        }
    }
    // Infinities take the scalar at the transfer function's ends, as stored numbers.
    let rescale = grid.rescale();
    let stored = |value: f64| f32_of((value - rescale.intercept) / rescale.slope);
    let low = stored(if rescale.slope > 0.0 { ends[0] } else { ends[1] });
    let high = stored(if rescale.slope > 0.0 { ends[1] } else { ends[0] });
    match (grid.samples(), encoding) {
        (Samples::U8(v), Encoding::R8) => put(&v[first..], memory, |x| [x]),
        (Samples::U8(v), Encoding::R16) => put(&v[first..], memory, |x| (u16::from(x) * 257).to_ne_bytes()),
        (Samples::U8(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
        (Samples::U16(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
        (Samples::U16(v), _) => put(&v[first..], memory, u16::to_ne_bytes),
        (Samples::I16(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
        // -32768 becomes 0 and 32767 becomes 65535: flip the sign bit.
        (Samples::I16(v), _) => put(&v[first..], memory, |x| (x.cast_unsigned() ^ 0x8000).to_ne_bytes()),
        (Samples::F32(v), _) => put(&v[first..], memory, |x| {
            let x = if x == f32::INFINITY {
                high
            } else if x == f32::NEG_INFINITY {
                low
            } else {
                x
            };
            x.to_ne_bytes()
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Rescale;

    fn texels(grid: &Grid, encoding: Encoding, bytes: usize) -> Vec<u8> {
        let mut memory = vec![0; bytes];
        encode(grid, [-1.0, 2.0], encoding, 0, &mut memory);
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
