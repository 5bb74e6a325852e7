//! A scene on the device: uploaded once, in the encodings that techniques ask for.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::shader::{
    BINDING_BRICKS, BINDING_RANGES, BINDING_VISIBLE, BRICKS_COMPUTE, TABLE_BINS_PER_ROW,
};
use crate::gpu::{
    Buffer, BufferUse, Commands, ComputeDesc, Descriptors, Gpu, Image, ImageDesc, Recorder, Resource,
};
use crate::interface::{BricksPush, CumulativeBin, TableHead};
use crate::num::{self, f32_of};
use crate::optics::DeviceKnots;
use crate::optics::cumulative::Cumulative;
use crate::optics::full::Full;
use crate::scene::{Grid, Kernels, Rescale, Samples, Scene, Surface, TetScalars, Tets, TransferFunction};

use super::bricks::{MinMax, nonzero_ranges};
use super::grid_options::{Integrator, SegmentOptions};
use super::mesh_data::{DrawnPrimitives, MeshData, drawn_cells_buffer, drawn_faces_buffer};
use super::mesh_frame::Primitives;
use super::mips;
use super::splat_data::SplatSet;
use super::splat_frame::SplatNeeds;
use super::surfaces::SurfaceData;

/// Format of tables.
pub(crate) const TABLE_FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// Octaves of thickness in a 2-D table: from the domain's diagonal down to a two-thousandth of it. Thinner
/// segments take the last one's colour.
const LAYERS: u32 = 12;

/// What a place holds so far, for another scene.
fn copied<T: Clone>(place: &Mutex<T>) -> Mutex<T> {
    Mutex::new(place.lock().unwrap_or_else(PoisonError::into_inner).clone())
}

/// A scene with what of it lies on the device. Data is uploaded when a technique first needs it, once for
/// each form in which techniques ask for it.
///
/// `Send` and `Sync`: what several threads ask for at once is uploaded by the first.
#[derive(Debug)]
pub struct GpuScene {
    gpu: Gpu,
    scene: Scene,
    data: Arc<GridData>,
    mesh: Arc<MeshData>,
    primitives: Mutex<Vec<(Choice, DrawnPrimitives)>>,
    /// Stands for a table where an integrator reads none.
    no_table: Mutex<Option<Arc<Image>>>,
    knots: Mutex<Option<Arc<Knots>>>,
    tables: Mutex<Vec<Arc<Table>>>,
    bricks: Mutex<Vec<(f32, Arc<Buffer>)>>,
    splats: Mutex<Vec<(SplatChoice, Arc<SplatSet>)>>,
    /// What frames of splats have needed so far.
    pub(crate) splat_needs: Mutex<SplatNeeds>,
    surfaces: SurfacePlace,
    times: Mutex<UploadTimes>,
}

/// Surfaces, once they have been looked for; none where there is no triangle.
type SurfacePlace = Arc<Mutex<Option<Option<Arc<SurfaceData>>>>>;

/// Faces or cells; with a margin those alone that show something.
type Choice = (Primitives, Option<f32>);

/// Kernels, and how thick sheets may be at most, in the data's steps.
type SplatChoice = (Kernels, f64);

/// What the grid alone decides: scenes that differ in the transfer function share it.
#[derive(Debug, Default)]
struct GridData {
    volumes: Mutex<Vec<Arc<Volume>>>,
    /// Ranges of the bricks, and their number.
    ranges: Mutex<Option<(Arc<Buffer>, u32)>>,
}

/// Where samples lie on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// One 3D image.
    Volume,
    /// An array of 2D slices perpendicular to an axis; the other two follow it cyclically.
    Stack(usize),
}

/// A table of the transfer function, for segments.
#[derive(Debug)]
pub(crate) struct Table {
    options: SegmentOptions,
    /// Its head.
    pub(crate) buffer: Arc<Buffer>,
    /// Its bins or nodes.
    pub(crate) image: Arc<Image>,
}

