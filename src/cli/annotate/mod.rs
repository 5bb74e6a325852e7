//! Annotations of a picture: a scalar bar, the box of the data, the directions of the axes, a caption.
//!
//! They are drawn into the finished picture. Edges of the box whose two faces look away from the eye lie behind all
//! data, and are laid under it; the others lie before it.

mod ink;

use tiny_skia::Mask;
use volraster::glam::{DVec2, DVec3};
use volraster::scene::{Anatomy, Data, Scene, TransferFunction, View};
use volraster::{Error, Image, Result};

use self::ink::{Align, Ink, Letters, blend};
use crate::cli::plot::nice_step;

/// The annotations of a picture.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct AnnotationArgs {
    /// Draw a bar of the colours of the scalars, with this title [default: the name of the array].
    #[arg(long, value_name = "TITLE", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    bar: Option<String>,
    /// Draw the edges of the data's box.
    #[arg(long = "box")]
    edges: bool,
    /// Draw the directions of the axes: x, y and z, or the sides of the patient where the file tells.
    #[arg(long)]
    axes: bool,
    /// Write a line of text below the picture's centre.
    #[arg(long, value_name = "TEXT")]
    caption: Option<String>,
}

/// Annotations of the pictures of one scene.
pub(crate) struct Annotations<'a> {
    args: &'a AnnotationArgs,
    letters: Letters,
    bar: Option<(TransferFunction, String)>,
    /// Corners of the box, with the axes as the bits of their indices.
    corners: [DVec3; 8],
    names: [&'static str; 3],
    /// Linear colours of text and of its rim.
    colours: [[f32; 3]; 2],
}

impl AnnotationArgs {
    /// Prepares the annotations; `None` if there are none. `array` names the scalars.
    pub(crate) fn prepare(
        &self,
        scene: &Scene,
        array: &str,
        background: [f64; 4],
    ) -> Result<Option<Annotations<'_>>> {
        let Self { bar, edges, axes, caption } = self;
        if bar.is_none() && caption.is_none() && !edges && !axes {
            return Ok(None);
        }
        if bar.is_some() && scene.gaussians().is_some() {
            let why = "gaussians have no scalars to show".to_string();
            return Err(Error::Invalid { what: "--bar".to_string(), why });
        }
        let bar = bar.as_ref().map(|title| {
            let title = if title.is_empty() { array } else { title };
            (scene.transfer.clone(), title.to_string())
        });
        // Names of the positive sides.
        let names = match &scene.data {
            Data::Grid(grid) => match grid.anatomy() {
                Anatomy::Unknown => ["x", "y", "z"],
                Anatomy::Ras => ["R", "A", "S"],
                Anatomy::Lps => ["L", "P", "S"],
                Anatomy::Las => ["L", "A", "S"],
            },
            _ => ["x", "y", "z"],
        };
        let [red, green, blue, alpha] = background;
        let is_bright = alpha * (0.2126 * red + 0.7152 * green + 0.0722 * blue) > 0.3;
        let [black, white] = [[0.0; 3], [0.9; 3]];
        let colours = if is_bright { [black, white] } else { [white, black] };
        let (letters, corners) = (Letters::new()?, scene.data.corners());
        Ok(Some(Annotations { args: self, letters, bar, corners, names, colours }))
    }
}

