//! Rays through a regular grid, cut at every voxel face.

use glam::{DMat3, DVec3};

use crate::num;
use crate::scene::{Grid, Lighting, Mode, TransferFunction};

use super::march::{Classes, March, finite};
use super::polynomial::{self, Cubic};

/// Samples are clamped to this magnitude, so that their differences and products do not overflow. Only a
/// rescale can exceed it; no stored type does.
const MAX_SAMPLE: f64 = 1e100;

/// The index space of a grid, where samples are one unit apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct IndexSpace {
    to_index: DMat3,
    centre: DVec3,
    /// Position of the last sample.
    pub(super) last: DVec3,
}

/// The part of a ray inside a box of index space. The parameter is a world length.
#[derive(Clone, Copy, Debug)]
pub(super) struct IndexRay {
    pub(super) start: DVec3,
    pub(super) slope: DVec3,
    pub(super) range: [f64; 2],
}

impl IndexSpace {
    pub(super) fn new(grid: &Grid) -> Self {
        Self { to_index: grid.index_to_world().inverse(), centre: grid.centre(), last: grid.last_index() }
    }

    /// Clips a ray to the closed box that reaches `beyond` the samples on each side. `direction` has unit length.
    pub(super) fn ray(
        &self,
        origin: DVec3,
        direction: DVec3,
        range: [f64; 2],
        beyond: f64,
    ) -> Option<IndexRay> {
        // Measure from the point of the ray nearest to the grid's centre: coordinates along the ray are then
        // as small as the grid, however far the eye is.
        let nearest = (self.centre - origin).dot(direction);
        let start = self.to_index * (origin + direction * nearest - self.centre) + self.last * 0.5;
        let slope = self.to_index * direction;
        let [mut from, mut to] = range.map(|t| t - nearest);
        let (low, high) = (DVec3::ZERO - beyond, self.last + beyond);
        for axis in 0..3 {
            if slope[axis] == 0.0 {
                if !(start[axis] >= low[axis] && start[axis] <= high[axis]) {
                    return None;
                }
                continue;
            }
            let [a, b] = [low, high].map(|side| (side[axis] - start[axis]) / slope[axis]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        let inside = from < to && from.is_finite() && to.is_finite();
        inside.then_some(IndexRay { start, slope, range: [from, to] })
    }
}

/// A scene's grid and transfer function, prepared for rays.
#[derive(Debug)]
pub(super) struct GridRays<'a> {
    grid: &'a Grid,
    transfer: &'a TransferFunction,
    mode: Mode,
    classes: Classes,
    space: IndexSpace,
    /// Scalars that stand for -Inf and +Inf.
    ends: [f64; 2],
}

/// The segment of a ray inside one cell, between two positions in the cell's own coordinates.
struct Segment {
    cell: [u32; 3],
    from: DVec3,
    to: DVec3,
    length: f64,
}

impl<'a> GridRays<'a> {
    pub(super) fn new(grid: &'a Grid, transfer: &'a TransferFunction, mode: Mode) -> Self {
        let (classes, space) = (Classes::new(transfer), IndexSpace::new(grid));
        Self { grid, transfer, mode, classes, space, ends: transfer.domain() }
    }

    /// Draws one ray. `direction` has unit length, so the parameter is a world length.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3, range: [f64; 2]) -> [f64; 4] {
        let Some(ray) = self.space.ray(origin, direction, range, 0.0) else { return [0.0; 4] };
        if self.mode == Mode::Maximum {
            return self.maximum(&ray);
        }
        let light = if let Mode::Lit(lighting) = &self.mode {
            Some(Light::new(self.grid, lighting, direction))
        } else {
            None
        };
        let mut march = March::default();
        self.walk(&ray, |segment| {
            self.add_cell(&mut march, segment, light.as_ref());
            march.is_opaque()
        });
        march.pixel()
    }

