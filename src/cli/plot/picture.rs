//! Pictures of lines, polygons and text, written as SVG.
//!
//! Text is set in the viewer's sans-serif font; layouts use an estimate of its width.

use std::fmt::Write as _;

use crate::cli::markup::escape_xml;

/// Estimated advance of a letter in ems: sans-serif fonts average 0.5 to 0.6.
const LETTER_WIDTH: f64 = 0.6;

/// Red, green and blue, 0 to 255 in sRGB, and opacity.
pub(crate) type Colour = ([u8; 3], f64);

/// The point of a text that lies at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// Shape of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    Disc,
    Square,
    Diamond,
    Up,
    Down,
    Cross,
}

/// A shape. Positions are in units from the top left corner, y down.
#[derive(Clone, Debug)]
enum Shape {
    Line { points: Vec<[f64; 2]>, width: f64, colour: Colour, dashed: bool },
    Polygon { points: Vec<[f64; 2]>, colour: Colour },
    Text { text: String, at: [f64; 2], size: f64, anchor: Anchor, rotated: bool, colour: Colour },
}

/// A picture on a white background.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    width: u32,
    height: u32,
    shapes: Vec<Shape>,
}

impl Picture {
    /// Creates an empty picture; width and height are in units (CSS pixels).
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self { width, height, shapes: Vec::new() }
    }

    /// Draws a line through points.
    pub(crate) fn line(&mut self, points: Vec<[f64; 2]>, width: f64, colour: Colour, dashed: bool) {
        self.shapes.push(Shape::Line { points, width, colour, dashed });
    }

    /// Draws a filled box between two corners.
    pub(crate) fn fill(&mut self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], colour: Colour) {
        self.polygon(vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]], colour);
    }

    fn polygon(&mut self, points: Vec<[f64; 2]>, colour: Colour) {
        self.shapes.push(Shape::Polygon { points, colour });
    }

    /// Draws a marker.
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

    /// Draws text; `at` is a point on its baseline.
    pub(crate) fn text(&mut self, text: &str, at: [f64; 2], size: f64, anchor: Anchor, colour: Colour) {
        self.shapes.push(Shape::Text { text: text.to_string(), at, size, anchor, rotated: false, colour });
    }

    /// Draws centred text that runs upwards.
    pub(crate) fn upwards(&mut self, text: &str, at: [f64; 2], size: f64, colour: Colour) {
        let anchor = Anchor::Middle;
        self.shapes.push(Shape::Text { text: text.to_string(), at, size, anchor, rotated: true, colour });
    }

    /// Returns the picture as SVG.
    pub(crate) fn svg(&self) -> String {
        let (width, height) = (self.width, self.height);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\">\n\
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
                Shape::Text { text, at: [x, y], size, anchor, rotated, colour } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    let transform = if *rotated {
                        format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"")
                    } else {
                        String::new()
                    };
                    writeln!(
                        svg,
                        "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{transform} {}>{}</text>",
                        paint("fill", *colour),
                        escape_xml(text)
                    )
                }
            };
        }
        svg.push_str("</svg>\n");
        svg
    }
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

/// Estimates the width of a text of a font size, in units of the picture.
pub(crate) fn text_width(text: &str, size: f64) -> f64 {
    LETTER_WIDTH * size * text.chars().count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Colour = ([200, 0, 0], 1.0);

    #[test]
    fn shapes_are_written_as_svg() {
        let mut picture = Picture::new(40, 30);
        picture.fill([5.0, 5.0], [15.0, 10.0], RED);
        picture.line(vec![[20.0, 20.0], [30.0, 20.0]], 2.0, ([0, 0, 0], 0.5), true);
        picture.mark(Mark::Disc, [35.0, 5.0], 3.0, RED);
        picture.text("a < b", [5.0, 25.0], 12.5, Anchor::End, RED);
        picture.upwards("up", [3.0, 15.0], 12.5, RED);
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
    fn widths_grow_with_letters_and_size() {
        assert_eq!(text_width("", 10.0), 0.0);
        assert!((text_width("10 µs", 10.0) - 30.0).abs() < 1e-12);
    }
}
