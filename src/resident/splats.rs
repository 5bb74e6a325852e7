//! Splats on the device: the kernels of a scene that show something (`glsl/splats.glsl`), in a space of their own.
//!
//! A lattice's kernels lie at voxel indices, relative to the domain's centre, over sigma where they are Gaussians: there all
//! are alike. Those of points and of a mesh's vertices lie in radii of the data from its centre. So float32 has all its
//! digits for the data, wherever and however large it is.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::gpu::shader::{SHAPE_ALIKE, SHAPE_COVARIANCES, SHAPE_RADII};
use crate::gpu::{Buffer, Gpu};
use crate::num::{self, f32_of};
use crate::optics::kernel::prefilter;
use crate::resident::bricks::nonzero_ranges;
use crate::scene::grid::diagonal;
use crate::scene::{Data, Grid, Kernel, KernelSize, Kernels, Model, Points, Scene, TransferFunction};

/// What frames of a scene have needed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SplatNeeds {
    /// Entries of the bins of a band.
    pub(crate) entries: u32,
    /// Dispatches that take a band's bins.
    pub(crate) rounds: u32,
}

/// Which sizes splats have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Alike,
    Radii,
    Covariances,
}

impl Shape {
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Alike => SHAPE_ALIKE,
            Self::Radii => SHAPE_RADII,
            Self::Covariances => SHAPE_COVARIANCES,
        }
    }
}

/// Where splats lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Space {
    /// The middle of the data, in the world.
    pub(crate) centre: DVec3,
    /// World length of a unit of depth: from the centre to the furthest corner of the data.
    pub(crate) unit: f64,
    /// From splat space to the world, relative to the centre.
    pub(crate) to_world: DMat3,
    /// A box that holds all kernels, half extents in the world relative to the centre, along its own axes.
    pub(crate) corners: [DVec3; 8],
    /// Half extents of a lattice's domain, in splat space; infinite where there is none.
    pub(crate) domain: DVec3,
    /// Distance of a lattice's layers, in splat space; of points, that of sheets for a step of 1.
    pub(crate) layer: f64,
    /// Where the middle of the sheet of number 0 lies, in sheets, for each axis.
    pub(crate) middles: [f64; 3],
    /// World length that a step of 1 means.
    pub(crate) step: f64,
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

/// What goes to the device, four floats each.
#[derive(Debug, Default)]
struct Lists {
    points: Vec<[f32; 4]>,
    shapes: Vec<[f32; 4]>,
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

/// Smallest distance of samples along an axis, of axes that have several.
fn smallest_spacing(grid: &Grid) -> f64 {
    let spacing = grid.spacing().to_array();
    let dims = grid.dims();
    let several = dims.iter().zip(spacing).filter(|(n, _)| **n > 1).map(|(_, s)| s);
    several.reduce(f64::min).unwrap_or_else(|| diagonal(grid).max(1.0))
}

/// Standard deviations of points, the greatest of each covariance's axes bounded from above; of kernels that show nothing
/// too.
fn sigmas(points: &Points) -> Box<dyn Iterator<Item = f64> + '_> {
    match points.size() {
        KernelSize::Unknown => Box::new(std::iter::empty()),
        KernelSize::Radius(radius) => Box::new(std::iter::once(*radius / 3.0)),
        KernelSize::Radii(radii) => {
            Box::new(radii.iter().map(|&r| f64::from(r) / 3.0).filter(|r| r.is_finite()))
        }
        KernelSize::Covariances(all) => Box::new(all.iter().filter_map(|c| {
            let trace = f64::from(c[0]) + f64::from(c[3]) + f64::from(c[5]);
            (trace >= 0.0).then(|| trace.sqrt())
        })),
    }
}

