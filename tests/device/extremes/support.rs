//! Scenes with closed forms, views, bounds.

use glam::{DMat3, DVec2, DVec3};
use volraster::Image;
use volraster::scene::{
    Camera, Data, Grid, Projection, Samples, Scene, TetScalars, Tets, TransferFunction, View,
};

use crate::common::*;

/// What composited pieces may round, of values in [0, 1].
pub fn t32(pieces: f64) -> f64 {
    (1.2e-7 * pieces).max(2e-6)
}

/// Opacity of an optical depth.
pub fn opacity(od: f64) -> f64 {
    -(-od).exp_m1()
}

/// Within `bound` of what is wanted, and a number.
pub fn near(what: &str, got: f64, want: f64, bound: f64) -> Result<(), String> {
    if (got - want).abs() <= bound {
        Ok(())
    } else {
        Err(format!("{what} {got} is not {want} within {bound:.1e}: off by {:.2e}", got - want))
    }
}

pub fn transfer(rows: &[[f64; 5]]) -> TransferFunction {
    TransferFunction::from_rows(rows).unwrap()
}

/// One colour, which no two channels share.
pub const COLOUR: [f64; 3] = [0.25, 0.5, 1.0];

/// The same extinction everywhere.
pub fn fog(tau: f64) -> TransferFunction {
    transfer(&[[0.0, COLOUR[0], COLOUR[1], COLOUR[2], tau]])
}

/// Extinction from `a` at 0 to `b` at 1, in the one colour.
pub fn ramp(a: f64, b: f64) -> TransferFunction {
    let [red, green, blue] = COLOUR;
    transfer(&[[0.0, red, green, blue, a], [1.0, red, green, blue, b]])
}

/// A box of samples of a function of the place.
pub fn grid(dims: [u32; 3], low: DVec3, high: DVec3, field: impl Fn(DVec3) -> f64) -> Grid {
    let step = (high - low) / DVec3::from_array(dims.map(|n| f64::from(n - 1)));
    let mut values = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                values.push(field(low + step * DVec3::new(x.into(), y.into(), z.into())) as f32);
            }
        }
    }
    Grid::new(dims, Samples::F32(values)).unwrap().with_placement(step, low, DMat3::IDENTITY).unwrap()
}

/// How a block is cut into tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    Five,
    Six,
    TwentyFour,
}

/// Blocks between planes along each axis, cut so that neighbours share faces.
pub fn blocks(planes: [&[f64]; 3], cut: Cut, field: impl Fn(DVec3) -> f64) -> Tets {
    let count = planes.map(|planes| planes.len() - 1);
    let mut points: Vec<DVec3> = Vec::new();
    for &z in planes[2] {
        for &y in planes[1] {
            points.extend(planes[0].iter().map(|&x| DVec3::new(x, y, z)));
        }
    }
    let mut cells: Vec<[u32; 4]> = Vec::new();
    for z in 0..count[2] {
        for y in 0..count[1] {
            for x in 0..count[0] {
                let corner = |i: usize| {
                    let at = [x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)];
                    ((at[2] * (count[1] + 1) + at[1]) * (count[0] + 1) + at[0]) as u32
                };
                match cut {
                    Cut::Five => {
                        // Mirrored in every other block, so that diagonals of shared faces meet.
                        let flip = (x + y + z) % 2;
                        let five = [[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]];
                        cells.extend(five.map(|cell| cell.map(|i| corner(i ^ flip))));
                    }
                    Cut::Six => {
                        // Along the paths from corner 0 to corner 7.
                        for path in [[1, 2, 4], [1, 4, 2], [2, 1, 4], [2, 4, 1], [4, 1, 2], [4, 2, 1]] {
                            let [a, b] = [path[0], path[0] + path[1]];
                            cells.push([corner(0), corner(a), corner(b), corner(7)]);
                        }
                    }
                    Cut::TwentyFour => {
                        let at = |corners: &[usize]| {
                            let sum: DVec3 = corners.iter().map(|&i| points[corner(i) as usize]).sum();
                            sum / corners.len() as f64
                        };
                        let body = at(&[0, 1, 2, 3, 4, 5, 6, 7]);
                        let faces = [
                            [0, 1, 3, 2],
                            [4, 5, 7, 6],
                            [0, 1, 5, 4],
                            [2, 3, 7, 6],
                            [0, 2, 6, 4],
                            [1, 3, 7, 5],
                        ];
                        let middles = faces.map(|face| at(&face));
                        let first = points.len() as u32;
                        points.push(body);
                        for (i, (face, middle)) in (1..).zip(faces.iter().zip(middles)) {
                            points.push(middle);
                            for k in 0..4 {
                                let [a, b] = [face[k], face[(k + 1) % 4]].map(corner);
                                cells.push([first, first + i, a, b]);
                            }
                        }
                    }
                }
            }
        }
    }
    let scalars = points.iter().map(|&p| field(p) as f32).collect();
    Tets::new(points, cells, TetScalars::Point(scalars)).unwrap().0
}