/// Milliseconds that a scene's way to the device has taken so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct UploadTimes {
    /// Samples, and the ranges of bricks.
    pub upload: f64,
    /// Tables of the transfer function, and which bricks it makes visible.
    pub tables: f64,
}

/// How samples are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    /// 8-bit normalised.
    R8,
    /// 16-bit normalised; 8-bit samples are widened, signed ones shifted.
    R16,
    /// 32-bit float.
    R32f,
}

/// The grid's samples as an image.
#[derive(Debug)]
pub(crate) struct Volume {
    pub(crate) image: Arc<Image>,
    encoding: Encoding,
    layout: Layout,
    /// Value of a texel: `scale * texel + offset`.
    pub(crate) scale: f32,
    pub(crate) offset: f32,
    /// Whether the sampler can filter it.
    pub(crate) filterable: bool,
}

/// The transfer function as a buffer.
#[derive(Debug)]
pub(crate) struct Knots {
    pub(crate) buffer: Arc<Buffer>,
    pub(crate) count: u32,
    pub(crate) walk: u32,
    pub(crate) iterations: u32,
}

impl GpuScene {
    /// Takes a scene for a device. Nothing is uploaded yet.
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
            no_table: Mutex::default(),
            knots: Mutex::default(),
            tables: Mutex::default(),
            bricks: Mutex::default(),
            splats: Mutex::default(),
            splat_needs: Mutex::default(),
            surfaces: Arc::default(),
            times: Mutex::default(),
        }
    }

    /// The same data and kernels under another transfer function. What is on the device of the samples is shared; the
    /// transfer function's tables are made when they are first needed.
    #[must_use]
    pub fn with_transfer(&self, transfer: TransferFunction) -> Arc<Self> {
        // Infinite samples were uploaded as the old transfer function's ends.
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

    /// The same mesh with other scalars, and perhaps another transfer function for them. Points and their
    /// connections stay on the device.
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

    /// The same place and transfer function with other samples of a grid, of any type: a step of a time series. Nothing is
    /// uploaded yet. Pipelines, knots and tables do not depend on samples; plans are prepared for the new scene, if the frames in
    /// flight should not wait for the upload on another thread, and then take the place of the old ones.
    ///
    /// # Errors
    ///
    /// As [`Grid::with_samples`]; [`Error::Invalid`] where the scene holds no grid.
    pub fn with_samples(&self, samples: Samples) -> Result<Arc<Self>> {
        let grid = self.grid()?.with_samples(samples)?;
        let scene = Scene { data: grid.into(), ..self.scene.clone() };
        Ok(Arc::new(Self {
            no_table: copied(&self.no_table),
            knots: copied(&self.knots),
            tables: copied(&self.tables),
            surfaces: Arc::clone(&self.surfaces),
            ..Self::unshared(&self.gpu, scene)
        }))
    }

    /// The same scene among other surfaces: those that move, come or go. Everything else that lies on the device is shared; plans
    /// are prepared for the new scene.
    #[must_use]
    pub fn with_surfaces(&self, surfaces: Vec<Surface>) -> Arc<Self> {
        Arc::new(Self {
            data: Arc::clone(&self.data),
            mesh: Arc::clone(&self.mesh),
            primitives: copied(&self.primitives),
            no_table: copied(&self.no_table),
            knots: copied(&self.knots),
            tables: copied(&self.tables),
            bricks: copied(&self.bricks),
            splats: copied(&self.splats),
            splat_needs: copied(&self.splat_needs),
            ..Self::unshared(&self.gpu, Scene { surfaces, ..self.scene.clone() })
        })
    }

    /// What of a mesh lies on the device.
    pub(crate) fn mesh_data(&self) -> Arc<MeshData> {
        Arc::clone(&self.mesh)
    }

    /// The faces or cells of the mesh that are drawn; with `margin` only those of cells that show something, as wide
    /// as an integrator smears extinction, in scalars.
    pub(crate) fn primitives(&self, kind: Primitives, margin: Option<f32>) -> Result<DrawnPrimitives> {
        let mesh = self.mesh()?;
        let mut known = self.primitives.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known.iter().find(|(key, _)| *key == (kind, margin)) {
            return Ok(found.clone());
        }
        let start = Instant::now();
        let transfer = &self.scene.transfer;
        let ranges = nonzero_ranges(transfer);
        let seen = margin.map(|margin| (ranges.as_slice(), margin));
        let made = match kind {
            Primitives::Cells => drawn_cells_buffer(&self.gpu, mesh, transfer.domain(), seen)?,
            Primitives::Faces => {
                let topology = self.mesh.topology(mesh)?;
                drawn_faces_buffer(&self.gpu, mesh, &topology, transfer.domain(), seen)?
            }
        };
        known.push(((kind, margin), made.clone()));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).upload +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(made)
    }

    /// By how much an integrator smears a scalar with extinction, in scalars.
    pub(crate) fn margin(&self, segments: Option<&SegmentOptions>) -> f32 {
        let [first, last] = self.scene.transfer.domain();
        let size = segments.map_or(0, SegmentOptions::table_size);
        let rounding = 1e-6 * first.abs().max(last.abs());
        let smear = match segments.map(|segments| segments.integrator) {
            None | Some(Integrator::Midpoint | Integrator::Smoke) => 0.0,
            // Interpolation rounds.
            Some(Integrator::Exact) => rounding,
            Some(Integrator::Integral | Integrator::Full) => {
                (2.0 * (last - first) / f64::from(size - 1)).max(rounding)
            }
        };
        f32_of(smear)
    }

    /// The kernels of the scene that show something, for sheets no thicker than `thickness`, in the data's steps.
    pub(crate) fn splats(&self, kernels: &Kernels, thickness: f64) -> Result<Arc<SplatSet>> {
        // A power of two, so that a sweep over thicknesses does not upload each time.
        let thickness = thickness.log2().ceil().max(0.0).exp2();
        let mut known = self.splats.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known.iter().find(|(key, _)| *key == (*kernels, thickness)) {
            return Ok(Arc::clone(found));
        }
        let start = Instant::now();
        let slab = thickness * SplatSet::step(&self.scene)?;
        let made = Arc::new(SplatSet::new(&self.gpu, &self.scene, kernels, slab)?);
        known.push(((*kernels, thickness), Arc::clone(&made)));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).upload +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(made)
    }

    /// A table for integrators that read none.
    pub(crate) fn no_table(&self) -> Result<Arc<Image>> {
        let mut place = self.no_table.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = &*place {
            return Ok(Arc::clone(found));
        }
        let desc = ImageDesc::sampled_volume(TABLE_FORMAT, [1; 3]);
        let image = Image::with_data(&self.gpu, "transfer.no-table", &desc, |_, _, memory| memory.fill(0))?;
        *place = Some(Arc::clone(&image));
        Ok(image)
    }

    /// No segment is longer.
    fn longest_segment(&self) -> Result<f64> {
        if let Some(mesh) = self.scene.mesh() {
            let [low, high] = mesh.bounds();
            return Ok((high - low).length());
        }
        self.grid().map(diagonal)
    }

    /// The scene's surfaces; none where it has no triangles.
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

    /// The largest channel of what is seen, 1 at least: what a line that ends early may miss is dimmer than it.
    pub(crate) fn max_colour(&self) -> f64 {
        let surfaces = self.scene.surfaces.iter().flat_map(|surface| surface.colour()[..3].to_vec());
        surfaces.fold(self.scene.transfer.max_colour().max(1.0), f64::max)
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The grid.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] where the scene holds something else.
    pub(crate) fn grid(&self) -> Result<&Grid> {
        self.scene.grid().ok_or_else(|| self.not_drawn("grids"))
    }

    /// The mesh.
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

    /// Time that uploads have taken.
    #[must_use]
    pub fn times(&self) -> UploadTimes {
        *self.times.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The samples, encoded for exact fetches or for the sampler's filter, with mip levels or without.
    pub(crate) fn volume(&self, layout: Layout, for_filter: bool, mip: bool) -> Result<Arc<Volume>> {
        let grid = self.grid()?;
        let encoding = self.encoding(grid.samples(), for_filter, mip)?;
        let (dims, along) = match layout {
            Layout::Volume => (grid.dims(), [true; 3]),
            Layout::Stack(axis) => (turned(grid.dims(), axis), [true, true, false]),
        };
        let levels = if mip { mips::levels(dims, along) } else { 1 };
        let mut volumes = self.data.volumes.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |v: &&Arc<Volume>| {
            v.encoding == encoding && v.layout == layout && v.image.desc().levels == levels
        };
        if let Some(found) = volumes.iter().find(is_it) {
            return Ok(Arc::clone(found));
        }
        let start = Instant::now();
        let [w, h, d] = dims;
        let format = encoding.format();
        let (name, desc) = match layout {
            Layout::Volume => ("volume".to_string(), ImageDesc::sampled_volume(format, dims)),
            Layout::Stack(axis) => {
                (format!("stack.{}", ["x", "y", "z"][axis % 3]), ImageDesc::sampled_stack(format, [w, h], d))
            }
        };
        let desc = desc.with_levels(levels);
        // Before samples are turned and averaged: the device may have no room for them.
        self.gpu.check_image(&name, &desc)?;
        let turned_samples;
        let samples = match layout {
            Layout::Stack(axis) if axis != 2 => {
                turned_samples = turn_samples(grid.samples(), grid.dims(), axis);
                &turned_samples
            }
            _ => grid.samples(),
        };
        let source =
            Source { samples, rescale: grid.rescale(), ends: self.scene.transfer.domain(), encoding };
        let smaller = source.smaller_levels(dims, along, levels);
        let image = Image::with_data(&self.gpu, &name, &desc, |level, first, memory| {
            let plane = num::index(desc.level_extent(level)[0]) * num::index(desc.level_extent(level)[1]);
            match num::index(level).checked_sub(1) {
                None => source.encode(first * plane, memory),
                Some(smaller_level) => encoding.put(&smaller[smaller_level][first * plane..], memory),
            }
        })?;
        let (scale, offset) = value_map(grid, encoding);
        let volume = Arc::new(Volume {
            image,
            encoding,
            layout,
            scale: f32_of(scale),
            offset: f32_of(offset),
            filterable: self.filterable(encoding),
        });
        volumes.push(Arc::clone(&volume));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).upload +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(volume)
    }

    /// The transfer function's table for an integrator; `None` for one that needs none.
    pub(crate) fn table(&self, options: &SegmentOptions) -> Result<Option<Arc<Table>>> {
        let size = options.table_size();
        let options = SegmentOptions { table: Some(size), ..*options };
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = tables.iter().find(|table| table.options == options) {
            return Ok(Some(Arc::clone(found)));
        }
        let start = Instant::now();
        let transfer = &self.scene.transfer;
        let volume = |extent| ImageDesc::sampled_volume(TABLE_FORMAT, extent);
        let (head, sizes, desc, texels) = match options.integrator {
            Integrator::Midpoint | Integrator::Exact | Integrator::Smoke => return Ok(None),
            Integrator::Integral => {
                let Cumulative { head, mut bins } = Cumulative::new(transfer, size);
                let rows = size.div_ceil(TABLE_BINS_PER_ROW);
                bins.resize(num::index(rows * TABLE_BINS_PER_ROW), CumulativeBin::default());
                let texels: Vec<[f32; 4]> = bytemuck::cast_slice(&bins).to_vec();
                let desc = volume([4 * TABLE_BINS_PER_ROW, rows, 1]);
                (head, [f64::from(size), 0.0, 0.0, 0.0], desc, texels)
            }
            Integrator::Full => {
                let longest = self.longest_segment()?;
                let Full { head, size, layers, texels } = Full::new(transfer, size, LAYERS, longest);
                let sizes = [f64::from(size), f64::from(layers), longest, 0.0];
                (head, sizes, volume([size, size, layers]), texels)
            }
        };
        let head = TableHead { size: sizes.map(f32_of), ..head };
        let buffer = Buffer::with_data(&self.gpu, "transfer.table-head", bytemuck::bytes_of(&head))?;
        let plane = num::index(desc.extent[0]) * num::index(desc.extent[1]);
        let image = Image::with_data(&self.gpu, "transfer.table", &desc, |_, first, memory| {
            let bytes = bytemuck::cast_slice(&texels[first * plane..]);
            memory.copy_from_slice(&bytes[..memory.len()]);
        })?;
        let table = Arc::new(Table { options, buffer, image });
        tables.push(Arc::clone(&table));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).tables +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(Some(table))
    }

    /// One word for each brick: 0 where nothing is visible. `margin` widens the scalars with extinction: what
    /// a table smears is visible too.
    pub(crate) fn bricks(&self, margin: f32) -> Result<Arc<Buffer>> {
        let mut known = self.bricks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known.iter().find(|(m, _)| *m == margin) {
            return Ok(Arc::clone(found));
        }
        let (ranges, count) = self.brick_ranges()?;
        let desc = ComputeDesc { shader: &BRICKS_COMPUTE, constants: &[] };
        let pipeline = self.gpu.compute_pipeline("bricks.mark", &desc)?;
        let start = Instant::now();
        let mut scalars = nonzero_ranges(&self.scene.transfer);
        let push = BricksPush { bricks: count, ranges: num::count(scalars.len()), margin };
        if scalars.is_empty() {
            scalars.push([0.0; 2]);
        }
        let scalars = Buffer::with_data(&self.gpu, "transfer.visible", bytemuck::cast_slice(&scalars))?;
        let bricks = Buffer::new(&self.gpu, "bricks", 4 * u64::from(count), BufferUse::ShaderWrite)?;
        let bricks = Arc::new(bricks);
        let resources = [
            (BINDING_RANGES, Resource::Buffer(ranges)),
            (BINDING_VISIBLE, Resource::Buffer(scalars)),
            (BINDING_BRICKS, Resource::Buffer(Arc::clone(&bricks))),
        ];
        let descriptors = Arc::new(Descriptors::new(&self.gpu, &pipeline, &resources)?);
        let groups = count.div_ceil(64);
        // At least this many workgroups are allowed along each side.
        let across = groups.min(65_535);
        let mut commands = Commands::new(&self.gpu)?;
        let mut recorder = Recorder::new(&self.gpu, commands.begin()?, None);
        let push = bytemuck::bytes_of(&push);
        recorder.dispatch("bricks.mark", &pipeline, &descriptors, push, [across, groups.div_ceil(across), 1]);
        recorder.release_buffer(&bricks);
        let (_, keep) = recorder.finish();
        commands.submit(keep, "bricks.mark")?;
        known.push((margin, Arc::clone(&bricks)));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).tables +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(bricks)
    }

    /// Least and greatest scalar of each brick, and the number of bricks.
    fn brick_ranges(&self) -> Result<(Arc<Buffer>, u32)> {
        let mut known = self.data.ranges.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = &*known {
            return Ok(found.clone());
        }
        let start = Instant::now();
        let bricks = MinMax::of(self.grid()?);
        let buffer = Buffer::with_data(&self.gpu, "bricks.ranges", bytemuck::cast_slice(&bricks.ranges))?;
        let made = (buffer, num::count(bricks.ranges.len()));
        *known = Some(made.clone());
        self.times.lock().unwrap_or_else(PoisonError::into_inner).upload +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(made)
    }

    /// The transfer function.
    pub(crate) fn knots(&self) -> Result<Arc<Knots>> {
        let mut knots = self.knots.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = &*knots {
            return Ok(Arc::clone(found));
        }
        let start = Instant::now();
        let table = DeviceKnots::new(&self.scene.transfer);
        let made = Arc::new(Knots {
            buffer: Buffer::with_data(&self.gpu, "transfer.knots", bytemuck::cast_slice(&table.knots))?,
            count: table.count,
            walk: table.walk,
            iterations: table.iterations(),
        });
        *knots = Some(Arc::clone(&made));
        self.times.lock().unwrap_or_else(PoisonError::into_inner).tables +=
            start.elapsed().as_secs_f64() * 1e3;
        Ok(made)
    }

    /// The encoding of samples: their own type where the device has it, widened from 8 bits where the
    /// device's filter would round to them, or mip levels to fewer digits than their samples have.
    fn encoding(&self, samples: &Samples, for_filter: bool, mip: bool) -> Result<Encoding> {
        let own = match samples {
            Samples::U8(_) if mip => Encoding::R16,
            Samples::U8(_) if for_filter && self.gpu.filters_in_8_bit()? => Encoding::R16,
            _ => Encoding::own(samples),
        };
        // 16-bit normalised images are optional.
        let sampled = self.gpu.image_features(own.format()).contains(vk::FormatFeatureFlags::SAMPLED_IMAGE);
        Ok(if sampled { own } else { Encoding::R32f })
    }

    fn filterable(&self, encoding: Encoding) -> bool {
        self.gpu
            .image_features(encoding.format())
            .contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)
    }
}

