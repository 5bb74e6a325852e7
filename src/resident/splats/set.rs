//! Splats on the device: the kernels of a scene that show something (`glsl/splats.glsl`), in a space of their own.
//!
//! A lattice's kernels lie at voxel indices, relative to the domain's centre, over sigma where they are Gaussians: there all
//! are alike. Those of points and of a mesh's vertices lie in radii of the data from its centre. So float32 has all its
//! digits for the data, wherever and however large it is.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu};
use crate::num;
use crate::resident::splats::lattice::lattice;
use crate::resident::splats::records::Lists;
use crate::resident::splats::scattered::scattered;
use crate::resident::splats::sizes::{median_sigma, sigmas, smallest_spacing};
use crate::resident::splats::space::{Shape, Space};
use crate::scene::{Data, Grid, Kernel, KernelSize, Kernels, Model, Points, Scene, TransferFunction};

/// What frames of a scene have needed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SplatNeeds {
    /// Entries of the bins of a band.
    pub(crate) entries: u32,
    /// Dispatches that take a band's bins.
    pub(crate) rounds: u32,
}

/// The splats of a scene.
#[derive(Debug)]
pub(crate) struct SplatSet {
    pub(crate) kernels: Kernels,
    pub(crate) shape: Shape,
    pub(crate) space: Space,
    pub(crate) count: u32,
    /// Each one's centre with its scalar; or centre and inverse of sigma, then what it is.
    pub(crate) points: Arc<Buffer>,
    pub(crate) shapes: Arc<Buffer>,
    /// Distance at which kernels end: in sigmas, or along each axis.
    pub(crate) cut: f64,
    /// What a kernel is multiplied by.
    pub(crate) amplitude: f64,
}

impl SplatSet {
    /// The kernels of a scene that may show something. `slab` is how far a sheet reaches in depth, in world units.
    pub(crate) fn new(gpu: &Gpu, scene: &Scene, kernels: &Kernels, slab: f64) -> Result<Self> {
        kernels.check()?;
        match &scene.data {
            Data::Grid(grid) => Self::of_grid(gpu, grid, &scene.transfer, kernels, slab),
            Data::Mesh(mesh) => Self::of_points(gpu, &Points::of_vertices(mesh)?, &scene.transfer, kernels),
            Data::Points(points) => Self::of_points(gpu, points, &scene.transfer, kernels),
        }
    }

    /// World length that a step of 1 means for the data of a scene.
    pub(crate) fn step(scene: &Scene) -> Result<f64> {
        match &scene.data {
            Data::Grid(grid) => Ok(smallest_spacing(grid)),
            Data::Mesh(mesh) => median_sigma(&Points::of_vertices(mesh)?),
            Data::Points(points) => median_sigma(points),
        }
    }

    fn of_grid(
        gpu: &Gpu,
        grid: &Grid,
        transfer: &TransferFunction,
        kernels: &Kernels,
        slab: f64,
    ) -> Result<Self> {
        let gaussian = kernels.kernel == Kernel::Gaussian;
        let sigma = if gaussian { kernels.sigma } else { 1.0 };
        let last = grid.last_index();
        let step = smallest_spacing(grid);
        let reach = kernels.reach();
        let to_world = grid.index_to_world() * sigma;
        // Kernels reach beyond the domain where extinctions add up.
        let beyond = last * 0.5 + reach;
        let corner = |i: usize| {
            let sign = |bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
            grid.index_to_world() * (beyond * DVec3::new(sign(1), sign(2), sign(4)))
        };
        let corners: [DVec3; 8] = std::array::from_fn(corner);
        let space = Space {
            centre: grid.centre(),
            unit: corners.iter().map(|corner| corner.length()).fold(f64::MIN_POSITIVE, f64::max),
            to_world,
            corners,
            domain: last * (0.5 / sigma),
            layer: 1.0 / sigma,
            middles: grid.dims().map(|n| if n % 2 == 0 { 0.5 } else { 0.0 }),
            step,
        };
        let slab = (slab / step).min(f64::from(u32::MAX));
        let lists = lattice(grid, transfer, kernels, slab)?;
        let cut = if gaussian { kernels.cut } else { reach };
        // Products along the axes have their own peak.
        let amplitude = if gaussian { kernels.peak_on_grid() } else { 1.0 };
        Self::upload(gpu, *kernels, Shape::Alike, space, lists, cut, amplitude)
    }

