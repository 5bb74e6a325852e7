//! `volraster compare`: draws a scene with several techniques and reports their errors and times.
//!
//! Images come first, then the ground truth, then files and the report. `entry` draws one technique, `truth` holds what it is compared
//! with, `page` writes report.html with the sections `error_table` and `pass_bars`.

mod entry;
mod error_table;
mod page;
mod pass_bars;
mod row;
mod truth;

use std::path::{Path, PathBuf};

use serde_json::Value;
use volraster::Result;
use volraster::io::{ReadOptions, read_exr};
use volraster::reference::ReferenceImage;
use volraster::scene::{Data, Scene, SplatRule, View};

use self::entry::{Entry, FRAMES, draw};
use self::page::Page;
use self::row::{HEADING, Row};
use self::truth::{Truth, distances};
use crate::cli::cache::{Cache, Origin};
use crate::cli::input::{self, ArraysArgs, DeviceArgs, Input, LookArgs, Size, Wanted};
use crate::cli::outcome::{Outcome, check_validation};
use crate::cli::{output, table};

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A scene file (.json) or a data file.
    #[arg(value_name = "SCENE|DATA")]
    scene: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Folder for images, heat maps, errors.json and report.html, which contains all of it in one file.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Techniques with options, separated by `;` or `,`; may be repeated. `all`: every technique that draws the
    /// scene's data, by every route of the device. The scene's own technique, named without options, keeps those of the
    /// scene file.
    #[arg(long, value_name = "all|NAME[:key=value,...];...", default_value = "all")]
    techniques: Vec<String>,
    /// Ground truth: the float64 reference, or an OpenEXR file.
    #[arg(long, value_name = "reference|FILE.exr", default_value = "reference")]
    against: PathBuf,
    /// Image size [default: that of the scene].
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    /// Draw the reference image anew, and cache none.
    #[arg(long)]
    no_cache: bool,
    #[command(flatten)]
    device: DeviceArgs,
    /// Enable core and synchronization validation; any message makes the exit code 1.
    #[arg(long)]
    validate: bool,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        output::check_folder(&self.output)?;
        let lists =
            self.techniques.iter().map(|list| Wanted::parse_list(list)).collect::<Result<Vec<_>>>()?;
        let wanted = lists.concat();
        let given = self.given_truth()?;
        let input = Input::load(&self.scene, self.size, &self.arrays, quiet)?;
        let Input { scene, settings } = self.look.apply(input)?;
        let [width, height] = settings.view.extent();
        if let Some((has_width, has_height)) = given.as_ref().map(|truth| (truth.width(), truth.height()))
            && (has_width, has_height) != (width, height)
        {
            let rule = format!("{has_width} x {has_height}: must be the image size, {width} x {height}");
            return Err(output::refuse(&self.against, "dataWindow", &rule).into());
        }
        // With `all`, an error in the scene file's technique would only skip that technique.
        settings.technique()?;
        for wanted in &wanted {
            match *wanted {
                Wanted::All => input::drawn(&scene)?,
                Wanted::One(request) => drop(settings.choose(Some(request), &scene)?),
            }
        }
        let (gpu, log) = self.device.open_with(self.validate, |options| self.arrays.limit(options))?;
        let device = gpu.report().clone();
        // Images come before the slow reference: an unsupported request fails early and leaves no file.
        let (entries, refused) = draw(&gpu, &scene, &settings, &wanted)?;
        // The destruction of the device may cause validation messages too.
        drop(gpu);
        let truths = match given {
            Some(image) => vec![Truth { rule: None, image, what: self.against.display().to_string() }],
            None => self.references(&scene, &settings.view, &entries)?,
        };
        output::make_folder(&self.output)?;
        let projection = if settings.view.is_perspective() { "perspective" } else { "orthographic" };
        let facts = vec![
            ("Scene", self.scene.display().to_string()),
            ("Data", format!("{}, {}", settings.data.display(), described(&scene.data))),
            ("View", format!("{width} × {height}, {projection}")),
            ("Ground truth", truths[0].what.clone()),
            ("Device", format!("{}, {}, Vulkan {}", device.name, device.driver, device.api)),
            ("Frames", format!("{FRAMES} timed, after one warm-up frame")),
            ("volraster", env!("CARGO_PKG_VERSION").to_string()),
        ];
        let write = |truth: &Truth| {
            truth.write(&self.output, !self.wants_reference(), scene.colours(), settings.background)
        };
        let pictures = truths.iter().map(write).collect::<Result<Vec<_>>>()?;
        let distances = distances(&self.output, &truths)?;
        let rows = self.write_entries(&entries, &truths, settings.background)?;
        let lines: Vec<_> =
            std::iter::once(HEADING.map(str::to_string)).chain(rows.iter().map(Row::line)).collect();
        let title = format!("Comparison: {}", self.scene.file_name().unwrap_or_default().to_string_lossy());
        let page = Page { title, facts, truths: pictures, distances, rows, refused };
        volraster::io::write_text(self.output.join("report.html"), &page::html(&page))?;
        if !quiet {
            output::print(&table::aligned(&lines, &[0, 1, 2]))?;
            if let Some(lines) = page.matrix() {
                output::print(&format!(
                    "\ndistances between rules, RMSE:\n{}",
                    table::aligned(&lines, &[0])
                ))?;
            }
        }
        check_validation(&log)
    }

    /// Draws the reference, or reads it from the cache; of trained splats one for each rule that is drawn. Returns each with its
    /// description in the report.
    fn references(&self, scene: &Scene, view: &View, entries: &[Entry]) -> Result<Vec<Truth>> {
        let cache = Cache::of_user(!self.no_cache);
        let mut rules: Vec<Option<SplatRule>> = Vec::new();
        // Where nothing was drawn, the scene's own.
        for rule in
            entries.iter().map(|entry| entry.rule).chain(entries.is_empty().then(|| scene.splat_rule()))
        {
            if !rules.contains(&rule) {
                rules.push(rule);
            }
        }
        let truth = |rule: Option<SplatRule>| {
            let scene = rule.map_or_else(|| scene.clone(), |rule| scene.clone().with_rule(rule));
            let (image, origin) = output::counting_rows(view, |rows| cache.image(&scene, view, Some(rows)))?;
            let what = match origin {
                Origin::Drawn => "float64 reference",
                Origin::Cached => "float64 reference (cached)",
            };
            Ok(Truth { rule, image, what: what.to_string() })
        };
        rules.into_iter().map(truth).collect()
    }

    /// Returns whether the ground truth is the float64 reference, not a given file.
    fn wants_reference(&self) -> bool {
        self.against == Path::new("reference")
    }

    /// Reads the file of `--against`, if one is given.
    fn given_truth(&self) -> Result<Option<ReferenceImage>> {
        if self.wants_reference() {
            return Ok(None);
        }
        let image = read_exr(&self.against, &ReadOptions::default())?;
        let pixels = image.pixels().iter().map(|pixel| pixel.map(f64::from)).collect();
        ReferenceImage::new(image.width(), image.height(), pixels).map(Some)
    }

    /// Writes the images of all entries and errors.json; returns the rows of the report.
    fn write_entries(&self, entries: &[Entry], truths: &[Truth], background: [f64; 4]) -> Result<Vec<Row>> {
        let truth =
            |entry: &Entry| truths.iter().find(|truth| truth.rule == entry.rule).unwrap_or(&truths[0]);
        let rows = entries.iter().map(|entry| entry.row(&self.output, &truth(entry).image, background));
        let rows = rows.collect::<Result<Vec<_>>>()?;
        let errors: Value = entries.iter().zip(&rows).map(|(entry, row)| entry.json(row)).collect();
        output::write_json(&self.output.join("errors.json"), &errors)?;
        Ok(rows)
    }
}

/// Describes kind and size of data.
fn described(data: &Data) -> String {
    match data {
        Data::Grid(grid) => {
            let [x, y, z] = grid.dims();
            format!("grid of {x} × {y} × {z} {}", grid.samples().type_name())
        }
        Data::Mesh(mesh) => {
            format!("mesh of {} tetrahedra, {} points", mesh.cells().len(), mesh.points().len())
        }
        Data::Points(points) => format!("{} points", points.centres().len()),
        Data::Gaussians(splats) => format!("{} Gaussian splats, degree {}", splats.len(), splats.degree()),
        other => other.kind().to_string(),
    }
}
