//! Grids, meshes, points, surfaces and transfer functions, copied from the caller's memory.

use std::ffi::c_void;

use bytemuck::AnyBitPattern;
use glam::{DMat3, DVec3};

use super::argument::{Caller, Structure, choice, reserved};
use crate::error::{Error, Result};
use crate::io::SampleType;
use crate::num;
use crate::scene::{
    Axes, GaussianParts, Gaussians, Grid, Kernel, KernelSize, Kernels, Knot, Lighting, Mode, Model, Points,
    Rescale, Samples, Shading, StoredAxes, Surface, TetScalars, Tets, TrainedMode, TransferFunction,
    harmonics,
};

/// Type of samples.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_sample_type {
    /// 8-bit unsigned.
    VR_SAMPLE_U8 = 1,
    /// 16-bit unsigned.
    VR_SAMPLE_U16 = 2,
    /// 16-bit signed.
    VR_SAMPLE_I16 = 3,
    /// 32-bit float. NaN marks vacuum.
    VR_SAMPLE_F32 = 4,
    /// 8-bit signed; kept as 32-bit float.
    VR_SAMPLE_I8 = 5,
    /// 32-bit unsigned; kept as 32-bit float.
    VR_SAMPLE_U32 = 6,
    /// 32-bit signed; kept as 32-bit float.
    VR_SAMPLE_I32 = 7,
    /// 64-bit unsigned; kept as 32-bit float.
    VR_SAMPLE_U64 = 8,
    /// 64-bit signed; kept as 32-bit float.
    VR_SAMPLE_I64 = 9,
    /// 64-bit float; kept as 32-bit float.
    VR_SAMPLE_F64 = 10,
}

/// In the order of `vr_sample_type`.
const SAMPLE_TYPES: [SampleType; 10] = {
    use SampleType::*;
    [U8, U16, I16, F32, I8, U32, I32, U64, I64, F64]
};

/// Copies samples of one type.
pub(super) fn samples(
    caller: &Caller,
    dims: [u32; 3],
    sample_type: u32,
    (samples, bytes): (*const c_void, usize),
) -> Result<Samples> {
    let kind = choice(sample_type, 1, &SAMPLE_TYPES, "sample_type")?;
    let needed = dims.iter().try_fold(kind.bytes(), |bytes, &n| bytes.checked_mul(u64::from(n)));
    if needed != Some(num::wide(bytes)) {
        let needed = needed.map_or("more than 2^64".to_string(), |needed| needed.to_string());
        let why = format!("{dims:?} samples of type {} need {needed} bytes, {bytes} are given", kind.name());
        return Err(Error::invalid("sample_bytes", why));
    }
    let bytes = caller.array(samples.cast::<u8>(), bytes, "samples")?;
    Ok(match kind {
        SampleType::U8 => Samples::U8(numbers(bytes, |s| s)?),
        SampleType::U16 => Samples::U16(numbers(bytes, |s| s)?),
        SampleType::I16 => Samples::I16(numbers(bytes, |s| s)?),
        SampleType::F32 => Samples::F32(numbers(bytes, |s| s)?),
        SampleType::I8 => Samples::F32(numbers(bytes, |s: i8| f32::from(s))?),
        SampleType::U32 => Samples::F32(numbers(bytes, |s: u32| s as f32)?),
        SampleType::I32 => Samples::F32(numbers(bytes, |s: i32| s as f32)?),
        SampleType::U64 => Samples::F32(numbers(bytes, |s: u64| s as f32)?),
        SampleType::I64 => Samples::F32(numbers(bytes, |s: i64| s as f32)?),
        SampleType::F64 => Samples::F32(numbers(bytes, num::f32_of)?),
    })
}

/// Copies and converts numbers from memory of any alignment.
fn numbers<T: AnyBitPattern, U>(bytes: &[u8], convert: impl Fn(T) -> U) -> Result<Vec<U>> {
    let numbers = bytes.chunks_exact(size_of::<T>()).map(|b| convert(bytemuck::pod_read_unaligned(b)));
    copied(numbers, "samples")
}

