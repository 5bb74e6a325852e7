//! Specialisation constants that take properties of the device.

use super::device::Gpu;
use super::inputs::{Bound, add};
use super::pipeline::{DeviceConstant, SpecConstant};
use crate::error::Result;

/// Bits of the fraction of filter weights, as samplers of GPUs have.
const WEIGHT_BITS: u32 = 8;

/// Loop iterations of one invocation on a device without a limit: at 100 ns each a tenth of a second, far below what watchdogs of operating
/// systems allow.
const UNLIMITED_TURNS: u32 = 1 << 20;

impl Gpu {
    /// Returns the loop iterations that shaders may make in one invocation, summed over the loops that count them.
    pub(crate) fn turns(&self) -> Result<u32> {
        let limit = self.loop_limit()?.min(UNLIMITED_TURNS);
        // Loops that do not count theirs have the rest. Splats take half for the sheet in which a dispatch ends.
        Ok((limit - limit / 12).max(2))
    }

    /// Returns the constants of shaders with their inputs.
    pub(super) fn constants(&self, bound: &Bound) -> Result<Vec<SpecConstant>> {
        let mut constants = bound.constants.clone();
        for &(constant, number) in bound.shaders.iter().flat_map(|shader| shader.device) {
            let value = match constant {
                DeviceConstant::Turns => self.turns()?,
                DeviceConstant::SubpixelBits => self.subpixel_bits(),
                DeviceConstant::WeightBits => u32::from(self.inner.emulates_weights) * WEIGHT_BITS,
                DeviceConstant::Permuted => self.inner.permutes.into(),
            };
            add(&mut constants, (number, value));
        }
        Ok(constants)
    }
}
