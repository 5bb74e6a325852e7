//! A scene with its data on the device.

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Image};
use crate::num::f32_of;
use crate::resident::bricks::BrickRanges;
use crate::resident::clock::{Clock, UploadTimes};
use crate::resident::mesh::{DrawnPrimitives, MeshData, Primitives, drawn_cells_buffer, drawn_faces_buffer};
use crate::resident::splats::{SplatNeeds, SplatSet};
use crate::resident::surfaces::SurfaceData;
use crate::resident::tables::{Integrator, Knots, SegmentOptions, Table, Tables};
use crate::resident::visible_scalars::nonzero_ranges;
use crate::resident::volume::{Form, Layout, Volume, Volumes};
use crate::scene::grid::diagonal;
use crate::scene::{Grid, Kernels, Samples, Scene, Surface, TetScalars, Tets, TransferFunction};

/// Copies the contents of a place, for another scene.
fn copied<T: Clone>(place: &Mutex<T>) -> Mutex<T> {
    Mutex::new(place.lock().unwrap_or_else(PoisonError::into_inner).clone())
}

/// A scene with its data on the device.
///
/// Data is uploaded when a technique first needs it, once for each form that techniques ask for. The type is `Send` and
/// `Sync`: if several threads ask for the same data at once, the first uploads it.
#[derive(Debug)]
pub struct GpuScene {
    gpu: Gpu,
    scene: Scene,
    data: Arc<GridData>,
    mesh: Arc<MeshData>,
    primitives: Mutex<Vec<(Choice, DrawnPrimitives)>>,
    tables: Arc<Tables>,
    bricks: Mutex<Vec<(f32, Arc<Buffer>)>>,
    splats: Mutex<Vec<(SplatChoice, Arc<SplatSet>)>>,
    /// Capacities that frames of splats have needed so far.
    pub(crate) splat_needs: Mutex<SplatNeeds>,
    surfaces: SurfacePlace,
    clock: Clock,
}

/// Surfaces on the device: `None` before they are first asked for, `Some(None)` where no triangle has an area.
type SurfacePlace = Arc<Mutex<Option<Option<Arc<SurfaceData>>>>>;

/// Faces or cells; with a margin only those of visible cells.
type Choice = (Primitives, Option<f32>);

/// Kernels, and the largest thickness of sheets, in steps of the data.
type SplatChoice = (Kernels, f64);

/// Data that depends only on the grid; scenes that differ in the transfer function share it.
#[derive(Debug, Default)]
struct GridData {
    volumes: Volumes,
    ranges: BrickRanges,
}

impl GpuScene {
    /// Takes a scene for a device; uploads nothing yet.
    #[must_use]
    pub fn new(gpu: &Gpu, scene: Scene) -> Arc<Self> {
        Arc::new(Self::unshared(gpu, scene))
    }

    fn unshared(gpu: &Gpu, scene: Scene) -> Self {
        Self {
            gpu: gpu.clone(),
            scene,
            data: Arc::default(),
            mesh: Arc::default(),
            primitives: Mutex::default(),
            tables: Arc::default(),
            bricks: Mutex::default(),
            splats: Mutex::default(),
            splat_needs: Mutex::default(),
            surfaces: Arc::default(),
            clock: Clock::default(),
        }
    }

    /// Returns the same data and kernels with another transfer function.
    ///
    /// Samples on the device are shared; the tables of the transfer function are uploaded when they are first needed.
    #[must_use]
    pub fn with_transfer(&self, transfer: TransferFunction) -> Arc<Self> {
        // Infinite samples were uploaded as the ends of the old transfer function.
        let shared = self.scene.grid().is_none_or(|grid| grid.infinite_count() == 0);
        let data = if shared { Arc::clone(&self.data) } else { Arc::default() };
        let finite = |mesh: &Tets| mesh.scalars().values().iter().all(|s| !s.is_infinite());
        let mesh = if self.scene.mesh().is_none_or(finite) {
            Arc::clone(&self.mesh)
        } else {
            Arc::new(MeshData::with_shape(&self.mesh.shape))
        };
        let scene = Scene { transfer, ..self.scene.clone() };
        let surfaces = Arc::clone(&self.surfaces);
        Arc::new(Self { data, mesh, surfaces, ..Self::unshared(&self.gpu, scene) })
    }

