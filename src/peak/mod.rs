//! Peaks of a device: the most that it does per second of each kind of work that volume rendering consists of, measured by
//! micro-benchmarks (`glsl/peak/peak.glsl`); and pulses, which tell how fast it is at a time. Behind the feature `cli`.
//!
//! A frame that needs a number of fetches, bytes or pairs cannot take less time than the peak of each allows. May use `gpu` and
//! `primitives`.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::shader::{
    COMPOSITE_VERTEX, CompositeVertex, PEAK_ATOMIC, PEAK_COPY, PEAK_EXPONENTIAL, PEAK_FETCH, PEAK_FRAGMENT,
    PEAK_IMAGE, PEAK_TEXEL, PeakAtomic, PeakCopy, PeakFetch, PeakFragment, PeakImage,
};
use crate::gpu::{
    Attachment, Blend, Bound, Buffer, BufferUse, Commands, Descriptors, Gpu, GraphicsState, Image, ImageDesc,
    Recorder,
};
use crate::interface::PeakPush;
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};
use crate::primitives::radix_sort::RadixSort;

/// Work is doubled until it takes this long, in seconds: submitting it is then less than a hundredth.
const ENOUGH: f64 = 0.01;

/// Number of times that work is measured; the fastest counts.
const TRIES: u32 = 3;

/// Time of a pulse, in seconds.
const PULSE: f64 = 0.003;

/// Invocations of a workgroup.
const GROUP: u32 = 64;

/// Most workgroups of a dispatch; fewer run at a time on any device.
const MOST_GROUPS: u32 = 1 << 18;

/// Bits of keys that are sorted by: those of the tiles of 512 x 512 pixels.
const SORTED_BITS: u32 = 12;

/// Sides of the least image of 16-byte texels that is copied, 64 MiB, and of the greatest, 1 GiB: more than caches hold, and
/// enough that a copy takes many times as long as it takes to start.
const COPIED_SIDES: [u32; 2] = [2048, 8192];

/// Sides of an image that is blended into.
const BLENDED_SIDE: u32 = 1024;

/// Sides of a volume that is fetched from.
const SIDE: u32 = 64;

/// Fetches of an invocation.
const FETCHES: u32 = 128;

/// Atomic additions of an invocation.
const ATOMICS: u32 = 16;

/// Exponentials of an invocation.
const EXPONENTIALS: u32 = 512;

/// Words that are added to, a power of two: 4 MiB.
const ADDED_WORDS: u32 = 1 << 20;

/// The most that a device does per second of one kind of work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Kind of work.
    pub name: &'static str,
    /// The work that is counted.
    pub what: &'static str,
    /// Number per second.
    pub per_second: f64,
}

/// A kind of work: its name, the work that is counted, and the measurement.
type Kind = (&'static str, &'static str, fn(&Gpu) -> Result<f64>);

/// All kinds of work.
#[rustfmt::skip]
const KINDS: [Kind; 14] = [
    ("filtered.r8", "trilinear samples of a volume of 8-bit samples", |gpu| filtered(gpu, vk::Format::R8_UNORM)),
    ("filtered.r16", "trilinear samples of a volume of 16-bit samples", |gpu| filtered(gpu, vk::Format::R16_UNORM)),
    ("filtered.r32f", "trilinear samples of a volume of 32-bit floats", |gpu| filtered(gpu, vk::Format::R32_SFLOAT)),
    ("texels.r8", "single fetches from a volume of 8-bit samples", |gpu| texels(gpu, vk::Format::R8_UNORM)),
    ("texels.r16", "single fetches from a volume of 16-bit samples", |gpu| texels(gpu, vk::Format::R16_UNORM)),
    ("texels.r32f", "single fetches from a volume of 32-bit floats", |gpu| texels(gpu, vk::Format::R32_SFLOAT)),
    ("buffer_bytes", "bytes read and written, in a copy of a buffer of at most 1 GiB", buffer_bytes),
    ("image_bytes", "bytes read and written, in a copy of an image of at most 1 GiB", image_bytes),
    ("blended.rgba8", "pixels blended into four 8-bit channels", |gpu| blended(gpu, vk::Format::R8G8B8A8_UNORM)),
    ("blended.rgba16f", "pixels blended into four half floats", |gpu| blended(gpu, vk::Format::R16G16B16A16_SFLOAT)),
    ("blended.rgba32f", "pixels blended into four 32-bit floats", |gpu| blended(gpu, vk::Format::R32G32B32A32_SFLOAT)),
    ("atomics", "atomic additions to words far apart", atomics),
    ("sorted_pairs", "pairs sorted by 12 bits of their keys", sorted_pairs),
    ("exponentials", "exponentials of 32-bit floats", exponentials),
];

