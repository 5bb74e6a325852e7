//! SOG, versions 1 and 2: a `meta.json` and lossless WebP images, in a folder or in a zip archive (`.sog`). Pixel i belongs to
//! splat i.
//!
//! Positions have 16 bits, in two images, and a logarithmic scale. Quaternions lack the part that alpha tells. Version 2 has
//! bytes that index tables of 256 numbers; in version 1 they lie between limits. Coefficients but the constant ones are
//! rows of a palette of at most 65,536. Axes are right, down, front.

mod archive;
mod image;
mod meta;

use std::path::{Component, Path};

use crate::error::Result;
use crate::io::build::gaussians::{About, Columns, about_licence};
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::file::text::shown;
use crate::io::formats::gaussian::sog::archive::Archive;
use crate::io::formats::gaussian::sog::image::Image;
use crate::io::formats::gaussian::sog::meta::{Harmonics, META, Meta, Values};
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Axes, Gaussians, TrainedMode, harmonics};

pub(crate) struct Sog;

/// The limit on its size, in bytes.
const MOST_META: u64 = 1 << 20;
/// Memory of a byte of it after parsing.
const PARSED: u64 = 64;
/// Splats that a byte of an image may hold.
const DENSITY: u64 = 1024;
/// Entries of the palette in a row of its image.
const ROW: usize = 64;

impl Reader for Sog {
    fn name(&self) -> &'static str {
        "SOG"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["sog"]
    }

    fn recognises(&self, source: &Source) -> bool {
        archive::begins_one(source) || is_meta(source)
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let mut budget = Budget::new(source, request);
        if !source.is_gzip() && source.head().starts_with(b"PK") {
            let archive = Archive::open(source)?;
            return read(&Files::Archive(&archive), source, &mut budget, request);
        }
        read(&Files::Beside(source, request), source, &mut budget, request)
    }
}

/// Whether a file is the `meta.json` of splats: it has the name, or names images of positions in its first bytes.
pub(crate) fn is_meta(source: &Source) -> bool {
    let head = source.head();
    let holds = |text: &str| head.windows(text.len()).any(|window| window == text.as_bytes());
    let object = head.trim_ascii_start().starts_with(b"{") && !source.is_gzip();
    let named = source.path().file_name().is_some_and(|name| name == META);
    let parts = ["\"means\"", "\"scales\"", "\"quats\"", "\"sh0\""];
    object && (holds("\"means\"") && holds(".webp\"") || named && parts.into_iter().any(holds))
}

/// Opens the `meta.json` of splats in a folder, if there is one.
pub(crate) fn in_folder(folder: &Path, request: &Request) -> Result<Option<Source>> {
    let path = folder.join(META);
    if !path.is_file() {
        return Ok(None);
    }
    Source::open(&path, request).map(|source| is_meta(&source).then_some(source))
}

/// The files of a data set.
enum Files<'a> {
    /// Those beside a file.
    Beside(&'a Source, &'a Request<'a>),
    Archive(&'a Archive<'a>),
}

impl Files<'_> {
    /// Reads a file whose memory the budget grants; the caller puts it back.
    fn read(&self, name: &str, budget: &mut Budget, most: u64) -> Result<Vec<u8>> {
        match self {
            Self::Archive(archive) => archive.read(name, budget, most),
            Self::Beside(source, request) => {
                let path = Path::new(name);
                let mut parts = path.components();
                let plain = !name.contains('\\') && parts.all(|part| matches!(part, Component::Normal(_)));
                if !plain || name.is_empty() {
                    return Err(source.error(format!("file \"{}\"", shown(name)), archive::INSIDE));
                }
                let file = source.sibling(path, request)?;
                if file.len() > most {
                    return Err(file.error("size", format!("{} bytes: must have at most {most}", file.len())));
                }
                budget.take(name, file.len())?;
                file.bytes(0, file.len())
            }
        }
    }

    /// Reads an image with at least so many pixels.
    fn image(&self, source: &Source, name: &str, budget: &mut Budget, least: usize) -> Result<Image> {
        let bytes = self.read(name, budget, u64::MAX)?;
        let image = Image::decode(source, name, &bytes, budget, least)?;
        budget.put_back(num::wide(bytes.len()));
        Ok(image)
    }
}

