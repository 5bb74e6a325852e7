//! A scene with its data on the device.

use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::shader::{self, Segments};
use crate::gpu::{Buffer, Gpu, Image, Sampled};
use crate::num::f32_of;
use crate::resident::bricks::{BrickRanges, Bricks, Telling, greatest_scalars};
use crate::resident::cache::Cache;
use crate::resident::clock::{Clock, UploadTimes};
use crate::resident::light;
use crate::resident::mesh::{DrawnPrimitives, MeshData, Primitives, drawn_cells};
use crate::resident::mesh_parts::MeshParts;
use crate::resident::pages::{PagePool, PageTable, is_one_page};
use crate::resident::splats::trained::TrainedSet;
use crate::resident::splats::{Place, SplatNeeds, SplatSet};
use crate::resident::surfaces::SurfaceData;
use crate::resident::tables::{Integrator, Knots, SegmentOptions, TABLE_FORMAT, Table};
use crate::resident::visible_scalars::nonzero_ranges;
use crate::resident::volume::{Form, Layout, Volume};
use crate::scene::grid::diagonal;
use crate::scene::{
    Data, Grid, Kernel, Kernels, Mode, Model, Samples, Scene, Surface, TetScalars, Tets, TransferFunction,
};

/// A scene with its data on the device.
///
/// Data is uploaded when a technique first needs it, once for each form that techniques ask for. The type is `Send` and
/// `Sync`: if several threads ask for the same data at once, the first uploads it.
#[derive(Debug)]
pub struct GpuScene {
    gpu: Gpu,
    scene: Scene,
    grid: GridData,
    mesh: Arc<MeshData>,
    tables: Tables,
    visible: VisibleData,
    /// Capacities that frames of splats have needed so far.
    pub(crate) splat_needs: Mutex<SplatNeeds>,
    /// Surfaces; `None` where no triangle has an area.
    surfaces: Cache<(), Option<Arc<SurfaceData>>>,
    light: Cache<(), Arc<Buffer>>,
    clock: Clock,
}

/// Data that depends on the grid alone.
#[derive(Clone, Debug, Default)]
struct GridData {
    volumes: Cache<Form, Arc<Volume>>,
    /// Pools of pages, where the device has no room for the whole.
    pools: Cache<Form, Arc<PagePool>>,
    ranges: Cache<(), BrickRanges>,
    /// The greatest scalar of each brick.
    greatest: Cache<(), Bricks>,
}

/// Data that depends on the transfer function and the longest segment.
#[derive(Clone, Debug, Default)]
struct Tables {
    /// A texel of a volume, for bindings that a variant of a shader leaves alone.
    nothing: Cache<(), Arc<Image>>,
    knots: Cache<(), Arc<Knots>>,
    tables: Cache<SegmentOptions, Option<Arc<Table>>>,
}

/// Data that depends on both the data and the transfer function. The bits of floats are keys.
#[derive(Clone, Debug, Default)]
struct VisibleData {
    /// Visible bricks, by margin.
    bricks: Cache<u32, Bricks>,
    /// Page tables, by form and margin; without a margin they tell the greatest scalars.
    pages: Cache<(Form, Option<u32>), Arc<PageTable>>,
    /// Faces or cells that are drawn; with a margin only those of visible cells.
    primitives: Cache<(Primitives, Option<u32>), DrawnPrimitives>,
    /// The same in so many parts.
    parts: Cache<(Primitives, Option<u32>, u32), Arc<MeshParts>>,
    /// Visible kernels, by kernel and the largest thickness of sheets in steps of the data.
    splats: Cache<SplatKey, Arc<SplatSet>>,
    trained: Cache<(), Arc<TrainedSet>>,
}

/// The properties that decide the visible kernels of a scene.
type SplatKey = (Kernel, Model, [u64; 4], Place);

fn splat_key(kernels: &Kernels, thickness: f64, place: Place) -> SplatKey {
    let Kernels { kernel, sigma, cut, model, least } = *kernels;
    (kernel, model, [sigma, cut, least, whole_steps(thickness)].map(f64::to_bits), place)
}

