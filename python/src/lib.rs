//! The native half of the Python package `volraster`: scenes from arrays and files, drawn on the device or by the float64
//! reference. `volraster/__init__.py` checks and converts arguments, and documents them.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::ndarray::{Array3, ArrayView1};
use numpy::{Element, IntoPyArray, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use volraster::choice::{self, Goal, Profile};
use volraster::glam::{DMat3, DVec3};
use volraster::gpu::GpuOptions;
use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{self, Loaded, ReadOptions, Report};
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceImage, ReferenceOptions};
use volraster::scene::{Camera, Data, Grid, KernelSize, Points, Projection, Samples, TetScalars, Tets, View};
use volraster::technique::Method;
use volraster::{Error, Gpu, GpuScene, Image, Renderer, Technique};

/// Wrong input is a `ValueError`; what a device or a disk lacks is a `RuntimeError`.
fn raised(error: Error) -> PyErr {
    match error {
        Error::Invalid { .. } | Error::File { .. } => PyValueError::new_err(error.to_string()),
        _ => PyRuntimeError::new_err(error.to_string()),
    }
}

/// The device of the process, opened once it is needed: that of `VOLRASTER_DEVICE`, or the best.
fn gpu() -> Result<Gpu, Error> {
    static GPU: Mutex<Option<Gpu>> = Mutex::new(None);
    let mut gpu = GPU.lock().unwrap_or_else(PoisonError::into_inner);
    // A device that is lost is opened anew.
    if let Some(gpu) = gpu.as_ref().filter(|gpu| !gpu.is_lost()) {
        return Ok(gpu.clone());
    }
    let device = std::env::var("VOLRASTER_DEVICE").ok().filter(|name| !name.is_empty());
    let opened = Gpu::new(&GpuOptions { device, ..GpuOptions::default() })?;
    *gpu = Some(opened.clone());
    Ok(opened)
}

/// A scene, which lies on the device once it has been drawn there.
#[pyclass(frozen, module = "volraster._native")]
struct Scene {
    loaded: LoadedScene,
    on_device: Mutex<Option<Arc<GpuScene>>>,
}

/// A camera as (eye, target, up, fov_y_deg, half_height).
type CameraParts = ([f64; 3], [f64; 3], [f64; 3], Option<f64>, Option<f64>);

/// Everything about a drawn image but its pixels: technique, milliseconds of the frame, milliseconds on the device, counters.
type Facts = (String, f64, Option<f64>, Vec<(String, u64)>);

impl Scene {
    fn new(loaded: LoadedScene) -> Self {
        Self { loaded, on_device: Mutex::new(None) }
    }

    /// Makes a scene of data that `make` makes of copies of the arrays, while other threads of Python run.
    fn of_data<D: Into<Data>>(
        py: Python<'_>,
        document: &str,
        make: impl FnOnce() -> Result<D, Error> + Send,
    ) -> PyResult<Self> {
        let read = || {
            let loaded = Loaded { data: make()?.into(), report: Report::default() };
            SceneFile::with_data(document, loaded, &ReadOptions::default())
        };
        py.detach(read).map(Self::new).map_err(raised)
    }

    fn view(&self, camera: Option<CameraParts>, [width, height]: [u32; 2]) -> Result<View, Error> {
        let Some((eye, target, up, fov_y_deg, half_height)) = camera else {
            return self.loaded.view(width, height);
        };
        let projection = match (fov_y_deg, half_height) {
            (Some(fov_y_deg), None) => Projection::Perspective { fov_y_deg },
            (None, Some(half_height)) => Projection::Orthographic { half_height },
            _ => {
                let why = "must have either fov_y_deg or half_height".to_string();
                return Err(Error::Invalid { what: "camera".to_string(), why });
            }
        };
        let camera = Camera { eye: eye.into(), target: target.into(), up: up.into(), projection };
        Ok(View::new(camera, width, height)?.with_clip(self.loaded.clip))
    }