/// `n` + 1 planes from -1 to 1.
pub fn planes(n: u32) -> Vec<f64> {
    (0..=n).map(|i| 2.0 * f64::from(i) / f64::from(n) - 1.0).collect()
}

/// The cube [-1, 1]³ of `n` blocks along each axis.
pub fn cube(n: u32, cut: Cut, field: impl Fn(DVec3) -> f64) -> Tets {
    let planes = planes(n);
    blocks([&planes, &planes, &planes], cut, field)
}

/// The cube of one block across and `layers` along z.
pub fn layered(layers: u32, field: impl Fn(DVec3) -> f64) -> Tets {
    blocks([&planes(1), &planes(1), &planes(layers)], Cut::Five, field)
}

/// The cube as each kind of data: samples at each `n`-th, and as many blocks.
pub fn kinds(n: u32, field: impl Fn(DVec3) -> f64) -> Vec<Data> {
    vec![grid([n + 1; 3], DVec3::NEG_ONE, DVec3::ONE, &field).into(), cube(n, Cut::Five, &field).into()]
}

pub fn scenes(n: u32, transfer: &TransferFunction, field: impl Fn(DVec3) -> f64) -> Vec<Scene> {
    kinds(n, field).into_iter().map(|data| Scene::new(data, transfer.clone())).collect()
}

/// Along -z, rays inside the cube's face and off every edge of its cells: all cross 2 units.
pub fn through(width: u32, height: u32) -> View {
    along(DVec3::Z, DVec3::Y, width, height)
}

/// The same along another axis.
pub fn along(axis: DVec3, up: DVec3, width: u32, height: u32) -> View {
    let aside = (axis.cross(up) * 0.0137 + up * 0.0291).normalize() * 0.0322;
    let projection = Projection::Orthographic { half_height: 0.4 };
    let camera = Camera { eye: axis * 5.0 + aside, target: aside, up, projection };
    View::new(camera, width, height).unwrap()
}

pub fn look(eye: DVec3, target: DVec3, up: DVec3, fov_y_deg: f64, side: u32) -> View {
    let projection = Projection::Perspective { fov_y_deg };
    View::new(Camera { eye, target, up, projection }, side, side).unwrap()
}

/// An affine field without a symmetry, within [0, 1] in the cube.
pub fn affine(p: DVec3) -> f64 {
    0.5 + 0.27 * p.x - 0.13 * p.y + 0.09 * p.z
}

/// Extinction of [`affine`] under [`ramp`] of these ends.
pub const ENDS: [f64; 2] = [0.2, 2.2];

/// Begin and length of a ray in the cube, and where it comes from and goes.
fn piece(view: &View, pixel: DVec2) -> (DVec3, DVec3, f64, f64) {
    let (origin, direction) = view.ray(pixel);
    let mut begin = if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY };
    for axis in 0..3 {
        let side = |at: f64| (at - origin[axis]) / direction[axis];
        begin = f64::max(begin, side(-1.0).min(side(1.0)));
    }
    (origin, direction, begin, chord(view, pixel))
}