impl Annotations<'_> {
    /// Returns a picture with its annotations.
    pub(crate) fn draw(&self, image: &Image, view: &View) -> Result<Image> {
        let extent = [image.width(), image.height()];
        let size = extent.map(f64::from);
        // Sizes follow the picture's, within what can be read.
        let text = (0.032 * size[1].min(size[0])).clamp(9.0, 64.0);
        let mut pixels = image.pixels().to_vec();
        let mut put = |ink: &Ink, is_behind: bool| {
            for (colour, mask) in ink.layers(extent, 0.09 * text) {
                lay(&mut pixels, colour, &mask, is_behind);
            }
        };
        let plain = || Ink::new(self.colours[0], None);
        if self.args.edges {
            let [mut behind, mut before] = [plain(), plain()];
            for (edge, is_behind) in self.edges(view) {
                let ink = if is_behind { &mut behind } else { &mut before };
                ink.line(&edge, (0.06 * text).max(1.0));
            }
            put(&behind, true);
            put(&before, false);
        }
        if self.args.axes {
            for ink in self.axes(view, size, text) {
                put(&ink, false);
            }
        }
        let mut ink = Ink::new(self.colours[0], Some(self.colours[1]));
        if let Some(caption) = &self.args.caption {
            let own = 1.15 * text;
            let fits = 0.96 * size[0] / self.letters.width(caption, own).max(1.0);
            let base = DVec2::new(0.5 * size[0], size[1] - 0.8 * text);
            ink.text(&self.letters, caption, own * fits.min(1.0), base, Align::Centre);
        }
        if let Some((transfer, title)) = &self.bar {
            let bar = Bar::new(self, transfer, size, text);
            bar.scale(self, title, &mut ink);
            put(&ink, false);
            bar.fill(transfer, &mut pixels, extent);
        } else {
            put(&ink, false);
        }
        Image::new(extent[0], extent[1], pixels).map(|drawn| drawn.with_colours(image.colours()))
    }

    /// Returns the visible parts of the edges of the box, and whether each lies behind the data.
    fn edges(&self, view: &View) -> Vec<([DVec2; 2], bool)> {
        let eye = view.camera().eye;
        // Whether the face of an axis, at its low or high side, looks to the eye.
        let is_front = |axis: usize, is_high: bool| {
            let bit = 1 << axis;
            let (on, across) = if is_high { (bit, 0) } else { (0, bit) };
            let outward = self.corners[on] - self.corners[across];
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            let sides = [1 << u, 1 << v].map(|side: usize| self.corners[side] - self.corners[0]);
            let normal = sides[0].cross(sides[1]);
            let normal = if normal.dot(outward) < 0.0 { -normal } else { normal };
            let to_eye = if view.is_perspective() { eye - self.corners[on] } else { -view.forward() };
            normal.dot(to_eye) > 0.0
        };
        let fronts = [0, 1, 2].map(|axis| [is_front(axis, false), is_front(axis, true)]);
        let mut edges = Vec::new();
        for axis in 0..3 {
            for place in 0..4_usize {
                let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
                let [high_u, high_v] = [place & 1 != 0, place & 2 != 0];
                let first = (usize::from(high_u) << u) | (usize::from(high_v) << v);
                let is_behind = !fronts[u][usize::from(high_u)] && !fronts[v][usize::from(high_v)];
                let ends = [self.corners[first], self.corners[first | 1 << axis]];
                edges.extend(seen(view, ends).map(|edge| (edge, is_behind)));
            }
        }
        edges
    }

    /// Returns the arrows of the axes in the lower left corner, the furthest first.
    fn axes(&self, view: &View, [_, height]: [f64; 2], text: f64) -> Vec<Ink> {
        let length = 2.2 * text;
        let centre = DVec2::new(1.8 * length, height - 1.8 * length);
        let mut axes: Vec<(f64, Ink)> = Vec::new();
        let colours = [[0.75, 0.06, 0.04], [0.1, 0.5, 0.05], [0.08, 0.2, 0.85]];
        for ((axis, name), colour) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(self.names).zip(colours)
        {
            let seen = DVec2::new(axis.dot(view.right()), -axis.dot(view.up()));
            let mut ink = Ink::new(colour, Some(self.colours[1]));
            ink.line(&[centre, centre + length * seen], 0.14 * text);
            let label = centre + (length + 0.75 * text) * seen + DVec2::new(0.0, 0.33 * text);
            ink.text(&self.letters, name, text, label, Align::Centre);
            axes.push((axis.dot(view.forward()), ink));
        }
        axes.sort_by(|a, b| b.0.total_cmp(&a.0));
        axes.into_iter().map(|(_, ink)| ink).collect()
    }
}

/// The place of a scalar bar.
struct Bar {
    domain: [f64; 2],
    ticks: Vec<(f64, String)>,
    text: f64,
    /// The width of the longest label.
    widest: f64,
    low: DVec2,
    high: DVec2,
}

impl Bar {
    fn new(own: &Annotations, transfer: &TransferFunction, [width, height]: [f64; 2], text: f64) -> Self {
        let domain = transfer.domain();
        let ticks = ticks(domain);
        let widest = ticks.iter().map(|(_, label)| own.letters.width(label, text)).fold(0.0, f64::max);
        let right = width - widest - 1.3 * text;
        let [low, high] = [0.75, 0.25].map(|share| share * height);
        Self {
            domain,
            ticks,
            text,
            widest,
            low: DVec2::new(right - 0.8 * text, low),
            high: DVec2::new(right, high),
        }
    }

