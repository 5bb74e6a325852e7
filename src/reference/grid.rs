//! Rays through a regular grid, cut at every voxel face.

use glam::{DMat3, DVec3};

use crate::scene::{Grid, Lighting, Mode, TransferFunction};

use super::cells::{Cells, Trilinear};
use super::index_space::{IndexRay, IndexSpace};
use super::march::{Classes, March};
use super::polynomial;
use super::walk::{Segment, Walk};

/// The greatest share by which rounding may lift an interpolant above its corners, generously.
const ROUNDING: f64 = 1e-9;

/// A scene's grid and transfer function, prepared for rays.
#[derive(Debug)]
pub(super) struct GridRays<'a> {
    grid: &'a Grid,
    transfer: &'a TransferFunction,
    mode: Mode,
    classes: Classes,
    space: IndexSpace,
    cells: Cells<'a>,
}

impl<'a> GridRays<'a> {
    pub(super) fn new(grid: &'a Grid, transfer: &'a TransferFunction, mode: Mode) -> Self {
        let (classes, space) = (Classes::new(transfer), IndexSpace::new(grid));
        Self { grid, transfer, mode, classes, space, cells: Cells::new(grid, transfer.domain()) }
    }

    #[cfg(test)]
    pub(super) fn cells(&self) -> &Cells<'a> {
        &self.cells
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
        let most = light.as_ref().map_or(self.classes.most, |light| light.most(self.classes.most));
        let mut march = March::new(most.to_array());
        let empty = |[low, high]: [f64; 2]| low > high || self.classes.is_vacuum([low, high]);
        let mut walk = Walk::new(&self.cells, &ray);
        while let Some(Segment { cell, t: [from, to] }) = walk.next(empty) {
            let v = self.cells.corners(cell);
            if has_nan(&v) || self.classes.is_vacuum(extremes(&v)) {
                continue;
            }
            let (start, end) = (walk.local(cell, from), walk.local(cell, to));
            let scalar = Trilinear::new(&v).along(start, end - start);
            if let Some(light) = &light {
                let stencil = Stencil::new(&self.cells, cell);
                let base = DVec3::from_array(cell.map(f64::from)) + start;
                let shade = |x: f64| light.seen(stencil.gradient(base + (end - start) * x));
                march.add_cubic(&self.classes, &scalar, to - from, Some(&shade));
            } else {
                march.add_cubic(&self.classes, &scalar, to - from, None);
            }
            if march.is_opaque() {
                break;
            }
        }
        march.pixel()
    }

    /// Returns colour and opacity of the greatest scalar of a ray, with the path of one voxel.
    fn maximum(&self, ray: &IndexRay) -> [f64; 4] {
        let below = |[low, high]: [f64; 2], greatest: f64| {
            low > high || high + ROUNDING * high.abs().max(low.abs()) < greatest
        };
        let mut greatest = f64::NEG_INFINITY;
        let mut walk = Walk::new(&self.cells, ray);
        while let Some(Segment { cell, t: [from, to] }) = walk.next(|range| below(range, greatest)) {
            let v = self.cells.corners(cell);
            if has_nan(&v) || below(extremes(&v), greatest) {
                continue;
            }
            let (start, end) = (walk.local(cell, from), walk.local(cell, to));
            let scalar = Trilinear::new(&v).along(start, end - start);
            let turns = polynomial::turning_points(&scalar);
            for x in turns.into_iter().filter(|x| !x.is_nan()).chain([0.0, 1.0]) {
                greatest = greatest.max(polynomial::value(&scalar, x));
            }
        }
        if greatest == f64::NEG_INFINITY {
            return [0.0; 4];
        }
        let (colour, tau) = self.transfer.at(greatest);
        let alpha = -(-tau * self.grid.spacing().min_element()).exp_m1();
        (colour * alpha).extend(alpha).to_array()
    }
}

/// Returns whether a corner is NaN. Looks at all of them, which is faster than to end at the first.
fn has_nan(v: &[f64; 8]) -> bool {
    v.iter().fold(false, |any, v| any | v.is_nan())
}

