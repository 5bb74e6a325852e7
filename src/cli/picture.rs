//! Pictures of lines, discs, boxes and text: as SVG, and as PNG.
//!
//! Both show the same: text is measured with the letters of the PNG, which are wide, so that it does not
//! overlap where a browser takes others.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Cursor;

use ab_glyph::{Font, FontRef, ScaleFont};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

/// The letters of PNG pictures.
const LETTERS: &[u8] = include_bytes!("../../assets/plots.ttf");

/// Pixels of a PNG to one unit of a picture: plots are looked at on dense screens.
const SCALE: u32 = 2;

/// Red, green, blue, 0 to 255 in sRGB, and opacity.
pub(crate) type Colour = ([u8; 3], f64);

/// Where a text's place is in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// Form of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    Disc,
    Square,
    Diamond,
    Up,
    Down,
    Cross,
}

/// One thing to draw. Places are in units from the top left corner, y down.
#[derive(Clone, Debug)]
enum Shape {
    Line { points: Vec<[f64; 2]>, width: f64, colour: Colour, dashed: bool },
    Polygon { points: Vec<[f64; 2]>, colour: Colour },
    Text { text: String, at: [f64; 2], size: f64, anchor: Anchor, turned: bool, colour: Colour },
}

/// A picture on white.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    width: u32,
    height: u32,
    shapes: Vec<Shape>,
}

impl Picture {
    /// An empty one, in units.
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self { width, height, shapes: Vec::new() }
    }

    /// A line through points.
    pub(crate) fn line(&mut self, points: Vec<[f64; 2]>, width: f64, colour: Colour, dashed: bool) {
        self.shapes.push(Shape::Line { points, width, colour, dashed });
    }

    /// A filled box between two corners.
    pub(crate) fn fill(&mut self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], colour: Colour) {
        self.polygon(vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]], colour);
    }

    fn polygon(&mut self, points: Vec<[f64; 2]>, colour: Colour) {
        self.shapes.push(Shape::Polygon { points, colour });
    }

    /// A marker of a radius.
    pub(crate) fn mark(&mut self, mark: Mark, [x, y]: [f64; 2], radius: f64, colour: Colour) {
        let around = |corners: u32, turn: f64, reach: f64| {
            let corner = |i: u32| {
                let (s, c) = (std::f64::consts::TAU * (f64::from(i) / f64::from(corners) + turn)).sin_cos();
                [x + reach * c, y + reach * s]
            };
            (0..corners).map(corner).collect::<Vec<_>>()
        };
        let points = match mark {
            Mark::Disc => around(24, 0.0, radius),
            Mark::Square => around(4, 0.125, 1.25 * radius),
            Mark::Diamond => around(4, 0.0, 1.35 * radius),
            Mark::Up => around(3, -0.25, 1.4 * radius),
            Mark::Down => around(3, 0.25, 1.4 * radius),
            Mark::Cross => {
                let r = radius;
                self.line(vec![[x - r, y - r], [x + r, y + r]], 0.6 * r, colour, false);
                self.line(vec![[x - r, y + r], [x + r, y - r]], 0.6 * r, colour, false);
                return;
            }
        };
        self.polygon(points, colour);
    }

    /// Text on its base line.
    pub(crate) fn text(&mut self, text: &str, at: [f64; 2], size: f64, anchor: Anchor, colour: Colour) {
        self.shapes.push(Shape::Text { text: text.to_string(), at, size, anchor, turned: false, colour });
    }

    /// Text that runs upwards, in the middle of its place.
    pub(crate) fn upwards(&mut self, text: &str, at: [f64; 2], size: f64, colour: Colour) {
        let anchor = Anchor::Middle;
        self.shapes.push(Shape::Text { text: text.to_string(), at, size, anchor, turned: true, colour });
    }

    /// As SVG.
    pub(crate) fn svg(&self) -> String {
        let (width, height) = (self.width, self.height);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"system-ui, sans-serif\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
        );
        for shape in &self.shapes {
            // Writing into a string cannot fail.
            let _ = match shape {
                Shape::Line { points, width, colour, dashed } => {
                    let dash = if *dashed { " stroke-dasharray=\"6 4\"" } else { "" };
                    writeln!(
                        svg,
                        "<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" \
                         stroke-width=\"{width}\"{dash} {}/>",
                        places(points),
                        paint("stroke", *colour)
                    )
                }
                Shape::Polygon { points, colour } => {
                    writeln!(svg, "<polygon points=\"{}\" {}/>", places(points), paint("fill", *colour))
                }
                Shape::Text { text, at: [x, y], size, anchor, turned, colour } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    let turn = if *turned {
                        format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"")
                    } else {
                        String::new()
                    };
                    writeln!(
                        svg,
                        "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{turn} {}>{}</text>",
                        paint("fill", *colour),
                        escaped(text)
                    )
                }
            };
        }
        svg.push_str("</svg>\n");
        svg
    }

    /// As PNG, two pixels to a unit.
    ///
    /// # Errors
    ///
    /// A line, when the picture is too large for its format.
    pub(crate) fn png(&self) -> Result<Vec<u8>, String> {
        let mut canvas = Canvas::new(self.width * SCALE, self.height * SCALE);
        let scale = f64::from(SCALE);
        let scaled = |points: &[[f64; 2]]| points.iter().map(|p| p.map(|v| v * scale)).collect::<Vec<_>>();
        for shape in &self.shapes {
            match shape {
                Shape::Line { points, width, colour, dashed } => {
                    let points = scaled(points);
                    let pieces =
                        if *dashed { dashes(&points, 6.0 * scale, 4.0 * scale) } else { vec![points] };
                    for piece in pieces {
                        canvas.stroke(&piece, 0.5 * width * scale, *colour);
                    }
                }
                Shape::Polygon { points, colour } => canvas.polygon(&scaled(points), *colour),
                Shape::Text { text, at, size, anchor, turned, colour } => {
                    canvas.text(text, at.map(|v| v * scale), size * scale, *anchor, *turned, *colour);
                }
            }
        }
        let mut file = Cursor::new(Vec::new());
        PngEncoder::new(&mut file)
            .write_image(&canvas.bytes(), canvas.width, canvas.height, ExtendedColorType::Rgb8)
            .map_err(|error| error.to_string())?;
        Ok(file.into_inner())
    }
}

