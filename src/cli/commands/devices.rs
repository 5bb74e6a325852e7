//! `volraster devices`: lists the Vulkan devices, and describes the selected one.

use serde_json::{Value, json};
use volraster::gpu::{DeviceReport, OptionalFeature};
use volraster::{Gpu, Result, gpu};

use crate::cli::input::DeviceArgs;
use crate::cli::outcome::Outcome;
use crate::cli::{output, table};

/// Arguments of `devices`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

impl Args {
    /// Runs the command. Without a usable device it fails after the list has been printed.
    pub(crate) fn run(&self) -> Outcome {
        let reports = gpu::devices(self.device.device.as_deref())?;
        let is_usable = reports.iter().any(|report| report.chosen);
        let chosen = if is_usable { Some(self.device.open(false)?.0) } else { None };
        if self.json {
            let mut json = json!({"devices": reports});
            if let Some(gpu) = &chosen {
                json["chosen"] = chosen_json(gpu)?;
            }
            output::print(&format!("{json:#}"))?;
        } else {
            let chosen = chosen.as_ref().map(chosen_text).transpose()?;
            output::print(&(devices_text(&reports) + &chosen.unwrap_or_default()))?;
        }
        if !is_usable {
            // Returns the same error as every other command, with the reason for each device.
            self.device.open(false)?;
        }
        Ok(())
    }
}

/// Returns the loop iterations that one shader invocation completes; `None` if the driver ends no loop early.
fn loop_limit(gpu: &Gpu) -> Result<Option<u32>> {
    Ok(Some(gpu.loop_limit()?).filter(|&limit| limit != u32::MAX))
}

fn chosen_json(gpu: &Gpu) -> Result<Value> {
    let feature = |&feature: &OptionalFeature| json!({"name": feature.name(), "available": gpu.has(feature), "fallback": feature.fallback()});
    Ok(json!({
        "name": gpu.report().name,
        "software": gpu.is_software(),
        "memory_budget": gpu.memory_budget(),
        "max_image_3d": gpu.max_image_3d(),
        "loop_limit": loop_limit(gpu)?,
        "filters_in_8_bit": gpu.filters_in_8_bit()?,
        "filter_error": gpu.filter_error()?,
        "features": OptionalFeature::ALL.iter().map(feature).collect::<Value>(),
    }))
}

fn devices_text(reports: &[DeviceReport]) -> String {
    let mut rows = vec![["", "device", "kind", "driver", "Vulkan", "why"].map(str::to_string)];
    for report in reports {
        let mark = if report.chosen { "*" } else { "" };
        let row = [mark, &report.name, report.kind, &report.driver, &report.api, &report.reason];
        rows.push(row.map(str::to_string));
    }
    table::aligned(&rows, &[0, 1, 2, 3, 4, 5])
}

fn chosen_text(gpu: &Gpu) -> Result<String> {
    let limit = loop_limit(gpu)?.map_or_else(|| "none found".to_string(), |limit| limit.to_string());
    let coarse = gpu.filters_in_8_bit()?;
    let filter = if coarse { "in 8-bit fixed point: they are widened" } else { "finer than 8 bits" };
    let row = |name: &str, value: String| [name.to_string(), value];
    let mut rows = vec![
        row("memory budget", indicatif::BinaryBytes(gpu.memory_budget()).to_string()),
        row("largest 3D image", format!("{0} x {0} x {0}", gpu.max_image_3d())),
        row("loop limit", limit),
        row("8-bit volumes filter", filter.to_string()),
    ];
    rows.extend(OptionalFeature::ALL.iter().map(|&feature| {
        let fallback = || format!("no: {}", feature.fallback());
        row(feature.name(), if gpu.has(feature) { "yes".to_string() } else { fallback() })
    }));
    Ok(format!("\n\n{}:\n{}", gpu.report().name, table::aligned(&rows, &[0, 1])))
}