    /// Returns colour and opacity of the greatest scalar of a ray, with the path of one voxel.
    fn maximum(&self, ray: &IndexRay) -> [f64; 4] {
        let mut greatest = f64::NEG_INFINITY;
        self.walk(ray, |Segment { cell, from, to, .. }| {
            let v = self.corners(*cell);
            if !v.iter().any(|v| v.is_nan()) {
                let scalar = along(&v, *from, *to - *from);
                let turns = polynomial::turning_points(&scalar);
                for x in turns.into_iter().filter(|x| !x.is_nan()).chain([0.0, 1.0]) {
                    greatest = greatest.max(polynomial::value(&scalar, x));
                }
            }
            false
        });
        if greatest == f64::NEG_INFINITY {
            return [0.0; 4];
        }
        let (colour, tau) = self.transfer.at(greatest);
        let alpha = -(-tau * self.grid.spacing().min_element()).exp_m1();
        (colour * alpha).extend(alpha).to_array()
    }

    /// Visits the cells of a ray in order, until `visit` returns whether to end.
    fn walk(&self, ray: &IndexRay, mut visit: impl FnMut(&Segment) -> bool) {
        let IndexRay { start, slope, range: [t0, t1] } = *ray;
        let (start, slope) = (start.to_array(), slope.to_array());

        // Step from face to face. A face's parameter is computed from its index, not accumulated. Two faces
        // at one place leave a segment of length zero between them.
        let dims = self.grid.dims();
        let mut cell: [u32; 3] = std::array::from_fn(|axis| {
            num::u32_of((start[axis] + slope[axis] * t0).floor()).min(dims[axis] - 2)
        });
        let face = |axis: usize, cell: u32| {
            let far = f64::from(cell + u32::from(slope[axis] > 0.0));
            if slope[axis] == 0.0 { f64::INFINITY } else { (far - start[axis]) / slope[axis] }
        };
        let mut next: [f64; 3] = std::array::from_fn(|axis| face(axis, cell[axis]));
        let mut t = t0;
        let mut ended = false;
        loop {
            let axis = match next {
                [x, y, z] if x <= y && x <= z => 0,
                [_, y, z] if y <= z => 1,
                _ => 2,
            };
            let end = next[axis].min(t1);
            if end > t {
                let local = |t: f64| {
                    DVec3::from_array(std::array::from_fn(|axis| {
                        start[axis] + slope[axis] * t - f64::from(cell[axis])
                    }))
                };
                ended = visit(&Segment { cell, from: local(t), to: local(end), length: end - t });
                t = end;
            }
            if next[axis] >= t1 || ended {
                return;
            }
            if slope[axis] > 0.0 {
                if cell[axis] + 2 >= dims[axis] {
                    return;
                }
                cell[axis] += 1;
            } else {
                if cell[axis] == 0 {
                    return;
                }
                cell[axis] -= 1;
            }
            next[axis] = face(axis, cell[axis]);
        }
    }

    /// Adds a segment.
    fn add_cell(&self, march: &mut March, segment: &Segment, light: Option<&Light>) {
        let Segment { cell, from, to, length } = *segment;
        let v = self.corners(cell);
        let (mut low, mut high) = (v[0], v[0]);
        for &value in &v {
            if value.is_nan() {
                return;
            }
            low = low.min(value);
            high = high.max(value);
        }
        if self.classes.is_vacuum(self.classes.interval(low), self.classes.interval(high)) {
            return;
        }
        let scalar = along(&v, from, to - from);
        let Some(light) = light else { return march.add_cubic(&self.classes, &scalar, length, None) };
        let base = DVec3::from_array(cell.map(f64::from)) + from;
        let shade = |x: f64| light.seen(self.gradient(base + (to - from) * x));
        march.add_cubic(&self.classes, &scalar, length, Some(&shade));
    }

