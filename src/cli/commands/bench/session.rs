//! The order of the work of `bench`.
//!
//! An image that is wrong has no speed: each case is compared with the reference before it is timed. The frames of a
//! scene's cases are drawn in turn, forwards and backwards, so that warm-up and disturbances affect all cases alike.

use std::sync::Arc;
use std::time::Duration;

use indicatif::ProgressBar;
use volraster::reference::ReferenceImage;
use volraster::scene::View;
use volraster::{Error, Gpu, GpuScene, Result};

use super::case::{Case, elements};
use super::record::{Record, Run, SCHEMA};
use super::required_k::RequiredK;
use super::results::Results;
use super::series::Limits;
use super::sizes::{Pace, Sizes};
use super::sweeps::Given;
use super::turns::{Watch, time};
use super::workload::{Opened, ViewCases, Workload};
use crate::cli::cache::Cache;
use crate::cli::input::is_refusal;
use crate::cli::{interrupt, output};

/// What all scenes of a run share.
pub(super) struct Session {
    pub(super) gpu: Gpu,
    pub(super) run: Run,
    /// Where reference images are kept.
    pub(super) cache: Cache,
    /// The settings that are measured in place of those of sweeps.
    pub(super) given: Given,
    /// Timed frames per case, if the user gives their number.
    pub(super) frames: Option<usize>,
    /// Frames in flight, one or two.
    pub(super) in_flight: u8,
    pub(super) quiet: bool,
}

impl Session {
    /// Measures scenes until all are measured or the user requests a stop.
    ///
    /// # Errors
    ///
    /// An error in a scene that the user names, in the device or the output.
    pub(super) fn measure(
        &self,
        workloads: Vec<Workload>,
        (sizes, mut pace): (Sizes, Option<Pace>),
        mut results: Results,
    ) -> Result<Results> {
        let steps = |workload: &Workload| Ok(2 * workload.case_count(sizes, &self.given)? as u64);
        let mut watch = Watch::new(&self.gpu)?;
        let bar = output::progress(workloads.iter().map(steps).sum::<Result<u64>>()?, "bench");
        for workload in workloads.into_iter().take_while(|_| !interrupt::requested()) {
            let end = bar.position() + steps(&workload)?;
            let is_found = matches!(workload, Workload::Found(..));
            let limits = Limits::of(workload.suite(), self.frames);
            let pace = pace.as_mut().filter(|_| workload.suite().is_some());
            match workload.open(sizes) {
                // The user named the folder, not this file: skip it.
                Err(error) if is_found => bar.suspend(|| output::complain(&format!("skipped: {error}"))),
                opened => self.measure_scene(opened?, limits, pace, &mut watch, &bar, &mut results)?,
            }
            if !interrupt::requested() {
                bar.set_position(end);
            }
        }
        bar.finish_and_clear();
        Ok(results)
    }

    /// Measures every case of a scene, one view after the other.
    fn measure_scene(
        &self,
        Opened { name, family, scene, views }: Opened,
        limits: Limits,
        mut pace: Option<&mut Pace>,
        watch: &mut Watch,
        bar: &ProgressBar,
        results: &mut Results,
    ) -> Result<()> {
        let scene = GpuScene::new(&self.gpu, scene);
        let device = self.gpu.report();
        for ViewCases { projection, view, sweeps } in views {
            let record = Record {
                schema: SCHEMA,
                run: self.run.clone(),
                version: env!("CARGO_PKG_VERSION").to_string(),
                device: device.name.clone(),
                driver: device.driver.clone(),
                api: device.api.clone(),
                software: self.gpu.is_software(),
                scene: name.clone(),
                family: family.clone(),
                projection: projection.to_string(),
                size: view.extent(),
                data: scene.scene().data.kind().to_string(),
                elements: elements(&scene.scene().data),
                ..Record::default()
            };
            bar.set_message(output::plain(&format!("{name} {projection}")));
            let settings = self.given.fitting(sweeps, scene.scene())?;
            let share = pace.as_mut().map_or(f64::INFINITY, |pace| pace.take(settings.len()));
            let limits = Limits { enough_ms: limits.enough_ms.min(share), ..limits };
            let cases =
                settings.into_iter().map(|setting| Case::new(setting, &record, self.in_flight, limits));
            let Some((records, required_k)) =
                self.measure_view(&scene, &view, cases.collect(), watch, bar)?
            else {
                return Ok(());
            };
            // Written after every view, so that an interrupted run keeps its results so far.
            let text = results.add(&record, records, required_k.as_ref())?;
            if !self.quiet {
                bar.suspend(|| output::print(&text))?;
            }
        }
        Ok(())
    }

    /// Checks, then times every case of a view; `None` if the run is stopped before all are checked.
    fn measure_view(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        mut cases: Vec<Case>,
        watch: &mut Watch,
        bar: &ProgressBar,
    ) -> Result<Option<(Vec<Record>, Option<RequiredK>)>> {
        let Some(truth) = truth(scene, view, &self.cache)? else { return Ok(None) };
        let mut weighed = Vec::new();
        for case in &mut cases {
            if interrupt::requested() {
                return Ok(None);
            }
            case.check(scene, view, &truth)?;
            if !weighed.contains(&case.kind()) {
                weighed.push(case.kind());
                case.measure_memory(scene, view);
            }
            case.count(scene, view)?;
            bar.inc(1);
        }
        time(&mut cases, view, watch, bar)?;
        let required_k = match RequiredK::measure(scene, view) {
            _ if interrupt::requested() => None,
            Err(error) if is_refusal(&error) => None,
            measured => measured?,
        };
        cases.retain(Case::is_done);
        let finish = |case: Case| case.finish(required_k.as_ref(), watch.pulse());
        Ok(Some((cases.into_iter().map(finish).collect(), required_k)))
    }
}

/// Returns the reference image of a view, drawn on a thread of its own; `None` as soon as the user requests a stop.
fn truth(scene: &Arc<GpuScene>, view: &View, cache: &Cache) -> Result<Option<ReferenceImage>> {
    let (scene, view, cache) = (Arc::clone(scene), *view, cache.clone());
    let drawing = std::thread::spawn(move || cache.image(scene.scene(), &view, None).map(|(image, _)| image));
    while !drawing.is_finished() {
        if interrupt::requested() {
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let why = "its thread ended without an image".to_string();
    drawing.join().map_err(|_| Error::Invalid { what: "reference".to_string(), why })?.map(Some)
}
