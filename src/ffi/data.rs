//! Grids, meshes, points, surfaces and transfer functions, copied from the caller's memory.

use glam::{DMat3, DVec3};

use super::argument::{self, Structure, choice};
use super::samples::samples;
use crate::error::{Error, Result};
use crate::scene::{
    Grid, KernelSize, Knot, Points, Rescale, Shading, Surface, TetScalars, Tets, TransferFunction,
};

/// A regular grid: a scalar field, trilinear between samples, with vacuum outside the box of the samples.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_grid_info {
    /// sizeof(vr_grid_info).
    pub struct_size: usize,
    /// Samples along x, y and z, each at least 2.
    pub dims: [u32; 3],
    /// A vr_sample_type.
    pub sample_type: u32,
    /// The samples: x fastest, then y, without gaps, of any alignment. They are copied.
    pub samples: *const std::ffi::c_void,
    /// Size of the samples in bytes: the size of a sample times the product of dims.
    pub sample_bytes: usize,
    /// Distance of neighbouring samples along x, y and z, in world units. All 0: 1.
    pub spacing: [f64; 3],
    /// World position of the first sample.
    pub origin: [f64; 3],
    /// World directions of the grid's x, y and z axes, of any length and at any angles. All 0: the world's axes.
    pub direction: [[f64; 3]; 3],
    /// A sample's value is slope * stored + intercept. 0: 1.
    pub slope: f64,
    /// See slope.
    pub intercept: f64,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_grid_info {
    const FIRST: usize = size_of::<Self>();
}

/// The elements of a mesh that have the scalars.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_scalars_per {
    /// Points: the field is linear inside each tetrahedron.
    VR_SCALARS_PER_POINT = 1,
    /// Tetrahedra: the field is constant inside each.
    VR_SCALARS_PER_CELL = 2,
}

/// A mesh of tetrahedra, with vacuum outside of them and in those with a NaN scalar. The library reorients tetrahedra that are
/// inside out, and removes those without volume.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_mesh_info {
    /// sizeof(vr_mesh_info).
    pub struct_size: usize,
    /// x, y and z of each point, in world units.
    pub points: *const f64,
    /// Number of points.
    pub point_count: usize,
    /// Indices of the four points of each tetrahedron, from 0.
    pub cells: *const u32,
    /// Number of tetrahedra.
    pub cell_count: usize,
    /// The scalars.
    pub scalars: *const f32,
    /// Number of scalars.
    pub scalar_count: usize,
    /// A vr_scalars_per.
    pub scalars_per: u32,
    /// 0.
    pub reserved: u32,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_mesh_info {
    const FIRST: usize = size_of::<Self>();
}

/// Dependence of a surface's colour on the direction of view.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_shading {
    /// The colour does not depend on it.
    VR_SHADING_FLAT = 0,
    /// The colour is scaled by the cosine between the triangle's normal and the ray, as if lit from the eye.
    VR_SHADING_HEADLIGHT = 1,
}

const SHADINGS: [(Shading, u32); 2] = [
    (Shading::Flat, vr_shading::VR_SHADING_FLAT as u32),
    (Shading::Headlight, vr_shading::VR_SHADING_HEADLIGHT as u32),
];

/// A triangle mesh of one colour in the volume, visible from both sides.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_surface_info {
    /// sizeof(vr_surface_info).
    pub struct_size: usize,
    /// x, y and z of each point, in world units.
    pub points: *const f64,
    /// Number of points.
    pub point_count: usize,
    /// Indices of the three points of each triangle, from 0.
    pub triangles: *const u32,
    /// Number of triangles.
    pub triangle_count: usize,
    /// Linear red, green and blue, not premultiplied, and opacity: 1 is opaque.
    pub colour: [f64; 4],
    /// A vr_shading.
    pub shading: u32,
    /// 0.
    pub reserved: u32,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_surface_info {
    const FIRST: usize = size_of::<Self>();
}

/// Scattered points with kernels. Arrays may be NULL; others have one element per point.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_points_info {
    /// sizeof(vr_points_info).
    pub struct_size: usize,
    /// x, y and z of each point, in world units.
    pub centres: *const f64,
    /// Number of points.
    pub point_count: usize,
    /// Scalars. NULL: 1.
    pub scalars: *const f32,
    /// Weights. NULL: 1.
    pub weights: *const f32,
    /// Support radii, in world units.
    pub radii: *const f32,
    /// Covariances of Gaussians, xx, xy, xz, yy, yz and zz of each point, in world units squared. Excludes radii.
    pub covariances: *const f32,
    /// Support radius of all points, used without radii and covariances. 0: estimated from the spacing.
    pub radius: f64,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_points_info {
    const FIRST: usize = size_of::<Self>();
}

/// A knot of a transfer function, which maps a scalar to emitted colour and extinction. It is linear between knots and constant
/// beyond the ends. Two knots of one scalar make a jump, at which the later one applies.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_knot {
    /// Scalar in the data's units, not less than that of the previous knot.
    pub scalar: f64,
    /// Emitted colour: linear red, green and blue, not premultiplied, at least 0.
    pub colour: [f64; 3],
    /// Extinction per world unit of length, at least 0.
    pub extinction: f64,
}

/// Copies a list.
///
/// # Safety
///
/// As [`argument::array()`].
unsafe fn list<T: Copy>(pointer: *const T, count: usize, name: &str) -> Result<Vec<T>> {
    // SAFETY: the caller's promise.
    let given = unsafe { argument::array(pointer, count, name) }?;
    let mut list = Vec::new();
    list.try_reserve_exact(count)
        .map_err(|error| Error::invalid(name, format!("no memory for a copy of {count}: {error}")))?;
    list.extend_from_slice(given);
    Ok(list)
}