/// Width of a text, in units.
pub(crate) fn text_width(text: &str, size: f64) -> f64 {
    let Ok(font) = FontRef::try_from_slice(LETTERS) else { return 0.0 };
    advance(&font, text, size)
}

/// Where each glyph's end is would be the same sum: kerning is left out.
fn advance(font: &FontRef<'_>, text: &str, size: f64) -> f64 {
    let scaled = font.as_scaled(letters(font, size));
    text.chars().map(|c| f64::from(scaled.h_advance(scaled.glyph_id(c)))).sum()
}

/// The scale at which an em is a size; the crate's own is from ascent to descent.
#[expect(clippy::cast_possible_truncation, reason = "sizes of text are small")]
fn letters(font: &FontRef<'_>, size: f64) -> f32 {
    let em = f64::from(font.units_per_em().unwrap_or(2048.0));
    (size * f64::from(font.height_unscaled()) / em) as f32
}

fn places(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect::<Vec<_>>().join(" ")
}

fn paint(what: &str, ([r, g, b], opacity): Colour) -> String {
    let mut text = format!("{what}=\"#{r:02x}{g:02x}{b:02x}\"");
    if opacity < 1.0 {
        // Writing into a string cannot fail.
        let _ = write!(text, " {what}-opacity=\"{opacity}\"");
    }
    text
}

/// Text inside of XML or HTML, attributes too.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // XML has no place for them, written in whatever way.
            c if c.is_control() && !"\t\n\r".contains(c) => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A line cut into dashes.
