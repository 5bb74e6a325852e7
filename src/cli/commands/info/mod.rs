//! `volraster info`: describes a file as text or JSON.
//!
//! `facts` collects what is reported; `data`, `gaussians` and `scene` add to it.

mod data;
mod facts;
mod gaussians;
mod scene;

use std::path::PathBuf;

use serde_json::{Map, Value, json};
use volraster::io::Data;
use volraster::{Error, Result};

use self::facts::Facts;
use crate::cli::input::{ArraysArgs, Input, LookArgs, scene_file};
use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `info`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A data file, a folder of slices, or a scene file (.json).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Print a scene file that draws what the data file draws by itself, to be edited.
    #[arg(long, conflicts_with = "json")]
    scene: bool,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self) -> Outcome {
        let input = self.look.apply(Input::load(&self.file, None, &self.arrays, true)?)?;
        if self.scene {
            let scene = scene_file(&self.file, &self.arrays, &input.scene, &input.settings)?;
            return Ok(output::print(&format!("{scene:#}"))?);
        }
        let facts = self.facts(input)?;
        let text =
            if self.json { format!("{:#}", Value::Object(facts.json)) } else { facts.text(&self.file) };
        Ok(output::print(&text)?)
    }

    fn facts(&self, Input { scene, settings }: Input) -> Result<Facts> {
        let mut facts = Facts::new(&self.file, scene.data.kind(), &settings.data, &settings.report);
        match &scene.data {
            Data::Grid(grid) => facts.of_grid(grid, &settings.report),
            Data::Mesh(mesh) => facts.of_mesh(mesh, &settings.report),
            Data::Points(points) => facts.of_points(points, &settings.report),
            Data::Gaussians(splats) => facts.of_gaussians(&scene, splats, &settings.report)?,
            other => {
                let why = format!("{}: unknown", other.kind());
                return Err(Error::Invalid { what: "data".into(), why });
            }
        }
        if let Some(kernels) = &scene.kernels {
            facts.kernels(kernels, matches!(scene.data, Data::Grid(_)));
        }
        facts.remarks(&settings.report);
        facts.camera(settings.view.camera(), settings.camera_is_automatic);
        if scene.gaussians().is_none() {
            facts.transfer(&scene.transfer, settings.transfer_is_automatic);
        }
        facts.mode(scene.mode);
        let extent @ [width, height] = settings.view.extent();
        facts.put(json!({"image": extent, "background": settings.background}));
        facts.line("image", format!("{width} x {height}"));
        facts.surfaces(&scene.surfaces);
        facts.clip(settings.view.clip());
        if let Some(choice) = &settings.choice {
            let mut technique = Map::from_iter([("name".to_string(), json!(choice.name))]);
            technique.extend(choice.options.iter().map(|(key, value)| (key.clone(), json!(value))));
            facts.put(json!({"technique": technique}));
            let options: Vec<String> =
                choice.options.iter().map(|(key, value)| format!("{key}={value}")).collect();
            facts.line("technique", format!("{} {}", choice.name, options.join(",")).trim_end().to_string());
        }
        Ok(facts)
    }
}