/// Bytes of a sample on a device that has the sample's own type.
pub(super) fn texel_bytes(samples: &Samples) -> u64 {
    u64::try_from(Encoding::own(samples).texel_bytes()).unwrap_or(u64::MAX)
}

impl Encoding {
    /// The one that keeps samples as they are.
    fn own(samples: &Samples) -> Self {
        match samples {
            Samples::U8(_) => Self::R8,
            Samples::U16(_) | Samples::I16(_) => Self::R16,
            Samples::F32(_) => Self::R32f,
        }
    }

    fn format(self) -> vk::Format {
        match self {
            Self::R8 => vk::Format::R8_UNORM,
            Self::R16 => vk::Format::R16_UNORM,
            Self::R32f => vk::Format::R32_SFLOAT,
        }
    }
}

/// Scale and offset that turn a texel into a value.
fn value_map(grid: &Grid, encoding: Encoding) -> (f64, f64) {
    let rescale = grid.rescale();
    // The stored number is full * texel + zero.
    let (full, zero) = match (grid.samples(), encoding) {
        (_, Encoding::R32f) => (1.0, 0.0),
        (Samples::U8(_), _) => (255.0, 0.0),
        (Samples::I16(_), _) => (65535.0, -32768.0),
        (Samples::U16(_) | Samples::F32(_), _) => (65535.0, 0.0),
    };
    (rescale.slope * full, rescale.slope * zero + rescale.intercept)
}

