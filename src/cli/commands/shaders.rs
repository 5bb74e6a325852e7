//! `volraster shaders`: prints the statistics that a driver's compiler gives of the shaders of every technique.

use std::collections::BTreeSet;

use serde_json::{Value, json};
use volraster::glam::DVec3;
use volraster::gpu::{GpuOptions, ShaderStatistics};
use volraster::scene::{Camera, Field, Projection, Scene, SplatRule, TransferFunction, View};
use volraster::technique::Renderer;
use volraster::{Error, Gpu, GpuScene, Result, TargetDesc};

use crate::cli::input::{self, DeviceArgs};
use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `shaders`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print JSON, with all that the driver tells.
    #[arg(long)]
    json: bool,
    /// Print these columns, by the driver's names for its statistics [default: all].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    columns: Vec<String>,
    /// Compile for another device, selected by part of its name, which draws nothing: it may be one without hardware.
    #[arg(long, value_name = "NAME")]
    compile_on: Option<String>,
    #[command(flatten)]
    device: DeviceArgs,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self) -> Outcome {
        let options = GpuOptions { no_pipeline_cache: true, ..self.device.options() };
        let Some(name) = &self.compile_on else {
            let gpu = Gpu::new(&GpuOptions { shader_statistics: true, ..options })?;
            prepare(&gpu)?;
            return Ok(self.print(&gpu.shader_statistics()?)?);
        };
        let drawing = Gpu::new(&options)?;
        let compiling = Gpu::new(&GpuOptions {
            shader_statistics: true,
            device: Some(name.clone()),
            no_pipeline_cache: true,
            ..GpuOptions::default()
        })?;
        prepare(&drawing)?;
        compiling.compile_pipelines_of(&drawing)?;
        let statistics = compiling.shader_statistics();
        // A driver without hardware may crash when its device is destroyed.
        std::mem::forget(compiling);
        Ok(self.print(&statistics?)?)
    }

    fn print(&self, statistics: &[ShaderStatistics]) -> Result<()> {
        if self.json {
            return output::print(&format!("{:#}", statistics.iter().map(json_of).collect::<Value>()));
        }
        let names: BTreeSet<&String> =
            statistics.iter().flat_map(|shader| shader.values.iter().map(|(name, _)| name)).collect();
        if let Some(unknown) = self.columns.iter().find(|column| !names.contains(column)) {
            let known = names.into_iter().cloned().collect::<Vec<_>>().join(", ");
            let (what, why) = ("--columns".to_string(), format!("{unknown}: the driver has {known}"));
            return Err(Error::Invalid { what, why });
        }
        let columns =
            if self.columns.is_empty() { names.into_iter().collect() } else { self.columns.iter().collect() };
        output::print(&table(statistics, &columns))
    }
}

/// Prepares a frame of every technique by every route that the device offers, of a small scene.
fn prepare(gpu: &Gpu) -> Result<()> {
    let transfer = || TransferFunction::from_rows(&[[0.0, 0.2, 0.4, 0.9, 0.0], [1.0, 0.9, 0.5, 0.1, 4.0]]);
    let scenes = [
        Scene::new(Field::Blobs.sample([12, 11, 10], "f32")?, transfer()?),
        Scene::new(Field::Blobs.tets(3)?, transfer()?),
        Scene::new(Field::Blobs.points(300)?.with_estimated_radius(), transfer()?),
        Scene::new(Field::Blobs.splats(8)?, transfer()?),
        Scene::new(Field::Blobs.splats(8)?, transfer()?).with_rule(SplatRule::Ray),
        Scene::new(Field::Blobs.splats(8)?, transfer()?).with_rule(SplatRule::Overlap),
    ];
    let projection = Projection::Perspective { fov_y_deg: 42.0 };
    let camera = Camera { eye: DVec3::new(2.0, 1.5, 3.8), target: DVec3::ZERO, up: DVec3::Y, projection };
    let view = View::new(camera, 64, 48)?;
    for scene in scenes {
        let on_gpu = GpuScene::new(gpu, scene);
        for (method, route) in input::all_routes() {
            if !method.draws_scene(on_gpu.scene()) {
                continue;
            }
            let technique = input::by_route(method, route, &[], &[])?;
            match Renderer::new(&on_gpu, technique).prepare(&view, &TargetDesc::own()) {
                Ok(_) | Err(Error::Unsupported { .. }) => {}
                Err(error) => return Err(error),
            }
        }
    }
    Ok(())
}

fn json_of(shader: &ShaderStatistics) -> Value {
    let values: serde_json::Map<String, Value> =
        shader.values.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
    json!({
        "pipeline": shader.pipeline,
        "shader": shader.shader,
        "subgroup_size": shader.subgroup_size,
        "statistics": values,
    })
}

/// Returns a table in Markdown, a line for each shader.
fn table(statistics: &[ShaderStatistics], columns: &Vec<&String>) -> String {
    let line = |cells: Vec<String>| format!("| {} |", cells.join(" | "));
    let text = |cells: &[&str]| cells.iter().map(ToString::to_string).collect::<Vec<_>>();
    let mut heading = text(&["pipeline", "shader", "subgroup"]);
    heading.extend(columns.iter().map(|name| name.to_lowercase()));
    let rule =
        heading.iter().enumerate().map(|(i, _)| if i < 2 { "---" } else { "---:" }.to_string()).collect();
    let row = |shader: &ShaderStatistics| {
        let value = |name: &&String| {
            let found = shader.values.iter().find(|(other, _)| other == *name);
            found.map_or_else(String::new, |(_, value)| value.to_string())
        };
        let names = [shader.pipeline.clone(), shader.shader.clone(), shader.subgroup_size.to_string()];
        line(names.into_iter().chain(columns.iter().map(value)).collect())
    };
    [line(heading), line(rule)].into_iter().chain(statistics.iter().map(row)).collect::<Vec<_>>().join("\n")
}