    fn on_device(&self) -> Result<Arc<GpuScene>, Error> {
        let mut made = self.on_device.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(scene) = made.as_ref().filter(|scene| !scene.gpu().is_lost()) {
            return Ok(Arc::clone(scene));
        }
        let scene = GpuScene::new(&gpu()?, self.loaded.scene.clone());
        *made = Some(Arc::clone(&scene));
        Ok(scene)
    }

    fn technique(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        named: Option<&str>,
        goal: Option<Goal>,
    ) -> Result<Technique, Error> {
        if let Some(goal) = goal {
            return Ok(choice::choose(scene, view, goal, &Profile::built_in())?.technique);
        }
        if let Some(name) = named {
            return Technique::parse(name);
        }
        if let Some(choice) = &self.loaded.technique {
            return Technique::new(Method::from_name(&choice.name)?, &choice.options);
        }
        Technique::default_for(&self.loaded.scene)
    }

    fn drawn(
        &self,
        camera: Option<CameraParts>,
        size: [u32; 2],
        named: Option<&str>,
        goal: Option<Goal>,
    ) -> Result<(Image, Facts), Error> {
        let view = self.view(camera, size)?;
        let scene = self.on_device()?;
        let technique = self.technique(&scene, &view, named, goal)?;
        let mut frames = Renderer::new(&scene, technique).frames(&view)?;
        // The first frame compiles and warms up.
        frames.draw(&view)?;
        let time = frames.draw(&view)?;
        let counters =
            frames.plan().counters().into_iter().map(|(name, number)| (name.to_string(), number)).collect();
        let gpu_ms = time.passes.iter().map(|pass| pass.ms).reduce(|sum, ms| sum + ms);
        let facts = (technique.to_string(), time.wall_ms, gpu_ms, counters);
        Ok((frames.read_back()?, facts))
    }
}

#[pymethods]
impl Scene {
    #[staticmethod]
    fn of_grid(
        py: Python<'_>,
        samples: &Bound<'_, PyAny>,
        spacing: [f64; 3],
        origin: [f64; 3],
        document: &str,
    ) -> PyResult<Self> {
        let (dims, samples) = samples_of(samples)?;
        Self::of_data(py, document, || {
            Grid::new(dims, samples)?.with_placement(spacing.into(), origin.into(), DMat3::IDENTITY)
        })
    }