fn dashes(points: &[[f64; 2]], on: f64, off: f64) -> Vec<Vec<[f64; 2]>> {
    let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
    let (mut drawing, mut left) = (true, on);
    for pair in points.windows(2) {
        let ([x0, y0], [x1, y1]) = (pair[0], pair[1]);
        let length = (x1 - x0).hypot(y1 - y0);
        let at = |t: f64| [x0 + (x1 - x0) * t / length, y0 + (y1 - y0) * t / length];
        let mut t = 0.0;
        while t < length {
            let end = (t + left).min(length);
            if drawing {
                pieces.push(vec![at(t), at(end)]);
            }
            left -= end - t;
            t = end;
            if left <= 0.0 {
                drawing = !drawing;
                left = if drawing { on } else { off };
            }
        }
    }
    pieces
}

/// Pixels in sRGB, blended as browsers blend.
struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<[f64; 3]>,
}

/// Samples along each side of a pixel, of polygons.
const SAMPLES: u32 = 4;

impl Canvas {
    fn new(width: u32, height: u32) -> Self {
        let pixels = (0..height).flat_map(|_| (0..width).map(|_| [255.0; 3])).collect();
        Self { width, height, pixels }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255, rounded")]
    fn bytes(&self) -> Vec<u8> {
        self.pixels.iter().flatten().map(|v| v.round().clamp(0.0, 255.0) as u8).collect()
    }

    fn blend(&mut self, x: u32, y: u32, (colour, opacity): Colour, coverage: f64) {
        let weight = (coverage * opacity).clamp(0.0, 1.0);
        let row = self.width as usize;
        if x < self.width
            && weight > 0.0
            && let Some(pixel) = self.pixels.get_mut(y as usize * row + x as usize)
        {
            for (channel, new) in pixel.iter_mut().zip(colour) {
                *channel += (f64::from(new) - *channel) * weight;
            }
        }
    }

    /// Blends every pixel near some points by its coverage, which is told of its centre.
    fn cover(&mut self, points: &[[f64; 2]], reach: f64, colour: Colour, coverage: impl Fn([f64; 2]) -> f64) {
        let [xs, ys] = [(0, self.width), (1, self.height)].map(|(axis, size)| {
            let all = || points.iter().map(move |point| point[axis]);
            let low = all().fold(f64::INFINITY, f64::min) - reach;
            let high = all().fold(f64::NEG_INFINITY, f64::max) + reach;
            pixel(low.floor(), size)..pixel(high.ceil(), size)
        });
        for y in ys {
            for x in xs.clone() {
                let covered = coverage([f64::from(x) + 0.5, f64::from(y) + 0.5]);
                self.blend(x, y, colour, covered);
            }
        }
    }

    /// A line with round ends: what is nearer than a radius. Each pixel is blended once, however many pieces of the
    /// line are near it.
    fn stroke(&mut self, points: &[[f64; 2]], radius: f64, colour: Colour) {
        let mut near: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        let reach = radius + 1.0;
        for pair in points.windows(2) {
            let ([ax, ay], [bx, by]) = (pair[0], pair[1]);
            let rows = pixel((ay.min(by) - reach).floor(), self.height)
                ..pixel((ay.max(by) + reach).ceil(), self.height);
            for y in rows {
                // Of a steep piece only what passes the row.
                let middle = f64::from(y) + 0.5;
                let at = |y: f64| {
                    if ay.total_cmp(&by).is_eq() {
                        None
                    } else {
                        Some(((y - ay) / (by - ay)).clamp(0.0, 1.0))
                    }
                };
                let [from, to] =
                    [at(middle - reach), at(middle + reach)].map(|t| t.map(|t| ax + (bx - ax) * t));
                let (from, to) = (from.unwrap_or(ax), to.unwrap_or(bx));
                let columns = pixel((from.min(to) - reach).floor(), self.width)
                    ..pixel((from.max(to) + reach).ceil(), self.width);
                for x in columns {
                    let away = distance([f64::from(x) + 0.5, middle], pair[0], pair[1]);
                    let coverage = (radius + 0.5 - away).clamp(0.0, 1.0);
                    if coverage > 0.0 {
                        let known = near.entry((y, x)).or_insert(0.0);
                        *known = known.max(coverage);
                    }
                }
            }
        }
        for ((y, x), coverage) in near {
            self.blend(x, y, colour, coverage);
        }
    }

    /// A convex polygon, either way round.
    fn polygon(&mut self, points: &[[f64; 2]], colour: Colour) {
        let inside = |[x, y]: [f64; 2]| {
            let side = |i: usize| {
                let ([ax, ay], [bx, by]) = (points[i], points[(i + 1) % points.len()]);
                (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            };
            let sides = || (0..points.len()).map(side);
            sides().all(|s| s >= 0.0) || sides().all(|s| s <= 0.0)
        };
        let offset = |i: u32| (f64::from(i) + 0.5) / f64::from(SAMPLES) - 0.5;
        self.cover(points, 1.0, colour, |[x, y]| {
            // A pixel whose corners are inside is, since the polygon is convex.
            if [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
                .iter()
                .all(|[dx, dy]| inside([x + dx, y + dy]))
            {
                return 1.0;
            }
            let hits = (0..SAMPLES * SAMPLES)
                .filter(|i| inside([x + offset(i % SAMPLES), y + offset(i / SAMPLES)]))
                .count();
            hits as f64 / f64::from(SAMPLES * SAMPLES)
        });
    }

    fn text(&mut self, text: &str, at: [f64; 2], size: f64, anchor: Anchor, turned: bool, colour: Colour) {
        let Ok(font) = FontRef::try_from_slice(LETTERS) else { return };
        let scale = letters(&font, size);
        let width = advance(&font, text, size);
        let mut along = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -0.5 * width,
            Anchor::End => -width,
        };
        for c in text.chars() {
            let id = font.glyph_id(c);
            // Upright glyphs at their own fractions of a pixel.
            let [x, y] = if turned { [0.0, 0.0] } else { [at[0] + along, at[1]] };
            let glyph = id.with_scale_and_position(scale, ab_glyph::point(single(x), single(y)));
            if let Some(outline) = font.outline_glyph(glyph) {
                let origin = outline.px_bounds().min;
                let (left, top) = (f64::from(origin.x), f64::from(origin.y));
                outline.draw(|x, y, coverage| {
                    let (x, y) = (f64::from(x) + left, f64::from(y) + top);
                    // Turned by a quarter, to the left.
                    let [x, y] = if turned { [at[0] + y, at[1] - along - x] } else { [x, y] };
                    if x >= 0.0 && y >= 0.0 {
                        let (x, y) = (pixel(x, self.width), pixel(y, self.height));
                        self.blend(x, y, colour, f64::from(coverage));
                    }
                });
            }
            along += f64::from(font.as_scaled(scale).h_advance(id));
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "places in a picture")]
fn single(value: f64) -> f32 {
    value as f32
}

/// The pixel of a place, within 0 and the image's end.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, and is clamped")]
fn pixel(place: f64, end: u32) -> u32 {
    (place as u32).min(end)
}

/// From a place to a segment.
fn distance([x, y]: [f64; 2], [ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let square = dx * dx + dy * dy;
    let t = if square > 0.0 { ((x - ax) * dx + (y - ay) * dy) / square } else { 0.0 };
    let t = t.clamp(0.0, 1.0);
    (x - ax - t * dx).hypot(y - ay - t * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Colour = ([200, 0, 0], 1.0);

    fn decoded(picture: &Picture) -> image::RgbImage {
        image::load_from_memory(&picture.png().unwrap()).unwrap().to_rgb8()
    }

    #[test]
    fn a_png_shows_what_the_svg_names() {
        let mut picture = Picture::new(40, 30);
        picture.fill([5.0, 5.0], [15.0, 10.0], RED);
        picture.line(vec![[20.0, 20.0], [30.0, 20.0]], 2.0, RED, false);
        picture.mark(Mark::Disc, [35.0, 5.0], 3.0, RED);
        let image = decoded(&picture);
        assert_eq!(image.dimensions(), (80, 60));
        let red = |x: u32, y: u32| image.get_pixel(x, y).0 == [200, 0, 0];
        // Whole pixels of the box, the line and the disc; and what lies just outside.
        assert!(red(10, 10) && red(29, 19) && red(50, 40) && red(70, 10));
        for (x, y) in [(9, 10), (30, 19), (50, 43), (77, 10), (35, 40)] {
            assert_eq!(image.get_pixel(x, y).0, [255; 3], "{x} {y}");
        }
        let svg = picture.svg();
        assert!(svg.contains("<polygon points=\"5.00,5.00 15.00,5.00") && svg.contains("stroke-width=\"2\""));
    }

    #[test]
    fn text_is_where_its_anchor_says_and_every_sign_has_a_form() {
        let ink = |anchor, turned: bool| {
            let mut picture = Picture::new(100, 100);
            if turned {
                picture.upwards("Hm", [50.0, 50.0], 16.0, RED);
            } else {
                picture.text("Hm", [50.0, 50.0], 16.0, anchor, RED);
            }
            let image = decoded(&picture);
            let dark: Vec<(u32, u32)> =
                image.enumerate_pixels().filter(|(_, _, p)| p.0[1] < 128).map(|(x, y, _)| (x, y)).collect();
            let bounds = |pick: fn(&(u32, u32)) -> u32| {
                (dark.iter().map(pick).min().unwrap(), dark.iter().map(pick).max().unwrap())
            };
            (bounds(|p| p.0), bounds(|p| p.1))
        };
        let ((left, right), (top, bottom)) = ink(Anchor::Start, false);
        assert!(left >= 100 && top > 70 && bottom <= 101, "{left} {top} {bottom}");
        let width = 2.0 * text_width("Hm", 16.0);
        assert!((f64::from(right - left) - width).abs() < 8.0, "{left} {right} {width}");
        assert!(ink(Anchor::End, false).0.1 <= 100);
        let ((left, right), (top, bottom)) = ink(Anchor::Middle, true);
        assert!(right <= 101 && left > 70 && top < 90 && bottom > 110, "{left} {right} {top} {bottom}");
        let font = FontRef::try_from_slice(LETTERS).unwrap();
        let signs = (' '..='~').chain("µ·×²³–≤…".chars());
        assert!(signs.clone().all(|c| font.glyph_id(c).0 != 0), "{signs:?}");
    }

    #[test]
    fn what_files_say_stays_text() {
        assert_eq!(escaped("<a b=\"c\">&'\u{1}"), "&lt;a b=&quot;c&quot;&gt;&amp;&#39;\u{fffd}");
    }

    #[test]
    fn a_bent_line_is_as_dark_at_its_bends_and_whole_along_them() {
        let mut picture = Picture::new(40, 40);
        let half: Colour = ([0, 0, 0], 0.5);
        picture.line(vec![[5.0, 5.0], [30.0, 10.0], [10.0, 35.0], [5.0, 35.0]], 3.0, half, false);
        let image = decoded(&picture);
        for (x, y) in [(10, 10), (60, 20), (20, 70), (35, 15), (41, 43), (12, 70)] {
            let [r, g, b] = image.get_pixel(x, y).0;
            assert!(r.abs_diff(128) <= 1 && r == g && g == b, "{x} {y}: {r}");
        }
        assert!(image.pixels().all(|pixel| pixel.0[0] >= 127));
    }

    #[test]
    fn dashes_are_as_long_as_told_round_corners() {
        let pieces = dashes(&[[0.0, 0.0], [8.0, 0.0], [8.0, 5.0]], 6.0, 4.0);
        assert_eq!(pieces, [vec![[0.0, 0.0], [6.0, 0.0]], vec![[8.0, 2.0], [8.0, 5.0]]]);
    }
}
