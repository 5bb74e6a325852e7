//! The transfer function on the device: its knots, and tables for segments with a scalar at both ends.

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::gpu::shader::{
    INTEGRATOR_EXACT, INTEGRATOR_FULL, INTEGRATOR_INTEGRAL, INTEGRATOR_MIDPOINT, INTEGRATOR_SMOKE, Optics,
};
use crate::gpu::{Buffer, Gpu, Image, ImageDesc, Step};
use crate::interface::TableHead;
use crate::num::{self, f32_of};
use crate::optics::DeviceKnots;
use crate::optics::cumulative::Cumulative;
use crate::optics::full::Full;
use crate::scene::TransferFunction;

/// Image format of tables.
pub(crate) const TABLE_FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// Thicknesses of a 2-D table, each half the one before, from the longest segment down to a two-thousandth of it.
///
/// A thinner segment takes its colour from the thinnest.
const LAYERS: u32 = 12;

/// How colour and opacity are integrated along a segment with a scalar at both ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Integrator {
    /// Classifies the scalar of the middle.
    Midpoint,
    /// Takes integrals from 1-D cumulative tables.
    Integral,
    /// Takes colours from a 2-D table for each of several thicknesses.
    Full,
    /// Cuts segments at the knots, without a table.
    Exact,
    /// Takes the mean scalar as extinction, without a transfer function; for meshes.
    Smoke,
}

impl Integrator {
    /// Returns the shader's code.
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Midpoint => INTEGRATOR_MIDPOINT,
            Self::Integral => INTEGRATOR_INTEGRAL,
            Self::Full => INTEGRATOR_FULL,
            Self::Exact => INTEGRATOR_EXACT,
            Self::Smoke => INTEGRATOR_SMOKE,
        }
    }
}

/// Bins of the cumulative table by default.
const BINS: u32 = 4096;
/// Nodes on each axis of the 2-D table by default.
const NODES: u32 = 256;

/// How segments are integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SegmentOptions {
    /// The method.
    pub integrator: Integrator,
    /// Bins of the cumulative table (`None`: 4096), or nodes on each axis of the 2-D table (`None`: 256).
    pub table: Option<u32>,
}

impl SegmentOptions {
    /// Makes options of an integrator with a table of the default size.
    pub(crate) const fn of(integrator: Integrator) -> Self {
        Self { integrator, table: None }
    }

    /// Returns the size of the table, chosen or default.
    pub(crate) fn table_size(&self) -> u32 {
        self.table.unwrap_or(if self.integrator == Integrator::Full { NODES } else { BINS })
    }
}

/// A table of integrals of the transfer function over segments.
#[derive(Debug)]
pub(crate) struct Table {
    /// Sizes and scales, and the bins of a cumulative table.
    pub(crate) buffer: Arc<Buffer>,
    /// Nodes of a 2-D table.
    pub(crate) image: Option<Arc<Image>>,
}

impl Table {
    /// Uploads the table of `size` bins or nodes that an integrator reads; `None` if it reads none.
    ///
    /// `longest` is the length of the longest segment, in world units.
    pub(crate) fn new(
        gpu: &Gpu,
        transfer: &TransferFunction,
        integrator: Integrator,
        size: u32,
        longest: impl FnOnce() -> Result<f64>,
    ) -> Result<Option<Arc<Self>>> {
        let (head, bytes, image) = match integrator {
            Integrator::Midpoint | Integrator::Exact | Integrator::Smoke => return Ok(None),
            Integrator::Integral => {
                let Cumulative { head, bins } = Cumulative::new(transfer, size);
                let head = TableHead { size: [f32_of(size.into()), 0.0, 0.0, 0.0], ..head };
                (head, bytemuck::cast_slice(&bins).to_vec(), None)
            }
            Integrator::Full => {
                let longest = longest()?;
                let Full { head, texels } = Full::new(transfer, size, LAYERS, longest);
                let sizes = [f64::from(size), f64::from(LAYERS), longest, 0.0];
                let desc = ImageDesc::sampled_volume(TABLE_FORMAT, [size, size, LAYERS]);
                let plane = num::index(size) * num::index(size);
                let image = Image::with_data(gpu, "transfer.table", &desc, |_, first, memory| {
                    let bytes = bytemuck::cast_slice(&texels[first * plane..]);
                    memory.copy_from_slice(&bytes[..memory.len()]);
                })?;
                (TableHead { size: sizes.map(f32_of), ..head }, Vec::new(), Some(image))
            }
        };
        let bytes = [bytemuck::bytes_of(&head), &bytes].concat();
        let name = if image.is_some() { "transfer.table-head" } else { "transfer.table" };
        let buffer = Buffer::with_data(gpu, name, &bytes)?;
        Ok(Some(Arc::new(Self { buffer, image })))
    }

    /// Uploads a texel of a volume, for bindings that a variant of a shader leaves alone.
    pub(crate) fn nothing(gpu: &Gpu) -> Result<Arc<Image>> {
        let desc = ImageDesc::sampled_volume(TABLE_FORMAT, [1; 3]);
        Image::with_data(gpu, Step::STAND_IN, &desc, |_, _, memory| memory.fill(0))
    }
}

/// The knots of the transfer function as a buffer.
#[derive(Debug)]
pub(crate) struct Knots {
    pub(crate) buffer: Arc<Buffer>,
    pub(crate) count: u32,
    pub(crate) walk: u32,
    pub(crate) iterations: u32,
}

impl Knots {
    /// Uploads the knots of a transfer function.
    pub(crate) fn new(gpu: &Gpu, transfer: &TransferFunction) -> Result<Arc<Self>> {
        let table = DeviceKnots::new(transfer);
        Ok(Arc::new(Self {
            buffer: Buffer::with_data(gpu, "transfer.knots", bytemuck::cast_slice(&table.knots))?,
            count: table.count,
            walk: table.walk,
            iterations: table.iterations(),
        }))
    }

    /// Returns the inputs of shaders that classify scalars.
    pub(crate) fn optics(&self) -> Optics {
        Optics { knots: self.buffer.read(), knots_uniform: self.buffer.uniform(), knot_walk: self.walk }
    }
}