    #[staticmethod]
    fn of_mesh(
        py: Python<'_>,
        points: PyReadonlyArray2<'_, f64>,
        cells: PyReadonlyArray2<'_, u32>,
        scalars: PyReadonlyArray1<'_, f32>,
        at_cells: bool,
        document: &str,
    ) -> PyResult<Self> {
        let cells = cells.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2], row[3]]).collect();
        let scalars = scalars.as_array().to_vec();
        let scalars = if at_cells { TetScalars::Cell(scalars) } else { TetScalars::Point(scalars) };
        let points = places(&points);
        Self::of_data(py, document, || Ok(Tets::new(points, cells, scalars)?.0))
    }

    #[staticmethod]
    fn of_points(
        py: Python<'_>,
        centres: PyReadonlyArray2<'_, f64>,
        scalars: Option<PyReadonlyArray1<'_, f32>>,
        weights: Option<PyReadonlyArray1<'_, f32>>,
        radii: Option<PyReadonlyArray1<'_, f32>>,
        covariances: Option<PyReadonlyArray2<'_, f32>>,
        document: &str,
    ) -> PyResult<Self> {
        let list = |given: Option<PyReadonlyArray1<'_, f32>>| given.map(|list| list.as_array().to_vec());
        let (centres, scalars, weights) = (places(&centres), list(scalars), list(weights));
        let of_row = |row: ArrayView1<'_, f32>| std::array::from_fn(|i| row[i]);
        let size = match (list(radii), covariances) {
            (Some(radii), _) => Some(KernelSize::Radii(radii)),
            (None, Some(rows)) => {
                Some(KernelSize::Covariances(rows.as_array().rows().into_iter().map(of_row).collect()))
            }
            (None, None) => None,
        };
        Self::of_data(py, document, || {
            let mut points = Points::new(centres)?;
            if let Some(scalars) = scalars {
                points = points.with_scalars(scalars)?;
            }
            if let Some(weights) = weights {
                points = points.with_weights(weights)?;
            }
            match size {
                Some(size) => points.with_size(size),
                None => Ok(points),
            }
        })
    }

    /// Reads a scene file, which has a document of its own, or a data file.
    #[staticmethod]
    fn of_file(py: Python<'_>, path: PathBuf, document: Option<String>) -> PyResult<Self> {
        let options = ReadOptions::default();
        let read = || match document {
            None => LoadedScene::load_any(&path, &options),
            Some(document) => SceneFile::with_data(&document, io::read(&path, &options)?, &options),
        };
        py.detach(read).map(Self::new).map_err(raised)
    }

    #[getter]
    fn kind(&self) -> &'static str {
        self.loaded.scene.data.kind()
    }

    #[getter]
    fn range(&self) -> [f64; 2] {
        self.loaded.scene.data.range()
    }

    /// The size and the background of the scene's document.
    #[getter]
    fn image(&self) -> ([u32; 2], [f64; 4]) {
        ([self.loaded.width, self.loaded.height], self.loaded.background)
    }

    /// The camera for an image size.
    fn camera(&self, size: [u32; 2]) -> PyResult<CameraParts> {
        let Camera { eye, target, up, projection } = *self.view(None, size).map_err(raised)?.camera();
        let (fov, half_height) = match projection {
            Projection::Perspective { fov_y_deg } => (Some(fov_y_deg), None),
            Projection::Orthographic { half_height } => (None, Some(half_height)),
        };
        Ok((eye.into(), target.into(), up.into(), fov, half_height))
    }

    /// The techniques that draw the scene.
    fn techniques(&self) -> Vec<&'static str> {
        let fits = |method: &Method| method.fits(&self.loaded.scene);
        Method::ALL.into_iter().filter(fits).map(Method::name).collect()
    }

    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: Option<CameraParts>,
        size: [u32; 2],
        technique: Option<String>,
        max_error: Option<f64>,
        budget_ms: Option<f64>,
    ) -> PyResult<(Bound<'py, PyArray3<f32>>, Facts)> {
        let goal = max_error.map(Goal::MaxError).or(budget_ms.map(Goal::Budget));
        let (image, facts) =
            py.detach(|| self.drawn(camera, size, technique.as_deref(), goal)).map_err(raised)?;
        Ok((array(py, image.width(), image.height(), image.pixels())?, facts))
    }

    fn reference<'py>(
        &self,
        py: Python<'py>,
        camera: Option<CameraParts>,
        size: [u32; 2],
        samples: u32,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let draw = || {
            let view = self.view(camera, size)?;
            reference::render(&self.loaded.scene, &view, &ReferenceOptions { samples }, None)
        };
        let image = py.detach(draw).map_err(raised)?;
        array(py, image.width(), image.height(), image.pixels())
    }
}

/// Returns the numbers of samples along x, y and z, and the samples, of an array [z, y, x] of one of the four types.
fn samples_of(array: &Bound<'_, PyAny>) -> PyResult<([u32; 3], Samples)> {
    fn of<T: Element + Copy>(
        array: &Bound<'_, PyAny>,
        samples: fn(Vec<T>) -> Samples,
    ) -> Option<([usize; 3], Samples)> {
        let array: PyReadonlyArray3<'_, T> = array.extract().ok()?;
        let view = array.as_array();
        let (z, y, x) = view.dim();
        Some(([x, y, z], samples(view.iter().copied().collect())))
    }
    let found = of(array, Samples::F32)
        .or_else(|| of(array, Samples::U8))
        .or_else(|| of(array, Samples::U16))
        .or_else(|| of(array, Samples::I16));
    let (dims, samples) = found.ok_or_else(|| {
        PyValueError::new_err("samples: must be a 3-D array of uint8, uint16, int16 or float32")
    })?;
    let long = |_| PyValueError::new_err("samples: must have fewer than 2^32 along each axis");
    let [x, y, z] = dims.map(u32::try_from);
    Ok(([x.map_err(long)?, y.map_err(long)?, z.map_err(long)?], samples))
}