/// Copies a list.
fn copied<T>(given: impl ExactSizeIterator<Item = T>, name: &str) -> Result<Vec<T>> {
    let (mut list, count) = (Vec::new(), given.len());
    list.try_reserve_exact(count)
        .map_err(|error| Error::invalid(name, format!("no memory for a copy of {count}: {error}")))?;
    list.extend(given);
    Ok(list)
}

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
unsafe impl Structure for vr_grid_info {}

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
unsafe impl Structure for vr_mesh_info {}

/// Dependence of a surface's colour on the direction of view.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_shading {
    /// The colour does not depend on it.
    VR_SHADING_FLAT = 0,
    /// The colour is scaled by the cosine between the triangle's normal and the ray, as if lit from the eye.
    VR_SHADING_HEADLIGHT = 1,
}

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
unsafe impl Structure for vr_surface_info {}

/// What the ray of a pixel shows.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_mode {
    /// Emission and absorption of the transfer function along the ray.
    VR_MODE_EMISSION = 0,
    /// The same, with the emitted colour lit; for grids.
    VR_MODE_LIT = 1,
    /// Maximum intensity projection: colour and opacity of the greatest scalar along the ray, with the path of one voxel; for grids.
    VR_MODE_MAXIMUM = 2,
}

/// Illumination of a grid by one directional light, from both sides. The emitted colour c becomes
/// c (ambient + diffuse |n.l|) + specular |n.h|^shininess, where n is the normalised central difference of the scalars, l points to the
/// light, and h halves the angle between l and the direction to the eye.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_lighting {
    /// sizeof(vr_lighting).
    pub struct_size: usize,
    /// Share of the colour that is seen whatever the direction of the light, at least 0.
    pub ambient: f64,
    /// Share of the colour that is seen where n points to the light, at least 0.
    pub diffuse: f64,
    /// Brightness of the white highlight, at least 0.
    pub specular: f64,
    /// Exponent of the highlight, 1 to 1024.
    pub shininess: f64,
    /// Direction to the light, in world coordinates, of any length; 0, 0, 0: to the eye.
    pub direction: [f64; 3],
    /// Length of the gradient, in scalars per unit of world length, up to which nothing is lit; negative: chosen for the data.
    pub least_gradient: f64,
}

// SAFETY: repr(C), numbers, the first its size.
unsafe impl Structure for vr_lighting {}

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
unsafe impl Structure for vr_points_info {}

/// Shape of a kernel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_kernel {
    /// A Gaussian that is cut.
    VR_KERNEL_GAUSSIAN = 1,
    /// The cubic B-spline.
    VR_KERNEL_BSPLINE = 2,
    /// Grids only: linear along each axis, so that the sum is trilinear interpolation.
    VR_KERNEL_TENT = 3,
    /// Grids only: Lanczos.
    VR_KERNEL_SINC = 4,
}

/// Meaning of the kernels' sum.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_kernel_model {
    /// Extinction: each kernel's, by its scalar, adds to that of the others.
    VR_KERNEL_DENSITY = 1,
    /// A scalar: the mean of the samples', weighted by the kernels.
    VR_KERNEL_INTERPOLATE = 2,
}

/// Kernels that reconstruct a field from the samples of a grid, the points of a mesh, or points. Zeros are the defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_kernels_info {
    /// sizeof(vr_kernels_info).
    pub struct_size: usize,
    /// A vr_kernel. 0: VR_KERNEL_GAUSSIAN.
    pub kernel: u32,
    /// A vr_kernel_model. 0: VR_KERNEL_DENSITY for points, else VR_KERNEL_INTERPOLATE.
    pub model: u32,
    /// Grids and Gaussians: standard deviation, in voxels along each axis. 0: 0.7.
    pub sigma: f64,
    /// Gaussians: distance at which they are cut, in standard deviations. 0: 3.
    pub cut: f64,
    /// VR_KERNEL_INTERPOLATE: smallest sum of weights that is not vacuum. 0: 0.05.
    pub least: f64,
}

// SAFETY: repr(C), numbers, the first its size.
unsafe impl Structure for vr_kernels_info {}