/// Returns a thickness of sheets rounded up to a power of two, so that not every thickness of a sweep uploads.
fn whole_steps(thickness: f64) -> f64 {
    thickness.log2().ceil().max(0.0).exp2()
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
            grid: GridData::default(),
            mesh: Arc::default(),
            tables: Tables::default(),
            visible: VisibleData::default(),
            splat_needs: Mutex::default(),
            surfaces: Cache::default(),
            light: Cache::default(),
            clock: Clock::default(),
        }
    }

    /// Returns the same data and kernels with another transfer function.
    ///
    /// Samples on the device are shared. Infinite ones count as the ends of the transfer function: a whole grid with some is uploaded again, and
    /// of a grid in pages those that contain some are read again. The tables of the transfer function are uploaded when they are first needed.
    #[must_use]
    pub fn with_transfer(&self, transfer: TransferFunction) -> Arc<Self> {
        // Infinite samples were uploaded as the ends of the old transfer function; a pool tells which.
        let shared = self.scene.grid().is_none_or(|grid| grid.infinite_count() == 0);
        let pools = || GridData { pools: self.grid.pools.clone(), ..GridData::default() };
        let grid = if shared { self.grid.clone() } else { pools() };
        let finite = |mesh: &Tets| mesh.scalars().values().iter().all(|s| !s.is_infinite());
        let mesh = if self.scene.mesh().is_none_or(finite) {
            Arc::clone(&self.mesh)
        } else {
            Arc::new(self.mesh.with_other_scalars())
        };
        let scene = Scene { transfer, ..self.scene.clone() };
        let surfaces = self.surfaces.clone();
        Arc::new(Self { grid, mesh, surfaces, ..Self::unshared(&self.gpu, scene) })
    }

    /// Returns the same mesh with other scalars and their transfer function. Points and topology on the device are
    /// shared.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if the scene holds no mesh, or as [`Tets::with_scalars`].
    pub fn with_scalars(&self, scalars: TetScalars, transfer: TransferFunction) -> Result<Arc<Self>> {
        let Some(mesh) = self.scene.mesh() else { return Err(self.not_held("with_scalars", "a mesh")) };
        let mesh = mesh.clone().with_scalars(scalars)?;
        let scene = Scene { data: mesh.into(), transfer, ..self.scene.clone() };
        let mesh = Arc::new(self.mesh.with_other_scalars());
        let surfaces = self.surfaces.clone();
        Ok(Arc::new(Self { mesh, surfaces, ..Self::unshared(&self.gpu, scene) }))
    }

    /// Returns the same grid with other samples of any type, such as the next step of a time series, as
    /// [`Self::with_data`] does.
    ///
    /// # Errors
    ///
    /// As [`Grid::with_samples`]; [`Error::Invalid`] where the scene holds no grid.
    pub fn with_samples(&self, samples: Samples) -> Result<Arc<Self>> {
        let Some(grid) = self.scene.grid() else { return Err(self.not_held("with_samples", "a grid")) };
        self.with_data(grid.with_samples(samples)?)
    }

    /// Returns the same scene with other data, such as the next step of a time series; uploads nothing yet.
    ///
    /// Pipelines are shared; so are tables where the size of the data is equal, and the topology of a mesh with equal
    /// points and cells. Plans must be prepared for the new scene; another thread can do that while frames of the old
    /// one are in flight.
    ///
    /// # Errors
    ///
    /// As [`Scene::with_kernels`] and [`Scene::with_mode`].
    pub fn with_data(&self, data: impl Into<Data>) -> Result<Arc<Self>> {
        let Scene { data: own, transfer, kernels, surfaces, mode, rule } = &self.scene;
        let mut scene = Scene::new(data, transfer.clone()).with_mode(*mode)?.with_surfaces(surfaces.clone());
        scene.rule = *rule;
        if let Some(kernels) = kernels {
            scene = scene.with_kernels(*kernels)?;
        }
        let mesh = match (own, &scene.data) {
            (Data::Mesh(own), Data::Mesh(other))
                if own.points() == other.points() && own.cells() == other.cells() =>
            {
                Arc::new(self.mesh.with_other_scalars())
            }
            _ => Arc::default(),
        };
        let mut other = Self { mesh, surfaces: self.surfaces.clone(), ..Self::unshared(&self.gpu, scene) };
        if let (Ok(own), Ok(length)) = (self.longest_segment(), other.longest_segment())
            && own == length
        {
            other.tables = self.tables.clone();
        }
        Ok(Arc::new(other))
    }

    /// Returns the scene with the overview of a grid whose samples are read on demand, for pictures until the grid itself is drawn; the scene
    /// itself where its data are in memory. Its error has no bound: what no sample of the overview shows is not there.
    ///
    /// # Errors
    ///
    /// Those of [`Self::with_data`].
    pub fn overview(self: &Arc<Self>) -> Result<Arc<Self>> {
        match &self.scene.data {
            Data::Grid(grid) if grid.is_on_demand() => self.with_data(grid.overview().into_owned()),
            _ => Ok(Arc::clone(self)),
        }
    }

    /// Returns the same scene with other surfaces, such as surfaces that move. All other data on the device is shared;
    /// plans must be prepared for the new scene.
    #[must_use]
    pub fn with_surfaces(&self, surfaces: Vec<Surface>) -> Arc<Self> {
        Arc::new(self.sharing(Scene { surfaces, ..self.scene.clone() }))
    }

    /// Returns the same scene with another mode, such as a light that moves. All data on the device is shared; plans must be
    /// prepared for the new scene.
    ///
    /// # Errors
    ///
    /// As [`Scene::with_mode`].
    pub fn with_mode(&self, mode: Mode) -> Result<Arc<Self>> {
        let scene = self.scene.clone().with_mode(mode)?;
        Ok(Arc::new(Self { surfaces: self.surfaces.clone(), ..self.sharing(scene) }))
    }

    /// Returns the same scene with its field reconstructed by other kernels. All data on the device is shared but the kernels; plans must be
    /// prepared for the new scene.
    ///
    /// # Errors
    ///
    /// As [`Scene::with_kernels`].
    pub fn with_kernels(&self, kernels: Kernels) -> Result<Arc<Self>> {
        let scene = self.scene.clone().with_kernels(kernels)?;
        Ok(Arc::new(Self { surfaces: self.surfaces.clone(), ..self.sharing(scene) }))
    }

    /// Returns a scene of the same data and transfer function, which shares what is on the device but surfaces.
    fn sharing(&self, scene: Scene) -> Self {
        Self {
            grid: self.grid.clone(),
            mesh: Arc::clone(&self.mesh),
            tables: self.tables.clone(),
            visible: self.visible.clone(),
            splat_needs: Mutex::new(*self.splat_needs.lock().unwrap_or_else(PoisonError::into_inner)),
            ..Self::unshared(&self.gpu, scene)
        }
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
        self.visible.primitives.get((kind, margin.map(f32::to_bits)), || {
            self.clock.upload(|| {
                DrawnPrimitives::new(&self.gpu, mesh, &self.mesh, &self.scene.transfer, kind, margin)
            })
        })
    }

    /// Returns whether the device has the faces or cells that [`Self::primitives`] returns.
    pub(crate) fn has_primitives(&self, kind: Primitives, margin: Option<f32>) -> bool {
        self.visible.primitives.has(&(kind, margin.map(f32::to_bits)))
    }

    /// Forgets them, so that the device has room for parts, and the parts where there were too few.
    pub(crate) fn forget_primitives(&self, kind: Primitives, margin: Option<f32>, parts: u32) {
        let margin = margin.map(f32::to_bits);
        self.visible.primitives.forget(&(kind, margin));
        self.visible.parts.forget(&(kind, margin, parts));
    }

    /// Returns the number of cells of the mesh that are drawn.
    pub(crate) fn drawn_cell_count(&self, margin: Option<f32>) -> Result<u64> {
        let drawn = drawn_cells(self.mesh()?, &self.scene.transfer, margin);
        Ok(drawn.into_iter().map(u64::from).sum())
    }

    /// Returns the faces or cells of the mesh that are drawn, in `count` parts, as [`Self::primitives`] takes `margin`.
    pub(crate) fn mesh_parts(
        &self,
        kind: Primitives,
        margin: Option<f32>,
        count: u32,
    ) -> Result<Arc<MeshParts>> {
        let mesh = self.mesh()?;
        self.visible.parts.get((kind, margin.map(f32::to_bits), count), || {
            self.clock.upload(|| {
                MeshParts::new(mesh, &self.mesh, &self.scene.transfer, kind, margin, count).map(Arc::new)
            })
        })
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
    pub(crate) fn splats(&self, kernels: &Kernels, thickness: f64, place: Place) -> Result<Arc<SplatSet>> {
        self.visible.splats.get(splat_key(kernels, thickness, place), || {
            self.clock
                .upload(|| SplatSet::new(&self.gpu, &self.scene, kernels, whole_steps(thickness), place))
        })
    }

    /// Forgets what [`Self::splats`] has returned.
    pub(crate) fn forget_splats(&self, kernels: &Kernels, thickness: f64, place: Place) {
        self.visible.splats.forget(&splat_key(kernels, thickness, place));
    }

    /// Returns the trained splats of the scene.
    pub(crate) fn trained(&self) -> Result<Arc<TrainedSet>> {
        let Some(splats) = self.scene.gaussians() else {
            let why = format!("draws trained splats: the scene holds a {}", self.scene.data.kind());
            return Err(Error::invalid("technique", why));
        };
        self.visible
            .trained
            .get((), || self.clock.upload(|| TrainedSet::new(&self.gpu, splats).map(Arc::new)))
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
        let form = Form::new(&self.gpu, grid, layout, for_filter, mip)?;
        self.grid.volumes.get(form, || {
            self.clock.upload(|| Volume::new(&self.gpu, grid, self.scene.transfer.domain(), form))
        })
    }

    /// Returns the form of the pages in which the device keeps the samples that a technique reads; `None` where it has room for all.
    pub(crate) fn pages_of(&self, layout: Layout, for_filter: bool, mip: bool) -> Result<Option<Form>> {
        let grid = self.grid()?;
        let form = Form::new(&self.gpu, grid, layout, for_filter, mip)?;
        let pages = Form::of_pages(&self.gpu, grid, layout, for_filter)?;
        if grid.is_on_demand() || self.gpu.page_pool().is_some() {
            return Ok(Some(pages));
        }
        let fits = is_one_page(grid)
            || self.grid.volumes.has(&form)
            || (!self.grid.pools.has(&pages) && form.fits(&self.gpu, grid));
        Ok((!fits).then_some(pages))
    }

    /// Returns the pool of the grid's pages.
    pub(crate) fn page_pool(&self, form: Form) -> Result<Arc<PagePool>> {
        let grid = self.grid()?;
        self.grid.pools.get(form, || {
            let left = self.gpu.memory_left();
            let bytes = self.gpu.page_pool().map_or(left / 8 * 5, |bytes| bytes.min(left / 8 * 7));
            PagePool::new(&self.gpu, grid, form, bytes)
        })
    }

    /// Returns the page table, with extinction smeared by `margin` scalars; without a margin bricks tell their greatest scalars.
    pub(crate) fn page_table(&self, form: Form, margin: Option<f32>) -> Result<Arc<PageTable>> {
        let pool = self.page_pool(form)?;
        self.visible.pages.get((form, margin.map(f32::to_bits)), || {
            let telling = match margin {
                Some(margin) => Telling::Visible { scalars: nonzero_ranges(&self.scene.transfer), margin },
                None => Telling::Greatest,
            };
            pool.table(telling, self.scene.transfer.domain())
        })
    }

    /// Returns the table that an integrator reads; `None` if it reads none.
    pub(crate) fn table(&self, options: &SegmentOptions) -> Result<Option<Arc<Table>>> {
        let (integrator, size) = (options.integrator, options.table_size());
        self.tables.tables.get(SegmentOptions { integrator, table: Some(size) }, || {
            self.clock.tables(|| {
                Table::new(&self.gpu, &self.scene.transfer, integrator, size, || self.longest_segment())
            })
        })
    }

    /// Returns the inputs of shaders that integrate segments. The sampler interpolates a full table where `hardware` filtering is
    /// wanted and the device can. `unread` is bound in the place of a table that no variant reads; else that is a texel of its own.
    pub(crate) fn segments(
        &self,
        options: &SegmentOptions,
        hardware: bool,
        unread: Option<Sampled>,
    ) -> Result<Segments> {
        let linear = vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        let table_filter = hardware
            && options.integrator == Integrator::Full
            && self.gpu.image_features(TABLE_FORMAT).contains(linear);
        let filter = if table_filter { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
        let table = self.table(options)?;
        let table_head = match &table {
            Some(table) => table.buffer.read(),
            None => self.knots()?.buffer.read(),
        };
        let table = match (table.as_ref().and_then(|table| table.image.as_ref()), unread) {
            (Some(image), _) => image.sampled(filter),
            (None, Some(unread)) => unread,
            (None, None) => self.nothing()?,
        };
        let (integrator, placed) = (options.integrator.code(), matches!(self.scene.mode, Mode::Lit(_)));
        Ok(Segments { table, table_head, integrator, table_filter, placed })
    }

    /// Returns a texel of a volume, for bindings that a variant of a shader leaves alone.
    fn nothing(&self) -> Result<Sampled> {
        let image = self.tables.nothing.get((), || Table::nothing(&self.gpu))?;
        Ok(image.sampled(vk::Filter::NEAREST))
    }

    /// Returns the knots of the transfer function.
    pub(crate) fn knots(&self) -> Result<Arc<Knots>> {
        self.tables.knots.get((), || self.clock.tables(|| Knots::new(&self.gpu, &self.scene.transfer)))
    }

    /// Returns the visible bricks, with extinction smeared by `margin` scalars.
    pub(crate) fn bricks(&self, margin: f32) -> Result<Bricks> {
        let grid = self.grid()?;
        self.visible.bricks.get(margin.to_bits(), || {
            let ranges =
                self.grid.ranges.get((), || self.clock.upload(|| BrickRanges::new(&self.gpu, grid)))?;
            ranges.visible(&self.gpu, &self.clock, &self.scene.transfer, margin)
        })
    }

    /// Returns the greatest scalar of each brick.
    pub(crate) fn greatest_scalars(&self) -> Result<Bricks> {
        let grid = self.grid()?;
        self.grid.greatest.get((), || self.clock.upload(|| greatest_scalars(&self.gpu, grid)))
    }

    /// Returns the light of the scene for the shaders of grids; `unread` stands in where it is not lit.
    pub(crate) fn lighting(&self, unread: &Arc<Buffer>) -> Result<shader::Lighting> {
        let Mode::Lit(lighting) = &self.scene.mode else {
            return Ok(shader::Lighting { light: unread.uniform(), lit: false });
        };
        let light = self.light.get((), || light::upload(&self.gpu, self.grid()?, lighting))?;
        Ok(shader::Lighting { light: light.uniform(), lit: true })
    }

    /// Returns the surfaces of the scene; `None` where no triangle has an area.
    pub(crate) fn surfaces(&self) -> Result<Option<Arc<SurfaceData>>> {
        let Scene { surfaces, data, .. } = &self.scene;
        self.surfaces.get((), || SurfaceData::new(&self.gpu, surfaces, &data.corners()))
    }

    /// Returns the largest colour channel of the scene, at least 1: a bound of the colour that a ray misses when it
    /// ends early.
    pub(crate) fn max_colour(&self) -> f64 {
        let surfaces = self.scene.surfaces.iter().flat_map(|surface| surface.colour()[..3].to_vec());
        let emitted = self.scene.transfer.max_colour();
        let seen =
            if let Mode::Lit(lighting) = &self.scene.mode { lighting.brightest(emitted) } else { emitted };
        surfaces.fold(seen.max(1.0), f64::max)
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

    fn not_held(&self, call: &str, what: &str) -> Error {
        Error::invalid(
            call,
            format!("takes the scene of {what}: this one holds a {}", self.scene.data.kind()),
        )
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