fn places(rows: &PyReadonlyArray2<'_, f64>) -> Vec<DVec3> {
    rows.as_array().rows().into_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect()
}

/// Returns an image as an array [row, column, channel].
fn array<'py, T: Element + Copy>(
    py: Python<'py>,
    width: u32,
    height: u32,
    pixels: &[[T; 4]],
) -> PyResult<Bound<'py, PyArray3<T>>> {
    let numbers = pixels.iter().flatten().copied().collect();
    let array = Array3::from_shape_vec((height as usize, width as usize, 4), numbers);
    Ok(array.map_err(|error| PyRuntimeError::new_err(error.to_string()))?.into_pyarray(py))
}

/// Returns the pixels of an array [row, column, 4], with their width and height.
fn pixels_of<T: Element + Copy>(array: &PyReadonlyArray3<'_, T>) -> PyResult<(u32, u32, Vec<[T; 4]>)> {
    let view = array.as_array();
    let (height, width, channels) = view.dim();
    let sides = (u32::try_from(width), u32::try_from(height));
    let ((Ok(width), Ok(height)), 4) = (sides, channels) else {
        return Err(PyValueError::new_err("image: must be an array of rows, columns and 4 channels"));
    };
    let numbers: Vec<T> = view.iter().copied().collect();
    Ok((width, height, numbers.as_chunks().0.to_vec()))
}

fn image_of(array: &PyReadonlyArray3<'_, f32>) -> PyResult<Image> {
    let (width, height, pixels) = pixels_of(array)?;
    Image::new(width, height, pixels).map_err(raised)
}

/// Compares an image with a truth: rmse, max, bias, p99, p99.9 and the share of pixels that are off by more than 1/255.
#[pyfunction]
fn errors(image: PyReadonlyArray3<'_, f32>, truth: PyReadonlyArray3<'_, f64>) -> PyResult<[f64; 6]> {
    let (width, height, pixels) = pixels_of(&truth)?;
    let truth = ReferenceImage::new(width, height, pixels).map_err(raised)?;
    let ImageErrors { all, above_1_255, .. } =
        ImageErrors::between_f64(&image_of(&image)?, &truth).map_err(raised)?;
    Ok([all.rmse, all.max_abs, all.bias, all.p99, all.p999, above_1_255])
}

/// Returns the bytes of an image as sRGB with straight alpha over a background, row by row.
#[pyfunction]
fn srgb8(image: PyReadonlyArray3<'_, f32>, background: [f64; 4]) -> PyResult<Vec<u8>> {
    Ok(io::to_srgb8(&image_of(&image)?, background))
}

/// Returns the PNG that `write_image` writes.
#[pyfunction]
fn png(image: PyReadonlyArray3<'_, f32>, background: [f64; 4]) -> PyResult<Vec<u8>> {
    let mut bytes = Vec::new();
    io::encode_png(&mut bytes, &image_of(&image)?, background)?;
    Ok(bytes)
}

/// Writes a PNG or EXR file.
#[pyfunction]
fn write_image(path: PathBuf, image: PyReadonlyArray3<'_, f32>, background: [f64; 4]) -> PyResult<()> {
    io::write_image(path, &image_of(&image)?, background).map_err(raised)
}

/// Returns name, driver and version of Vulkan of the device that draws.
#[pyfunction]
fn device(py: Python<'_>) -> PyResult<(String, String, String)> {
    let gpu = py.detach(gpu).map_err(raised)?;
    let report = gpu.report();
    Ok((report.name.clone(), report.driver.clone(), report.api.clone()))
}

/// An option of a technique: name, allowed values and default.
type OptionParts = (&'static str, String, String);

/// Returns the options of each technique.
#[pyfunction]
fn techniques() -> Vec<(&'static str, Vec<OptionParts>)> {
    let options = |method: Method| {
        method.options().iter().map(|info| (info.key, info.values.clone(), info.default.clone())).collect()
    };
    Method::ALL.into_iter().map(|method| (method.name(), options(method))).collect()
}

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::{Scene, device, errors, png, srgb8, techniques, write_image};
}