/// Returns the least and the greatest of the corners, none of which is NaN.
fn extremes(v: &[f64; 8]) -> [f64; 2] {
    let (mut low, mut high) = ([v[0], v[1]], [v[0], v[1]]);
    // Two at a time, as the compiler vectorises them.
    for pair in v.chunks_exact(2) {
        for (i, &v) in pair.iter().enumerate() {
            low[i] = if v < low[i] { v } else { low[i] };
            high[i] = if v > high[i] { v } else { high[i] };
        }
    }
    [low[0].min(low[1]), high[0].max(high[1])]
}

/// The scalars around a cell, of which central differences in it are made.
struct Stencil<'a> {
    cells: &'a Cells<'a>,
    /// For each axis, the cells in which differences begin and end: their lowest corners and interpolants.
    sides: [[(DVec3, Trilinear); 2]; 3],
}

impl<'a> Stencil<'a> {
    fn new(cells: &'a Cells<'a>, cell: [u32; 3]) -> Self {
        let middle = DVec3::from_array(cell.map(f64::from)) + 0.5;
        let side = |position: DVec3| {
            let (cell, _) = cells.place(position);
            (cell, cells.interpolant(cell))
        };
        Self { cells, sides: DVec3::AXES.map(|axis| [side(middle - axis), side(middle + axis)]) }
    }

    /// Returns the central difference at a position, in scalars per voxel along each axis.
    fn gradient(&self, position: DVec3) -> DVec3 {
        let along = |axis: usize| {
            let [begin, end] = &self.sides[axis];
            let step = DVec3::AXES[axis];
            0.5 * (self.scalar(position + step, end) - self.scalar(position - step, begin))
        };
        DVec3::new(along(0), along(1), along(2))
    }

    /// Returns the scalar at a position, most likely in the cell given; beyond the grid that of its nearest place.
    fn scalar(&self, position: DVec3, (cell, interpolant): &(DVec3, Trilinear)) -> f64 {
        let at = self.cells.clamp(position) - cell;
        if at.cmpge(DVec3::ZERO).all() && at.cmplt(DVec3::ONE).all() {
            return interpolant.at(at);
        }
        let (cell, at) = self.cells.place(position);
        self.cells.interpolant(cell).at(at)
    }
}

/// The light on a ray.
struct Light {
    lighting: Lighting,
    to_world: DMat3,
    to_light: DVec3,
    /// Between the directions to light and eye.
    half_way: DVec3,
    least: f64,
}

impl Light {
    /// Takes the light of a ray in this direction.
    fn new(grid: &Grid, lighting: &Lighting, direction: DVec3) -> Self {
        let to_light = lighting.direction.map_or(-direction, DVec3::normalize);
        Self {
            lighting: *lighting,
            to_world: grid.index_to_world().inverse().transpose(),
            to_light,
            half_way: (to_light - direction).normalize_or_zero(),
            least: lighting.least_gradient_of(grid),
        }
    }

    /// Returns the bounds of lit colours.
    fn most(&self, colours: DVec3) -> DVec3 {
        let Lighting { ambient, diffuse, specular, .. } = self.lighting;
        colours * (ambient + diffuse).max(1.0) + specular
    }

    /// Returns the factor of the colour, and the highlight, for a gradient in scalars per voxel.
    fn seen(&self, gradient: DVec3) -> [f64; 2] {
        let gradient = self.to_world * gradient;
        // Neither a zero gradient nor NaN is above the limit.
        if gradient.length() > self.least && gradient.length() > 0.0 {
            let n = gradient.normalize();
            let Lighting { ambient, diffuse, specular, shininess, .. } = self.lighting;
            let highlight = n.dot(self.half_way).abs().min(1.0).powf(shininess);
            [ambient + diffuse * n.dot(self.to_light).abs(), specular * highlight]
        } else {
            [1.0, 0.0]
        }
    }
}