/// Measures the peaks of a device, in a few seconds on a software device.
///
/// # Errors
///
/// [`Error::DeviceLost`] and other errors of Vulkan. Kinds of work that the device or its memory does not allow are left out.
pub fn measure(gpu: &Gpu) -> Result<Vec<Peak>> {
    let peak = |(name, what, per_second): Kind| match per_second(gpu) {
        Ok(per_second) => Ok(Some(Peak { name, what, per_second })),
        Err(Error::Unsupported { .. } | Error::Memory { .. }) => Ok(None),
        Err(error) => Err(error),
    };
    KINDS.into_iter().filter_map(|kind| peak(kind).transpose()).collect()
}

/// A fixed amount of work, whose rate tells how fast the device is at a time: its clock and other users of it change that.
#[derive(Debug)]
pub struct Pulse {
    commands: Commands,
    dispatch: Dispatch,
    groups: u32,
}

impl Pulse {
    /// Prepares the work, trilinear samples of a volume of 8-bit samples, of which there are as many as take 3 ms.
    ///
    /// # Errors
    ///
    /// [`Error::Memory`] and errors of Vulkan.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let dispatch = filtering(gpu, vk::Format::R8_UNORM)?;
        let mut commands = Commands::new(gpu)?;
        let groups = enough(&mut commands, PULSE, MOST_GROUPS, of_groups(FETCHES, &dispatch))?;
        Ok(Self { commands, dispatch, groups })
    }

    /// Does the work three times, and returns the most samples per second.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceLost`] and other errors of Vulkan.
    pub fn per_second(&mut self) -> Result<f64> {
        let seconds = least(&mut self.commands, self.groups, of_groups(FETCHES, &self.dispatch))?;
        Ok(f64::from(FETCHES) * f64::from(GROUP) * f64::from(self.groups) / seconds)
    }
}

