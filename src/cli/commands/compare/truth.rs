//! Ground truths, one for each rule of trained splats that is drawn, and the distances between them.

use std::path::Path;

use serde_json::{Value, json};
use volraster::io::{write_exr, write_png};
use volraster::measure::{ImageErrors, heat_map_f64};
use volraster::reference::ReferenceImage;
use volraster::scene::SplatRule;
use volraster::{Colours, Result};

use super::entry::read;

/// An image that others are compared with.
pub(super) struct Truth {
    /// The rule of trained splats that it shows.
    pub(super) rule: Option<SplatRule>,
    pub(super) image: ReferenceImage,
    /// Its description in the report.
    pub(super) what: String,
}

/// The picture of a ground truth as PNG.
#[derive(Debug)]
pub(crate) struct Picture {
    /// Of a rule, its name.
    pub(crate) name: Option<&'static str>,
    pub(crate) png: Vec<u8>,
    pub(crate) what: String,
}

/// How far the images of two rules are apart.
#[derive(Debug)]
pub(crate) struct Distance {
    pub(crate) rules: [&'static str; 2],
    pub(crate) rmse: f64,
    /// The differences as PNG.
    pub(crate) heat: Vec<u8>,
}

impl Truth {
    /// Writes the image into a folder and returns its picture. Of trained splats it is named after the rule.
    pub(super) fn write(
        &self,
        folder: &Path,
        is_given: bool,
        colours: Colours,
        background: [f64; 4],
    ) -> Result<Picture> {
        let image = self.image.to_image()?.with_colours(colours);
        let name = self.rule.map(SplatRule::name);
        let stem = if is_given { "against" } else { "reference" };
        let file = |ending: &str| {
            folder.join(
                name.map_or_else(|| format!("{stem}.{ending}"), |name| format!("{stem}-{name}.{ending}")),
            )
        };
        if !is_given {
            write_exr(file("exr"), &image)?;
        }
        write_png(file("png"), &image, background)?;
        Ok(Picture { name, png: read(&file("png"))?, what: self.what.clone() })
    }
}

/// Compares each two of several rules, and writes their differences and distances.json.
pub(super) fn distances(folder: &Path, truths: &[Truth]) -> Result<Vec<Distance>> {
    let mut all = Vec::new();
    for (i, one) in truths.iter().enumerate() {
        let image = one.image.to_image()?;
        for other in &truths[i + 1..] {
            let (Some(a), Some(b)) = (one.rule, other.rule) else { continue };
            let rules = [a.name(), b.name()];
            let file = folder.join(format!("{}-{}.heat.png", rules[0], rules[1]));
            write_png(&file, &heat_map_f64(&image, &other.image)?, [0.0, 0.0, 0.0, 1.0])?;
            let rmse = ImageErrors::between_f64(&image, &other.image)?.all.rmse;
            all.push(Distance { rules, rmse, heat: read(&file)? });
        }
    }
    if !all.is_empty() {
        let json = |distance: &Distance| json!({"rules": distance.rules, "rmse": distance.rmse});
        crate::cli::output::write_json(
            &folder.join("distances.json"),
            &all.iter().map(json).collect::<Value>(),
        )?;
    }
    Ok(all)
}
