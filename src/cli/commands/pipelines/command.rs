//! `volraster pipelines`: builds the pipelines of every technique, and prints entries, constants, build times and the driver's statistics
//! of each.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use volraster::gpu::{GpuOptions, PipelineCache, PipelineReport};
use volraster::{Error, Gpu, Result};

use super::variants::prepare;
use crate::cli::input::DeviceArgs;
use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `pipelines`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Build only what the default options of each technique and route ask for, not every variant.
    #[arg(long)]
    defaults: bool,
    /// Print JSON, with all that the driver tells.
    #[arg(long)]
    json: bool,
    /// Print these columns: entry, constants, ms, or the driver's names for its statistics [default: all].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    columns: Vec<String>,
    /// Write the SPIR-V of each pipeline's shaders into a folder, with constants applied.
    #[arg(long, value_name = "DIR")]
    spirv: Option<PathBuf>,
    /// Build on another device, selected by part of its name, which draws nothing: it may be one without hardware.
    #[arg(long, value_name = "NAME")]
    compile_on: Option<String>,
    #[command(flatten)]
    device: DeviceArgs,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An unknown column, a missing device, or output that cannot be written.
    pub(crate) fn run(&self) -> Outcome {
        if let Some(folder) = &self.spirv {
            output::check_folder(folder)?;
        }
        let options = GpuOptions { pipeline_cache: PipelineCache::Off, ..self.device.options() };
        let Some(name) = &self.compile_on else {
            let gpu = with_statistics(&options)?;
            prepare(&gpu, !self.defaults)?;
            return Ok(self.print(&gpu.pipeline_reports()?)?);
        };
        let drawing = Gpu::new(&options)?;
        let device = Some(name.clone());
        let compiling = with_statistics(&GpuOptions {
            device,
            pipeline_cache: PipelineCache::Off,
            ..GpuOptions::default()
        })?;
        prepare(&drawing, !self.defaults)?;
        compiling.compile_pipelines_of(&drawing)?;
        let reports = compiling.pipeline_reports();
        // A driver without hardware may crash when its device is destroyed.
        std::mem::forget(compiling);
        Ok(self.print(&reports?)?)
    }

    fn print(&self, reports: &[PipelineReport]) -> Result<()> {
        let files = self.spirv.as_deref().map(|folder| write_modules(folder, reports)).transpose()?;
        if self.json {
            let files = |i: usize| files.as_ref().map(|files| &files[i]);
            let all = reports.iter().enumerate().map(|(i, report)| json_of(report, files(i)));
            return output::print(&format!("{:#}", all.collect::<Value>()));
        }
        let told = reports.iter().flat_map(|report| &report.shaders).flat_map(|shader| &shader.values);
        let names: BTreeSet<&str> = told.map(|(name, _)| name.as_str()).collect();
        let names: Vec<&str> = OWN.into_iter().chain(names).collect();
        if let Some(unknown) = self.columns.iter().find(|column| !names.contains(&column.as_str())) {
            let (what, why) =
                ("--columns".to_string(), format!("{unknown}: the columns are {}", names.join(", ")));
            return Err(Error::Invalid { what, why });
        }
        let columns =
            if self.columns.is_empty() { names } else { self.columns.iter().map(String::as_str).collect() };
        output::print(&table(reports, &columns))
    }
}

/// Columns that do not come from the driver.
const OWN: [&str; 3] = ["entry", "constants", "ms"];

/// Opens a device that keeps statistics where it can.
fn with_statistics(options: &GpuOptions) -> Result<Gpu> {
    match Gpu::new(&GpuOptions { shader_statistics: true, ..options.clone() }) {
        Err(Error::Unsupported { .. }) => Gpu::new(options),
        opened => opened,
    }
}

/// Writes the modules, named after entry and content, and returns the files of each pipeline.
fn write_modules(folder: &Path, reports: &[PipelineReport]) -> Result<Vec<Vec<String>>> {
    output::make_folder(folder)?;
    let write = |(entry, words): (&&str, Vec<u32>)| {
        let bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
        let name = format!("{entry}-{}.spv", output::digest(&bytes));
        let path = folder.join(&name);
        std::fs::write(&path, bytes).map_err(output::unwritable(&path))?;
        Ok(name)
    };
    reports.iter().map(|report| report.entries.iter().zip(report.modules()).map(write).collect()).collect()
}

fn json_of(report: &PipelineReport, files: Option<&Vec<String>>) -> Value {
    let constants: Map<String, Value> =
        report.constants.iter().map(|(name, value)| ((*name).to_string(), json!(value))).collect();
    let shaders = report.shaders.iter().map(|shader| {
        let values: Map<String, Value> =
            shader.values.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
        json!({ "shader": shader.shader, "subgroup_size": shader.subgroup_size, "statistics": values })
    });
    output::without_nulls(json!({
        "pipeline": report.name,
        "entries": report.entries,
        "constants": constants,
        "target": report.target,
        "build_ms": report.build_ms,
        "shaders": shaders.collect::<Value>(),
        "spirv": files,
    }))
}

/// Returns a table in Markdown: a line for each shader of which the driver tells, or for each pipeline.
fn table(reports: &[PipelineReport], columns: &[&str]) -> String {
    let line = |cells: Vec<String>| format!("| {} |", cells.join(" | "));
    let told = reports.iter().any(|report| !report.shaders.is_empty());
    let mut heading = vec!["pipeline".to_string()];
    heading.extend(told.then_some(["shader", "subgroup"]).into_iter().flatten().map(str::to_string));
    heading.extend(columns.iter().map(|name| name.to_lowercase()));
    let is_text = |name: &String| ["pipeline", "shader", "entry", "constants"].contains(&name.as_str());
    let rule = heading.iter().map(|name| if is_text(name) { "---" } else { "---:" }.to_string()).collect();
    let mut lines = vec![line(heading), line(rule)];
    for report in reports {
        let own = |name: &str| match name {
            "entry" => Some(report.entries.join(", ")),
            "constants" => {
                let texts = report.constants.iter().map(|(name, value)| format!("{name}={value}"));
                Some(texts.collect::<Vec<_>>().join(" "))
            }
            "ms" => Some(format!("{:.1}", report.build_ms)),
            _ => None,
        };
        let shaders = report.shaders.iter().map(Some).chain(report.shaders.is_empty().then_some(None));
        for shader in shaders {
            let cell = |name: &&str| {
                let found = shader.and_then(|shader| shader.values.iter().find(|(other, _)| other == name));
                own(name).or_else(|| found.map(|(_, value)| value.to_string())).unwrap_or_default()
            };
            let mut cells = vec![report.name.clone()];
            if told {
                let names = shader.map(|shader| [shader.shader.clone(), shader.subgroup_size.to_string()]);
                cells.extend(names.unwrap_or_default());
            }
            lines.push(line(cells.into_iter().chain(columns.iter().map(cell)).collect()));
        }
    }
    lines.join("\n")
}
