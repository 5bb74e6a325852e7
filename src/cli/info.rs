//! `volraster info`: what a file holds, and what would be drawn of it.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Map, Value, json};
use volraster::glam::DVec3;
use volraster::scene::{Anatomy, Camera, Grid, Projection, Samples, TransferFunction};

use super::input::Input;
use super::{Outcome, output, table};

/// Most classes of the histogram.
const CLASSES: usize = 64;

/// Knots that are listed; the JSON has all of them.
const LISTED_KNOTS: usize = 16;

/// Arguments of `info`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A data file or a scene file (.json).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// What is wrong with the file.
    pub(crate) fn run(&self) -> Outcome {
        let input = Input::load(&self.file, None)?;
        let histogram = Histogram::of(&input.scene.grid);
        if self.json {
            output::print_json(&self.json_of(&input, &histogram))?;
        } else {
            output::print(&self.text_of(&input, &histogram))?;
        }
        Ok(())
    }

    fn json_of(&self, input: &Input, histogram: &Histogram) -> Value {
        let Input { scene, settings } = input;
        let grid = &scene.grid;
        let mut json = Map::new();
        let mut put = |key: &str, value: Value| json.insert(key.to_string(), value);
        put("file", json!(self.file.display().to_string()));
        put("dims", json!(grid.dims()));
        put("type", json!(grid.samples().type_name()));
        put("bytes", json!(bytes(grid)));
        put("spacing", json!(grid.spacing().to_array()));
        put("origin", json!(grid.origin().to_array()));
        put("axes", json!(axes(grid).map(|axis| axis.to_array())));
        put("anatomy", json!(anatomy(grid.anatomy())));
        put("rescale", json!({"slope": grid.rescale().slope, "intercept": grid.rescale().intercept}));
        put("range", json!(grid.range()));
        put("nan", json!(grid.nan_count()));
        put("infinite", json!(grid.infinite_count()));
        put(
            "histogram",
            json!({"first": histogram.first, "width": histogram.width, "counts": histogram.counts}),
        );
        put("camera", camera_json(settings.view.camera(), settings.camera_is_automatic));
        put("transfer", json!(rows(&scene.transfer)));
        put("image", json!(settings.view.extent()));
        put("background", json!(settings.background));
        if let Some(choice) = &settings.choice {
            let mut technique = Map::from_iter([("name".to_string(), json!(choice.name))]);
            technique.extend(choice.options.iter().map(|(key, value)| (key.clone(), json!(value))));
            put("technique", Value::Object(technique));
        }
        Value::Object(json)
    }

    fn text_of(&self, input: &Input, histogram: &Histogram) -> String {
        let Input { scene, settings } = input;
        let grid = &scene.grid;
        let [nx, ny, nz] = grid.dims();
        let [width, height] = settings.view.extent();
        let size = grid.spacing() * grid.last_index();
        let [lo, hi] = grid.range();
        let [x, y, z] = axes(grid).map(triple);
        let mut lines = vec![
            ("samples", format!("{nx} x {ny} x {nz}, {}, {} bytes", grid.samples().type_name(), bytes(grid))),
            ("spacing", triple(grid.spacing())),
            ("size", triple(size)),
            ("origin", triple(grid.origin())),
            ("axes", format!("x {x}; y {y}; z {z}")),
            ("anatomy", anatomy(grid.anatomy()).to_string()),
            ("range", format!("{} to {}", number(lo), number(hi))),
        ];
        let rescale = grid.rescale();
        if (rescale.slope, rescale.intercept) != (1.0, 0.0) {
            lines.push(("rescale", format!("value = {} * stored + {}", rescale.slope, rescale.intercept)));
        }
        lines.push(("NaN", grid.nan_count().to_string()));
        lines.push(("infinite", grid.infinite_count().to_string()));
        lines.push(("histogram", format!("|{}| logarithmic", histogram.sketch())));
        lines.push(("camera", camera_text(settings.view.camera(), settings.camera_is_automatic)));
        lines.push(("image", format!("{width} x {height}")));
        if let Some(choice) = &settings.choice {
            let options: Vec<String> =
                choice.options.iter().map(|(key, value)| format!("{key}={value}")).collect();
            lines
                .push(("technique", format!("{} {}", choice.name, options.join(",")).trim_end().to_string()));
        }
        let width = lines.iter().map(|(key, _)| key.len()).max().unwrap_or(0);
        let mut text = self.file.display().to_string();
        for (key, value) in lines {
            // Writing into a string cannot fail.
            let _ = write!(text, "\n  {key:<width$}  {value}");
        }
        let knots = rows(&scene.transfer);
        let _ = write!(
            text,
            "\n  transfer function of {} knots: value, red, green, blue, extinction",
            knots.len()
        );
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
}

/// How often values occur. NaN and infinities are left out.
#[derive(Debug, PartialEq)]
struct Histogram {
    /// Smallest value of the first class.
    first: f64,
    /// Width of each class.
    width: f64,
    /// Samples in each class.
    counts: Vec<u64>,
}

