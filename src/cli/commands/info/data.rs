//! Facts about the data: grids, meshes and points.

use serde_json::{Value, json};
use volraster::GridBytes;
use volraster::glam::DVec3;
use volraster::io::Report;
use volraster::scene::{Anatomy, Grid, KernelSize, Points, TetScalars, Tets};

use super::facts::Facts;
use super::histogram::Histogram;
use crate::cli::numbers::{number, triple};

impl Facts {
    /// Adds the facts about a grid.
    pub(super) fn of_grid(&mut self, grid: &Grid, report: &Report) {
        self.lattice(grid);
        self.values(grid.range(), grid.nan_count(), grid.infinite_count(), &Histogram::of(grid));
        self.arrays(report);
        let device = GridBytes::of(grid);
        self.put(
            "device_bytes",
            json!({
                "volume": device.volume, "stack": device.stack, "stacks": device.stacks, "bricks": device.bricks,
            }),
        );
        self.line(
            "on device",
            format!(
                "{} bytes (slices-3d, slabs, raycast), {} (slices-2d and shear-warp, {} with stacks=all); bricks {} more",
                device.volume, device.stack, device.stacks, device.bricks
            ),
        );
    }

    /// Adds the facts about a mesh.
    pub(super) fn of_mesh(&mut self, mesh: &Tets, report: &Report) {
        let (points, cells) = (mesh.points().len(), mesh.cells().len());
        let values = mesh.scalars().values();
        let (of, each) = match mesh.scalars() {
            TetScalars::Point(_) => ("point", "a scalar at each point"),
            TetScalars::Cell(_) => ("cell", "a scalar in each cell"),
        };
        let bytes = 24 * points + 16 * cells + 4 * values.len();
        self.put("points", json!(points));
        self.put("tetrahedra", json!(cells));
        self.put("scalars", json!(of));
        self.put("type", json!("f32"));
        self.put("bytes", json!(bytes));
        self.put("vacuum", json!(mesh.blank_count()));
        self.line("points", format!("{points}, {cells} tetrahedra, {bytes} bytes"));
        self.line("scalars", format!("f32, {each}"));
        self.line("vacuum", format!("{} tetrahedra", mesh.blank_count()));
        self.bounds(mesh.bounds());
        self.scalars(mesh.range(), values);
        self.arrays(report);
        self.geometry(12 * points + 16 * cells + 4 * values.len());
    }

    /// Adds the facts about points.
    pub(super) fn of_points(&mut self, points: &Points, report: &Report) {
        let count = points.centres().len();
        let lists = points.scalars().map_or(0, |_| 4) + points.weights().map_or(0, |_| 4);
        let (kernel, extra) = match points.size() {
            KernelSize::Unknown => (json!({"kind": "unknown"}), 0),
            KernelSize::Radius(radius) => (json!({"kind": "radius", "radius": radius}), 0),
            KernelSize::Radii(radii) => (json!({"kind": "radii", "range": range_of(radii)}), 4),
            KernelSize::Covariances(_) => (json!({"kind": "covariances"}), 24),
        };
        let bytes = count * (24 + lists + extra);
        self.put("points", json!(count));
        self.put("type", json!("f32"));
        self.put("bytes", json!(bytes));
        self.line("points", format!("{count}, {bytes} bytes"));
        self.line(
            "kernels",
            match points.size() {
                KernelSize::Unknown => "of unknown size".to_string(),
                KernelSize::Radius(radius) => format!("radius {}", number(*radius)),
                KernelSize::Radii(radii) => format!("radii {}", range_text(radii)),
                KernelSize::Covariances(_) => "covariances".to_string(),
            },
        );
        self.put("kernel", kernel);
        self.put("weights", points.weights().map_or(Value::Null, |weights| json!(range_of(weights))));
        self.line("weights", points.weights().map_or_else(|| "1 each".to_string(), range_text));
        self.bounds(points.bounds());
        match points.scalars() {
            Some(scalars) => self.scalars(points.range(), scalars),
            None => {
                self.values(
                    points.range(),
                    0,
                    0,
                    &Histogram { first: 1.0, width: 1.0, counts: vec![count as u64] },
                );
            }
        }
        self.arrays(report);
        self.geometry(count * (12 + lists + extra));
    }

