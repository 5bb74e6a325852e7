//! The devices and reference images that cases share.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use volraster::gpu::{Gpu, GpuOptions, OptionalFeature, Validation, ValidationLog};
use volraster::measure::ImageErrors;
use volraster::reference::{ReferenceImage, ReferenceOptions};
use volraster::scene::View;
use volraster::{Error, GpuScene, Image, Renderer, Result, Technique, reference};

use super::subject::{Sight, Subject, view};

/// Why a case does not pass.
#[derive(Debug)]
pub(crate) enum Stop {
    /// The device lacks a feature that the case needs.
    Skip(String),
    /// The check failed.
    Fail(String),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Fail(error.to_string())
    }
}

/// The result of a case: a summary if it passes.
pub(crate) type Verdict = std::result::Result<String, Stop>;

/// Returns a failure.
pub(crate) fn fail<T>(reason: impl Into<String>) -> std::result::Result<T, Stop> {
    Err(Stop::Fail(reason.into()))
}

/// The devices, validation and reference images that cases share.
pub(crate) struct Workbench {
    pub(crate) device: Option<String>,
    pub(crate) validation: Validation,
    pub(crate) log: Arc<ValidationLog>,
    shared: RefCell<Option<Gpu>>,
    light: RefCell<Option<Gpu>>,
    truths: RefCell<HashMap<Sight, Rc<ReferenceImage>>>,
}

impl Workbench {
    pub(crate) fn new(device: Option<String>, validation: Validation) -> Self {
        Self {
            device,
            validation,
            log: Arc::default(),
            shared: RefCell::default(),
            light: RefCell::default(),
            truths: RefCell::default(),
        }
    }

    /// Returns core and synchronization validation, if any is on.
    pub(crate) fn plain(&self) -> Validation {
        if self.validation == Validation::Off { Validation::Off } else { Validation::On }
    }

    /// Opens a separate device under core and synchronization validation. Instrumenting its shaders as well would
    /// dominate the run time.
    ///
    /// # Errors
    ///
    /// As [`Gpu::new`].
    pub(crate) fn open(&self, options: GpuOptions) -> Result<Gpu> {
        self.open_under(self.plain(), options)
    }

    fn open_under(&self, validation: Validation, options: GpuOptions) -> Result<Gpu> {
        Gpu::new(&GpuOptions {
            device: self.device.clone(),
            validation,
            validation_log: Some(Arc::clone(&self.log)),
            no_pipeline_cache: true,
            ..options
        })
    }

    /// Returns the shared device, under full validation.
    ///
    /// # Errors
    ///
    /// As [`Gpu::new`].
    pub(crate) fn gpu(&self) -> Result<Gpu> {
        if let Some(gpu) = &*self.shared.borrow() {
            return Ok(gpu.clone());
        }
        let gpu = self.open_under(self.validation, GpuOptions::default())?;
        *self.shared.borrow_mut() = Some(gpu.clone());
        Ok(gpu)
    }

    /// Returns a second shared device without instrumented shaders, for cases with so many shader variants that
    /// compiling instrumented ones takes minutes.
    ///
    /// # Errors
    ///
    /// As [`Gpu::new`].
    pub(crate) fn light(&self) -> Result<Gpu> {
        if let Some(gpu) = &*self.light.borrow() {
            return Ok(gpu.clone());
        }
        let validation = match self.validation {
            Validation::Full => Validation::BestPractices,
            Validation::GpuAssisted => Validation::On,
            other => other,
        };
        let gpu = self.open_under(validation, GpuOptions::default())?;
        *self.light.borrow_mut() = Some(gpu.clone());
        Ok(gpu)
    }

    /// Destroys the shared devices.
    pub(crate) fn end(&self) {
        self.shared.borrow_mut().take();
        self.light.borrow_mut().take();
    }

    /// Returns the reference image.
    ///
    /// # Errors
    ///
    /// As [`reference::render`].
    pub(crate) fn truth(&self, sight: Sight) -> Result<Rc<ReferenceImage>> {
        if let Some(truth) = self.truths.borrow().get(&sight) {
            return Ok(Rc::clone(truth));
        }
        let (subject, name, size) = sight;
        let image =
            reference::render(&subject.scene()?, &view(name, size)?, &ReferenceOptions::default(), None)?;
        let truth = Rc::new(image);
        self.truths.borrow_mut().insert(sight, Rc::clone(&truth));
        Ok(truth)
    }

    /// Returns RMSE and largest error of an image; infinite if a sample is not finite.
    ///
    /// # Errors
    ///
    /// As [`Workbench::truth`].
    pub(crate) fn errors(&self, image: &Image, sight: Sight) -> Result<[f64; 2]> {
        let errors = ImageErrors::between_f64(image, &*self.truth(sight)?)?;
        let finite = if errors.non_finite == 0 { errors.all.max_abs } else { f64::INFINITY };
        Ok([errors.all.rmse, finite])
    }
}

/// Draws one image of a scene.
///
/// # Errors
///
/// As [`Renderer::render`].
pub(crate) fn draw(scene: &Arc<GpuScene>, technique: Technique, view: &View) -> Result<Image> {
    Renderer::new(scene, technique).render(view)
}

/// Skips the case if the device lacks a feature that the technique's options need.
pub(crate) fn offered(gpu: &Gpu, spec: &str) -> std::result::Result<(), Stop> {
    let lacks = |feature: OptionalFeature| {
        let why = format!("the device lacks {}: {}", feature.name(), feature.fallback());
        if gpu.has(feature) { Ok(()) } else { Err(Stop::Skip(why)) }
    };
    let has = |option: &str| spec.split([':', ',']).any(|part| part == option);
    if has("route=raster") {
        lacks(OptionalFeature::BlendRgba32f)?;
    }
    if has("route=interlock") {
        lacks(OptionalFeature::FragmentInterlock)?;
    }
    if has("route=implementation-ordered") {
        lacks(OptionalFeature::OrderedStores)?;
    }
    if spec.contains("dither=") {
        lacks(OptionalFeature::FragmentStores)?;
    }
    Ok(())
}

/// Returns the shared device, the technique of a spec and its subject; skips the case if the device does not support
/// it.
pub(super) fn prepared(
    workbench: &Workbench,
    spec: &str,
) -> std::result::Result<(Gpu, Technique, Subject), Stop> {
    let gpu = workbench.gpu()?;
    offered(&gpu, spec)?;
    let technique = Technique::parse(spec)?;
    Ok((gpu, technique, Subject::of(technique.method())))
}
