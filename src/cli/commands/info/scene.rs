//! Facts about a scene: kernels, surfaces, clip region, camera and transfer function.

use std::fmt::Write as _;

use serde_json::{Map, Value, json};
use volraster::glam::DVec3;
use volraster::scene::{
    Camera, Clip, Kernel, Kernels, Model, Projection, Shading, Surface, TransferFunction,
};

use super::facts::Facts;
use crate::cli::numbers::{number, triple};
use crate::cli::table;

/// Maximum number of knots in the text; the JSON lists all.
const LISTED_KNOTS: usize = 16;

/// Maximum number of surfaces in the text; the JSON lists all.
const LISTED_SURFACES: usize = 16;

impl Facts {
    /// Adds the kernels of the scene.
    pub(super) fn kernels(&mut self, kernels: &Kernels, on_grid: bool) {
        let Kernels { kernel, sigma, cut, model, least } = *kernels;
        let mut json = Map::from_iter([
            ("kernel".to_string(), json!(kernel.name())),
            ("model".to_string(), json!(model.name())),
        ]);
        let numbers = [
            ("sigma", sigma, kernel == Kernel::Gaussian && on_grid),
            ("cut", cut, kernel == Kernel::Gaussian),
            ("least", least, model == Model::Interpolate),
        ];
        let mut text = format!("{}, {}", kernel.name(), model.name());
        for (name, value, _) in numbers.into_iter().filter(|(.., counts)| *counts) {
            json.insert(name.to_string(), json!(value));
            // Writing into a string cannot fail.
            let _ = write!(text, ", {name} {}", number(value));
        }
        self.put("kernels", Value::Object(json));
        self.line("field", text);
    }

    /// Adds the surfaces.
    pub(super) fn surfaces(&mut self, surfaces: &[Surface]) {
        let shade = |surface: &Surface| match surface.shading() {
            Shading::Flat => "flat",
            Shading::Headlight => "headlight",
        };
        let json_of = |surface: &Surface| {
            let [r, g, b, opacity] = surface.colour();
            json!({
                "points": surface.points().len(), "triangles": surface.triangles().len(),
                "bounds": surface.bounds().map(|bounds| bounds.map(|corner| corner.to_array())),
                "colour": [r, g, b], "opacity": opacity, "shade": shade(surface),
            })
        };
        self.put("surfaces", Value::Array(surfaces.iter().map(json_of).collect()));
        for (i, surface) in surfaces.iter().take(LISTED_SURFACES).enumerate() {
            let [r, g, b, opacity] = surface.colour();
            let bounds = surface
                .bounds()
                .map_or_else(String::new, |[low, high]| format!(", {} to {}", triple(low), triple(high)));
            let text = format!(
                "{} triangles{bounds}, colour {}, opacity {}, {}",
                surface.triangles().len(),
                triple(DVec3::new(r, g, b)),
                number(opacity),
                shade(surface)
            );
            self.line(if i == 0 { "surfaces" } else { "" }, text);
        }
        if surfaces.len() > LISTED_SURFACES {
            self.line("", format!("and {} more", surfaces.len() - LISTED_SURFACES));
        }
    }

    /// Adds clip planes and crop box.
    pub(super) fn clip(&mut self, clip: &Clip) {
        // JSON has no infinite numbers: a side of the box that does not clip is null.
        let planes: Vec<Value> = clip
            .planes()
            .map(|plane| json!({"point": plane.point.to_array(), "normal": plane.normal.to_array()}))
            .collect();
        let crop = clip.crop().map(|[low, high]| json!({"low": low.to_array(), "high": high.to_array()}));
        let is_none = planes.is_empty() && crop.is_none();
        self.put("clip", if is_none { Value::Null } else { json!({"planes": planes, "crop": crop}) });
        let planes = clip
            .planes()
            .map(|plane| format!("plane through {} along {}", triple(plane.point), triple(plane.normal)));
        let crop = clip.crop().map(|[low, high]| format!("box {} to {}", bounds(low), bounds(high)));
        for (i, text) in planes.chain(crop).enumerate() {
            self.line(if i == 0 { "kept" } else { "" }, text);
        }
    }
}

pub(super) fn rows(transfer: &TransferFunction) -> Vec<[f64; 5]> {
    transfer.knots().iter().map(|k| [k.s, k.colour.x, k.colour.y, k.colour.z, k.tau]).collect()
}

pub(super) fn knots_text(transfer: &TransferFunction) -> String {
    let knots = rows(transfer);
    let mut text =
        format!("\n  transfer function of {} knots: value, red, green, blue, extinction", knots.len());
    let listed: Vec<Vec<String>> =
        knots.iter().take(LISTED_KNOTS).map(|row| row.iter().map(|&n| number(n)).collect()).collect();
    for line in table::aligned(&listed, &[]).lines() {
        let _ = write!(text, "\n    {line}");
    }
    if knots.len() > LISTED_KNOTS {
        let _ = write!(text, "\n    and {} more", knots.len() - LISTED_KNOTS);
    }
    text
}

/// Formats a corner of a crop box, with `-` for a side that does not clip.
fn bounds(corner: DVec3) -> String {
    let [x, y, z] =
        corner.to_array().map(|bound| if bound.is_finite() { number(bound) } else { "-".to_string() });
    format!("[{x}, {y}, {z}]")
}

pub(super) fn camera_json(camera: &Camera, automatic: bool) -> Value {
    let mut json = json!({
        "eye": camera.eye.to_array(),
        "target": camera.target.to_array(),
        "up": camera.up.to_array(),
        "automatic": automatic,
    });
    match camera.projection {
        Projection::Perspective { fov_y_deg } => json["fov_y_deg"] = json!(fov_y_deg),
        Projection::Orthographic { half_height } => json["half_height"] = json!(half_height),
    }
    json
}

pub(super) fn camera_text(camera: &Camera, automatic: bool) -> String {
    let projection = match camera.projection {
        Projection::Perspective { fov_y_deg } => format!("fov_y_deg {}", number(fov_y_deg)),
        Projection::Orthographic { half_height } => format!("half_height {}", number(half_height)),
    };
    let origin = if automatic { " (automatic)" } else { "" };
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(triple);
    format!("eye {eye}, target {target}, up {up}, {projection}{origin}")
}