    /// Returns the samples at the corners of a cell. Bits number them: 1 is x, 2 is y, 4 is z.
    fn corners(&self, cell: [u32; 3]) -> [f64; 8] {
        std::array::from_fn(|corner| {
            let step = |bit: usize| u32::from(corner & bit != 0);
            self.sample(cell[0] + step(1), cell[1] + step(2), cell[2] + step(4))
        })
    }

    /// Returns the scalar at a position; beyond the grid that of its nearest place.
    fn scalar(&self, position: DVec3) -> f64 {
        let place = position.clamp(DVec3::ZERO, self.space.last);
        let base = place.floor().min(self.space.last - 1.0).max(DVec3::ZERO);
        let cell = base.to_array().map(num::u32_of);
        along(&self.corners(cell), place - base, DVec3::ZERO)[0]
    }

    /// Returns the central difference at a position, in scalars per voxel along each axis.
    fn gradient(&self, position: DVec3) -> DVec3 {
        let along = |axis: DVec3| 0.5 * (self.scalar(position + axis) - self.scalar(position - axis));
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
    }

    /// Returns one sample. NaN stays and means vacuum; infinities become the ends of the transfer function.
    fn sample(&self, x: u32, y: u32, z: u32) -> f64 {
        let value = self.grid.value(x, y, z);
        if value.is_infinite() { finite(value, self.ends) } else { value.clamp(-MAX_SAMPLE, MAX_SAMPLE) }
    }
}

/// Returns the trilinear interpolant of a cell's corners along a line, as a cubic of the line's parameter.
///
/// Bits number the corners: 1 is x, 2 is y, 4 is z. Where corners are equal, the coefficients made of their
/// differences are exactly zero.
fn along(v: &[f64; 8], at: DVec3, d: DVec3) -> Cubic {
    let (x, y, z) = (v[1] - v[0], v[2] - v[0], v[4] - v[0]);
    let xy = (v[3] - v[2]) - x;
    let xz = (v[5] - v[4]) - x;
    let yz = (v[6] - v[4]) - y;
    let xyz = ((v[7] - v[6]) - (v[5] - v[4])) - xy;
    [
        v[0] + at.x * x + at.y * (y + at.x * xy) + at.z * (z + at.x * xz + at.y * (yz + at.x * xyz)),
        d.x * (x + at.y * xy + at.z * (xz + at.y * xyz))
            + d.y * (y + at.x * xy + at.z * (yz + at.x * xyz))
            + d.z * (z + at.x * xz + at.y * (yz + at.x * xyz)),
        d.x * d.y * (xy + at.z * xyz) + d.x * d.z * (xz + at.y * xyz) + d.y * d.z * (yz + at.x * xyz),
        d.x * d.y * d.z * xyz,
    ]
}

/// The light on a ray.
struct Light {
    lighting: Lighting,
    to_world: DMat3,
    to_light: DVec3,
    to_eye: DVec3,
    least: f64,
}

impl Light {
    /// Takes the light of a ray in this direction.
    fn new(grid: &Grid, lighting: &Lighting, direction: DVec3) -> Self {
        Self {
            lighting: *lighting,
            to_world: grid.index_to_world().inverse().transpose(),
            to_light: lighting.direction.map_or(-direction, DVec3::normalize),
            to_eye: -direction,
            least: lighting.least_gradient_of(grid),
        }
    }

    /// Returns the factor of the colour, and the highlight, for a gradient in scalars per voxel.
    fn seen(&self, gradient: DVec3) -> [f64; 2] {
        let gradient = self.to_world * gradient;
        // Neither a zero gradient nor NaN is above the limit.
        if gradient.length() > self.least && gradient.length() > 0.0 {
            let (n, h) = (gradient.normalize(), (self.to_light + self.to_eye).normalize_or_zero());
            let Lighting { ambient, diffuse, specular, shininess, .. } = self.lighting;
            let highlight = n.dot(h).abs().min(1.0).powf(shininess);
            [ambient + diffuse * n.dot(self.to_light).abs(), specular * highlight]
        } else {
            [1.0, 0.0]
        }
    }
}