/// Longest chord of the domain, world units.
pub(crate) fn diagonal(grid: &Grid) -> f64 {
    grid.corners().iter().map(|corner| 2.0 * (*corner - grid.centre()).length()).fold(0.0, f64::max)
}

/// Axes in the order of a stack along one of them: the others follow it cyclically, the stack's comes last.
pub(crate) fn turned<T: Copy>(xyz: [T; 3], axis: usize) -> [T; 3] {
    [xyz[(axis + 1) % 3], xyz[(axis + 2) % 3], xyz[axis % 3]]
}

/// Samples in the order of a stack's texels.
fn turn_samples(samples: &Samples, dims: [u32; 3], axis: usize) -> Samples {
    fn turn<T: Copy>(values: &[T], dims: [u32; 3], axis: usize) -> Vec<T> {
        let [nx, ny, _] = dims.map(num::index);
        let [u, v, k] = turned(dims, axis).map(num::index);
        let [du, dv, dk] = turned([1, nx, nx * ny], axis);
        let mut out = Vec::with_capacity(values.len());
        for slice in 0..k {
            for row in 0..v {
                let start = slice * dk + row * dv;
                out.extend((0..u).map(|i| values[start + i * du]));
            }
        }
        out
    }
    match samples {
        Samples::U8(v) => Samples::U8(turn(v, dims, axis)),
        Samples::U16(v) => Samples::U16(turn(v, dims, axis)),
        Samples::I16(v) => Samples::I16(turn(v, dims, axis)),
        Samples::F32(v) => Samples::F32(turn(v, dims, axis)),
    }
}