    /// Draws frame, ticks and title.
    fn scale(&self, own: &Annotations, title: &str, ink: &mut Ink) {
        let Self { domain, ticks, text, widest, low, high } = self;
        let frame = [*low, DVec2::new(high.x, low.y), *high, DVec2::new(low.x, high.y), *low];
        ink.line(&frame, 0.06 * text);
        for (value, label) in ticks {
            let share = (value - domain[0]) / (domain[1] - domain[0]);
            let at = DVec2::new(high.x, low.y + share * (high.y - low.y));
            ink.line(&[at, at + DVec2::new(0.3 * text, 0.0)], 0.06 * text);
            ink.text(&own.letters, label, *text, at + DVec2::new(0.5 * text, 0.33 * text), Align::Left);
        }
        let base = DVec2::new(high.x + 0.5 * text + widest, high.y - 0.8 * text);
        ink.text(&own.letters, title, *text, base, Align::Right);
    }

    /// Fills the bar with the colours of the scalars.
    fn fill(&self, transfer: &TransferFunction, pixels: &mut [[f32; 4]], [width, height]: [u32; 2]) {
        let Self { domain, low, high, .. } = self;
        for (y, row) in (0..height).zip(pixels.chunks_exact_mut(width as usize)) {
            let share = (low.y - f64::from(y) - 0.5) / (low.y - high.y);
            if !(0.0..=1.0).contains(&share) {
                continue;
            }
            let (colour, _) = transfer.at(domain[0] + share * (domain[1] - domain[0]));
            for (x, pixel) in (0..width).zip(row) {
                if (low.x..=high.x).contains(&(f64::from(x) + 0.5)) {
                    blend(pixel, colour.as_vec3().to_array(), 1.0, false);
                }
            }
        }
    }
}

/// Composites a colour by the coverage of each pixel.
fn lay(pixels: &mut [[f32; 4]], colour: [f32; 3], mask: &Mask, is_behind: bool) {
    for (pixel, coverage) in pixels.iter_mut().zip(mask.data()).filter(|(_, coverage)| **coverage > 0) {
        blend(pixel, colour, f32::from(*coverage) / 255.0, is_behind);
    }
}

/// Returns the part of a line that lies before the eye, in pixels.
fn seen(view: &View, ends: [DVec3; 2]) -> Option<[DVec2; 2]> {
    let [a, b] = ends;
    let depth = |point: DVec3| (point - view.camera().eye).dot(view.forward());
    // A place at the eye has none in the picture.
    let least = 1e-3 * (b - a).length();
    let ends = match (depth(a) >= least, depth(b) >= least) {
        (true, true) => [a, b],
        _ if !view.is_perspective() => [a, b],
        (false, false) => return None,
        (first, _) => {
            let cut = a + (b - a) * ((least - depth(a)) / (depth(b) - depth(a)));
            if first { [a, cut] } else { [cut, b] }
        }
    };
    // Far outside of the picture, where 32 bits no longer tell places apart, a line is left out.
    let place = |point| view.project(point).map(|(place, _)| place).filter(|p| p.abs().max_element() < 1e6);
    Some([place(ends[0])?, place(ends[1])?])
}

/// Returns round scalars in a range, with labels of as many places as they need.
fn ticks([low, high]: [f64; 2]) -> Vec<(f64, String)> {
    const MOST: f64 = 6.0;
    let step = nice_step((high - low) / MOST);
    let largest = low.abs().max(high.abs());
    let places = (0..=6_usize).find(|places| {
        let scaled = step * 10.0_f64.powi(i32::try_from(*places).unwrap_or(0));
        (scaled - scaled.round()).abs() < 1e-6 * scaled
    });
    let label = |value: f64| match places {
        Some(places) if largest < 1e6 => format!("{value:.places$}"),
        _ => {
            let text = format!("{value:.2e}");
            let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
            format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
        }
    };
    let first = (low / step - 1e-9).ceil();
    let values = (0..=20_u8).map(|i| (first + f64::from(i)) * step).take_while(|v| *v <= high + 1e-9 * step);
    // No label is "-0".
    values.map(|value| if value.abs() < 1e-9 * step { 0.0 } else { value }).map(|v| (v, label(v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_as_long_as_needed() {
        let labels = |range| ticks(range).into_iter().map(|(_, label)| label).collect::<Vec<_>>();
        assert_eq!(labels([0.0, 1.0]), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels([-1024.0, 3071.0]), ["-1000", "0", "1000", "2000", "3000"]);
        assert_eq!(labels([-0.3, 0.3]), ["-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels([0.0, 1.2e7]), ["0e0", "2e6", "4e6", "6e6", "8e6", "1e7", "1.2e7"]);
        assert_eq!(labels([5.0, 5.001]), ["5.0000", "5.0002", "5.0004", "5.0006", "5.0008", "5.0010"]);
    }
}
