//! Facts about Gaussian splats.

use serde_json::json;
use volraster::Result;
use volraster::io::Report;
use volraster::scene::{Gaussians, Scene, View, auto};

use super::facts::Facts;
use crate::cli::numbers::number;

/// Opacity from which a splat counts as opaque.
const OPAQUE: f32 = 0.99;
/// Side of the image for which sizes in pixels are told.
const SIDE: u32 = 512;
/// Maximum number of texts about the licence in the text; the JSON lists all.
const LISTED_TEXTS: usize = 8;

impl Facts {
    /// Adds the facts about Gaussian splats.
    pub(super) fn of_gaussians(&mut self, scene: &Scene, splats: &Gaussians, report: &Report) -> Result<()> {
        let count = splats.len();
        let numbers = 3 + 4 + 3 + 1 + splats.harmonics().len() / count;
        let bytes = 4 * numbers * count;
        self.put(json!({"splats": count, "degree": splats.degree(), "type": "f32", "bytes": bytes}));
        self.line("splats", format!("{count}, harmonics of degree {}, f32, {bytes} bytes", splats.degree()));
        self.bounds(splats.bounds());
        self.axes(splats, report);
        self.sizes(scene, splats)?;
        self.geometry(bytes);
        Ok(())
    }

    /// Adds axes, the rule of training, texts, and what was left out.
    fn axes(&mut self, splats: &Gaussians, report: &Report) {
        let about = report.gaussians.clone().unwrap_or_default();
        let (axes, rule, dropped) = (splats.axes().name(), splats.mode().name(), about.dropped);
        self.put(json!({
            "axes": axes, "axes_from": about.axes_from, "trained_as": rule, "texts": about.texts,
            "left_out": {"nan": dropped.nan, "infinite": dropped.infinite, "rotation": dropped.rotation},
            "clamped": dropped.clamped,
        }));
        let words = axes.chars().map(|letter| match letter {
            'r' => "right",
            'l' => "left",
            'u' => "up",
            'd' => "down",
            'f' => "front",
            _ => "back",
        });
        let words = words.collect::<Vec<_>>().join(", ");
        let from =
            if about.axes_from.is_empty() { String::new() } else { format!(", from: {}", about.axes_from) };
        self.line("axes", format!("{axes} ({words}){from}"));
        self.line("trained as", rule.to_string());
        self.line("left out", format!("{}", dropped.total()));
        self.list("texts", LISTED_TEXTS, &about.texts);
    }

    /// Adds statistics of opacities, shapes, and sizes in an image of the automatic camera.
    fn sizes(&mut self, scene: &Scene, splats: &Gaussians) -> Result<()> {
        let count = splats.len();
        let mut ratios: Vec<f64> = (0..count)
            .map(|i| {
                let scales = splats.scales(i);
                scales.max_element() / scales.min_element()
            })
            .map(|ratio| if ratio.is_nan() { 1.0 } else { ratio })
            .collect();
        ratios.sort_unstable_by(f64::total_cmp);
        let [median, most] = [count / 2, (count - 1) * 99 / 100].map(|i| ratios[i]);
        let share = |some: usize| some as f64 / count as f64;
        let opaque = share(splats.opacities().iter().filter(|opacity| **opacity >= OPAQUE).count());
        let view = View::new(auto::camera(scene, SIDE, SIDE)?, SIDE, SIDE)?;
        let is_small = |&i: &usize| {
            let depth = (splats.centre(i) - view.camera().eye).dot(view.forward());
            depth > 0.0 && 2.0 * splats.scales(i).max_element() < view.pixel_size() * depth
        };
        let small = share((0..count).filter(is_small).count());
        // JSON has no infinity: the ratio of a flat splat is null.
        self.put(json!({
            "anisotropy": {"median": median, "p99": most}, "opaque_share": opaque, "subpixel_share": small,
        }));
        let percent = |share: f64| number(100.0 * share);
        self.line(
            "anisotropy",
            format!("{} median, {} at 99 % (longest over shortest axis)", number(median), number(most)),
        );
        self.line("opaque", format!("{} % have an opacity of at least {OPAQUE}", percent(opaque)));
        let camera = format!("from the automatic camera, {SIDE} x {SIDE}");
        self.line("sub-pixel", format!("{} % have two deviations below a pixel {camera}", percent(small)));
        Ok(())
    }
}