fn read(files: &Files, source: &Source, budget: &mut Budget, request: &Request) -> Result<Found> {
    let text = match files {
        Files::Archive(archive) => archive.read(META, budget, MOST_META)?,
        // Its name need not be the usual one.
        Files::Beside(source, _) if source.len() > MOST_META => {
            return Err(
                source.error("size", format!("{} bytes: must have at most {MOST_META}", source.len()))
            );
        }
        Files::Beside(source, _) => {
            budget.take(META, source.len())?;
            source.bytes(0, source.len())?
        }
    };
    let size = num::wide(text.len());
    budget.take(META, size * PARSED)?;
    let meta = Meta::parse(source, &text)?;
    let count = usize::try_from(meta.count).unwrap_or(usize::MAX);
    let [low, high] = meta.positions.files.each_ref();
    // The image of low bytes is the one that compresses least.
    let bytes = files.read(low, budget, u64::MAX)?;
    if meta.count > num::wide(bytes.len()).saturating_mul(DENSITY) {
        let rule = format!("{} splats: more than an image of {} bytes can hold", meta.count, bytes.len());
        return Err(source.error("count", rule));
    }
    let low = Image::decode(source, low, &bytes, budget, count)?;
    budget.put_back(num::wide(bytes.len()));
    drop(bytes);
    let high = files.image(source, high, budget, count)?;
    let degree = meta.harmonics.as_ref().map_or(0, |harmonics| harmonics.degree);
    let mut columns = Columns::new(source, budget, meta.count, degree)?;
    for i in 0..count {
        let (low, high) = (low.pixel(i), high.pixel(i));
        columns.parts.centres[i] = [0, 1, 2].map(|k| {
            let share = f64::from(u16::from_le_bytes([low[k], high[k]])) / 65535.0;
            let [least, most] = meta.positions.limits[k];
            let value = least * (1.0 - share) + most * share;
            num::f32_of(value.signum() * value.abs().exp_m1())
        });
    }
    low.put_back(budget);
    high.put_back(budget);
    let image = files.image(source, &meta.scales.file, budget, count)?;
    for (i, log_scales) in columns.parts.log_scales.iter_mut().enumerate() {
        let pixel = image.pixel(i);
        *log_scales = [0, 1, 2].map(|k| num::f32_of(meta.scales.values.of(k, pixel[k])));
    }
    image.put_back(budget);
    let image = files.image(source, &meta.rotations, budget, count)?;
    for (i, rotation) in columns.parts.rotations.iter_mut().enumerate() {
        *rotation = quaternion(image.pixel(i)).map(num::f32_of);
    }
    image.put_back(budget);
    let image = files.image(source, &meta.colours.file, budget, count)?;
    for i in 0..count {
        let pixel = image.pixel(i);
        let constant = [0, 1, 2].map(|k| num::f32_of(meta.colours.values.of(k, pixel[k])));
        columns.harmonics(i)[..3].copy_from_slice(&constant);
        columns.parts.opacities[i] = match &meta.colours.values {
            Values::Table(_) => num::f32_of(f64::from(pixel[3]) / 255.0),
            limits @ Values::Limits(_) => Gaussians::opacity_of_logit(limits.of(3, pixel[3])),
        };
    }
    image.put_back(budget);
    if let Some(harmonics) = &meta.harmonics {
        palette(files, source, budget, harmonics, &mut columns)?;
    }
    budget.put_back(size * (PARSED + 1));
    let about = About {
        format: if meta.version == 1 { "SOG 1" } else { "SOG 2" },
        axes: Axes::Rdf.into(),
        axes_from: "the convention of SOG files",
        mode: if meta.antialias { TrainedMode::Antialiased } else { TrainedMode::Unknown },
        texts: about_licence(&meta.texts),
        notes: Vec::new(),
    };
    columns.finish(source, budget, about, request)
}

/// Reads the coefficients but the constant ones: an index for each splat, and the entries of a palette.
fn palette(
    files: &Files,
    source: &Source,
    budget: &mut Budget,
    Harmonics { degree, entries, values, files: [centroids, labels] }: &Harmonics,
    columns: &mut Columns,
) -> Result<()> {
    let functions = harmonics::count(*degree) - 1;
    let image = files.image(source, centroids, budget, 1)?;
    let wrong = |rule: String| source.error(format!("image {}", shown(centroids)), rule);
    if image.width != ROW * functions {
        let rule = format!("{} pixels wide: must be {}, for degree {degree}", image.width, ROW * functions);
        return Err(wrong(rule));
    }
    let held = ROW * image.height;
    let entries = entries.unwrap_or(num::wide(held));
    if entries > num::wide(held) {
        return Err(wrong(format!("{held} entries of the palette: must be at least {entries}")));
    }
    let labels = files.image(source, labels, budget, columns.parts.centres.len())?;
    for i in 0..columns.parts.centres.len() {
        let pixel = labels.pixel(i);
        let label = usize::from(u16::from_le_bytes([pixel[0], pixel[1]]));
        if num::wide(label) >= entries {
            return Err(source
                .error("shN", format!("splat {i} has entry {label} of the palette: there are {entries}")));
        }
        let own = &mut columns.harmonics(i)[3..];
        for (function, k) in own.chunks_exact_mut(3).enumerate() {
            let pixel = image.pixel((label / ROW) * image.width + (label % ROW) * functions + function);
            for (k, byte) in k.iter_mut().zip(pixel) {
                *k = num::f32_of(values.of(0, byte));
            }
        }
    }
    image.put_back(budget);
    labels.put_back(budget);
    Ok(())
}

/// Returns the quaternion w, x, y, z of a pixel: alpha tells the largest part, which is left out; 0 where it tells none.
fn quaternion([r, g, b, tag]: [u8; 4]) -> [f64; 4] {
    let Some(largest) = tag.checked_sub(252).map(usize::from) else { return [0.0; 4] };
    let [r, g, b] = [r, g, b].map(|byte| (f64::from(byte) / 255.0 * 2.0 - 1.0) / std::f64::consts::SQRT_2);
    let mut parts = [r, g, b, (1.0 - r * r - g * g - b * b).max(0.0).sqrt()];
    parts[largest..].rotate_right(1);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alpha_tells_the_largest_part() {
        let near = |found: [f64; 4], expected: [f64; 4]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 5e-3), "{found:?} {expected:?}");
        };
        let root = std::f64::consts::FRAC_1_SQRT_2;
        near(quaternion([255, 128, 128, 252]), [root, root, 0.0, 0.0]);
        near(quaternion([255, 128, 128, 253]), [root, root, 0.0, 0.0]);
        near(quaternion([128, 0, 128, 254]), [0.0, -root, root, 0.0]);
        near(quaternion([128, 128, 255, 255]), [0.0, 0.0, root, root]);
        assert_eq!(quaternion([255, 255, 255, 255])[3], 0.0);
        assert_eq!(quaternion([1, 2, 3, 251]), [0.0; 4]);
    }
}