/// Writes values as texels until `memory` or `values` end.
fn put<T: Copy, const N: usize>(values: &[T], memory: &mut [u8], bytes: impl Fn(T) -> [u8; N]) {
    for (value, place) in values.iter().zip(memory.chunks_exact_mut(N)) {
        place.copy_from_slice(&bytes(*value));
    }
}

impl Encoding {
    /// Writes numbers as a shader reads them (0 to 1 where the format is normalised), until `memory` is full.
    fn put(self, texels: &[f32], memory: &mut [u8]) {
        match self {
            Self::R8 => put(texels, memory, |x| [num::u8_code(f64::from(x) * 255.0)]),
            Self::R16 => put(texels, memory, |x| num::u16_code(f64::from(x) * 65535.0).to_ne_bytes()),
            Self::R32f => put(texels, memory, f32::to_ne_bytes),
        }
    }

    /// What a shader reads of texels.
    fn texels(self, memory: &[u8]) -> Vec<f32> {
        match self {
            Self::R8 => memory.iter().map(|&b| f32::from(b) / 255.0).collect(),
            Self::R16 => memory
                .chunks_exact(2)
                .map(|b| f32::from(u16::from_ne_bytes([b[0], b[1]])) / 65535.0)
                .collect(),
            Self::R32f => {
                memory.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect()
            }
        }
    }