    fn of_points(gpu: &Gpu, points: &Points, transfer: &TransferFunction, kernels: &Kernels) -> Result<Self> {
        if !matches!(kernels.kernel, Kernel::Gaussian | Kernel::BSpline) {
            let why = format!("{}: is for grids; points have gaussian or bspline", kernels.kernel.name());
            return Err(Error::invalid("kernel", why));
        }
        let shape = match points.size() {
            KernelSize::Unknown => {
                return Err(Error::invalid(
                    "points",
                    "have no radius: a radius or covariances must be given",
                ));
            }
            KernelSize::Radius(_) | KernelSize::Radii(_) => Shape::Radii,
            KernelSize::Covariances(_) if kernels.kernel == Kernel::BSpline => {
                return Err(Error::invalid("kernel", "bspline: points with covariances have gaussian"));
            }
            KernelSize::Covariances(_) => Shape::Covariances,
        };
        let [low, high] = points.bounds();
        let half = high * 0.5 - low * 0.5;
        let step = median_sigma(points)?;
        // Sizes are bounded by the greatest.
        // A B-spline's radius is two of its units, and three standard deviations of the Gaussian that has it, too.
        let (cut, in_sigmas) =
            if kernels.kernel == Kernel::Gaussian { (kernels.cut, kernels.cut) } else { (2.0, 3.0) };
        let reach = in_sigmas * sigmas(points).fold(0.0, f64::max);
        let half = half + reach;
        let unit = half.length().max(f64::MIN_POSITIVE);
        let corner = |i: usize| {
            let sign = |bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
            half * DVec3::new(sign(1), sign(2), sign(4))
        };
        let space = Space {
            centre: low + (half - reach),
            unit,
            to_world: DMat3::from_diagonal(DVec3::splat(unit)),
            corners: std::array::from_fn(corner),
            domain: DVec3::INFINITY,
            layer: step / unit,
            middles: [0.25; 3],
            step,
        };
        let lists = scattered(points, transfer, kernels, &space)?;
        Self::upload(gpu, *kernels, shape, space, lists, cut, 1.0)
    }

    fn upload(
        gpu: &Gpu,
        kernels: Kernels,
        shape: Shape,
        space: Space,
        mut lists: Lists,
        cut: f64,
        amplitude: f64,
    ) -> Result<Self> {
        let each = if shape == Shape::Alike && kernels.model == Model::Interpolate { 1 } else { 2 };
        let count = lists.points.len() / each;
        let most = u64::from(gpu.inner.properties.limits.max_storage_buffer_range);
        let widest = if shape == Shape::Covariances { 64 } else { 16 * num::wide(each) };
        if num::wide(count) * widest > most || count >= 1 << 27 {
            return Err(Error::unsupported(
                "splats of this scene",
                format!("{count} kernels that show something: {} fit a buffer", most / widest),
            ));
        }
        // Nothing to bind is not allowed.
        for list in [&mut lists.points, &mut lists.shapes] {
            if list.is_empty() {
                list.extend([[0.0; 4]; 2]);
            }
        }
        let buffer = |name: &str, list: &[[f32; 4]]| Buffer::with_data(gpu, name, bytemuck::cast_slice(list));
        Ok(Self {
            kernels,
            shape,
            space,
            count: num::count(count),
            points: buffer("splats.points", &lists.points)?,
            shapes: buffer("splats.shapes", &lists.shapes)?,
            cut,
            amplitude,
        })
    }
}
