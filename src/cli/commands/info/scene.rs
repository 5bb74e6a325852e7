//! Facts about a scene: kernels, surfaces, clip region, camera and transfer function.

use std::fmt::Write as _;

use serde_json::{Map, Value, json};
use volraster::glam::DVec3;
use volraster::scene::{
    Camera, Clip, Kernel, Kernels, Lighting, Mode, Model, Shading, Surface, TransferFunction, auto,
};

use super::facts::Facts;
use crate::cli::input::{lighting_json, projection, rows};
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
        self.put(json!({"kernels": json}));
        self.line("field", text);
    }

    /// Adds the mode.
    pub(super) fn mode(&mut self, mode: Mode) {
        let Mode::Lit(lighting) = mode else {
            self.put(json!({"mode": mode.name()}));
            if mode != Mode::Emission {
                self.line("mode", mode.name().to_string());
            }
            return;
        };
        let Lighting { ambient, diffuse, specular, shininess, direction, .. } = lighting;
        self.put(json!({"mode": mode.name(), "lighting": lighting_json(lighting)}));
        let from = direction.map_or_else(|| "from the eye".to_string(), |d| format!("from {}", triple(d)));
        let [ambient, diffuse, specular, shininess] = [ambient, diffuse, specular, shininess].map(number);
        let shares =
            format!("ambient {ambient}, diffuse {diffuse}, specular {specular}, shininess {shininess}");
        self.line("mode", format!("lit {from}, {shares}"));
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
        self.put(json!({"surfaces": surfaces.iter().map(json_of).collect::<Value>()}));
        let text_of = |surface: &Surface| {
            let [r, g, b, opacity] = surface.colour();
            let bounds = surface.bounds().map(|bounds| bounds.map(triple).join(" to "));
            let bounds = bounds.map_or_else(String::new, |bounds| format!(", {bounds}"));
            let (triangles, colour) = (surface.triangles().len(), triple(DVec3::new(r, g, b)));
            let look = format!("colour {colour}, opacity {}, {}", number(opacity), shade(surface));
            format!("{triangles} triangles{bounds}, {look}")
        };
        self.list("surfaces", LISTED_SURFACES, &surfaces.iter().map(text_of).collect::<Vec<_>>());
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
        self.put(
            json!({"clip": if is_none { Value::Null } else { json!({"planes": planes, "crop": crop}) }}),
        );
        let planes = clip
            .planes()
            .map(|plane| format!("plane through {} along {}", triple(plane.point), triple(plane.normal)));
        let crop = clip.crop().map(|[low, high]| format!("box {} to {}", bounds(low), bounds(high)));
        self.list("kept", usize::MAX, &planes.chain(crop).collect::<Vec<_>>());
    }

    /// Adds the transfer function; its text follows all lines.
    pub(super) fn transfer(&mut self, transfer: &TransferFunction, is_automatic: bool) {
        let knots = rows(transfer);
        self.put(json!({"transfer": knots}));
        if is_automatic && auto::diverges(transfer) {
            self.put(json!({"diverging": true}));
            self.line("signs", "both: colour and extinction diverge around zero (automatic)".to_string());
        }
        let heading = "value, red, green, blue, extinction";
        self.tail = format!("\n  transfer function of {} knots: {heading}", knots.len());
        let listed: Vec<[String; 5]> = knots.iter().take(LISTED_KNOTS).map(|row| row.map(number)).collect();
        for line in table::aligned(&listed, &[]).lines() {
            let _ = write!(self.tail, "\n    {line}");
        }
        if knots.len() > LISTED_KNOTS {
            let _ = write!(self.tail, "\n    and {} more", knots.len() - LISTED_KNOTS);
        }
    }

    /// Adds the camera.
    pub(super) fn camera(&mut self, camera: &Camera, is_automatic: bool) {
        let (key, value) = projection(camera);
        let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| v.to_array());
        self.put(json!({
            "camera": {"eye": eye, "target": target, "up": up, "automatic": is_automatic, key: value},
        }));
        let origin = if is_automatic { " (automatic)" } else { "" };
        let [eye, target, up] = [camera.eye, camera.target, camera.up].map(triple);
        self.line("camera", format!("eye {eye}, target {target}, up {up}, {key} {}{origin}", number(value)));
    }
}

/// Formats a corner of a crop box, with `-` for a side that does not clip.
fn bounds(corner: DVec3) -> String {
    let [x, y, z] =
        corner.to_array().map(|bound| if bound.is_finite() { number(bound) } else { "-".to_string() });
    format!("[{x}, {y}, {z}]")
}
