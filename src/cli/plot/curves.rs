//! Curves over logarithmic axes.

use super::axis::{bounds, share, ticks};
use super::picture::{DISC, FRAME, GREY, GRID, INK, LINE, Picture, Titles, style, text_width};

/// The stroke of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stroke {
    Solid,
    Dashed,
    /// Marks alone.
    None,
    /// A grey line with its name at its end, to read others by. It does not widen the axes.
    Guide,
}

/// A named curve, with further points around it.
#[derive(Debug)]
pub(crate) struct Series {
    pub(crate) name: String,
    /// Index of colour and mark, the same for a technique in all charts.
    pub(crate) style: usize,
    pub(crate) stroke: Stroke,
    /// Points joined in this order, with a mark at each.
    pub(crate) line: Vec<[f64; 2]>,
    /// Points drawn small and pale, not joined.
    pub(crate) dots: Vec<[f64; 2]>,
}

/// Draws curves over logarithmic axes, with a legend at the right. Leaves out points that are not positive and
/// finite, and series without a line. `None` if no point remains.
pub(crate) fn curves(titles: &Titles, mut series: Vec<Series>) -> Option<Picture> {
    let shown = |point: &[f64; 2]| point.iter().all(|v| *v > 0.0 && v.is_finite());
    for one in &mut series {
        one.line.retain(shown);
        one.dots.retain(shown);
    }
    series.retain(|one| !one.line.is_empty());
    let own = || series.iter().filter(|one| one.stroke != Stroke::Guide);
    let points = || own().flat_map(|one| one.line.iter().chain(&one.dots));
    let [across, up] = [0, 1].map(|axis| bounds(points().map(move |point| point[axis])));
    let (across, up) = (across?, up?);

    let legend = own().map(|one| text_width(&one.name)).fold(0.0, f64::max) + 44.0;
    let (left, top, bottom) = (78.0, 66.0, 470.0);
    let right = left + 600.0;
    let mut picture = Picture::new([right + 22.0 + legend, 524.0], titles);
    let x = |v: f64| left + (right - left) * share(&across, v);
    let y = |v: f64| bottom - (bottom - top) * share(&up, v);
    let width = |label: &str| if label.is_empty() { 0.5 } else { 1.0 };
    for (value, label) in ticks(&across, right - left, true) {
        picture.line(&[[x(value), top], [x(value), bottom]], width(&label), GRID, false);
        picture.text(&label, [x(value), bottom + 18.0], "middle", INK);
    }
    for (value, label) in ticks(&up, bottom - top, false) {
        picture.line(&[[left, y(value)], [right, y(value)]], width(&label), GRID, false);
        picture.text(&label, [left - 8.0, y(value) + 4.5], "end", INK);
    }
    let frame = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
    picture.line(&frame, 1.0, FRAME, false);
    picture.text(titles.x, [0.5 * (left + right), bottom + 42.0], "middle", INK);
    picture.upwards(titles.y, [20.0, 0.5 * (top + bottom)], INK);

    let place = |point: &[f64; 2]| [x(point[0]), y(point[1])];
    // Pale dots lie below the lines.
    for one in &series {
        for dot in &one.dots {
            picture.mark(DISC, place(dot), 2.2, (style(one.style).0, 0.35));
        }
    }
    for one in &series {
        let (colour, mark) = style(one.style);
        let solid = (colour, 1.0);
        let points: Vec<[f64; 2]> = one.line.iter().map(place).collect();
        match one.stroke {
            Stroke::Guide => {
                let ends = within(&points, [left, right], [top, bottom]);
                picture.line(&ends, 1.0, GREY, false);
                if let Some([x, y]) = ends.last() {
                    picture.text(&one.name, [x - 6.0, y + 14.0], "end", GREY);
                }
                continue;
            }
            Stroke::Solid | Stroke::Dashed if points.len() > 1 => {
                picture.line(&points, 2.0, solid, one.stroke == Stroke::Dashed);
            }
            _ => {}
        }
        for point in &one.line {
            picture.mark(mark, place(point), 4.0, solid);
        }
    }
    for (i, one) in (0_u32..).zip(own()) {
        let (at, y) = (right + 18.0, top + 10.0 + LINE * f64::from(i));
        let (colour, mark) = style(one.style);
        let sample = [[at, y], [at + 26.0, y]];
        if one.stroke != Stroke::None {
            picture.line(&sample, 2.0, (colour, 1.0), one.stroke == Stroke::Dashed);
        }
        picture.mark(mark, [at + 13.0, y], 4.0, (colour, 1.0));
        picture.text(&one.name, [at + 34.0, y + 4.5], "start", INK);
    }
    Some(picture)
}

/// Returns the part of a straight line between two points that lies within a frame.
fn within(points: &[[f64; 2]], x: [f64; 2], y: [f64; 2]) -> Vec<[f64; 2]> {
    let &[from, to] = points else { return Vec::new() };
    let (mut begin, mut end) = (0.0_f64, 1.0_f64);
    for (axis, [low, high]) in [x, y].into_iter().enumerate() {
        let step = to[axis] - from[axis];
        let [a, b] = [(low - from[axis]) / step, (high - from[axis]) / step];
        (begin, end) = (begin.max(a.min(b)), end.min(a.max(b)));
    }
    let at = |t: f64| [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
    if begin < end { vec![at(begin), at(end)] } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn titles() -> Titles {
        Titles { title: "a <scene>".to_string(), note: "device".to_string(), x: "ms", y: "RMSE" }
    }

    fn series(name: &str, points: &[[f64; 2]]) -> Series {
        Series {
            name: name.to_string(),
            style: 2,
            stroke: Stroke::Dashed,
            line: points.to_vec(),
            dots: points.to_vec(),
        }
    }

    #[test]
    fn curves_show_lines_dots_and_names() {
        let points = [[1.0, 0.1], [10.0, 0.01], [100.0, 0.0]];
        let svg =
            curves(&titles(), vec![series("raster & more", &points), series("empty", &[])]).unwrap().svg();
        for part in
            ["a &lt;scene&gt;", "raster &amp; more", "RMSE", "stroke-dasharray", "fill-opacity=\"0.35\""]
        {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        assert!(!svg.contains("empty") && !svg.contains("NaN") && !svg.contains("inf"));
        assert!(within(&[[0.0, 0.0], [10.0, 10.0]], [2.0, 20.0], [0.0, 5.0]) == [[2.0, 2.0], [5.0, 5.0]]);
        assert!(within(&[[0.0, 9.0], [1.0, 10.0]], [0.0, 1.0], [0.0, 5.0]).is_empty());
        assert!(curves(&titles(), vec![series("none", &[[1.0, 0.0], [f64::NAN, 1.0]])]).is_none());
    }
}