/// Optical depth of [`affine`] under [`ramp`] of [`ENDS`]: linear along the ray, so its mean is that of the middle.
pub fn affine_depth(view: &View, pixel: DVec2) -> f64 {
    let (origin, direction, begin, length) = piece(view, pixel);
    if length <= 0.0 {
        return 0.0;
    }
    let mean = affine(origin + direction * (begin + 0.5 * length));
    (ENDS[0] + (ENDS[1] - ENDS[0]) * mean) * length
}

/// The finest warp: what other techniques lack is left out.
pub const FINE: &[(&str, &str)] =
    &[("step", "0.25"), ("filter", "exact"), ("intermediate", "8"), ("warp", "bicubic")];

/// Most that a bicubic warp of texels so many pixels apart is off by at a pixel, of an image of which every place is known.
///
/// Keys' kernel gives polynomials of the second degree back, along each side of the lattice. So what it is off by is a sum of
/// third differences over its four texels, of weights that add up to less than one (`x (1 - x) (1 - 2 x) / 12` of one where the
/// third derivative is constant). The lattice lies anywhere in the image: the largest third difference within two and a half
/// texels is taken, in any direction, for each of two sides. An outline that is so near makes it as large as the jump, an
/// edge of the domain that is seen through it as the kink: there the bound says nothing, as it should.
pub fn warped(pixel: DVec2, texel: f64, value: impl Fn(DVec2) -> f64) -> f64 {
    let mut most = 0.0_f64;
    for i in 0..6 {
        let d = DVec2::from_angle(f64::from(i) / 6.0 * std::f64::consts::PI) * texel;
        for (x, y) in (-1..=1).flat_map(|y| (-1..=1).map(move |x| (x, y))) {
            let at = |t: f64| value(pixel + DVec2::new(x.into(), y.into()) * texel + d * t);
            most = most.max((at(1.5) - at(-1.5) - 3.0 * (at(0.5) - at(-0.5))).abs());
        }
    }
    2.0 * most
}

/// Every pixel has the opacity of `depth` and the one colour, but for those next to the cube's outline.
pub fn assert_depths(
    image: &Image,
    view: &View,
    bound: impl Fn(DVec2) -> f64,
    depth: impl Fn(DVec2) -> f64,
) -> Result<(), String> {
    for (i, pixel) in pixels(view).filter(|(_, pixel)| !on_outline(view, *pixel)) {
        let bound = bound(pixel);
        let [r, g, b, a] = image.pixels()[i].map(f64::from);
        near(&format!("opacity at {pixel}"), a, opacity(depth(pixel)), bound)?;
        for (got, colour) in [r, g, b].into_iter().zip(COLOUR) {
            near(&format!("colour at {pixel}"), got, colour * a, bound)?;
        }
    }
    Ok(())
}

/// The largest difference of two images; NaN is infinite.
pub fn apart(a: &Image, b: &Image) -> f64 {
    let pairs = a.pixels().iter().flatten().zip(b.pixels().iter().flatten());
    pairs.fold(0.0, |most, (a, b)| {
        let apart = (f64::from(*a) - f64::from(*b)).abs();
        if apart <= most {
            most
        } else if apart.is_nan() {
            f64::INFINITY
        } else {
            apart
        }
    })
}

/// The same bits.
pub fn equal(what: &str, a: &Image, b: &Image) -> Result<(), String> {
    if a == b { Ok(()) } else { Err(format!("{what}: not the same image: off by {:.1e}", apart(a, b))) }
}

pub fn finite(image: &Image) -> Result<(), String> {
    let odd = image.pixels().iter().flatten().filter(|value| !value.is_finite()).count();
    if odd == 0 { Ok(()) } else { Err(format!("{odd} values are no numbers")) }
}