/// Copies positions.
///
/// # Safety
///
/// As [`argument::array()`].
unsafe fn positions(pointer: *const f64, count: usize, name: &str) -> Result<Vec<DVec3>> {
    // SAFETY: the caller's promise.
    let given = unsafe { argument::tuples::<3, f64>(pointer, count, name) }?;
    Ok(given.iter().copied().map(DVec3::from_array).collect())
}

/// # Safety
///
/// Its samples are null or as many bytes as it says.
pub(super) unsafe fn grid(info: &vr_grid_info) -> Result<Grid> {
    // SAFETY: the caller's promise.
    let samples = unsafe { samples(info.dims, info.sample_type, info.samples, info.sample_bytes) }?;
    let spacing = if info.spacing == [0.0; 3] { [1.0; 3] } else { info.spacing };
    let axes =
        if info.direction == [[0.0; 3]; 3] { DMat3::IDENTITY.to_cols_array_2d() } else { info.direction };
    let slope = if info.slope == 0.0 { 1.0 } else { info.slope };
    Grid::new(info.dims, samples)?
        .with_placement(spacing.into(), info.origin.into(), DMat3::from_cols_array_2d(&axes))?
        .with_rescale(Rescale { slope, intercept: info.intercept })
}

/// # Safety
///
/// `values` is null or has so many.
pub(super) unsafe fn scalars(values: *const f32, count: usize, per: u32) -> Result<TetScalars> {
    let kinds = [vr_scalars_per::VR_SCALARS_PER_POINT, vr_scalars_per::VR_SCALARS_PER_CELL];
    let kind = choice(per, &kinds.map(|kind| (kind, kind as u32)), "scalars_per")?;
    // SAFETY: the caller's promise.
    let values = unsafe { list(values, count, "scalars") }?;
    Ok(match kind {
        vr_scalars_per::VR_SCALARS_PER_POINT => TetScalars::Point(values),
        vr_scalars_per::VR_SCALARS_PER_CELL => TetScalars::Cell(values),
    })
}

/// # Safety
///
/// Its arrays are null or as long as it says.
pub(super) unsafe fn mesh(info: &vr_mesh_info) -> Result<Tets> {
    argument::reserved(info.reserved)?;
    // SAFETY: the caller's promise.
    let points = unsafe { positions(info.points, info.point_count, "points") }?;
    // SAFETY: the caller's promise.
    let cells = unsafe { argument::tuples::<4, u32>(info.cells, info.cell_count, "cells") }?.to_vec();
    // SAFETY: the caller's promise.
    let scalars = unsafe { scalars(info.scalars, info.scalar_count, info.scalars_per) }?;
    Ok(Tets::new(points, cells, scalars)?.0)
}

/// # Safety
///
/// Its arrays are null or have an element for each point.
pub(super) unsafe fn points(info: &vr_points_info) -> Result<Points> {
    let count = info.point_count;
    // SAFETY: the caller's promise.
    let mut points = Points::new(unsafe { positions(info.centres, count, "centres") }?)?;
    if !info.scalars.is_null() {
        // SAFETY: the caller's promise.
        points = points.with_scalars(unsafe { list(info.scalars, count, "scalars") }?)?;
    }
    if !info.weights.is_null() {
        // SAFETY: the caller's promise.
        points = points.with_weights(unsafe { list(info.weights, count, "weights") }?)?;
    }
    let size = match (info.radii.is_null(), info.covariances.is_null()) {
        (true, true) if info.radius == 0.0 => return Ok(points.with_estimated_radius()),
        (true, true) => KernelSize::Radius(info.radius),
        // SAFETY: the caller's promise.
        (false, true) => KernelSize::Radii(unsafe { list(info.radii, count, "radii") }?),
        (true, false) => KernelSize::Covariances(
            // SAFETY: the caller's promise.
            unsafe { argument::tuples::<6, f32>(info.covariances, count, "covariances") }?.to_vec(),
        ),
        (false, false) => {
            return Err(Error::invalid("radii and covariances", "one of them must be NULL"));
        }
    };
    points.with_size(size)
}

/// # Safety
///
/// Its arrays are null or as long as it says.
pub(super) unsafe fn surface(info: &vr_surface_info) -> Result<Surface> {
    argument::reserved(info.reserved)?;
    let shading = choice(info.shading, &SHADINGS, "shading")?;
    // SAFETY: the caller's promise.
    let points = unsafe { positions(info.points, info.point_count, "points") }?;
    // SAFETY: the caller's promise.
    let triangles = unsafe { argument::tuples::<3, u32>(info.triangles, info.triangle_count, "triangles") }?;
    Ok(Surface::new(points, triangles.to_vec(), info.colour)?.with_shading(shading))
}

/// Converts a transfer function; `None` without knots.
///
/// # Safety
///
/// As [`argument::array()`].
pub(super) unsafe fn transfer(knots: *const vr_knot, count: usize) -> Result<Option<TransferFunction>> {
    // SAFETY: the caller's promise.
    let knots = unsafe { argument::array(knots, count, "knots") }?;
    if knots.is_empty() {
        return Ok(None);
    }
    if knots.len() > TransferFunction::MAX_KNOTS {
        let why = format!("{} are given, at most {} are taken", knots.len(), TransferFunction::MAX_KNOTS);
        return Err(Error::invalid("knots", why));
    }
    let knot = |knot: &vr_knot| Knot { s: knot.scalar, colour: knot.colour.into(), tau: knot.extinction };
    TransferFunction::new(knots.iter().map(knot).collect()).map(Some)
}
