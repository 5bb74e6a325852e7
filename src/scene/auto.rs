//! A camera and a transfer function for data that comes without them.
//!
//! Both are functions of the data alone: the same file gives the same image.

mod framing;
mod grid;
mod mesh;
mod points;
mod statistics;
mod visible;

pub use framing::{Side, camera, camera_of};
pub use visible::visible;

use glam::DVec3;

pub use self::statistics::DEPTH;
use self::statistics::{COOL, WARM, knot, quantile, sorted};
use super::{Data, Kernels, Knot, Lighting, Mode, TransferFunction};
use crate::error::{Error, Result};

/// The colour of an isosurface that none is chosen for: linear RGB, bone.
pub const ISOSURFACE_COLOUR: DVec3 = DVec3::new(0.9, 0.84, 0.7);

/// Derives a transfer function that shows the data's structure from the distribution of its values alone.
///
/// - Grid: the background (air, zero, padding) is the peak of the histogram, provided the faces of the grid's
///   box have that value too. It becomes vacuum; the foreground starts at the foot of the peak.
/// - Mesh: the background is a value that at least a tenth of the volume has, such as the free stream. It
///   becomes a haze that shows the shape of the mesh; values above it are warm, values below it cool.
/// - Points: low scalars become a haze. Points without scalars have one colour.
/// - Gaussian splats: one white knot, which is ignored.
/// - Values of both signs, of which neither is a mere undershoot of the other: magnitudes count, with warm colours above zero and cool
///   ones below it ([`diverges`]). A grid with a background or a border of another value than zero, as in computed tomography, has one
///   foreground as above, and a mesh with a background diverges around that.
///
/// Knots are placed at quantiles of the foreground, by samples or by volume, so outliers have little
/// influence and all data use the whole colour range. Extinction is scaled so that the densest tenth of the
/// rays through the foreground has an optical depth of at least 5. The image is therefore neither empty nor a
/// solid block, whatever the unit of length.
///
/// # Errors
///
/// [`crate::Error::Invalid`] if the values are so large that float64 cannot hold their differences.
pub fn transfer(data: &Data) -> Result<TransferFunction> {
    transfer_of(data, None)
}

/// Derives a transfer function as [`transfer`] does, for a scene with kernels of its own.
///
/// With [`Model::Density`](super::Model) extinction is scaled by the sum of the kernels along a ray, with
/// [`Model::Interpolate`](super::Model) by the length of the ray inside kernels.
///
/// # Errors
///
/// As [`transfer`].
pub fn transfer_of(data: &Data, kernels: Option<&Kernels>) -> Result<TransferFunction> {
    match data {
        Data::Grid(grid) => grid::transfer(grid),
        Data::Mesh(mesh) => mesh::transfer(mesh),
        Data::Points(points) => points::transfer(points, kernels.unwrap_or(&Kernels::of_points())),
        Data::Gaussians(_) => TransferFunction::new(vec![knot(0.0, 1.0, [1.0; 3])]),
    }
}

/// Derives a transfer function for a mode: [`maximum`] for maximum intensity projection, else [`transfer_of`].
///
/// # Errors
///
/// Those of either.
pub fn transfer_in(data: &Data, kernels: Option<&Kernels>, mode: Mode) -> Result<TransferFunction> {
    if mode == Mode::Maximum { maximum(data) } else { transfer_of(data, kernels) }
}

/// Returns a transfer function with its extinction scaled so that the densest tenth of the rays through what it shows has this optical depth.
///
/// # Errors
///
/// [`Error::Invalid`] if an extinction is not finite then.
pub fn fitted(
    data: &Data,
    kernels: Option<&Kernels>,
    transfer: &TransferFunction,
    depth: f64,
) -> Result<TransferFunction> {
    let dense = match data {
        Data::Grid(grid) => grid::dense_depth(grid, transfer),
        Data::Mesh(mesh) => mesh::dense_depth(mesh, transfer),
        Data::Points(points) => {
            points::dense_depth(points, kernels.unwrap_or(&Kernels::of_points()), transfer)
        }
        Data::Gaussians(_) => return Ok(transfer.clone()),
    };
    transfer.thickened(depth / dense)
}

/// Returns finite scalars of an evenly spread, repeatable subset of the data, ascending: samples of a grid, equal shares of a mesh's
/// volume, or visible points.
fn values(data: &Data) -> Vec<f64> {
    match data {
        Data::Grid(grid) => sorted(grid::all_samples(grid)),
        Data::Mesh(mesh) => mesh::drawn(mesh),
        Data::Points(points) => points::shown(points),
        Data::Gaussians(_) => Vec::new(),
    }
}