fn median_sigma(points: &Points) -> Result<f64> {
    let mut all: Vec<f64> = sigmas(points).filter(|&sigma| sigma > 0.0).collect();
    if all.is_empty() {
        return Err(Error::invalid("points", "none has a size: a radius or covariances must be given"));
    }
    let middle = all.len() / 2;
    Ok(*all.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Premultiplied by nothing: colour, and extinction times weight.
fn classified(transfer: &TransferFunction, s: f64, weight: f64) -> [f32; 4] {
    let (colour, tau) = transfer.at(s);
    // What overflows is opaque long before.
    let extinction = (tau * weight).clamp(0.0, 1e30);
    [colour.x, colour.y, colour.z, extinction].map(f32_of)
}

/// A scalar with infinities as the transfer function's ends.
fn finite(s: f64, [low, high]: [f64; 2]) -> f64 {
    if s == f64::INFINITY {
        high
    } else if s == f64::NEG_INFINITY {
        low
    } else {
        s
    }
}

/// The kernels of a grid that show something.
fn lattice(grid: &Grid, transfer: &TransferFunction, kernels: &Kernels, slab: f64) -> Result<Lists> {
    let dims = grid.dims().map(num::index);
    let [nx, ny, nz] = dims;
    let ends = transfer.domain();
    let rescale = grid.rescale();
    let value = |i: usize| finite(rescale.slope * grid.samples().get(i) + rescale.intercept, ends);
    let sigma = if kernels.kernel == Kernel::Gaussian { kernels.sigma } else { 1.0 };
    let half = grid.last_index() * 0.5;
    let centre = |x: usize, y: usize, z: usize| {
        let index = DVec3::new(num::f64_of(x), num::f64_of(y), num::f64_of(z));
        ((index - half) / sigma).to_array().map(f32_of)
    };
    if kernels.model == Model::Density {
        let slice = |z: usize| {
            let mut lists = Lists::default();
            for y in 0..ny {
                for x in 0..nx {
                    let shown = classified(transfer, value((z * ny + y) * nx + x), 1.0);
                    if shown[3] > 0.0 {
                        let [a, b, c] = centre(x, y, z);
                        lists.points.extend([[a, b, c, 1.0], shown]);
                    }
                }
            }
            lists
        };
        return Ok(joined((0..nz).into_par_iter().map(slice).collect()));
    }

    let scalars: Vec<f64> = if kernels.kernel == Kernel::BSpline {
        if grid.nan_count() > 0 {
            return Err(Error::unsupported(
                "kernel bspline on this grid",
                "samples without NaN: its coefficients need all",
            ));
        }
        let mut all: Vec<f64> = (0..nx * ny * nz).into_par_iter().map(value).collect();
        prefilter(&mut all, dims);
        all
    } else {
        (0..nx * ny * nz).into_par_iter().map(value).collect()
    };
    let shown = needed(&scalars, dims, transfer, kernels, slab);
    let slice = |z: usize| {
        let mut lists = Lists::default();
        for y in 0..ny {
            for x in 0..nx {
                let i = (z * ny + y) * nx + x;
                let s = scalars[i];
                if shown[i] && !s.is_nan() {
                    let [a, b, c] = centre(x, y, z);
                    lists.points.push([a, b, c, f32_of(s)]);
                }
            }
        }
        lists
    };
    Ok(joined((0..nz).into_par_iter().map(slice).collect()))
}

fn joined(parts: Vec<Lists>) -> Lists {
    let mut all = Lists::default();
    for part in parts {
        all.points.extend(part.points);
        all.shapes.extend(part.shapes);
    }
    all
}

/// Voxels without which something that shows would be missing: those in reach of a cell in which the sum of kernels, which lies
/// between the scalars in reach of the cell, may show something; or of what lies in one sheet with it, `slab` voxels thick.
fn needed(
    scalars: &[f64],
    dims: [usize; 3],
    transfer: &TransferFunction,
    kernels: &Kernels,
    slab: f64,
) -> Vec<bool> {
    let reach = num::usize_of(kernels.reach().ceil());
    let slab = num::usize_of(slab.ceil());
    let wider = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let below = |s: f64| f32_of(s).next_down();
    let above = |s: f64| f32_of(s).next_up();
    let mut ranges: Vec<[f32; 2]> = scalars.par_iter().map(|&s| [below(s), above(s)]).collect();
    let mut extent = dims;
    for (axis, n) in dims.into_iter().enumerate() {
        // Cell j lies between voxels j and j + 1.
        let cells = n.saturating_sub(1).max(1);
        ranges = windows(&ranges, &mut extent, axis, cells, [reach - 1, reach], wider);
    }
    let seen = nonzero_ranges(transfer);
    // Negative lobes go beyond the scalars in reach; those of a product of three are no more than 2.4 in all.
    let beyond = if kernels.kernel == Kernel::Sinc { 0.75 } else { 1e-6 };
    let shows = |[low, high]: &[f32; 2]| {
        let margin = beyond * (high - low) + 1e-6 * low.abs().max(high.abs());
        seen.iter().any(|range| low - margin <= range[1] && high + margin >= range[0])
    };
    let mut shown: Vec<bool> = ranges.par_iter().map(shows).collect();
    for (axis, n) in dims.into_iter().enumerate() {
        let around = [reach + slab, reach + slab - 1];
        shown = windows(&shown, &mut extent, axis, n, around, |a, b| a || b);
    }
    shown
}

/// Along an axis `count` values, each joined of those from `before` ahead of its place to `behind` after it.
fn windows<T: Copy + Send + Sync>(
    values: &[T],
    extent: &mut [usize; 3],
    axis: usize,
    count: usize,
    [before, behind]: [usize; 2],
    join: impl Fn(T, T) -> T + Sync,
) -> Vec<T> {
    let old = *extent;
    extent[axis] = count;
    let new = *extent;
    let stride = [1, old[0], old[0] * old[1]][axis];
    let row = |row: usize| {
        let (y, z) = (row % new[1], row / new[1]);
        let join = &join;
        (0..new[0]).map(move |x| {
            let mut place = [x, y, z];
            let first = place[axis].saturating_sub(before).min(old[axis] - 1);
            let last = (place[axis] + behind).min(old[axis] - 1);
            place[axis] = first;
            let start = (place[2] * old[1] + place[1]) * old[0] + place[0];
            (first..=last).map(|p| values[start + (p - first) * stride]).reduce(join).unwrap_or(values[start])
        })
    };
    (0..new[1] * new[2]).into_par_iter().flat_map_iter(row).collect()
}

/// The kernels of points that show something.
fn scattered(
    points: &Points,
    transfer: &TransferFunction,
    kernels: &Kernels,
    space: &Space,
) -> Result<Lists> {
    let ends = transfer.domain();
    let density = kernels.model == Model::Density;
    let mut lists = Lists::default();
    for (i, centre) in points.centres().iter().enumerate() {
        let s = finite(points.scalars().map_or(1.0, |all| f64::from(all[i])), ends);
        let weight = points.weights().map_or(1.0, |all| f64::from(all[i]));
        let [x, y, z] = ((*centre - space.centre) / space.unit).to_array().map(f32_of);
        // Inverse of sigma in splat space; of a B-spline half the radius is 1.
        let per_radius = if kernels.kernel == Kernel::Gaussian { 3.0 } else { 2.0 };
        let mut shape = None;
        let inverse = match points.size() {
            KernelSize::Radius(radius) => per_radius * space.unit / radius,
            KernelSize::Radii(radii) => per_radius * space.unit / f64::from(radii[i]),
            KernelSize::Covariances(all) => {
                shape = root(all[i].map(f64::from).map(|c| c / (space.unit * space.unit)));
                if shape.is_some() { 1.0 } else { f64::NAN }
            }
            KernelSize::Unknown => f64::NAN,
        };
        let valid =
            s.is_finite() && weight.is_finite() && weight != 0.0 && inverse > 0.0 && inverse.is_finite();
        if !valid {
            continue;
        }
        let value = if density {
            let value = classified(transfer, s, weight);
            if value[3] <= 0.0 {
                continue;
            }
            value
        } else {
            [f32_of(s), f32_of(weight), 0.0, 0.0]
        };
        lists.points.extend([[x, y, z, f32_of(inverse)], value]);
        lists.shapes.extend(shape.into_iter().flatten());
    }
    Ok(lists)
}

/// From a covariance (xx, xy, xz, yy, yz, zz) the root L of its inverse, `L^T L`, lower triangular, and itself, as shaders have
/// them; none where it is not positive definite in float32.
fn root([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Option<[[f32; 4]; 4]> {
    // Cholesky: S = C C^T.
    let c00 = xx.sqrt();
    let (c10, c20) = (xy / c00, xz / c00);
    let c11 = (yy - c10 * c10).sqrt();
    let c21 = (yz - c10 * c20) / c11;
    let c22 = (zz - c20 * c20 - c21 * c21).sqrt();
    // L = C^-1.
    let (l00, l11, l22) = (1.0 / c00, 1.0 / c11, 1.0 / c22);
    let l10 = -c10 * l00 * l11;
    let l21 = -c21 * l11 * l22;
    let l20 = (c10 * c21 * l11 - c20) * l00 * l22;
    let all = [l00, l10, l11, l20, l21, l22];
    let positive = [c00, c11, c22].iter().all(|c| c.is_finite() && *c > 0.0);
    let rows = [[l00, l10, l11, l20], [l21, l22, 0.0, 0.0], [xx, xy, xz, yy], [yz, zz, 0.0, 0.0]];
    let rows = rows.map(|row| row.map(f32_of));
    (positive && all.iter().all(|l| f32_of(*l).is_finite())).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_those_of_the_inverse() {
        let covariance = [2.0, 0.3, -0.4, 1.0, 0.2, 0.5];
        let [r0, r1, ..] = root(covariance).unwrap().map(|row| row.map(f64::from));
        let l = DMat3::from_cols(
            DVec3::new(r0[0], r0[1], r0[3]),
            DVec3::new(0.0, r0[2], r1[0]),
            DVec3::new(0.0, 0.0, r1[1]),
        );
        let [xx, xy, xz, yy, yz, zz] = covariance;
        let s = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
        let one = l.transpose() * l * s;
        assert!((one - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-6), "{one}");
        for singular in
            [[0.0; 6], [1.0, 1.0, 0.0, 1.0, 0.0, 1.0], [f64::NAN; 6], [1.0, 2.0, 0.0, 1.0, 0.0, 1.0]]
        {
            assert!(root(singular).is_none(), "{singular:?}");
        }
    }

    #[test]
    fn windows_join_what_is_in_reach() {
        let mut values = vec![false; 5 * 3 * 2];
        values[5 + 1] = true;
        let set = |values: &[bool]| (0..values.len()).filter(|&i| values[i]).collect::<Vec<_>>();
        let mut extent = [5, 3, 2];
        assert_eq!(set(&windows(&values, &mut extent, 0, 5, [2, 1], |a, b| a || b)), [5, 6, 7, 8]);
        assert_eq!(set(&windows(&values, &mut extent, 0, 4, [0, 1], |a, b| a || b)), [4, 5]);
        assert_eq!(extent, [4, 3, 2]);
        let mut extent = [5, 3, 2];
        assert_eq!(set(&windows(&values, &mut extent, 2, 2, [1, 1], |a, b| a || b)), [6, 21]);
    }

    /// Every voxel whose kernel reaches a place that shows something is there, and few others.
    #[test]
    fn what_shows_is_needed() {
        let dims = [9, 8, 7];
        let mut scalars = vec![0.0; 9 * 8 * 7];
        scalars[(3 * 8 + 4) * 9 + 5] = 1.0;
        let transfer =
            TransferFunction::from_rows(&[[0.0; 5], [0.5, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0]])
                .unwrap();
        let tent = Kernels { kernel: Kernel::Tent, ..Kernels::of_samples() };
        let shown = needed(&scalars, dims, &transfer, &tent, 0.0);
        let count = |shown: &[bool]| shown.iter().filter(|&&s| s).count();
        assert_eq!(count(&shown), 27);
        assert_eq!(count(&needed(&scalars, dims, &transfer, &tent, 1.0)), 5 * 5 * 5);
        let flat = needed(&[1.0], [1, 1, 1], &transfer, &tent, 1.0);
        assert_eq!(flat, [true]);
    }
}
