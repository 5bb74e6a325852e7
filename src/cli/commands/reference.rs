//! `volraster reference`: draws the float64 reference image.

use std::path::PathBuf;
use std::time::Instant;

use volraster::reference::{self, ReferenceOptions};

use crate::cli::annotate::AnnotationArgs;
use crate::cli::input::{ArraysArgs, Input, LookArgs, Size};
use crate::cli::numbers::counted;
use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `reference`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A scene file (.json) or a data file.
    #[arg(value_name = "SCENE|DATA")]
    scene: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    annotations: AnnotationArgs,
    /// Output image: .exr (rounded to 32-bit float) or .png.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Rays along each side of a pixel, averaged by a box filter; 1 samples the pixel centre alone.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(ReferenceOptions::MAX_SAMPLES)))]
    samples: u32,
    /// Image size [default: that of the scene].
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        output::check_image(&self.output)?;
        let input = Input::load(&self.scene, self.size, &self.arrays, quiet)?;
        let Input { scene, settings } = self.look.apply(input)?;
        let start = Instant::now();
        let options = ReferenceOptions { samples: self.samples };
        let image = output::counting_rows(&settings.view, |rows| {
            reference::render(&scene, &settings.view, &options, Some(rows))
        });
        let mut image = image?.to_image()?.with_colours(scene.colours());
        let seconds = start.elapsed().as_secs_f64();
        let array = settings.report.shown_name();
        if let Some(annotations) = self.annotations.prepare(&scene, array, settings.background)? {
            image = annotations.draw(&image, &settings.view)?;
        }
        volraster::io::write_image(&self.output, &image, settings.background)?;
        if !quiet {
            output::print(&format!(
                "reference (float64, {} per pixel): {} x {}, {seconds:.1} s: {}",
                counted(self.samples * self.samples, "sample"),
                image.width(),
                image.height(),
                self.output.display()
            ))?;
        }
        Ok(())
    }
}