/// Returns the shape of a transfer function that grows both ways from a middle, with cool colours below it and warm ones above: from zero for
/// data of both signs, else from their median.
pub(super) fn diverging(data: &Data) -> Result<TransferFunction> {
    const TAUS: [f64; 7] = [0.0, 0.01, 0.05, 0.15, 0.35, 0.65, 1.0];
    let [least, greatest] = data.range();
    let values = values(data);
    let one_sign = least >= 0.0 || greatest <= 0.0;
    let middle = if one_sign && !values.is_empty() { quantile(&values, 0.5) } else { 0.0 };
    let magnitudes = sorted(values.into_iter().map(|s| (s - middle).abs()).collect());
    let reach = [quantile(&magnitudes, 0.999), (greatest - middle).max(middle - least)];
    let reach = reach.into_iter().find(|reach| *reach > 0.0).unwrap_or(1.0);
    let side = |sign: f64, colours: [[f64; 3]; 7]| {
        (0..7_u8)
            .zip(TAUS)
            .zip(colours)
            .map(move |((i, tau), colour)| knot(middle + sign * reach * f64::from(i) / 6.0, tau, colour))
    };
    TransferFunction::new(
        side(-1.0, COOL).collect::<Vec<_>>().into_iter().rev().chain(side(1.0, WARM)).collect(),
    )
}

/// Returns the lower and upper end of the positive scalars, without outliers, for scales of their logarithm.
pub(super) fn decades(data: &Data) -> Result<[f64; 2]> {
    let mut values = values(data);
    values.retain(|s| *s > 0.0);
    let [low, high] = [0.01, 0.9995].map(|share| quantile(&values, share));
    if low < high {
        return Ok([low, high]);
    }
    let [least, greatest] = data.range();
    Err(Error::invalid(
        "preset log",
        format!("requires different scalars above zero, these are {least} to {greatest}"),
    ))
}

/// Derives a transfer function for maximum intensity projection: white, with an opacity over one voxel that rises linearly
/// over the scalars that [`transfer`] shows, of those of both signs over the positive ones, from 0 to 0.98.
///
/// # Errors
///
/// As [`transfer`]; [`Error::Invalid`] for data that is not a grid.
pub fn maximum(data: &Data) -> Result<TransferFunction> {
    const STEPS: u32 = 16;
    let Data::Grid(grid) = data else {
        return Err(Error::invalid("maximum", format!("requires a grid, not a {}", data.kind())));
    };
    let transfer = transfer(data)?;
    let [low, high] = transfer.domain();
    let low = if diverges(&transfer) { 0.0 } else { low };
    let voxel = grid.spacing().min_element();
    let knot = |i: u32| {
        let share = f64::from(i) / f64::from(STEPS);
        Knot { s: low + (high - low) * share, colour: DVec3::ONE, tau: -(-0.98 * share).ln_1p() / voxel }
    };
    TransferFunction::new((0..=STEPS).map(knot).collect())
}

/// Returns whether a transfer function shows values of equal magnitude and either sign equally opaque, as [`transfer`] makes it for data of
/// both signs.
#[must_use]
pub fn diverges(transfer: &TransferFunction) -> bool {
    let knots = transfer.knots();
    let [low, high] = transfer.domain();
    low < 0.0
        && high > 0.0
        && knots.iter().zip(knots.iter().rev()).all(|(a, b)| a.s == -b.s && a.tau == b.tau)
}

/// Returns the mode in which solid bodies are shown: lit in a grid, emission elsewhere.
#[must_use]
pub fn lit(data: &Data, kernels: Option<&Kernels>) -> Mode {
    let can_be_lit = matches!(data, Data::Grid(_)) && kernels.is_none();
    if can_be_lit { Mode::Lit(Lighting::default()) } else { Mode::Emission }
}

/// Makes the transfer function of an isosurface: vacuum below a scalar, one colour from it on, which is opaque within a
/// hundred-thousandth of the diagonal of the data's box.
///
/// # Errors
///
/// [`Error::Invalid`] if no scalar of the data lies below `s` or none above it, the data has none, or the colour is negative or not finite.
pub fn isosurface(data: &Data, s: f64, colour: DVec3) -> Result<TransferFunction> {
    if let Data::Gaussians(_) = data {
        return Err(Error::invalid("isosurface", "gaussians have no scalars"));
    }
    let [least, greatest] = data.range();
    if !(s > least && s <= greatest) {
        let why = format!("{s}: the data has scalars from {least} to {greatest}, and no surface there");
        return Err(Error::invalid("isosurface", why));
    }
    let corners = data.corners();
    let diagonal = corners.iter().map(|corner| corner.distance(corners[0])).fold(0.0, f64::max);
    // exp(-12) is below a step of 16 bits.
    let tau = if diagonal > 0.0 { 12e5 / diagonal } else { 1.0 };
    TransferFunction::new([0.0, tau].map(|tau| Knot { s, colour, tau }).to_vec())
}
