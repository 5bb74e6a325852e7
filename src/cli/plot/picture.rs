//! Pictures of lines, polygons and text as SVG, with the colours, marks and sizes that charts share.
//!
//! Positions are in units (CSS pixels) from the top left corner, y down. Text is set in the viewer's sans-serif font;
//! layouts use an estimate of its width.

use crate::cli::markup::escape_xml;

/// Estimated advance of a letter in ems: sans-serif fonts average 0.5 to 0.6.
const LETTER_WIDTH: f64 = 0.6;

/// Font size of a title.
const TITLE: f64 = 17.0;

/// Font size of all other text.
const TEXT: f64 = 12.5;

/// Distance between lines of text.
pub(super) const LINE: f64 = 19.0;

/// Red, green and blue, 0 to 255 in sRGB, and opacity.
pub(super) type Colour = ([u8; 3], f64);

pub(super) const INK: Colour = ([34, 34, 34], 1.0);

pub(super) const GREY: Colour = ([110, 110, 110], 1.0);

pub(super) const GRID: Colour = ([228, 228, 228], 1.0);

pub(super) const FRAME: Colour = ([150, 150, 150], 1.0);

/// A colour for each technique. Colour-blind readers can tell the first eight apart (Okabe and Ito; the last two of these are darker than
/// theirs), and marks tell all.
pub(super) const COLOURS: [[u8; 3]; 10] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [60, 60, 60],
    [136, 84, 24],
    [110, 64, 170],
    [150, 160, 0],
];

/// A marker: the corners of a polygon, the turn of the first, and its size relative to other markers; `None` for a cross.
pub(super) type Mark = Option<(u32, f64, f64)>;

pub(super) const DISC: Mark = Some((24, 0.0, 1.0));

/// Marks: curves also differ in shape, for readers who see no colours.
const MARKS: [Mark; 6] =
    [DISC, Some((4, 0.125, 1.25)), Some((3, -0.25, 1.4)), Some((4, 0.0, 1.35)), None, Some((3, 0.25, 1.4))];

/// Returns colour and mark of a curve.
pub(super) fn style(index: usize) -> ([u8; 3], Mark) {
    (COLOURS[index % COLOURS.len()], MARKS[index % MARKS.len()])
}

/// Title, note and axis names of a chart.
#[derive(Clone, Debug)]
pub(crate) struct Titles {
    pub(crate) title: String,
    /// A smaller line below the title.
    pub(crate) note: String,
    pub(crate) x: &'static str,
    pub(crate) y: &'static str,
}

/// A picture on a white background.
#[derive(Debug)]
pub(crate) struct Picture {
    /// The SVG without its end.
    text: String,
}