    /// Adds extent, type, position and orientation of a grid.
    pub(super) fn lattice(&mut self, grid: &Grid) {
        let samples = grid.samples();
        let [nx, ny, nz] = grid.dims();
        let bytes = samples.len() * samples.sample_bytes();
        let m = grid.index_to_world();
        let axes = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize_or_zero);
        let anatomy = anatomy(grid.anatomy());
        let rescale = grid.rescale();
        self.put("dims", json!(grid.dims()));
        self.put("type", json!(samples.type_name()));
        self.put("bytes", json!(bytes));
        self.put("spacing", json!(grid.spacing().to_array()));
        self.put("origin", json!(grid.origin().to_array()));
        self.put("axes", json!(axes.map(|axis| axis.to_array())));
        self.put("anatomy", json!(anatomy));
        self.put("rescale", json!({"slope": rescale.slope, "intercept": rescale.intercept}));
        self.line("samples", format!("{nx} x {ny} x {nz}, {}, {bytes} bytes", samples.type_name()));
        self.line("spacing", triple(grid.spacing()));
        self.line("size", triple(grid.spacing() * grid.last_index()));
        self.line("origin", triple(grid.origin()));
        let [x, y, z] = axes.map(triple);
        self.line("axes", format!("x {x}; y {y}; z {z}"));
        self.line("anatomy", anatomy.to_string());
        let corners = grid.corners();
        let all = |f: fn(DVec3, DVec3) -> DVec3| corners.into_iter().reduce(f).unwrap_or_default();
        self.bounds([all(DVec3::min), all(DVec3::max)]);
        if (rescale.slope, rescale.intercept) != (1.0, 0.0) {
            self.line("rescale", format!("value = {} * stored + {}", rescale.slope, rescale.intercept));
        }
    }

    /// Adds the bounding box.
    pub(super) fn bounds(&mut self, [low, high]: [DVec3; 2]) {
        self.put("bounds", json!([low.to_array(), high.to_array()]));
        self.line("bounds", format!("{} to {}", triple(low), triple(high)));
    }

    /// Adds range and histogram of the scalars of a mesh or of points.
    pub(super) fn scalars(&mut self, range: [f64; 2], values: &[f32]) {
        let nan = values.iter().filter(|value| value.is_nan()).count();
        let infinite = values.iter().filter(|value| value.is_infinite()).count();
        self.values(range, nan, infinite, &Histogram::of_values(range, values));
    }

    /// Adds range, number of NaN and infinite values, and histogram.
    pub(super) fn values(&mut self, [lo, hi]: [f64; 2], nan: usize, infinite: usize, histogram: &Histogram) {
        let Histogram { first, width, counts } = histogram;
        self.put("range", json!([lo, hi]));
        self.put("nan", json!(nan));
        self.put("infinite", json!(infinite));
        self.put("histogram", json!({"first": first, "width": width, "counts": counts}));
        self.line("range", format!("{} to {}", number(lo), number(hi)));
        self.line("NaN", nan.to_string());
        self.line("infinite", infinite.to_string());
        self.line("histogram", format!("|{}| logarithmic", histogram.sketch()));
    }

    /// Adds a lower bound of the device memory of a mesh or of points.
    pub(super) fn geometry(&mut self, bytes: usize) {
        self.put("device_bytes", json!({"geometry": bytes}));
        self.line("on device", format!("{bytes} bytes at least (geometry and scalars in 32 bits)"));
    }
}

/// Returns the smallest and largest finite value, if any.
fn range_of(values: &[f32]) -> Option<[f32; 2]> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    Some([finite().reduce(f32::min)?, finite().reduce(f32::max)?])
}

fn range_text(values: &[f32]) -> String {
    match range_of(values) {
        Some([lo, hi]) => format!("{} to {}", number(f64::from(lo)), number(f64::from(hi))),
        None => "none finite".to_string(),
    }
}

fn anatomy(anatomy: Anatomy) -> &'static str {
    match anatomy {
        Anatomy::Unknown => "unknown",
        Anatomy::Ras => "right-anterior-superior",
        Anatomy::Lps => "left-posterior-superior",
        Anatomy::Las => "left-anterior-superior",
    }
}
