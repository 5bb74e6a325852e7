//! Emulated devices with lower limits: loop iterations, bytes of a storage buffer, size of an allocation, memory
//! budget.

use volraster::gpu::GpuOptions;
use volraster::measure::ImageErrors;
use volraster::{Error, Image, Result};

use super::workbench::{Stop, Trial, Verdict, Workbench, fail};

/// Largest difference of images when work is split differently: rounding.
const ROUNDING: f64 = 1e-5;

/// Draws the image on a new device with options.
fn limited(workbench: &Workbench, spec: &str, options: GpuOptions) -> Result<Image> {
    Trial::on(workbench.open(options)?, spec)?.image()
}

fn near(what: &str, image: &Image, expected: &Image) -> std::result::Result<(), Stop> {
    let errors = ImageErrors::between(image, expected)?;
    if errors.non_finite == 0 && errors.all.max_abs <= ROUNDING {
        return Ok(());
    }
    fail(format!("{what}: {:.1e} from the image without the limit", errors.all.max_abs))
}

/// Checks that marches resume where the loop limit stopped an invocation.
pub(super) fn loops(workbench: &Workbench, spec: &str) -> Verdict {
    let expected = Trial::new(workbench, spec)?.image()?;
    let options = GpuOptions { loop_limit: Some(1500), ..GpuOptions::default() };
    near("1500 loop iterations", &limited(workbench, spec, options)?, &expected)?;
    Ok("1500 loop iterations".to_string())
}

/// Tries limits in ascending order. Each must refuse with the right error or draw the same image; at least
/// `least_refused` must refuse, and the last must draw.
fn tighten(
    workbench: &Workbench,
    spec: &str,
    limits: &[u64],
    least_refused: u32,
    options: impl Fn(u64) -> GpuOptions,
    is_refusal: impl Fn(&Error) -> bool,
) -> Verdict {
    let expected = Trial::new(workbench, spec)?.image()?;
    let mut least = None;
    let mut refused = 0;
    for (i, &limit) in limits.iter().enumerate() {
        match limited(workbench, spec, options(limit)) {
            Ok(image) => {
                near(&format!("{limit} bytes"), &image, &expected)?;
                least = least.or(Some(limit));
            }
            Err(error) if is_refusal(&error) && i + 1 < limits.len() => refused += 1,
            Err(error) => return fail(format!("{limit} bytes: {error}")),
        }
        // Higher limits would repeat the same case.
        if least.is_some() && i > 2 {
            break;
        }
    }
    if refused < least_refused {
        return fail(format!("{} bytes are not refused", limits[0]));
    }
    let least = least.map_or_else(|| "none".to_string(), |bytes| bytes.to_string());
    Ok(format!("{refused} refused, drawn with {least} bytes"))
}

/// Limits the bytes of a storage buffer that a shader sees.
pub(super) fn storage(workbench: &Workbench, spec: &str) -> Verdict {
    // The resolution of the intermediate image of shear-warp depends on this limit; with less, the image differs.
    let fits = |&limit: &u64| limit >= 1 << 20 || !spec.starts_with("shear-warp");
    let limits: Vec<u64> = [1 << 10, 1 << 13, 1 << 16, 1 << 20, 1 << 24].into_iter().filter(fits).collect();
    tighten(
        workbench,
        spec,
        &limits,
        0,
        |limit| GpuOptions { storage_range: u32::try_from(limit).ok(), ..GpuOptions::default() },
        |error| matches!(error, Error::Unsupported { .. }),
    )
}

/// Limits the size of an allocation.
pub(super) fn allocation(workbench: &Workbench, spec: &str) -> Verdict {
    tighten(
        workbench,
        spec,
        &[1 << 8, 1 << 12, 1 << 16, 1 << 20, 1 << 27],
        1,
        |limit| GpuOptions { allocation_size: Some(limit), ..GpuOptions::default() },
        |error| matches!(error, Error::Unsupported { .. }),
    )
}

/// Limits the memory budget: requests above it must be refused before the driver is called.
pub(super) fn budget(workbench: &Workbench, spec: &str) -> Verdict {
    let mut limits: Vec<u64> = (10..=28).step_by(2).map(|bits| 1 << bits).collect();
    limits.extend([5 << 12, 9 << 13, 11 << 14]);
    limits.sort_unstable();
    tighten(
        workbench,
        spec,
        &limits,
        1,
        |limit| GpuOptions { memory_budget: Some(limit), ..GpuOptions::default() },
        |error| matches!(error, Error::Memory { .. }),
    )
}
