//! Lines and text as coverage of pixels, composited with a picture in linear light.

use ab_glyph::{Font as _, FontRef, OutlineCurve, Point, PxScale, ScaleFont as _};
use tiny_skia::{FillRule, LineCap, LineJoin, Mask, Path, PathBuilder, Stroke, Transform};
use volraster::glam::DVec2;
use volraster::{Error, Result};

/// A size or a place as the drawing library counts.
#[allow(clippy::cast_possible_truncation, reason = "a place in a picture needs no more than 32 bits")]
fn f32_of(value: f64) -> f32 {
    value as f32
}

/// The font of all text.
pub(super) struct Letters(FontRef<'static>);

impl Letters {
    pub(super) fn new() -> Result<Self> {
        let font = FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT);
        font.map(Self).map_err(|error| Error::Invalid { what: "font".to_string(), why: error.to_string() })
    }

    /// Returns the width of a line of text of this height.
    pub(super) fn width(&self, text: &str, size: f64) -> f64 {
        self.set(text, size).1
    }

    /// Places the glyphs of a line, and returns their outlines from the origin to the right with the width.
    fn set(&self, text: &str, size: f64) -> (PathBuilder, f64) {
        let font = self.0.as_scaled(PxScale::from(f32_of(size)));
        let [across, down] = [font.h_scale_factor(), -font.v_scale_factor()];
        let (mut path, mut x, mut last) = (PathBuilder::new(), 0.0_f32, None);
        for glyph in text.chars().map(|c| font.glyph_id(c)) {
            x += last.map_or(0.0, |last| font.kern(last, glyph));
            if let Some(outline) = self.0.outline(glyph) {
                outlined(&mut path, &outline.curves, |p| (x + across * p.x, down * p.y));
            }
            x += font.h_advance(glyph);
            last = Some(glyph);
        }
        (path, f64::from(x))
    }
}

/// Adds the curves of a glyph. Those of one contour follow each other.
fn outlined(path: &mut PathBuilder, curves: &[OutlineCurve], place: impl Fn(Point) -> (f32, f32)) {
    let mut pen: Option<Point> = None;
    for curve in curves {
        let (OutlineCurve::Line(start, end)
        | OutlineCurve::Quad(start, _, end)
        | OutlineCurve::Cubic(start, _, _, end)) = *curve;
        if pen != Some(start) {
            if pen.is_some() {
                path.close();
            }
            let (x, y) = place(start);
            path.move_to(x, y);
        }
        let (x, y) = place(end);
        match *curve {
            OutlineCurve::Line(..) => path.line_to(x, y),
            OutlineCurve::Quad(_, by, _) => {
                let (by_x, by_y) = place(by);
                path.quad_to(by_x, by_y, x, y);
            }
            OutlineCurve::Cubic(_, first, second, _) => {
                let ((first_x, first_y), (second_x, second_y)) = (place(first), place(second));
                path.cubic_to(first_x, first_y, second_x, second_y, x, y);
            }
        }
        pen = Some(end);
    }
    if pen.is_some() {
        path.close();
    }
}

/// The side of a place at which text stands.
#[derive(Clone, Copy)]
pub(super) enum Align {
    Left,
    Centre,
    Right,
}

/// Something drawn in one colour, with a rim of another colour beneath that sets it off.
pub(super) struct Ink {
    paths: Vec<(Path, f64)>,
    texts: Vec<Path>,
    /// Linear colour.
    pub(super) colour: [f32; 3],
    pub(super) rim: Option<[f32; 3]>,
}

impl Ink {
    pub(super) fn new(colour: [f32; 3], rim: Option<[f32; 3]>) -> Self {
        Self { paths: Vec::new(), texts: Vec::new(), colour, rim }
    }

    /// Adds a line of this width.
    pub(super) fn line(&mut self, points: &[DVec2], width: f64) {
        let mut path = PathBuilder::new();
        for (i, point) in points.iter().enumerate() {
            let (x, y) = (f32_of(point.x), f32_of(point.y));
            if i == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        self.paths.extend(path.finish().map(|path| (path, width)));
    }

    /// Adds a line of text on a base line.
    pub(super) fn text(&mut self, letters: &Letters, text: &str, size: f64, base: DVec2, align: Align) {
        let (path, width) = letters.set(text, size);
        let left = match align {
            Align::Left => base.x,
            Align::Centre => base.x - 0.5 * width,
            Align::Right => base.x - width,
        };
        let placed = Transform::from_translate(f32_of(left), f32_of(base.y));
        self.texts.extend(path.finish().and_then(|path| path.transform(placed)));
    }

    /// Returns the colours with the coverage of each pixel, from the lowest up.
    pub(super) fn layers(&self, [width, height]: [u32; 2], rim_width: f64) -> Vec<([f32; 3], Mask)> {
        let stroked = |path: &Path, width: f64| {
            let round = (LineCap::Round, LineJoin::Round);
            let stroke =
                Stroke { width: f32_of(width), line_cap: round.0, line_join: round.1, ..Stroke::default() };
            path.stroke(&stroke, 1.0)
        };
        let mut layers = Vec::new();
        let mut layer = |colour, paths: Vec<Path>| {
            if let Some(mut mask) = Mask::new(width, height) {
                for path in paths {
                    mask.fill_path(&path, FillRule::Winding, true, Transform::identity());
                }
                layers.push((colour, mask));
            }
        };
        if let Some(rim) = self.rim {
            let lines = self.paths.iter().filter_map(|(path, width)| stroked(path, width + 2.0 * rim_width));
            let texts = self.texts.iter().filter_map(|path| stroked(path, 2.0 * rim_width));
            layer(rim, lines.chain(texts).collect());
        }
        let lines = self.paths.iter().filter_map(|(path, width)| stroked(path, *width));
        layer(self.colour, lines.chain(self.texts.iter().cloned()).collect());
        layers
    }
}

/// Lays a colour over a premultiplied pixel, or under it.
pub(super) fn blend(pixel: &mut [f32; 4], colour: [f32; 3], coverage: f32, is_behind: bool) {
    let share = if is_behind { coverage * (1.0 - pixel[3]) } else { coverage };
    let kept = if is_behind { 1.0 } else { 1.0 - coverage };
    for (channel, ink) in pixel.iter_mut().zip([colour[0], colour[1], colour[2], 1.0]) {
        *channel = kept * *channel + share * ink;
    }
}
