//! What cases share: a device, scenes, views, and the truth of both.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use volraster::glam::DVec3;
use volraster::gpu::{Gpu, GpuOptions, OptionalFeature, Validation, ValidationLog};
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceImage, ReferenceOptions};
use volraster::scene::{
    Camera, Field, Kernel, KernelSize, Kernels, Model, Points, Projection, Scene, TransferFunction, View,
};
use volraster::technique::Method;
use volraster::{Error, GpuScene, Image, Renderer, Result, Technique};

/// Why a case does not pass.
#[derive(Debug)]
pub(crate) enum Stop {
    /// The device does not offer what it needs.
    Skip(String),
    /// Something is wrong.
    Fail(String),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Fail(error.to_string())
    }
}

/// How a case ends: what is told of one that passes.
pub(crate) type Verdict = std::result::Result<String, Stop>;

/// A failure with its reason.
pub(crate) fn fail<T>(reason: impl Into<String>) -> std::result::Result<T, Stop> {
    Err(Stop::Fail(reason.into()))
}

/// Data to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Subject {
    /// A grid of a sample type.
    Grid(&'static str),
    /// A grid whose samples are Gaussians that add up.
    Gaussians,
    /// A mesh.
    Mesh,
    /// Points.
    Points,
}

/// Transfer function of all subjects, over the field's range.
const FOG: [[f64; 5]; 5] = [
    [0.0, 0.1, 0.2, 0.7, 0.0],
    [0.06, 0.1, 0.2, 0.7, 0.0],
    [0.3, 0.2, 0.6, 0.9, 1.0],
    [0.6, 0.9, 0.85, 0.3, 3.0],
    [1.0, 1.0, 0.25, 0.1, 8.0],
];

/// Another one.
const SMOKE: [[f64; 5]; 3] =
    [[0.0, 1.0, 0.9, 0.8, 0.2], [0.5, 0.3, 0.1, 0.9, 0.0], [1.0, 0.1, 0.8, 0.2, 5.0]];

/// The grid's Gaussians.
const GAUSSIANS: Kernels =
    Kernels { kernel: Kernel::Gaussian, sigma: 0.7, cut: 2.5, model: Model::Density, least: Kernels::LEAST };

impl Subject {
    /// What a technique draws by itself.
    pub(crate) fn of(method: Method) -> Self {
        match method {
            Method::Havs | Method::Abuffer | Method::ProjectedTets => Self::Mesh,
            Method::SplatSheets | Method::SplatEwa => Self::Points,
            _ => Self::Grid("f32"),
        }
    }

    /// The scene.
    ///
    /// # Errors
    ///
    /// None, unless a constant above is wrong.
    pub(crate) fn scene(self) -> Result<Scene> {
        match self {
            Self::Grid(kind) => {
                let grid = Field::Blobs.sample([12, 11, 10], kind)?;
                Ok(Scene::new(grid, self.transfer(&FOG)?))
            }
            Self::Gaussians => {
                let grid = Field::Blobs.sample([9, 8, 7], "f32")?;
                Scene::new(grid, self.transfer(&FOG)?).with_kernels(GAUSSIANS)
            }
            Self::Mesh => Ok(Scene::new(Field::Blobs.tets(3)?, self.transfer(&FOG)?)),
            Self::Points => {
                let points =
                    Points::of_vertices(&Field::Blobs.tets(4)?)?.with_size(KernelSize::Radius(0.5))?;
                Ok(Scene::new(points, self.transfer(&FOG)?))
            }
        }
    }

    /// Another transfer function for it.
    ///
    /// # Errors
    ///
    /// As [`Subject::scene`].
    pub(crate) fn other_transfer(self) -> Result<TransferFunction> {
        self.transfer(&SMOKE)
    }

    fn transfer(self, rows: &[[f64; 5]]) -> Result<TransferFunction> {
        // What integers stand for when a field is sampled in them.
        let scale = match self {
            Self::Grid("u8") => 255.0,
            Self::Grid("u16") => 65535.0,
            Self::Grid("i16") => 32767.0,
            _ => 1.0,
        };
        let row = |&[scalar, r, g, b, tau]: &[f64; 5]| [scale * scalar, r, g, b, tau];
        TransferFunction::from_rows(&rows.iter().map(row).collect::<Vec<_>>())
    }
}

/// The views from which pictures are compared: from outside, parallel, from inside.
pub(crate) const VIEWS: [&str; 3] = ["perspective", "orthographic", "inside"];

/// A view of [`VIEWS`].
///
/// # Errors
///
/// As [`View::new`].
pub(crate) fn view(name: &str, [width, height]: [u32; 2]) -> Result<View> {
    let (distance, projection) = match name {
        "orthographic" => (1.0, Projection::Orthographic { half_height: 1.6 }),
        "inside" => (0.1, Projection::Perspective { fov_y_deg: 60.0 }),
        _ => (1.0, Projection::Perspective { fov_y_deg: 42.0 }),
    };
    let eye = DVec3::new(2.0, 1.5, 3.8) * distance;
    View::new(Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection }, width, height)
}

/// Image size of most cases.
pub(crate) const SIZE: [u32; 2] = [40, 30];

/// What is drawn, and from where.
type Sight = (Subject, &'static str, [u32; 2]);

/// Where cases run.
pub(crate) struct Stage {
    pub(crate) device: Option<String>,
    pub(crate) validation: Validation,
    pub(crate) log: Arc<ValidationLog>,
    shared: RefCell<Option<Gpu>>,
    light: RefCell<Option<Gpu>>,
    truths: RefCell<HashMap<Sight, Rc<ReferenceImage>>>,
}

impl Stage {
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

    /// Core and synchronization validation, if any is on.
    pub(crate) fn plain(&self) -> Validation {
        if self.validation == Validation::Off { Validation::Off } else { Validation::On }
    }

    /// A device of the case's own, under core and synchronization validation: to instrument its shaders once more would take
    /// most of the time.
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

    /// The device that cases share.
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

    /// Another, under the same but for instrumented shaders: for more variants of shaders than a driver compiles in minutes
    /// when they are instrumented.
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

    /// Ends the devices that cases share.
    pub(crate) fn end(&self) {
        self.shared.borrow_mut().take();
        self.light.borrow_mut().take();
    }

    /// What a picture ought to be.
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

    /// RMSE and largest error of a picture.
    ///
    /// # Errors
    ///
    /// As [`Stage::truth`].
    pub(crate) fn errors(&self, image: &Image, sight: Sight) -> Result<[f64; 2]> {
        let errors = ImageErrors::between_f64(image, &*self.truth(sight)?)?;
        let finite = if errors.non_finite == 0 { errors.all.max_abs } else { f64::INFINITY };
        Ok([errors.all.rmse, finite])
    }
}

/// A picture of a scene, drawn for one.
///
/// # Errors
///
/// As [`Renderer::render`].
pub(crate) fn draw(scene: &Arc<GpuScene>, technique: Technique, view: &View) -> Result<Image> {
    Renderer::new(scene, technique).render(view)
}

/// Skips what the device does not offer of a technique's route.
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
