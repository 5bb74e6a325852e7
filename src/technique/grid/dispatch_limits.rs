//! Limits the slabs of one fragment or dispatch, by the loop limit of the device and by time.

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::shader::BRICK;
use crate::resident::tables::{Integrator, Knots, SegmentOptions};
use crate::scene::Grid;

/// Loop iterations that every device completes; only loops beyond this need the probe of the device's limit.
const ALWAYS: u32 = 32_768;

/// Invocations that some devices run in lockstep, and whose loop iterations they count together.
const LANES: u32 = 8;

/// Loop iterations of a march.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Loops {
    /// Those of a slab.
    each: u32,
    /// Those of the quadrature in opaque matter, once per ray.
    once: u32,
    exact: bool,
}

impl Loops {
    /// Counts them for a transfer function, an integrator and a lit scene.
    pub(crate) fn new(knots: &Knots, segments: Option<&SegmentOptions>, lit: bool) -> Self {
        // The slab itself, its classification, and one step through bricks per slab; for the light the branch, and the ends' extinctions.
        let each = 3 + knots.iterations + if lit { 1 + 2 * knots.iterations } else { 0 };
        if !segments.is_some_and(|segments| segments.integrator == Integrator::Exact) {
            return Self { each, once: 0, exact: false };
        }
        // A segment may span every knot; each piece between knots has one panel of four nodes. Opaque matter ends a ray after a few panels.
        let pieces = if knots.walk > 0 { knots.walk } else { knots.count };
        let each = each.saturating_add(pieces.saturating_mul(5));
        Self { each, once: LANES * 5 * 64, exact: true }
    }
}

fn too_many_loops(name: &str, each: u32, limit: u32) -> Error {
    Error::unsupported(
        format!("{name} integrator=exact"),
        format!("{each} loop iterations for this transfer function, the limit is {limit}; integral works"),
    )
}

/// Checks that one fragment can integrate a slab, which cannot be split.
pub(crate) fn check_loops(gpu: &Gpu, name: &str, loops: &Loops) -> Result<()> {
    let all = loops.each.saturating_add(loops.once);
    if all <= ALWAYS {
        return Ok(());
    }
    let limit = gpu.loop_limit()?;
    if all > limit { Err(too_many_loops(name, loops.each, limit)) } else { Ok(()) }
}

/// Returns the slabs that one dispatch of `rays` rays may walk. No invocation exceeds the device's loop limit, and no dispatch runs for
/// so long that a watchdog ends it.
pub(crate) fn slabs_per_dispatch(
    gpu: &Gpu,
    name: &str,
    slabs: u32,
    loops: &Loops,
    grid: &Grid,
    rays: u64,
) -> Result<u32> {
    /// Samples of one dispatch: 0.2 s at 5e9 samples per second.
    const SAMPLES: u64 = 1 << 30;
    let Loops { each, once: panels, exact } = *loops;
    // Bricks along a ray.
    let bricks: u32 = grid.dims().iter().map(|side| side.div_ceil(BRICK)).sum();
    let once = (LANES * (bricks + 2)).saturating_add(panels);
    let few = slabs.saturating_mul(each).saturating_add(once) <= ALWAYS && gpu.loop_limit_is_unknown();
    let limit = if few { ALWAYS } else { gpu.loop_limit()? };
    // Each dispatch walks through the bricks anew; at least half of the limit is left for slabs.
    let iterations = limit.saturating_sub(once).max(limit / 2);
    if each > iterations && exact {
        return Err(too_many_loops(name, each, limit));
    }
    let by_time = u32::try_from(SAMPLES / rays.max(1)).unwrap_or(u32::MAX);
    Ok((iterations / each).min(by_time).max(1))
}
