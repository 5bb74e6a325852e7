//! The devices and reference images that cases share.

use std::cell::RefCell;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use volraster::gpu::{Gpu, GpuOptions, OptionalFeature, PipelineCache, Validation, ValidationLog};
use volraster::measure::ImageErrors;
use volraster::reference::{ReferenceImage, ReferenceOptions};
use volraster::scene::View;
use volraster::{Error, GpuScene, Image, Renderer, Result, Technique, reference};

use super::subject::{SIZE, Sight, Subject, VIEWS, view};
use crate::cli::input::DeviceArgs;

/// Why a case does not pass.
#[derive(Debug)]
pub(super) enum Stop {
    /// The device lacks a feature that the case needs.
    Skip(String),
    /// The device refused, for a limit or a feature that it lacks.
    Refused(String),
    /// The check failed.
    Fail(String),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        match error {
            Error::Unsupported { .. } | Error::Memory { .. } => Self::Refused(error.to_string()),
            _ => Self::Fail(error.to_string()),
        }
    }
}

/// The result of a case: a summary if it passes.
pub(super) type Verdict = std::result::Result<String, Stop>;

/// Returns a failure.
pub(super) fn fail<T>(reason: impl Into<String>) -> std::result::Result<T, Stop> {
    Err(Stop::Fail(reason.into()))
}

/// The devices, validation and reference images that cases share.
#[derive(Default)]
pub(super) struct Workbench {
    /// Which device, and how it is treated.
    pub(super) device: DeviceArgs,
    pub(super) validation: Validation,
    pub(super) log: Arc<ValidationLog>,
    shared: RefCell<Option<Gpu>>,
    truths: RefCell<HashMap<Sight, ReferenceImage>>,
}

impl Workbench {
    pub(super) fn new(device: DeviceArgs, validation: Validation) -> Self {
        Self { device, validation, ..Self::default() }
    }

    /// Returns core and synchronization validation, if any is on.
    pub(super) fn plain(&self) -> Validation {
        if self.validation == Validation::Off { Validation::Off } else { Validation::On }
    }

    /// Opens a separate device under core and synchronization validation. Instrumenting its shaders as well would
    /// dominate the run time.
    pub(super) fn open(&self, options: GpuOptions) -> Result<Gpu> {
        self.open_under(self.plain(), options)
    }

    /// Opens a separate device under some validation.
    pub(super) fn open_under(&self, validation: Validation, options: GpuOptions) -> Result<Gpu> {
        let given = self.device.options();
        Gpu::new(&GpuOptions {
            loop_limit: options.loop_limit.or(given.loop_limit),
            storage_range: options.storage_range.or(given.storage_range),
            allocation_size: options.allocation_size.or(given.allocation_size),
            memory_budget: options.memory_budget.or(given.memory_budget),
            page_pool: options.page_pool.or(given.page_pool),
            command_buffer_by_pass: options.command_buffer_by_pass,
            validation,
            validation_log: Some(Arc::clone(&self.log)),
            pipeline_cache: PipelineCache::Off,
            poison: true,
            ..given
        })
    }

    /// Returns the shared device, under full validation.
    pub(super) fn gpu(&self) -> Result<Gpu> {
        if let Some(gpu) = &*self.shared.borrow() {
            return Ok(gpu.clone());
        }
        let gpu = self.open_under(self.validation, GpuOptions::default())?;
        Ok(self.shared.borrow_mut().insert(gpu).clone())
    }

    /// Destroys the shared device.
    pub(super) fn end(&self) {
        self.shared.borrow_mut().take();
    }

    /// Compares an image with the reference. Returns RMSE and largest error; infinite if a sample is not finite.
    pub(super) fn errors(&self, image: &Image, sight: Sight) -> Result<[f64; 2]> {
        let mut truths = self.truths.borrow_mut();
        let truth = match truths.entry(sight) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => {
                let (subject, name, size) = sight;
                let (scene, view) = (subject.scene()?, view(name, size)?);
                place.insert(reference::render(&scene, &view, &ReferenceOptions::default(), None)?)
            }
        };
        let errors = ImageErrors::between_f64(image, truth)?;
        let finite = if errors.non_finite == 0 { errors.all.max_abs } else { f64::INFINITY };
        Ok([errors.all.rmse, finite])
    }
}

/// Skips the case if the device lacks a feature that the technique's options need.
pub(super) fn offered(gpu: &Gpu, spec: &str) -> std::result::Result<(), Stop> {
    let needs = [
        ("route=raster", OptionalFeature::BlendRgba32f),
        ("route=interlock", OptionalFeature::FragmentInterlock),
        ("route=implementation-ordered", OptionalFeature::OrderedStores),
        ("dither=", OptionalFeature::FragmentStores),
    ];
    match needs.into_iter().find(|(option, feature)| spec.contains(option) && !gpu.has(*feature)) {
        Some((_, lacks)) => {
            Err(Stop::Skip(format!("the device lacks {}: {}", lacks.name(), lacks.fallback())))
        }
        None => Ok(()),
    }
}

/// A technique with the device, the subject and the view that it draws.
pub(super) struct Trial {
    pub(super) gpu: Gpu,
    pub(super) technique: Technique,
    pub(super) subject: Subject,
    pub(super) view: View,
}

impl Trial {
    /// Takes the shared device; skips the case if the device does not support the options.
    pub(super) fn new(workbench: &Workbench, spec: &str) -> std::result::Result<Self, Stop> {
        let gpu = workbench.gpu()?;
        offered(&gpu, spec)?;
        Ok(Self::on(gpu, spec)?)
    }

    /// Takes any device.
    pub(super) fn on(gpu: Gpu, spec: &str) -> Result<Self> {
        let technique = Technique::parse(spec)?;
        let subject = Subject::of(technique.method());
        Ok(Self { gpu, technique, subject, view: view(VIEWS[0], SIZE)? })
    }

    /// Uploads the scene of the subject.
    pub(super) fn scene(&self) -> Result<Arc<GpuScene>> {
        Ok(GpuScene::new(&self.gpu, self.subject.scene()?))
    }

    /// Draws a scene.
    pub(super) fn draw(&self, scene: &Arc<GpuScene>) -> Result<Image> {
        Renderer::new(scene, self.technique).render(&self.view)
    }

    /// Uploads the scene of the subject, and draws it.
    pub(super) fn image(&self) -> Result<Image> {
        self.draw(&self.scene()?)
    }
}
