//! `volraster devices`: lists the Vulkan devices, and describes the selected one.

use std::fmt::Write as _;

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

/// Limits and features of the selected device.
struct Offer {
    name: String,
    software: bool,
    memory_budget: u64,
    max_image_3d: u32,
    /// Loop iterations that one shader invocation completes; `None` if the driver ends no loop early.
    loop_limit: Option<u32>,
    filters_in_8_bit: bool,
    features: Vec<(String, bool, &'static str)>,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// [`volraster::Error::NoDevice`] when no device is usable, after the list has been printed.
    pub(crate) fn run(&self) -> Outcome {
        let reports = gpu::devices(self.device.device.as_deref())?;
        let offer = if reports.iter().any(|report| report.chosen) {
            Some(Offer::of(&self.device.open(false)?.0)?)
        } else {
            None
        };
        if self.json {
            let mut json = json!({"devices": reports});
            if let Some(offer) = &offer {
                json["chosen"] = offer.json();
            }
            output::print_json(&json)?;
        } else {
            output::print(&text(&reports, offer.as_ref()))?;
        }
        if offer.is_none() {
            // Returns the same error as every other command, with the reason for each device.
            self.device.open(false)?;
        }
        Ok(())
    }
}

impl Offer {
    fn of(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            name: gpu.report().name.clone(),
            software: gpu.is_software(),
            memory_budget: gpu.memory_budget(),
            max_image_3d: gpu.max_image_3d(),
            loop_limit: Some(gpu.loop_limit()?).filter(|&limit| limit != u32::MAX),
            filters_in_8_bit: gpu.filters_in_8_bit()?,
            features: OptionalFeature::ALL
                .iter()
                .map(|&feature| (feature.name().to_string(), gpu.has(feature), feature.fallback()))
                .collect(),
        })
    }

    fn json(&self) -> Value {
        let feature = |(name, available, fallback): &(String, bool, &'static str)| json!({"name": name, "available": available, "fallback": fallback});
        json!({
            "name": self.name,
            "software": self.software,
            "memory_budget": self.memory_budget,
            "max_image_3d": self.max_image_3d,
            "loop_limit": self.loop_limit,
            "filters_in_8_bit": self.filters_in_8_bit,
            "features": self.features.iter().map(feature).collect::<Value>(),
        })
    }
}

fn text(reports: &[DeviceReport], offer: Option<&Offer>) -> String {
    let mut rows = vec![["", "device", "kind", "driver", "Vulkan", "why"].map(str::to_string).to_vec()];
    for report in reports {
        let mark = if report.chosen { "*" } else { "" };
        rows.push(
            [mark, &report.name, report.kind, &report.driver, &report.api, &report.reason]
                .map(str::to_string)
                .to_vec(),
        );
    }
    let mut text = table::aligned(&rows, &[0, 1, 2, 3, 4, 5]);
    let Some(offer) = offer else { return text };
    let limit = offer.loop_limit.map_or_else(|| "none found".to_string(), |limit| limit.to_string());
    let filter =
        if offer.filters_in_8_bit { "in 8-bit fixed point: they are widened" } else { "finer than 8 bits" };
    let mut rows = vec![
        [
            "memory budget".to_string(),
            format!("{:.1} GiB", offer.memory_budget as f64 / (1_u64 << 30) as f64),
        ]
        .to_vec(),
        ["largest 3D image".to_string(), format!("{0} x {0} x {0}", offer.max_image_3d)].to_vec(),
        ["loop limit".to_string(), limit].to_vec(),
        ["8-bit volumes filter".to_string(), filter.to_string()].to_vec(),
    ];
    for (name, available, fallback) in &offer.features {
        let verdict = if *available { "yes".to_string() } else { format!("no: {fallback}") };
        rows.push([name.clone(), verdict].to_vec());
    }
    // Writing into a string cannot fail.
    let _ = write!(text, "\n\n{}:\n{}", offer.name, table::aligned(&rows, &[0, 1]));
    text
}
