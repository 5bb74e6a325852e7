//! Drawing of one image, with timed frames after it.

use std::sync::Arc;
use std::time::Instant;

use volraster::scene::View;
use volraster::technique::FrameTime;
use volraster::{Error, GpuScene, Image, Result, Technique};

use super::Args;
use super::present::Presenter;
use super::stats::{Drawn, Setup};
use crate::cli::in_flight::InFlight;

impl Args {
    /// Draws one warm-up frame, which gives the image and the image of --overflow-map, then every timed view once.
    pub(super) fn draw(
        &self,
        scene: &Arc<GpuScene>,
        technique: Technique,
        view: &View,
        timed: &[View],
        load_and_open_ms: [f64; 2],
        presenter: &mut Presenter,
    ) -> Result<(Drawn, Option<Image>)> {
        let start = Instant::now();
        let mut plans = InFlight::new(scene, technique, view, self.in_flight)?;
        if let Some(goal) = self.choice.goal() {
            plans.stop_within(goal.stop());
        }
        let drawing = plans.first();
        let setup = Setup::of(scene, technique, start, drawing.plan());
        let first = drawing.draw(view)?;
        presenter.present(drawing)?;
        let image = drawing.read_back()?;
        let map = if self.overflow_map.is_some() {
            let Some(map) = drawing.overflow_map()? else {
                let why = format!("\"{}\": has no k-buffer", technique.method().name());
                return Err(Error::Invalid { what: "--overflow-map".to_string(), why });
            };
            let grey = map.into_iter().map(|is_set| f32::from(u8::from(is_set)));
            Some(Image::new(image.width(), image.height(), grey.map(|v| [v, v, v, 1.0]).collect())?)
        } else {
            None
        };
        let frame = |view| {
            let time = plans.draw(view)?;
            presenter.present(plans.first())?;
            Ok(time)
        };
        let frames: Vec<FrameTime> = timed.iter().map(frame).collect::<Result<_>>()?;
        drop(plans);
        let counts = self.stats.is_some();
        let drawn = setup.report(scene, image, (view, first), &frames, load_and_open_ms, counts)?;
        Ok((drawn, map))
    }
}
