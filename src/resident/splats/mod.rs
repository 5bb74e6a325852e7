//! The visible kernels of a scene on the device (`splats.glsl`), in a space of their own.
//!
//! The kernels of a lattice lie at voxel indices relative to the centre of the domain, divided by sigma where they are
//! Gaussian; in that space all are alike. Those of points and of a mesh's vertices lie relative to the centre of the
//! data, in its radii. So float32 keeps all its digits for the data, wherever it lies and however large it is.

mod lattice;
mod scattered;
mod space;
pub(crate) mod trained;

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu};
use crate::num;
use crate::primitives::radix_sort::MOST_PAIRS;
use crate::scene::grid::{box_corners, diagonal};
use crate::scene::{Data, Grid, Kernel, KernelSize, Kernels, Model, Points, Scene, TransferFunction};
use lattice::lattice;
use scattered::scattered;
pub(crate) use space::Shape;
use space::Space;

/// Capacities that frames of a scene have needed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SplatNeeds {
    /// Entries of the bins of a band.
    pub(crate) entries: u32,
    /// Dispatches that draw a band's bins.
    pub(crate) rounds: u32,
}

/// The visible kernels of a scene.
#[derive(Debug)]
pub(crate) struct SplatSet {
    pub(crate) kernels: Kernels,
    pub(crate) shape: Shape,
    pub(crate) space: Space,
    pub(crate) count: u32,
    held: Held,
    /// Distance at which kernels end: in sigmas, or for products along each axis.
    pub(crate) cut: f64,
    /// World distance at which the largest kernel ends.
    pub(crate) reach: f64,
    /// Factor of every kernel.
    pub(crate) amplitude: f64,
}

/// The lists of kernels, four floats an entry: centre and scalar of each; or centre and inverse of sigma, then colour and extinction or scalar
/// and weight. Then roots of inverse covariances, and covariances.
#[derive(Debug)]
enum Held {
    Device([Arc<Buffer>; 2]),
    /// The device has buffers for a part of them.
    Host([Vec<[f32; 4]>; 2]),
}

/// The place of the lists of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    Device,
    Host,
}

impl SplatSet {
    /// Takes the kernels of a scene that may be visible, for sheets of at most `thickness` steps of the data.
    pub(crate) fn new(
        gpu: &Gpu,
        scene: &Scene,
        kernels: &Kernels,
        thickness: f64,
        place: Place,
    ) -> Result<Arc<Self>> {
        let transfer = &scene.transfer;
        let mut set = match &scene.data {
            Data::Grid(grid) => Self::of_grid(grid, transfer, kernels, thickness)?,
            Data::Mesh(mesh) => Self::of_points(&Points::of_vertices(mesh)?, transfer, kernels)?,
            Data::Points(points) => Self::of_points(points, transfer, kernels)?,
            Data::Gaussians(_) => {
                let why = "draws grids, meshes and points: the scene holds gaussians";
                return Err(Error::invalid("technique", why));
            }
        };
        if place == Place::Device {
            set.upload(gpu)?;
        }
        Ok(Arc::new(set))
    }

    /// Returns the entries of the lists for each kernel.
    pub(crate) fn entries(&self) -> [usize; 2] {
        let alike = self.shape == Shape::Alike && self.kernels.model == Model::Interpolate;
        [if alike { 1 } else { 2 }, if self.shape == Shape::Covariances { 4 } else { 0 }]
    }

    /// Returns the lists on the device, where they are there.
    pub(crate) fn on_device(&self) -> Option<&[Arc<Buffer>; 2]> {
        if let Held::Device(lists) = &self.held { Some(lists) } else { None }
    }

    /// Returns the lists of the host; empty where they are on the device.
    pub(crate) fn on_host(&self) -> [&[[f32; 4]]; 2] {
        if let Held::Host(lists) = &self.held { lists.each_ref().map(Vec::as_slice) } else { [&[]; 2] }
    }

    fn of_grid(grid: &Grid, transfer: &TransferFunction, kernels: &Kernels, thickness: f64) -> Result<Self> {
        kernels.check()?;
        let gaussian = kernels.kernel == Kernel::Gaussian;
        let sigma = if gaussian { kernels.sigma } else { 1.0 };
        let last = grid.last_index();
        let step = smallest_spacing(grid);
        let reach = kernels.reach();
        let to_world = grid.index_to_world() * sigma;
        // Kernels of voxels on the boundary reach beyond the domain.
        let beyond = last * 0.5 + reach;
        let corners = box_corners([-beyond, beyond]).map(|corner| grid.index_to_world() * corner);
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
        let points = lattice(grid, transfer, kernels, thickness.min(f64::from(u32::MAX)))?;
        let cut = if gaussian { kernels.cut } else { reach };
        // The peak of a product along the axes is its own.
        let amplitude = if gaussian { kernels.peak_on_grid() } else { 1.0 };
        // A bound of the matrix' norm, its largest scale where it scales the axes.
        let largest =
            |m: DMat3| [0, 1, 2].map(|i| m.col(i).abs().element_sum()).into_iter().fold(0.0, f64::max);
        let reach = cut * (largest(to_world) * largest(to_world.transpose())).sqrt();
        Self::of_lists(*kernels, Shape::Alike, space, [points, vec![]], [cut, reach], amplitude)
    }

