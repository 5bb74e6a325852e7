//! Arguments of `info`, and the order of its output.

use std::path::PathBuf;
use std::time::Instant;

use serde_json::{Map, Value, json};
use volraster::io::Data;
use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::{Error, Result, io};

use super::facts::Facts;
use super::scene::{camera_json, camera_text, knots_text, rows};
use crate::cli::input::{ArraysArgs, Input};
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
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// An error in the file.
    pub(crate) fn run(&self) -> Outcome {
        let facts = self.facts()?;
        if self.json {
            output::print_json(&Value::Object(facts.json))?;
        } else {
            output::print(&facts.text(&self.file))?;
        }
        Ok(())
    }

    fn facts(&self) -> Result<Facts> {
        let start = Instant::now();
        let reading = output::Reading::new(&self.file);
        let options = reading.with_progress(self.arrays.options());
        let scene = |loaded: LoadedScene| self.of_scene(&Input::new(&self.file, loaded, None, start)?);
        if SceneFile::is_at(&self.file, &options) {
            let loaded = LoadedScene::load_any(&self.file, &options)?;
            drop(reading);
            return scene(loaded);
        }
        let loaded = io::read(&self.file, &options)?;
        drop(reading);
        scene(LoadedScene::from_loaded(&self.file, loaded)?)
    }

    fn of_scene(&self, input: &Input) -> Result<Facts> {
        let Input { scene, settings } = input;
        let mut facts = Facts::new(&self.file, scene.data.kind(), &settings.data, &settings.report);
        match &scene.data {
            Data::Grid(grid) => facts.of_grid(grid, &settings.report),
            Data::Mesh(mesh) => facts.of_mesh(mesh, &settings.report),
            Data::Points(points) => facts.of_points(points, &settings.report),
            other => {
                return Err(Error::Invalid {
                    what: "data".into(),
                    why: format!("{}: unknown", other.kind()),
                });
            }
        }
        if let Some(kernels) = &scene.kernels {
            facts.kernels(kernels, matches!(scene.data, Data::Grid(_)));
        }
        facts.remarks(&settings.report);

        let extent @ [width, height] = settings.view.extent();
        let camera = settings.view.camera();
        facts.put("camera", camera_json(camera, settings.camera_is_automatic));
        facts.line("camera", camera_text(camera, settings.camera_is_automatic));
        facts.put("transfer", json!(rows(&scene.transfer)));
        facts.put("image", json!(extent));
        facts.line("image", format!("{width} x {height}"));
        facts.put("background", json!(settings.background));
        facts.surfaces(&scene.surfaces);
        facts.clip(settings.view.clip());
        if let Some(choice) = &settings.choice {
            let mut technique = Map::from_iter([("name".to_string(), json!(choice.name))]);
            technique.extend(choice.options.iter().map(|(key, value)| (key.clone(), json!(value))));
            facts.put("technique", Value::Object(technique));
            let options: Vec<String> =
                choice.options.iter().map(|(key, value)| format!("{key}={value}")).collect();
            facts.line("technique", format!("{} {}", choice.name, options.join(",")).trim_end().to_string());
        }
        facts.tail = knots_text(&scene.transfer);
        Ok(facts)
    }
}
