//! `volraster techniques`: lists the techniques with their routes and options.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};
use volraster::technique::{Method, Renderer};
use volraster::{GpuScene, TargetDesc};

use crate::cli::input::{ArraysArgs, DeviceArgs, Input, Request};
use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `techniques`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Print the passes of a frame of this technique, which may have options: what each reads and writes.
    #[arg(long, value_name = "TECHNIQUE", requires = "scene", conflicts_with = "json")]
    steps: Option<String>,
    /// The scene of --steps: a scene file (.json) or a data file.
    #[arg(value_name = "SCENE|DATA", requires = "steps")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    arrays: ArraysArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self) -> Outcome {
        if let (Some(technique), Some(scene)) = (&self.steps, &self.scene) {
            let request = Request::parse(technique)?;
            let Input { scene, settings } = Input::load(scene, None, &self.arrays, true)?;
            let technique = settings.choose(Some(request), &scene)?;
            let (gpu, _) = self.device.open(false)?;
            let renderer = Renderer::new(&GpuScene::new(&gpu, scene), technique);
            let plan = renderer.prepare(&settings.view, &TargetDesc::own())?;
            output::print(&plan.steps().join("\n"))?;
        } else if self.json {
            output::print(&format!("{:#}", Method::ALL.into_iter().map(json_of).collect::<Value>()))?;
        } else {
            output::print(&Method::ALL.map(text_of).join("\n\n"))?;
        }
        Ok(())
    }
}

fn json_of(method: Method) -> Value {
    json!({
        "name": method.name(),
        "summary": method.summary(),
        "source": method.source(),
        "data": method.data(),
        "routes": method.routes(),
        "options": method.options(),
    })
}

fn text_of(method: Method) -> String {
    let [routes, data] = [method.routes(), method.data()].map(|words| words.join(", "));
    let (name, summary, source) = (method.name(), method.summary(), method.source());
    let mut text = format!("{name}: {summary} ({source})\n  data: {data}\n  routes: {routes}");
    for option in method.options() {
        // Writing into a string cannot fail.
        let (key, values, default) = (option.key, &option.values, &option.default);
        let _ = write!(text, "\n  {key}={values} (default {default})\n      {}", option.effect);
    }
    text
}