    /// Returns the same mesh with other scalars and their transfer function. Points and topology on the device are
    /// shared.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the scene holds no mesh, or as [`Tets::with_scalars`].
    pub fn with_scalars(&self, scalars: TetScalars, transfer: TransferFunction) -> Result<Arc<Self>> {
        let mesh = self.mesh()?.clone().with_scalars(scalars)?;
        let mesh_data = Arc::new(MeshData::with_shape(&self.mesh.shape));
        let scene = Scene { data: mesh.into(), transfer, ..self.scene.clone() };
        let surfaces = Arc::clone(&self.surfaces);
        Ok(Arc::new(Self { mesh: mesh_data, surfaces, ..Self::unshared(&self.gpu, scene) }))
    }

    /// Returns the same grid with other samples of any type, such as the next step of a time series; uploads nothing
    /// yet.
    ///
    /// Pipelines, knots and tables do not depend on samples, and are shared. Plans must be prepared for the new scene;
    /// another thread can do that while frames of the old one are in flight.
    ///
    /// # Errors
    ///
    /// As [`Grid::with_samples`]; [`Error::Invalid`] where the scene holds no grid.
    pub fn with_samples(&self, samples: Samples) -> Result<Arc<Self>> {
        let grid = self.grid()?.with_samples(samples)?;
        let scene = Scene { data: grid.into(), ..self.scene.clone() };
        Ok(Arc::new(Self {
            tables: Arc::clone(&self.tables),
            surfaces: Arc::clone(&self.surfaces),
            ..Self::unshared(&self.gpu, scene)
        }))
    }

    /// Returns the same scene with other surfaces, such as surfaces that move. All other data on the device is shared;
    /// plans must be prepared for the new scene.
    #[must_use]
    pub fn with_surfaces(&self, surfaces: Vec<Surface>) -> Arc<Self> {
        Arc::new(Self {
            data: Arc::clone(&self.data),
            mesh: Arc::clone(&self.mesh),
            primitives: copied(&self.primitives),
            tables: Arc::clone(&self.tables),
            bricks: copied(&self.bricks),
            splats: copied(&self.splats),
            splat_needs: copied(&self.splat_needs),
            ..Self::unshared(&self.gpu, Scene { surfaces, ..self.scene.clone() })
        })
    }

    /// Returns the data of the mesh on the device.
    pub(crate) fn mesh_data(&self) -> Arc<MeshData> {
        Arc::clone(&self.mesh)
    }

    /// Returns the faces or cells of the mesh that are drawn.
    ///
    /// With `margin` these are only those of visible cells; it is the distance, in scalars, by which an integrator
    /// smears extinction.
    pub(crate) fn primitives(&self, kind: Primitives, margin: Option<f32>) -> Result<DrawnPrimitives> {
        let mesh = self.mesh()?;
        let mut known = self.primitives.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known.iter().find(|(key, _)| *key == (kind, margin)) {
            return Ok(found.clone());
        }
        let transfer = &self.scene.transfer;
        let ranges = nonzero_ranges(transfer);
        let seen = margin.map(|margin| (ranges.as_slice(), margin));
        let _time = self.clock.upload();
        let made = match kind {
            Primitives::Cells => drawn_cells_buffer(&self.gpu, mesh, transfer.domain(), seen)?,
            Primitives::Faces => {
                let topology = self.mesh.topology(mesh)?;
                drawn_faces_buffer(&self.gpu, mesh, &topology, transfer.domain(), seen)?
            }
        };
        known.push(((kind, margin), made.clone()));
        Ok(made)
    }

    /// Returns the distance, in scalars, by which an integrator smears extinction.
    pub(crate) fn margin(&self, segments: Option<&SegmentOptions>) -> f32 {
        let [first, last] = self.scene.transfer.domain();
        let size = segments.map_or(0, SegmentOptions::table_size);
        let rounding = 1e-6 * first.abs().max(last.abs());
        let smear = match segments.map(|segments| segments.integrator) {
            None | Some(Integrator::Midpoint | Integrator::Smoke) => 0.0,
            // Interpolated scalars are rounded.
            Some(Integrator::Exact) => rounding,
            Some(Integrator::Integral | Integrator::Full) => {
                (2.0 * (last - first) / f64::from(size - 1)).max(rounding)
            }
        };
        f32_of(smear)
    }