impl Picture {
    /// Creates a picture with a title and a note. Its size is rounded up.
    pub(super) fn new(size: [f64; 2], titles: &Titles) -> Self {
        let [width, height] = size.map(f64::ceil);
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
        );
        let mut picture = Self { text };
        picture.write(&titles.title, [16.0, 28.0], TITLE, "start", "", INK);
        picture.text(&titles.note, [16.0, 48.0], "start", GREY);
        picture
    }

    /// Draws a line through points.
    pub(super) fn line(&mut self, points: &[[f64; 2]], width: f64, colour: Colour, dashed: bool) {
        let dash = if dashed { " stroke-dasharray=\"6 4\"" } else { "" };
        let (points, paint) = (places(points), paint("stroke", colour));
        self.text += &format!(
            "<polyline points=\"{points}\" fill=\"none\" stroke-linejoin=\"round\" stroke-width=\"{width}\"{dash} {paint}/>\n"
        );
    }

    /// Draws a filled box between two corners.
    pub(super) fn fill(&mut self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], colour: Colour) {
        self.polygon(&[[x0, y0], [x1, y0], [x1, y1], [x0, y1]], colour);
    }

    fn polygon(&mut self, points: &[[f64; 2]], colour: Colour) {
        self.text += &format!("<polygon points=\"{}\" {}/>\n", places(points), paint("fill", colour));
    }

    /// Draws a marker.
    pub(super) fn mark(&mut self, mark: Mark, [x, y]: [f64; 2], radius: f64, colour: Colour) {
        let Some((corners, turn, size)) = mark else {
            let r = radius;
            self.line(&[[x - r, y - r], [x + r, y + r]], 0.6 * r, colour, false);
            return self.line(&[[x - r, y + r], [x + r, y - r]], 0.6 * r, colour, false);
        };
        let reach = size * radius;
        let corner = |i: u32| {
            let (s, c) = (std::f64::consts::TAU * (f64::from(i) / f64::from(corners) + turn)).sin_cos();
            [x + reach * c, y + reach * s]
        };
        self.polygon(&(0..corners).map(corner).collect::<Vec<_>>(), colour);
    }

    /// Draws text; `at` is the `start`, `middle` or `end` of its baseline, as `anchor` says.
    pub(super) fn text(&mut self, text: &str, at: [f64; 2], anchor: &str, colour: Colour) {
        self.write(text, at, TEXT, anchor, "", colour);
    }

    /// Draws centred text that runs upwards.
    pub(super) fn upwards(&mut self, text: &str, [x, y]: [f64; 2], colour: Colour) {
        let turn = format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"");
        self.write(text, [x, y], TEXT, "middle", &turn, colour);
    }

    fn write(&mut self, text: &str, [x, y]: [f64; 2], size: f64, anchor: &str, turn: &str, colour: Colour) {
        let (text, paint) = (escape_xml(text), paint("fill", colour));
        self.text += &format!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{turn} {paint}>{text}</text>\n"
        );
    }

    /// Returns the picture as SVG.
    pub(crate) fn svg(&self) -> String {
        format!("{}</svg>\n", self.text)
    }
}

fn places(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect::<Vec<_>>().join(" ")
}

fn paint(what: &str, ([r, g, b], opacity): Colour) -> String {
    let opacity = if opacity < 1.0 { format!(" {what}-opacity=\"{opacity}\"") } else { String::new() };
    format!("{what}=\"#{r:02x}{g:02x}{b:02x}\"{opacity}")
}

/// Estimates the width of a text.
pub(super) fn text_width(text: &str) -> f64 {
    LETTER_WIDTH * TEXT * text.chars().count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Colour = ([200, 0, 0], 1.0);

    #[test]
    fn shapes_are_written_as_svg() {
        let titles = Titles { title: String::new(), note: String::new(), x: "", y: "" };
        let mut picture = Picture::new([39.5, 30.0], &titles);
        picture.fill([5.0, 5.0], [15.0, 10.0], RED);
        picture.line(&[[20.0, 20.0], [30.0, 20.0]], 2.0, ([0, 0, 0], 0.5), true);
        picture.mark(DISC, [35.0, 5.0], 3.0, RED);
        picture.text("a < b", [5.0, 25.0], "end", RED);
        picture.upwards("up", [3.0, 15.0], RED);
        let svg = picture.svg();
        for part in [
            "viewBox=\"0 0 40 30\"",
            "<polygon points=\"5.00,5.00 15.00,5.00 15.00,10.00 5.00,10.00\" fill=\"#c80000\"/>",
            "stroke-width=\"2\" stroke-dasharray=\"6 4\" stroke=\"#000000\" stroke-opacity=\"0.5\"",
            "text-anchor=\"end\" fill=\"#c80000\">a &lt; b</text>",
            "transform=\"rotate(-90 3.00 15.00)\"",
        ] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        assert_eq!(svg.matches("<polygon").count(), 2);
    }

    #[test]
    fn widths_grow_with_letters() {
        assert_eq!(text_width(""), 0.0);
        assert!((text_width("10 µs") - 37.5).abs() < 1e-12);
    }
}