    fn of_points(points: &Points, transfer: &TransferFunction, kernels: &Kernels) -> Result<Self> {
        let step = median_sigma(points)?;
        kernels.check()?;
        if !matches!(kernels.kernel, Kernel::Gaussian | Kernel::BSpline) {
            let why = format!("{}: is for grids; points have gaussian or bspline", kernels.kernel.name());
            return Err(Error::invalid("kernel", why));
        }
        let shape = match points.size() {
            KernelSize::Unknown | KernelSize::Radius(_) | KernelSize::Radii(_) => Shape::Radii,
            KernelSize::Covariances(_) if kernels.kernel == Kernel::BSpline => {
                return Err(Error::invalid("kernel", "bspline: points with covariances have gaussian"));
            }
            KernelSize::Covariances(_) => Shape::Covariances,
        };
        let [low, high] = points.bounds();
        let half = high * 0.5 - low * 0.5;
        // The box is enlarged by the reach of the largest kernel. The radius of a kernel is three sigma of a Gaussian,
        // and two units of a B-spline.
        let (cut, in_sigmas) =
            if kernels.kernel == Kernel::Gaussian { (kernels.cut, kernels.cut) } else { (2.0, 3.0) };
        let reach = in_sigmas * sigmas(points).into_iter().fold(0.0, f64::max);
        let half = half + reach;
        let unit = half.length().max(f64::MIN_POSITIVE);
        let space = Space {
            centre: low + (half - reach),
            unit,
            to_world: DMat3::from_diagonal(DVec3::splat(unit)),
            corners: box_corners([-half, half]),
            domain: DVec3::INFINITY,
            layer: step / unit,
            middles: [0.25; 3],
            step,
        };
        let lists = scattered(points, transfer, kernels, &space);
        Self::of_lists(*kernels, shape, space, lists, [cut, reach], 1.0)
    }

    fn of_lists(
        kernels: Kernels,
        shape: Shape,
        space: Space,
        lists: [Vec<[f32; 4]>; 2],
        [cut, reach]: [f64; 2],
        amplitude: f64,
    ) -> Result<Self> {
        let entries = lists[0].len();
        let mut set =
            Self { kernels, shape, space, count: 0, held: Held::Host(lists), cut, reach, amplitude };
        let count = entries / set.entries()[0];
        set.count = u32::try_from(count).map_err(|_| {
            Error::unsupported(
                "splats of this scene",
                format!("{count} visible kernels; {} are numbered", u32::MAX),
            )
        })?;
        Ok(set)
    }

    /// Moves the lists to the device.
    fn upload(&mut self, gpu: &Gpu) -> Result<()> {
        let widest = 16 * num::wide(self.entries().into_iter().fold(0, usize::max));
        let room = gpu.most_buffer_bytes().min(widest * u64::from(MOST_PAIRS));
        let Held::Host(lists) = &mut self.held else { return Ok(()) };
        let needed = widest * u64::from(self.count);
        if needed > room {
            let object =
                format!("a buffer of {} visible kernels, of which {} fit,", self.count, room / widest);
            return Err(Error::Memory { object, needed, available: room, budget: gpu.memory_budget() });
        }
        // A binding must hold something.
        for list in lists.iter_mut().filter(|list| list.is_empty()) {
            list.extend([[0.0; 4]; 2]);
        }
        let buffer = |name: &str, list: &[[f32; 4]]| Buffer::with_data(gpu, name, bytemuck::cast_slice(list));
        self.held = Held::Device([buffer("splats.points", &lists[0])?, buffer("splats.shapes", &lists[1])?]);
        Ok(())
    }
}

/// Returns the smallest distance of samples along an axis that has several.
fn smallest_spacing(grid: &Grid) -> f64 {
    let spacing = grid.spacing().to_array();
    let dims = grid.dims();
    let several = dims.iter().zip(spacing).filter(|(n, _)| **n > 1).map(|(_, s)| s);
    several.reduce(f64::min).unwrap_or_else(|| diagonal(grid).max(1.0))
}

/// Returns the standard deviations of all points, visible or not.
///
/// Of a covariance it is an upper bound over all axes, the root of the trace.
fn sigmas(points: &Points) -> Vec<f64> {
    match points.size() {
        KernelSize::Unknown => Vec::new(),
        KernelSize::Radius(radius) => vec![radius / 3.0],
        KernelSize::Radii(radii) => {
            radii.iter().map(|&r| f64::from(r) / 3.0).filter(|r| r.is_finite()).collect()
        }
        KernelSize::Covariances(all) => {
            let traces = all.iter().map(|c| f64::from(c[0]) + f64::from(c[3]) + f64::from(c[5]));
            traces.filter(|&trace| trace >= 0.0).map(f64::sqrt).collect()
        }
    }
}

/// Returns the median standard deviation of points.
///
/// # Errors
///
/// [`Error::Invalid`] where no point has a size.
fn median_sigma(points: &Points) -> Result<f64> {
    let mut all = sigmas(points);
    all.retain(|&sigma| sigma > 0.0);
    if all.is_empty() {
        return Err(Error::invalid("points", "none has a size: a radius or covariances must be given"));
    }
    let middle = all.len() / 2;
    Ok(*all.select_nth_unstable_by(middle, f64::total_cmp).1)
}