    /// Returns the visible kernels of the scene, for sheets of at most `thickness` steps of the data.
    pub(crate) fn splats(&self, kernels: &Kernels, thickness: f64) -> Result<Arc<SplatSet>> {
        // Rounded up to a power of two, so that not every thickness of a sweep uploads.
        let thickness = thickness.log2().ceil().max(0.0).exp2();
        let mut known = self.splats.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known.iter().find(|(key, _)| *key == (*kernels, thickness)) {
            return Ok(Arc::clone(found));
        }
        let _time = self.clock.upload();
        let slab = thickness * SplatSet::step(&self.scene)?;
        let made = Arc::new(SplatSet::new(&self.gpu, &self.scene, kernels, slab)?);
        known.push(((*kernels, thickness), Arc::clone(&made)));
        Ok(made)
    }

    /// Returns an upper bound of the length of a segment, in world units.
    fn longest_segment(&self) -> Result<f64> {
        if let Some(mesh) = self.scene.mesh() {
            let [low, high] = mesh.bounds();
            return Ok((high - low).length());
        }
        self.grid().map(diagonal)
    }

    /// Returns the samples, encoded for exact fetches or for the sampler's filter, with mip levels or without.
    pub(crate) fn volume(&self, layout: Layout, for_filter: bool, mip: bool) -> Result<Arc<Volume>> {
        let grid = self.grid()?;
        let ends = self.scene.transfer.domain();
        self.data.volumes.volume(&self.gpu, &self.clock, grid, ends, Form { layout, for_filter, mip })
    }

    /// Returns the table that an integrator reads; `None` if it reads none.
    pub(crate) fn table(&self, options: &SegmentOptions) -> Result<Option<Arc<Table>>> {
        let longest = || self.longest_segment();
        self.tables.table(&self.gpu, &self.clock, &self.scene.transfer, options, longest)
    }

    /// Returns one texel, for the binding of shaders that read no table.
    pub(crate) fn no_table(&self) -> Result<Arc<Image>> {
        self.tables.no_table(&self.gpu)
    }

    /// Returns the knots of the transfer function.
    pub(crate) fn knots(&self) -> Result<Arc<Knots>> {
        self.tables.knots(&self.gpu, &self.clock, &self.scene.transfer)
    }

    /// Returns one word for each brick: 0 where nothing is visible, with extinction smeared by `margin` scalars.
    pub(crate) fn bricks(&self, margin: f32) -> Result<Arc<Buffer>> {
        let (grid, transfer) = (self.grid()?, &self.scene.transfer);
        self.data.ranges.visible(&self.gpu, &self.clock, grid, transfer, &self.bricks, margin)
    }

    /// Returns the surfaces of the scene; `None` where no triangle has an area.
    pub(crate) fn surfaces(&self) -> Result<Option<Arc<SurfaceData>>> {
        let mut place = self.surfaces.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = &*place {
            return Ok(found.clone());
        }
        let made =
            SurfaceData::new(&self.gpu, &self.scene.surfaces, &self.scene.data.corners())?.map(Arc::new);
        *place = Some(made.clone());
        Ok(made)
    }

    /// Returns the largest colour channel of the scene, at least 1: a bound of the colour that a ray misses when it
    /// ends early.
    pub(crate) fn max_colour(&self) -> f64 {
        let surfaces = self.scene.surfaces.iter().flat_map(|surface| surface.colour()[..3].to_vec());
        surfaces.fold(self.scene.transfer.max_colour().max(1.0), f64::max)
    }

    /// Returns the scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the grid.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] where the scene holds something else.
    pub(crate) fn grid(&self) -> Result<&Grid> {
        self.scene.grid().ok_or_else(|| self.not_drawn("grids"))
    }

    /// Returns the mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] where the scene holds something else.
    pub(crate) fn mesh(&self) -> Result<&Tets> {
        self.scene.mesh().ok_or_else(|| self.not_drawn("meshes"))
    }

    fn not_drawn(&self, what: &str) -> Error {
        Error::invalid("technique", format!("draws {what}: the scene holds a {}", self.scene.data.kind()))
    }

    /// Returns the times that uploads have taken.
    #[must_use]
    pub fn times(&self) -> UploadTimes {
        self.clock.times()
    }

    /// Returns the device.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }
}