impl Histogram {
    /// Classes over the whole range. Those of integer data hold equally many codes, so that the classes
    /// make no pattern of their own.
    fn of(grid: &Grid) -> Self {
        let (samples, rescale) = (grid.samples(), grid.rescale());
        let [lo, hi] = grid.range();
        let unit = rescale.slope.abs();
        let (first, width, count) = match samples {
            Samples::F32(_) if hi > lo => (lo, (hi - lo) / CLASSES as f64, CLASSES),
            Samples::F32(_) => (lo, 1.0, 1),
            Samples::U8(_) | Samples::U16(_) | Samples::I16(_) => {
                // Codes are at most 2^16, so that this is exact.
                let codes = whole((hi - lo) / unit) + 1;
                let each = codes.div_ceil(CLASSES);
                (lo - unit / 2.0, each as f64 * unit, codes.div_ceil(each))
            }
        };
        let mut counts = vec![0; count];
        let last = counts.len() - 1;
        for i in 0..samples.len() {
            let value = rescale.slope * samples.get(i) + rescale.intercept;
            if value.is_finite() {
                let class = whole(((value - first) / width).floor());
                counts[class.min(last)] += 1;
            }
        }
        Self { first, width, counts }
    }

    /// One bar for each class, as high as the logarithm of its count.
    fn sketch(&self) -> String {
        const BARS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
        let most = self.counts.iter().copied().max().unwrap_or(0);
        let height = |count: u64| ((1 + count) as f64).ln();
        let bar = |&count: &u64| match count {
            // What is there at all shows.
            0 => BARS[0],
            _ => BARS[whole(8.0 * height(count) / height(most)).clamp(1, 8)],
        };
        self.counts.iter().map(bar).collect()
    }
}

/// The nearest whole number; saturates, and no number gives 0.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounds and saturates, as it says"
)]
fn whole(value: f64) -> usize {
    value.round() as usize
}

/// Bytes that the samples take in memory.
fn bytes(grid: &Grid) -> usize {
    grid.samples().len() * grid.samples().sample_bytes()
}

/// Unit vectors along the index axes.
fn axes(grid: &Grid) -> [DVec3; 3] {
    let m = grid.index_to_world();
    [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize_or_zero)
}

fn anatomy(anatomy: Anatomy) -> &'static str {
    match anatomy {
        Anatomy::Unknown => "unknown",
        Anatomy::Ras => "right-anterior-superior",
        Anatomy::Lps => "left-posterior-superior",
        Anatomy::Las => "left-anterior-superior",
    }
}

fn rows(transfer: &TransferFunction) -> Vec<[f64; 5]> {
    transfer.knots().iter().map(|k| [k.s, k.colour.x, k.colour.y, k.colour.z, k.tau]).collect()
}

fn camera_json(camera: &Camera, automatic: bool) -> Value {
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

fn camera_text(camera: &Camera, automatic: bool) -> String {
    let projection = match camera.projection {
        Projection::Perspective { fov_y_deg } => format!("fov_y_deg {}", number(fov_y_deg)),
        Projection::Orthographic { half_height } => format!("half_height {}", number(half_height)),
    };
    let origin = if automatic { " (automatic)" } else { "" };
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(triple);
    format!("eye {eye}, target {target}, up {up}, {projection}{origin}")
}

fn triple(v: DVec3) -> String {
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

/// Six significant digits are enough to look at.
fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        return "0".to_string();
    }
    if !(1e-4..1e6).contains(&magnitude) {
        return format!("{value:.5e}");
    }
    let text = format!("{value:.*}", if magnitude < 1.0 { 6 } else { 4 });
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use volraster::scene::Rescale;

    #[test]
    fn classes_of_integers_hold_equally_many_codes() {
        let codes = (0..=255_u8).cycle().take(512).collect();
        let even = Histogram::of(&Grid::new([8, 8, 8], Samples::U8(codes)).unwrap());
        assert_eq!((even.first, even.width), (-0.5, 4.0));
        assert_eq!(even.counts, vec![8; 64]);
        let mask = Grid::new([2, 2, 2], Samples::U8(vec![3, 3, 3, 3, 3, 3, 5, 5])).unwrap();
        assert_eq!(Histogram::of(&mask).counts, [6, 0, 2]);
        let flipped = mask.with_rescale(Rescale { slope: -0.5, intercept: 9.0 }).unwrap();
        assert_eq!(Histogram::of(&flipped).counts, [2, 0, 6]);
    }

    #[test]
    fn what_is_not_finite_is_not_counted() {
        let values = vec![f32::NAN, f32::INFINITY, 0.0, 1.0, 1.0, 1.0, 0.5, f32::NEG_INFINITY];
        let histogram = Histogram::of(&Grid::new([2, 2, 2], Samples::F32(values)).unwrap());
        assert_eq!(histogram.counts.iter().sum::<u64>(), 5);
        assert_eq!((histogram.counts[0], histogram.counts[32], histogram.counts[63]), (1, 1, 3));
        assert_eq!(histogram.sketch().chars().next_back(), Some('█'));
        assert_eq!(histogram.sketch().chars().filter(|&c| c != ' ').count(), 3);
        let flat = Histogram::of(&Grid::new([2, 2, 2], Samples::F32(vec![2.0; 8])).unwrap());
        assert_eq!((flat.counts.as_slice(), flat.sketch().as_str()), ([8].as_slice(), "█"));
    }

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, 0.1 + 0.2, 1e-7, -12.345_678, 3e9].map(number);
        assert_eq!(texts, ["0", "1", "0.3", "1.00000e-7", "-12.3457", "3.00000e9"]);
    }
}