/// Reads kernels for data of a kind.
pub(super) fn kernels(info: &vr_kernels_info, of_points: bool) -> Result<Kernels> {
    let usual = if of_points { Kernels::of_points() } else { Kernels::of_samples() };
    let (kernels, models) = (Kernel::ALL.map(|(_, kernel)| kernel), Model::ALL.map(|(_, model)| model));
    let or = |given: f64, usual: f64| if given == 0.0 { usual } else { given };
    Ok(Kernels {
        kernel: if info.kernel == 0 { usual.kernel } else { choice(info.kernel, 1, &kernels, "kernel")? },
        model: if info.model == 0 { usual.model } else { choice(info.model, 1, &models, "model")? },
        sigma: or(info.sigma, usual.sigma),
        cut: or(info.cut, usual.cut),
        least: or(info.least, usual.least),
    })
}

/// The rule that Gaussian splats were trained under. The option `rule` of the technique `gaussians` selects another.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_trained_mode {
    /// Nothing is known: that of the first paper.
    VR_TRAINED_UNKNOWN = 0,
    /// That of the first paper (Kerbl and others 2023).
    VR_TRAINED_DEFAULT = 1,
    /// The same with opacities that make up for the widening (Mip-Splatting).
    VR_TRAINED_ANTIALIASED = 2,
    /// Flat splats that a ray intersects (2D Gaussian Splatting).
    VR_TRAINED_FLAT = 3,
    /// That of KHR_gaussian_splatting.
    VR_TRAINED_KHRONOS = 4,
}

/// Trained Gaussian splats. Those with NaN, infinite places or quaternions of length 0 are left out.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_gaussians_info {
    /// sizeof(vr_gaussians_info).
    pub struct_size: usize,
    /// Number of splats.
    pub splat_count: usize,
    /// x, y and z of each centre, in world units.
    pub centres: *const f32,
    /// Quaternion w, x, y, z of each.
    pub rotations: *const f32,
    /// Natural logarithms of the standard deviations along the rotated x, y and z of each; -INFINITY is flat.
    pub log_scales: *const f32,
    /// Opacity of each in its middle, 0 to 1.
    pub opacities: *const f32,
    /// For each splat the coefficients of red, green and blue for each of the (degree + 1)^2 spherical harmonics.
    pub harmonics: *const f32,
    /// Degree of the spherical harmonics, 0 to 4.
    pub degree: u32,
    /// A vr_trained_mode.
    pub trained: u32,
    /// Three letters that say what x, y and z point to, such as "rdf": r right, l left, u up, d down, f front, b back. NULL: "rub".
    pub axes: *const std::ffi::c_char,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_gaussians_info {}

