//! Push constants of the passes that shade segments of a mesh.

use crate::error::{Error, Result};
use crate::interface::MeshPush;
use crate::num::f32_of;
use crate::resident::GpuScene;
use crate::resident::tables::{Integrator, Knots};
use crate::technique::mesh::desc::MeshDesc;

/// Largest difference of two scalars that count as equal, relative to the transfer function's domain.
///
/// Where two faces coincide within rounding, the segment behind them may take either scalar.
const ALIKE: f64 = 1e-4;

/// Returns the push constants of the scene and the technique; those of the view are still to be set.
///
/// # Errors
///
/// [`Error::Unsupported`] where a ray may meet more knots than a loop on this device has iterations.
pub(crate) fn shading_push(scene: &GpuScene, desc: &MeshDesc, knots: &Knots) -> Result<MeshPush> {
    /// Every device makes this many iterations; the probe runs only above it.
    const ALWAYS: u32 = 32_768;
    // A segment may span every knot, and a ray has several such segments.
    let iterations = knots.count.saturating_mul(8).saturating_add(1024);
    if desc.options.segments.integrator == Integrator::Exact && iterations > ALWAYS {
        let limit = scene.gpu().loop_limit()?;
        if iterations > limit {
            return Err(Error::unsupported(
                format!("{} integrator=exact", desc.name),
                format!(
                    "{iterations} loop iterations for this transfer function, the limit is {limit}; integral works"
                ),
            ));
        }
    }
    let transfer = &scene.scene().transfer;
    let [low, high] = transfer.domain();
    Ok(MeshPush {
        knots: knots.count,
        opaque: f32_of(desc.options.stop / scene.max_colour()),
        smoke: f32_of(desc.options.smoke),
        alike: f32_of((high - low) * ALIKE),
        last_round: 0,
        ..MeshPush::default()
    })
}
