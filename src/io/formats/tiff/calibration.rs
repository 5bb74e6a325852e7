//! Voxel size, origin and rescale of a stack, and the volumes that its pages make.

use glam::DVec3;

use crate::io::formats::tiff::file::index;
use crate::num::wide;
use crate::scene::Rescale;

/// The meaning of the pages of a stack, and the size of a voxel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibration {
    pub(crate) spacing: DVec3,
    pub(crate) origin: DVec3,
    pub(crate) rescale: Option<Rescale>,
    /// The number of images that the description announces.
    pub(crate) images: Option<u64>,
    /// Extents of `C`, `Z` and `T`, the fastest first.
    pub(crate) axes: [(char, u64); 3],
    pub(crate) notes: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// The pages of one volume: `first`, and every `stride`-th after it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Volume {
    /// Frame and channel, if there are several.
    pub(crate) name: String,
    pub(crate) first: usize,
    pub(crate) stride: usize,
    pub(crate) slices: usize,
}

/// The tags of a page that give its scale.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Resolution {
    /// Pixels per unit along x and y.
    pub(crate) pixels: [Option<f64>; 2],
    /// The code of the unit: 1 none, 2 inch, 3 centimetre.
    pub(crate) unit: u64,
}

impl Resolution {
    /// Returns the size of a pixel along x and y, if both are known.
    pub(crate) fn sizes(self) -> Option<[f64; 2]> {
        let size = |pixels: Option<f64>| {
            pixels.map(|pixels| 1.0 / pixels).filter(|size| *size > 0.0 && size.is_finite())
        };
        Some([size(self.pixels[0])?, size(self.pixels[1])?])
    }
}

impl Calibration {
    pub(crate) fn unknown() -> Self {
        Self {
            spacing: DVec3::ONE,
            origin: DVec3::ZERO,
            rescale: None,
            images: None,
            axes: [('C', 1), ('Z', 1), ('T', 1)],
            notes: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Describes the announced counts.
    pub(crate) fn announced(&self) -> String {
        let [channels, slices, frames] = ['C', 'Z', 'T'].map(|axis| self.extent(axis));
        format!("the description announces {channels} channels x {slices} slices x {frames} frames")
    }

    /// Returns the extent of `C`, `Z` or `T`.
    pub(crate) fn extent(&self, axis: char) -> u64 {
        self.axes.iter().find(|(name, _)| *name == axis).map_or(1, |(_, extent)| *extent)
    }

    /// Returns the volumes that the pages make; the first is shown by default.
    pub(crate) fn volumes(&mut self, pages: usize) -> Vec<Volume> {
        let all = vec![Volume { name: String::new(), first: 0, stride: 1, slices: pages }];
        let product = self.axes.iter().try_fold(1_u64, |n, (_, extent)| n.checked_mul(*extent));
        if product == Some(1) {
            return all;
        }
        if product != Some(wide(pages)) {
            let announced = self.announced();
            self.warnings.push(format!("{announced}, there are {pages} pages: all are taken as slices"));
            return all;
        }
        // Programs without a notion of slices count them as frames or channels.
        let other = match ['Z', 'T', 'C'].map(|axis| self.extent(axis)) {
            [1, frames, _] if frames > 1 => Some(('T', frames, "frames")),
            [1, _, channels] if channels > 1 => Some(('C', channels, "channels")),
            _ => None,
        };
        if let Some((other, count, what)) = other {
            self.warnings.push(format!("{count} {what} of one slice are taken as slices"));
            let swap = |name| match name {
                'Z' => other,
                name if name == other => 'Z',
                name => name,
            };
            self.axes = self.axes.map(|(name, extent)| (swap(name), extent));
        }
        // The product of extents is the number of pages, so nothing here overflows.
        let stride = |axis| {
            let before = self.axes.iter().take_while(|(name, _)| *name != axis);
            before.map(|(_, extent)| index(*extent)).product::<usize>()
        };
        let [channels, slices, frames] = ['C', 'Z', 'T'].map(|axis| index(self.extent(axis)));
        let part = |what, number: usize, count| (count > 1).then(|| format!("{what} {}", number + 1));
        let volume = |(frame, channel)| {
            let name = [part("frame", frame, frames), part("channel", channel, channels)];
            Volume {
                name: name.into_iter().flatten().collect::<Vec<_>>().join(" "),
                first: frame * stride('T') + channel * stride('C'),
                stride: stride('Z'),
                slices,
            }
        };
        (0..frames).flat_map(|frame| (0..channels).map(move |channel| (frame, channel))).map(volume).collect()
    }
}

pub(crate) const UNKNOWN_VOXEL: &str = "the size of a voxel is unknown and counts as 1";