    fn texel_bytes(self) -> usize {
        match self {
            Self::R8 => 1,
            Self::R16 => 2,
            Self::R32f => 4,
        }
    }
}

/// Samples on their way to the device.
struct Source<'a> {
    samples: &'a Samples,
    rescale: Rescale,
    /// First and last scalar of the transfer function.
    ends: [f64; 2],
    encoding: Encoding,
}

impl Source<'_> {
    /// Writes samples from `first` on as texels, until `memory` is full.
    fn encode(&self, first: usize, memory: &mut [u8]) {
        // Infinities take the scalar at the transfer function's ends, as stored numbers.
        let slope = self.rescale.slope;
        let low = self.stored_end(if slope > 0.0 { 0 } else { 1 });
        let high = self.stored_end(if slope > 0.0 { 1 } else { 0 });
        match (self.samples, self.encoding) {
            (Samples::U8(v), Encoding::R8) => put(&v[first..], memory, |x| [x]),
            (Samples::U8(v), Encoding::R16) => {
                put(&v[first..], memory, |x| (u16::from(x) * 257).to_ne_bytes());
            }
            (Samples::U8(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
            (Samples::U16(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
            (Samples::U16(v), _) => put(&v[first..], memory, u16::to_ne_bytes),
            (Samples::I16(v), Encoding::R32f) => put(&v[first..], memory, |x| f32::from(x).to_ne_bytes()),
            // -32768 becomes 0 and 32767 becomes 65535: flip the sign bit.
            (Samples::I16(v), _) => {
                put(&v[first..], memory, |x| (x.cast_unsigned() ^ 0x8000).to_ne_bytes());
            }
            (Samples::F32(v), _) => put(&v[first..], memory, |x| {
                let x = if x == f32::INFINITY {
                    high
                } else if x == f32::NEG_INFINITY {
                    low
                } else {
                    x
                };
                x.to_ne_bytes()
            }),
        }
    }

    /// The stored number that the device takes for an end of the transfer function, or for what lies beyond.
    fn stored_end(&self, end: usize) -> f32 {
        let Rescale { slope, intercept } = self.rescale;
        let mut stored = f32_of((self.ends[end] - intercept) / slope);
        let reaches = |stored: f32| {
            let scalar = f32_of(slope) * stored + f32_of(intercept);
            if end == 0 { scalar <= f32_of(self.ends[0]) } else { scalar >= f32_of(self.ends[1]) }
        };
        // Rounding may leave it short of the end by a few units in the last place.
        for _ in 0..64 {
            if reaches(stored) {
                break;
            }
            stored = if (end == 1) == (slope > 0.0) { stored.next_up() } else { stored.next_down() };
        }
        stored
    }

    /// Texels of the levels below the first, each the mean of the one above.
    fn smaller_levels(&self, dims: [u32; 3], along: [bool; 3], levels: u32) -> Vec<Vec<f32>> {
        let mut smaller: Vec<Vec<f32>> = Vec::new();
        if levels > 1 {
            let mut memory = vec![0; self.samples.len() * self.encoding.texel_bytes()];
            self.encode(0, &mut memory);
            let (first, mut dims) = (self.encoding.texels(&memory), dims);
            for _ in 1..levels {
                let (next, next_dims) = mips::halve(smaller.last().unwrap_or(&first), dims, along);
                smaller.push(next);
                dims = next_dims;
            }
        }
        smaller
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Rescale;

    fn texels(grid: &Grid, encoding: Encoding, bytes: usize) -> Vec<u8> {
        let mut memory = vec![0; bytes];
        let source = Source { samples: grid.samples(), rescale: grid.rescale(), ends: [-1.0, 2.0], encoding };
        source.encode(0, &mut memory);
        memory
    }

    #[test]
    fn every_encoding_keeps_every_value() {
        let ends = |samples: Samples| {
            Grid::new([2, 2, 2], samples)
                .unwrap()
                .with_rescale(Rescale { slope: -0.5, intercept: 3.0 })
                .unwrap()
        };
        let u8s = ends(Samples::U8(vec![0, 255, 7, 0, 0, 0, 0, 0]));
        let i16s = ends(Samples::I16(vec![i16::MIN, i16::MAX, -1, 0, 0, 0, 0, 0]));
        let u16s = ends(Samples::U16(vec![0, 65535, 77, 0, 0, 0, 0, 0]));
        for (grid, encoding) in
            [(&u8s, Encoding::R8), (&u8s, Encoding::R16), (&i16s, Encoding::R16), (&u16s, Encoding::R16)]
        {
            let size = if encoding == Encoding::R8 { 1 } else { 2 };
            let memory = texels(grid, encoding, 8 * size);
            let (scale, offset) = value_map(grid, encoding);
            for i in 0..3_usize {
                let code = if size == 1 {
                    f64::from(memory[i]) / 255.0
                } else {
                    f64::from(u16::from_ne_bytes([memory[2 * i], memory[2 * i + 1]])) / 65535.0
                };
                let want = grid.value(num::count(i % 2), num::count(i / 2), 0);
                assert!((scale * code + offset - want).abs() < 1e-9, "{encoding:?} sample {i}");
            }
        }
    }

    #[test]
    fn infinities_become_the_transfer_function_s_ends() {
        let values = vec![f32::INFINITY, f32::NEG_INFINITY, 0.5, 0.0, 0.0, 0.0, 0.0, f32::NAN];
        let grid = Grid::new([2, 2, 2], Samples::F32(values)).unwrap();
        let read = |grid: &Grid| -> Vec<f32> {
            texels(grid, Encoding::R32f, 32)
                .chunks_exact(4)
                .map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]))
                .collect()
        };
        assert_eq!(read(&grid)[..3], [2.0, -1.0, 0.5]);
        assert!(read(&grid)[7].is_nan());
        let flipped = grid.with_rescale(Rescale { slope: -1.0, intercept: 0.0 }).unwrap();
        assert_eq!(read(&flipped)[..2], [1.0, -2.0]);
    }
}
