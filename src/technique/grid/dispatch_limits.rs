//! How many slabs one fragment or one dispatch may take, by the loop limit of the device and by time.

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::shader::BRICK;
use crate::resident::tables::{Integrator, Knots, SegmentOptions};
use crate::scene::Grid;

/// Every device manages this many loop iterations; the probe runs only where the answer counts.
const ALWAYS: u32 = 32_768;

/// Invocations that some devices run in step, and whose loops they count together.
const LANES: u32 = 8;

/// Loop iterations of a slab, and of the quadrature where matter is opaque.
fn loops(knots: &Knots, segments: Option<&SegmentOptions>) -> (u32, u32) {
    // One for the slab, those of the classification, and of the way through bricks as many as there are slabs.
    let each = 3 + knots.iterations;
    if !segments.is_some_and(|segments| segments.integrator == Integrator::Exact) {
        return (each, 0);
    }
    // Every piece has a panel of four nodes; opaque matter leaves few panels. A segment may span every knot.
    let pieces = if knots.walk > 0 { knots.walk } else { knots.count };
    (each.saturating_add(pieces.saturating_mul(5)), LANES * 5 * 64)
}

fn too_many_loops(name: &str, each: u32, limit: u32) -> Error {
    Error::unsupported(
        format!("{name} integrator=exact"),
        format!("{each} loop iterations for this transfer function, the limit is {limit}; integral works"),
    )
}

/// A fragment takes one slab, and cannot be split.
pub(crate) fn check_loops(
    gpu: &Gpu,
    name: &str,
    knots: &Knots,
    segments: Option<&SegmentOptions>,
) -> Result<()> {
    let (each, once) = loops(knots, segments);
    let all = each.saturating_add(once);
    if all <= ALWAYS {
        return Ok(());
    }
    let limit = gpu.loop_limit()?;
    if all > limit { Err(too_many_loops(name, each, limit)) } else { Ok(()) }
}

/// Slabs that one dispatch may walk. No invocation may make more loop iterations than the device allows, and no
/// dispatch may hold up the device for so long that a watchdog ends it.
pub(crate) fn slabs_per_dispatch(
    gpu: &Gpu,
    name: &str,
    slabs: u32,
    knots: &Knots,
    segments: Option<&SegmentOptions>,
    grid: &Grid,
    rays: u64,
) -> Result<u32> {
    /// Samples of one dispatch: a fifth of a second where 5e9 are taken in one.
    const SAMPLES: u64 = 1 << 30;
    let (each, panels) = loops(knots, segments);
    // Bricks along a ray.
    let bricks: u32 = grid.dims().iter().map(|side| side.div_ceil(BRICK)).sum();
    let once = (LANES * (bricks + 2)).saturating_add(panels);
    let few = slabs.saturating_mul(each).saturating_add(once) <= ALWAYS && gpu.loop_limit_is_unknown();
    let limit = if few { ALWAYS } else { gpu.loop_limit()? };
    // Splits cost the way through the bricks anew, so the limit is not eaten up by it.
    let iterations = limit.saturating_sub(once).max(limit / 2);
    if each > iterations && segments.is_some_and(|segments| segments.integrator == Integrator::Exact) {
        return Err(too_many_loops(name, each, limit));
    }
    let by_time = u32::try_from(SAMPLES / rays.max(1)).unwrap_or(u32::MAX);
    Ok((iterations / each).min(by_time).max(1))
}