/// Runs an amount of work, and returns the seconds that it takes.
fn seconds(commands: &mut Commands, amount: u32, record: impl Fn(&mut Recorder<'_>, u32)) -> Result<f64> {
    let begin = Instant::now();
    commands.run("peak", |recorder| record(recorder, amount))?;
    Ok(begin.elapsed().as_secs_f64())
}

/// Returns an amount of work that takes a number of seconds, at most `most`.
fn enough(
    commands: &mut Commands,
    wanted: f64,
    most: u32,
    record: impl Fn(&mut Recorder<'_>, u32),
) -> Result<u32> {
    // The first run may compile.
    seconds(commands, 1, &record)?;
    let mut amount = 1;
    while amount < most && seconds(commands, amount, &record)? < wanted {
        amount = amount.saturating_mul(2).min(most);
    }
    Ok(amount)
}

/// Returns the least of the seconds that an amount of work takes.
fn least(commands: &mut Commands, amount: u32, record: impl Fn(&mut Recorder<'_>, u32)) -> Result<f64> {
    let times = (0..TRIES).map(|_| seconds(commands, amount, &record)).collect::<Result<Vec<f64>>>()?;
    Ok(times.into_iter().fold(f64::INFINITY, f64::min))
}

/// Measures how much work is done per second. `record` records an amount of it, of `each`; at most `most` is recorded at a time.
fn rate(gpu: &Gpu, each: f64, most: u32, record: impl Fn(&mut Recorder<'_>, u32)) -> Result<f64> {
    let mut commands = Commands::new(gpu)?;
    let amount = enough(&mut commands, ENOUGH, most, &record)?;
    Ok(each * f64::from(amount) / least(&mut commands, amount, &record)?)
}

/// Returns what records a number of workgroups, each doing `each` of the work per invocation.
fn of_groups(each: u32, dispatch: &Dispatch) -> impl Fn(&mut Recorder<'_>, u32) {
    move |recorder, groups| {
        dispatch.record(recorder, &PeakPush { count: each }, groups_of(groups * GROUP, GROUP));
    }
}

/// Measures a dispatch of as many workgroups as are enough.
fn rate_of_groups(gpu: &Gpu, each: u32, dispatch: &Dispatch) -> Result<f64> {
    rate(gpu, f64::from(each) * f64::from(GROUP), MOST_GROUPS, of_groups(each, dispatch))
}

/// Makes a volume that fetches are measured in.
fn volume(gpu: &Gpu, format: vk::Format, needed: vk::FormatFeatureFlags) -> Result<Arc<Image>> {
    if !gpu.image_features(format).contains(needed) {
        return Err(Error::unsupported("peak", format!("{needed:?} of {format:?}")));
    }
    let desc = ImageDesc::sampled_volume(format, [SIDE; 3]);
    // Positive numbers of every format.
    Image::with_data(gpu, "peak.volume", &desc, |_, _, memory| memory.fill(0x3f))
}

/// Makes the pass of trilinear samples.
fn filtering(gpu: &Gpu, format: vk::Format) -> Result<Dispatch> {
    let volume = volume(gpu, format, vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)?;
    let (volume, result) = (volume.sampled(vk::Filter::LINEAR), buffer(gpu, "peak.result", 1)?.write());
    pass(gpu, "peak.filtered", &PEAK_FETCH.with(&PeakFetch { volume, result }))
}

fn filtered(gpu: &Gpu, format: vk::Format) -> Result<f64> {
    rate_of_groups(gpu, FETCHES, &filtering(gpu, format)?)
}

fn texels(gpu: &Gpu, format: vk::Format) -> Result<f64> {
    let volume = volume(gpu, format, vk::FormatFeatureFlags::SAMPLED_IMAGE)?;
    let (volume, result) = (volume.sampled(vk::Filter::NEAREST), buffer(gpu, "peak.result", 1)?.write());
    let bound = PEAK_TEXEL.with(&PeakFetch { volume, result });
    rate_of_groups(gpu, FETCHES, &pass(gpu, "peak.texels", &bound)?)
}

/// Returns the sides of an image that is copied, for which a copy takes at most an eighth of the memory.
fn copied_side(gpu: &Gpu) -> u32 {
    let [least, most] = COPIED_SIDES;
    let fits = |side: &u32| 8 * 32 * u64::from(*side).pow(2) <= gpu.memory_budget();
    std::iter::successors(Some(most), |side| Some(side / 2))
        .find(|side| fits(side) || *side <= least)
        .unwrap_or(least)
}

/// Measures a dispatch that copies so many vectors of 16 bytes, over and over.
fn rate_of_copies(gpu: &Gpu, vectors: u32, bound: &Bound, push: &[u8]) -> Result<f64> {
    let Dispatch { name, pipeline, descriptors } = pass(gpu, "peak.copy", bound)?;
    rate(gpu, 32.0 * f64::from(vectors), 1024, |recorder, times| {
        for _ in 0..times {
            recorder.dispatch(&name, &pipeline, &descriptors, push, groups_of(vectors, GROUP));
        }
    })
}

fn buffer_bytes(gpu: &Gpu) -> Result<f64> {
    let vectors = copied_side(gpu).pow(2);
    let [from, to] = ["peak.from", "peak.to"].map(|name| buffer(gpu, name, 4 * u64::from(vectors)));
    let (from, to) = (from?, to?);
    Commands::new(gpu)?.run("peak.fill", |recorder| recorder.clear_buffer("peak.fill", &from))?;
    let bound = PEAK_COPY.with(&PeakCopy { stream: from.read(), texels: to.write() });
    rate_of_copies(gpu, vectors, &bound, bytemuck::bytes_of(&PeakPush { count: vectors }))
}

fn image_bytes(gpu: &Gpu) -> Result<f64> {
    let side = copied_side(gpu);
    let image = |usage| ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, [side; 2], usage);
    let desc = image(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
    let from = Image::with_data(gpu, "peak.from", &desc, |_, _, _| ())?;
    let to = Arc::new(Image::new(gpu, "peak.to", &image(vk::ImageUsageFlags::STORAGE))?);
    let (source, accumulation) = (from.sampled(vk::Filter::NEAREST), to.stored());
    let bound = PEAK_IMAGE.with(&PeakImage { source, accumulation });
    rate_of_copies(gpu, side * side, &bound, &[])
}

fn blended(gpu: &Gpu, format: vk::Format) -> Result<f64> {
    if !gpu.image_features(format).contains(vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND) {
        return Err(Error::unsupported("peak", format!("blending of {format:?}")));
    }
    let bound = COMPOSITE_VERTEX.with(&CompositeVertex {}).and(PEAK_FRAGMENT.with(&PeakFragment {}));
    let topology = vk::PrimitiveTopology::TRIANGLE_LIST;
    let state = GraphicsState { topology, blend: Blend::Over, format: Some(format) };
    let pipeline = gpu.graphics_pipeline("peak.blended", &bound, state)?;
    let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &bound)?);
    let desc = ImageDesc::flat(format, [BLENDED_SIDE; 2], vk::ImageUsageFlags::COLOR_ATTACHMENT);
    let target = Attachment::Own(Arc::new(Image::new(gpu, "peak.target", &desc)?));
    let pixels = f64::from(BLENDED_SIDE) * f64::from(BLENDED_SIDE);
    rate(gpu, pixels, 4096, |recorder, times| {
        recorder.draw("peak.blended", &pipeline, &descriptors, &[], &target, true, 3, times);
    })
}

fn atomics(gpu: &Gpu) -> Result<f64> {
    let result = buffer(gpu, "peak.result", ADDED_WORDS.into())?.write();
    let dispatch = pass(gpu, "peak.atomics", &PEAK_ATOMIC.with(&PeakAtomic { result }))?;
    rate_of_groups(gpu, ATOMICS, &dispatch)
}

fn exponentials(gpu: &Gpu) -> Result<f64> {
    let result = buffer(gpu, "peak.result", 1)?.write();
    let dispatch = pass(gpu, "peak.exponentials", &PEAK_EXPONENTIAL.with(&PeakAtomic { result }))?;
    rate_of_groups(gpu, EXPONENTIALS, &dispatch)
}

/// Measures sorts of more and more pairs until one takes long enough.
fn sorted_pairs(gpu: &Gpu) -> Result<f64> {
    let mut best: f64 = 0.0;
    for n in [1_u32 << 18, 1 << 20, 1 << 22, 1 << 24] {
        let random = |i: u32| i.wrapping_mul(2_654_435_761) >> (32 - SORTED_BITS);
        let mut unsorted = Buffer::new(gpu, "peak.unsorted", 4 * u64::from(n), BufferUse::Upload)?;
        for (word, i) in unsorted.bytes_mut().unwrap_or_default().chunks_exact_mut(4).zip(0..) {
            word.copy_from_slice(&random(i).to_ne_bytes());
        }
        let unsorted = Arc::new(unsorted);
        let count = Buffer::with_data(gpu, "peak.count", bytemuck::bytes_of(&n))?;
        let [keys, values] = [buffer(gpu, "peak.keys", n.into())?, buffer(gpu, "peak.values", n.into())?];
        let sort = RadixSort::counted(gpu, "peak.sort", [&keys, &values], &count, n, SORTED_BITS)?;
        let mut commands = Commands::new(gpu)?;
        let mut least = f64::INFINITY;
        for _ in 0..TRIES {
            commands.run("peak.fill", |recorder| {
                for to in [&keys, &values] {
                    recorder.copy_buffer("peak.fill", &unsorted, to, 4 * u64::from(n));
                    recorder.release_buffer(to);
                }
            })?;
            let begin = Instant::now();
            commands.run("peak.sort", |recorder| sort.record(recorder))?;
            least = least.min(begin.elapsed().as_secs_f64());
        }
        best = best.max(f64::from(n) / least);
        if least >= ENOUGH {
            break;
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::TestGpu;

    #[test]
    fn every_kind_of_work_has_a_peak() {
        let gpu = TestGpu::new();
        let peaks = measure(&gpu).unwrap();
        let pulse = Pulse::new(&gpu).unwrap().per_second().unwrap();
        assert!((0.1..10.0).contains(&(pulse / peaks[0].per_second)), "{pulse:.3e} {:?}", peaks[0]);
        let names: Vec<&str> = peaks.iter().map(|peak| peak.name).collect();
        assert_eq!(names, KINDS.map(|(name, ..)| name));
        for Peak { name, per_second, .. } in peaks {
            println!("{name} {per_second:.3e}");
            assert!(per_second > 1e4 && per_second < 1e16, "{name}: {per_second}");
        }
    }
}