pub(super) fn gaussians(caller: &Caller, info: &vr_gaussians_info) -> Result<Gaussians> {
    use TrainedMode::{Antialiased, Default, Flat, Khronos, Unknown};
    let count = info.splat_count;
    if info.degree > harmonics::MAX_DEGREE {
        return Err(Error::invalid(
            "degree",
            format!("{}: must be 0 to {}", info.degree, harmonics::MAX_DEGREE),
        ));
    }
    let numbers = count.saturating_mul(3 * harmonics::count(info.degree));
    let axes = match caller.text(info.axes, "axes")? {
        Some(name) => {
            let StoredAxes { axes, mirrored } = Axes::named(name)?;
            if mirrored {
                let why = format!("\"{name}\": left-handed, which splats of structures cannot be");
                return Err(Error::invalid("axes", why));
            }
            axes
        }
        None => Axes::Rub,
    };
    let parts = GaussianParts {
        centres: list(caller, info.centres.cast::<[f32; 3]>(), count, "centres")?,
        rotations: list(caller, info.rotations.cast::<[f32; 4]>(), count, "rotations")?,
        log_scales: list(caller, info.log_scales.cast::<[f32; 3]>(), count, "log_scales")?,
        opacities: list(caller, info.opacities, count, "opacities")?,
        degree: info.degree,
        harmonics: list(caller, info.harmonics, numbers, "harmonics")?,
        axes,
        mode: choice(info.trained, 0, &[Unknown, Default, Antialiased, Flat, Khronos], "trained")?,
    };
    Ok(Gaussians::new(parts)?.0)
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

/// Copies an array of the caller's.
fn list<T: Copy>(caller: &Caller, pointer: *const T, count: usize, name: &str) -> Result<Vec<T>> {
    copied(caller.array(pointer, count, name)?.iter().copied(), name)
}

/// Copies positions.
fn positions(caller: &Caller, pointer: *const f64, count: usize, name: &str) -> Result<Vec<DVec3>> {
    let given = caller.array(pointer.cast::<[f64; 3]>(), count, name)?;
    copied(given.iter().copied().map(DVec3::from_array), name)
}

pub(super) fn grid(caller: &Caller, info: &vr_grid_info) -> Result<Grid> {
    let samples = samples(caller, info.dims, info.sample_type, (info.samples, info.sample_bytes))?;
    let spacing = if info.spacing == [0.0; 3] { [1.0; 3] } else { info.spacing };
    let axes =
        if info.direction == [[0.0; 3]; 3] { DMat3::IDENTITY.to_cols_array_2d() } else { info.direction };
    let slope = if info.slope == 0.0 { 1.0 } else { info.slope };
    Grid::new(info.dims, samples)?
        .with_placement(spacing.into(), info.origin.into(), DMat3::from_cols_array_2d(&axes))?
        .with_rescale(Rescale { slope, intercept: info.intercept })
}

pub(super) fn scalars(caller: &Caller, values: *const f32, count: usize, per: u32) -> Result<TetScalars> {
    let kinds: [fn(Vec<f32>) -> TetScalars; 2] = [TetScalars::Point, TetScalars::Cell];
    let kind = choice(per, 1, &kinds, "scalars_per")?;
    Ok(kind(list(caller, values, count, "scalars")?))
}

pub(super) fn mesh(caller: &Caller, info: &vr_mesh_info) -> Result<Tets> {
    reserved(info.reserved)?;
    let points = positions(caller, info.points, info.point_count, "points")?;
    let cells = list(caller, info.cells.cast::<[u32; 4]>(), info.cell_count, "cells")?;
    let scalars = scalars(caller, info.scalars, info.scalar_count, info.scalars_per)?;
    Ok(Tets::new(points, cells, scalars)?.0)
}

pub(super) fn points(caller: &Caller, info: &vr_points_info) -> Result<Points> {
    let count = info.point_count;
    let mut points = Points::new(positions(caller, info.centres, count, "centres")?)?;
    if !info.scalars.is_null() {
        points = points.with_scalars(list(caller, info.scalars, count, "scalars")?)?;
    }
    if !info.weights.is_null() {
        points = points.with_weights(list(caller, info.weights, count, "weights")?)?;
    }
    let size = match (info.radii.is_null(), info.covariances.is_null()) {
        (true, true) if info.radius == 0.0 => return Ok(points.with_estimated_radius()),
        (true, true) => KernelSize::Radius(info.radius),
        (false, true) => KernelSize::Radii(list(caller, info.radii, count, "radii")?),
        (true, false) => {
            let covariances = info.covariances.cast::<[f32; 6]>();
            KernelSize::Covariances(list(caller, covariances, count, "covariances")?)
        }
        (false, false) => {
            return Err(Error::invalid("radii and covariances", "one of them must be NULL"));
        }
    };
    points.with_size(size)
}

pub(super) fn surface(caller: &Caller, info: &vr_surface_info) -> Result<Surface> {
    reserved(info.reserved)?;
    let shading = choice(info.shading, 0, &[Shading::Flat, Shading::Headlight], "shading")?;
    let points = positions(caller, info.points, info.point_count, "points")?;
    let triangles = list(caller, info.triangles.cast::<[u32; 3]>(), info.triangle_count, "triangles")?;
    Ok(Surface::new(points, triangles, info.colour)?.with_shading(shading))
}

/// Converts a transfer function; `None` without knots.
pub(super) fn transfer(
    caller: &Caller,
    knots: *const vr_knot,
    count: usize,
) -> Result<Option<TransferFunction>> {
    let knots = caller.array(knots, count, "knots")?;
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

pub(super) fn mode(caller: &Caller, mode: u32, lighting: *const vr_lighting) -> Result<Mode> {
    let mode = choice(mode, 0, &[Mode::Emission, Mode::Lit(Lighting::default()), Mode::Maximum], "mode")?;
    if lighting.is_null() {
        return Ok(mode);
    }
    if !matches!(mode, Mode::Lit(_)) {
        return Err(Error::invalid(
            "lighting",
            format!("belongs to mode lit, not to {}: must be NULL", mode.name()),
        ));
    }
    let info = caller.structure(lighting, "vr_lighting")?;
    Ok(Mode::Lit(Lighting {
        ambient: info.ambient,
        diffuse: info.diffuse,
        specular: info.specular,
        shininess: info.shininess,
        direction: (info.direction != [0.0; 3]).then(|| info.direction.into()),
        least_gradient: (!info.least_gradient.is_sign_negative()).then_some(info.least_gradient),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_every_type_are_copied_from_any_place() {
        fn check<T: bytemuck::NoUninit>(kind: vr_sample_type, values: [T; 8], want: Samples) {
            let bytes: &[u8] = bytemuck::cast_slice(&values);
            // Not aligned.
            let mut memory = vec![0xee_u8; bytes.len() + 1];
            memory[1..].copy_from_slice(bytes);
            // SAFETY: that many bytes follow.
            let caller = unsafe { Caller::trusted() };
            let given = (memory[1..].as_ptr().cast(), bytes.len());
            let got = samples(&caller, [2; 3], kind as u32, given);
            assert_eq!(got.unwrap(), want, "{kind:?}");
        }
        use vr_sample_type::*;
        let floats = |values: [f32; 8]| Samples::F32(values.to_vec());
        check(VR_SAMPLE_U8, [0_u8, 1, 2, 3, 4, 5, 6, 255], Samples::U8(vec![0, 1, 2, 3, 4, 5, 6, 255]));
        let u16s = [0_u16, 1, 258, 3, 4, 5, 6, 65535];
        check(VR_SAMPLE_U16, u16s, Samples::U16(u16s.to_vec()));
        let i16s = [0_i16, -1, 258, 3, 4, 5, 6, -32768];
        check(VR_SAMPLE_I16, i16s, Samples::I16(i16s.to_vec()));
        let f32s = [0.0_f32, -1.5, 1e30, 3.0, 4.0, 5.0, 6.0, f32::INFINITY];
        check(VR_SAMPLE_F32, f32s, floats(f32s));
        check(VR_SAMPLE_I8, [-128_i8, 1, 2, 3, 4, 5, 6, 127], floats([-128., 1., 2., 3., 4., 5., 6., 127.]));
        let large = 4_294_967_296.0;
        check(VR_SAMPLE_U32, [u32::MAX, 1, 2, 3, 4, 5, 6, 7], floats([large, 1., 2., 3., 4., 5., 6., 7.]));
        check(VR_SAMPLE_I32, [-5_i32, 1, 2, 3, 4, 5, 6, 7], floats([-5., 1., 2., 3., 4., 5., 6., 7.]));
        check(VR_SAMPLE_U64, [1_u64 << 32, 1, 2, 3, 4, 5, 6, 7], floats([large, 1., 2., 3., 4., 5., 6., 7.]));
        check(
            VR_SAMPLE_I64,
            [-(1_i64 << 32), 1, 2, 3, 4, 5, 6, 7],
            floats([-large, 1., 2., 3., 4., 5., 6., 7.]),
        );
        check(
            VR_SAMPLE_F64,
            [0.1_f64, 1., 2., 3., 4., 5., 6., 1e300],
            floats([0.1, 1., 2., 3., 4., 5., 6., f32::INFINITY]),
        );
    }

    #[test]
    fn sizes_are_checked_before_anything_is_read() {
        let place = std::ptr::dangling::<u8>().cast();
        // SAFETY: refused before anything is read.
        let caller = unsafe { Caller::trusted() };
        let refused =
            |dims, kind, bytes| samples(&caller, dims, kind, (place, bytes)).unwrap_err().to_string();
        assert!(refused([2; 3], 2, 8).contains("need 16 bytes, 8 are given"));
        assert!(refused([u32::MAX; 3], 10, usize::MAX).contains("more than 2^64"));
        assert!(refused([2; 3], 0, 8).contains("sample_type: 0"));
        assert!(refused([2; 3], 11, 8).contains("must be one of 1, 2"));
    }

    #[test]
    fn every_type_has_a_code() {
        for kind in SampleType::ALL {
            assert_eq!(SAMPLE_TYPES.iter().filter(|known| **known == kind).count(), 1, "{kind:?}");
        }
    }
}
