//! Facts about the data: grids, meshes and points.

use serde_json::json;
use volraster::GridBytes;
use volraster::glam::DVec3;
use volraster::io::Report;
use volraster::scene::{Anatomy, Grid, KernelSize, Points, TetScalars, Tets};

use super::facts::Facts;
use crate::cli::histogram::Histogram;
use crate::cli::numbers::{number, triple};

impl Facts {
    /// Adds the facts about a grid.
    pub(super) fn of_grid(&mut self, grid: &Grid, report: &Report) {
        self.lattice(grid);
        self.values(
            grid.range(),
            report.file_range,
            grid.nan_count(),
            grid.infinite_count(),
            &Histogram::of(grid),
        );
        self.arrays(report);
        let GridBytes { volume, stack, stacks, bricks } = GridBytes::of(grid);
        let bytes = json!({"volume": volume, "stack": stack, "stacks": stacks, "bricks": bricks});
        self.put(json!({"device_bytes": bytes}));
        let stacks = format!("{stack} (slices-2d and shear-warp, {stacks} with stacks=all)");
        let text = format!("{volume} bytes (slices-3d, slabs, raycast), {stacks}; bricks {bricks} more");
        self.line("on device", text);
    }

    /// Adds the facts about a mesh.
    pub(super) fn of_mesh(&mut self, mesh: &Tets, report: &Report) {
        let (points, cells) = (mesh.points().len(), mesh.cells().len());
        let (values, vacuum) = (mesh.scalars().values(), mesh.blank_count());
        let (of, each) = match mesh.scalars() {
            TetScalars::Point(_) => ("point", "a scalar at each point"),
            TetScalars::Cell(_) => ("cell", "a scalar in each cell"),
        };
        let bytes = 24 * points + 16 * cells + 4 * values.len();
        self.put(json!({
            "points": points, "tetrahedra": cells, "scalars": of, "type": "f32", "bytes": bytes, "vacuum": vacuum,
        }));
        self.line("points", format!("{points}, {cells} tetrahedra, {bytes} bytes"));
        self.line("scalars", format!("f32, {each}"));
        self.line("vacuum", format!("{vacuum} tetrahedra"));
        self.bounds(mesh.bounds());
        self.scalars(mesh.range(), report.file_range, values);
        self.arrays(report);
        self.geometry(bytes - 12 * points);
    }

    /// Adds the facts about points.
    pub(super) fn of_points(&mut self, points: &Points, report: &Report) {
        let count = points.centres().len();
        let lists = points.scalars().map_or(0, |_| 4) + points.weights().map_or(0, |_| 4);
        let (kernel, text, extra) = match points.size() {
            KernelSize::Unknown => (json!({"kind": "unknown"}), "of unknown size".to_string(), 0),
            KernelSize::Radius(radius) => {
                (json!({"kind": "radius", "radius": radius}), format!("radius {}", number(*radius)), 0)
            }
            KernelSize::Radii(radii) => {
                let range = range_of(radii);
                (json!({"kind": "radii", "range": range}), format!("radii {}", range_text(range)), 4)
            }
            KernelSize::Covariances(_) => (json!({"kind": "covariances"}), "covariances".to_string(), 24),
        };
        let bytes = count * (24 + lists + extra);
        let weights = points.weights().map(range_of);
        self.put(json!({
            "points": count, "type": "f32", "bytes": bytes, "kernel": kernel, "weights": weights.flatten(),
        }));
        self.line("points", format!("{count}, {bytes} bytes"));
        self.line("kernels", text);
        self.line("weights", weights.map_or_else(|| "1 each".to_string(), range_text));
        self.bounds(points.bounds());
        if let Some(scalars) = points.scalars() {
            self.scalars(points.range(), None, scalars);
        } else {
            let histogram = Histogram { first: 1.0, width: 1.0, counts: vec![count as u64] };
            self.values(points.range(), None, 0, 0, &histogram);
        }
        self.arrays(report);
        self.geometry(count * (12 + lists + extra));
    }

    /// Adds extent, type, position and orientation of a grid.
    fn lattice(&mut self, grid: &Grid) {
        let (samples, kind) = (grid.samples(), grid.samples().type_name());
        let dims @ [nx, ny, nz] = grid.dims();
        let bytes = samples.len() * samples.sample_bytes();
        let m = grid.index_to_world();
        let axes = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize_or_zero);
        let (anatomy, rescale) = (anatomy(grid.anatomy()), grid.rescale());
        self.put(json!({
            "dims": dims, "type": kind, "bytes": bytes, "spacing": grid.spacing().to_array(),
            "origin": grid.origin().to_array(), "axes": axes.map(|axis| axis.to_array()), "anatomy": anatomy,
            "rescale": {"slope": rescale.slope, "intercept": rescale.intercept},
        }));
        self.line("samples", format!("{nx} x {ny} x {nz}, {kind}, {bytes} bytes"));
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
        self.put(json!({"bounds": [low.to_array(), high.to_array()]}));
        self.line("bounds", format!("{} to {}", triple(low), triple(high)));
    }

    /// Adds range and histogram of the scalars of a mesh or of points.
    fn scalars(&mut self, range: [f64; 2], of_file: Option<[f64; 2]>, values: &[f32]) {
        let nan = values.iter().filter(|value| value.is_nan()).count();
        let infinite = values.iter().filter(|value| value.is_infinite()).count();
        self.values(range, of_file, nan, infinite, &Histogram::of_values(range, values));
    }

    /// Adds range, number of NaN and infinite values, and histogram. `of_file` is the range in the file, where that may be another.
    fn values(
        &mut self,
        range: [f64; 2],
        of_file: Option<[f64; 2]>,
        nan: usize,
        infinite: usize,
        histogram: &Histogram,
    ) {
        self.put(json!({"range": range, "nan": nan, "infinite": infinite, "histogram": histogram}));
        let text = |range: [f64; 2]| range.map(number).join(" to ");
        let other = of_file.filter(|of_file| *of_file != range);
        self.put(json!({"file_range": of_file.unwrap_or(range)}));
        let other = other.map_or_else(String::new, |range| format!(" (in the file {})", text(range)));
        self.line("range", text(range) + &other);
        self.line("NaN", nan.to_string());
        self.line("infinite", infinite.to_string());
        self.line("histogram", format!("|{}| logarithmic", histogram.sketch()));
    }

    /// Adds a lower bound of the device memory of a mesh or of points.
    pub(super) fn geometry(&mut self, bytes: usize) {
        self.put(json!({"device_bytes": {"geometry": bytes}}));
        self.line("on device", format!("{bytes} bytes at least (geometry and scalars in 32 bits)"));
    }
}

/// Returns the smallest and largest finite value, if any.
fn range_of(values: &[f32]) -> Option<[f32; 2]> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    Some([finite().reduce(f32::min)?, finite().reduce(f32::max)?])
}

fn range_text(range: Option<[f32; 2]>) -> String {
    range.map_or_else(
        || "none finite".to_string(),
        |range| range.map(|end| number(f64::from(end))).join(" to "),
    )
}

fn anatomy(anatomy: Anatomy) -> &'static str {
    match anatomy {
        Anatomy::Unknown => "unknown",
        Anatomy::Ras => "right-anterior-superior",
        Anatomy::Lps => "left-posterior-superior",
        Anatomy::Las => "left-anterior-superior",
    }
}
