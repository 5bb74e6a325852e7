//! Pictures of curves.

use std::fmt::Display;
use std::ops::Range;

use plotters::prelude::*;
use volraster::measure::Cost;

/// Width and height of a picture.
const SIZE: (u32, u32) = (720, 480);

/// Family and size of all text but the title.
const FONT: (&str, u32) = ("sans-serif", 16);

/// Colours that those who see few colours can tell apart (Okabe and Ito).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// A curve with its name, and points beside it.
#[derive(Debug)]
pub(crate) struct Series {
    pub(crate) name: &'static str,
    /// Joined in this order.
    pub(crate) line: Vec<Cost>,
    /// Small and pale.
    pub(crate) dots: Vec<Cost>,
}

/// Draws time along x and error along y, both logarithmic, as SVG. `None` when there is no point;
/// series without points are left out. Every number must be more than 0.
pub(crate) fn log_log(
    title: &str,
    x: &str,
    y: &str,
    series: &[Series],
) -> Option<std::result::Result<String, String>> {
    let points = || series.iter().flat_map(|one| one.line.iter().chain(&one.dots));
    let times = decades(points().map(|cost| cost.time))?;
    let errors = decades(points().map(|cost| cost.error))?;
    let mut svg = String::new();
    let drawn = draw(&mut svg, [title, x, y], times, errors, series).map_err(|error| error.to_string());
    Some(drawn.map(|()| svg))
}

fn draw(
    svg: &mut String,
    [title, x, y]: [&str; 3],
    times: Range<f64>,
    errors: Range<f64>,
    series: &[Series],
) -> Result<(), Box<dyn std::error::Error>> {
    // A hair below the first decade, which rounding would else leave without its line.
    let [times, errors] = [times, errors].map(|range| range.start * (1.0 - 1e-9)..range.end);
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(times.log_scale(), errors.log_scale())?;
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        // Every decade and its nine parts have a line, the decade alone a number.
        .x_labels(60)
        .y_labels(60)
        .x_label_formatter(&|value| decade(*value))
        .y_label_formatter(&|value| decade(*value))
        .bold_line_style(BLACK.mix(0.15))
        .light_line_style(TRANSPARENT)
        .label_style(FONT)
        .axis_desc_style(FONT)
        .draw()?;
    for (one, colour) in series.iter().zip(COLOURS.iter().cycle()) {
        if one.line.is_empty() {
            continue;
        }
        let place = |cost: &Cost| (cost.time, cost.error);
        let pale = colour.mix(0.35).filled();
        chart.draw_series(one.dots.iter().map(|cost| Circle::new(place(cost), 2, pale)))?;
        let line = colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new(one.line.iter().map(place), line).point_size(4))?
            .label(one.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], line));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font(FONT)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    area.present()?;
    Ok(())
}

/// Whole decades around some numbers, so that both ends are labelled.
fn decades(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (lo, hi) = values.fold((f64::INFINITY, 0.0_f64), |(lo, hi), value| (lo.min(value), hi.max(value)));
    let (from, to) = (lo.log10().floor(), hi.log10().ceil());
    let to = if to > from { to } else { from + 1.0 };
    (lo <= hi).then(|| 10.0_f64.powf(from)..10.0_f64.powf(to))
}

/// A power of ten as text, nothing for other numbers.
fn decade(value: f64) -> String {
    let exponent = value.log10().round();
    // Products of tens are off by rounding.
    if (value / 10.0_f64.powf(exponent) - 1.0).abs() > 1e-6 {
        return String::new();
    }
    let text: &dyn Display = &10.0_f64.powf(exponent);
    if exponent.abs() <= 3.0 { format!("{text}") } else { format!("1e{exponent}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_whole_decades() {
        assert_eq!(decades([3.0, 250.0].into_iter()), Some(1.0..1000.0));
        assert_eq!(decades([0.01].into_iter()), Some(0.01..0.1));
        assert_eq!(decades(std::iter::empty()), None);
        let texts = [1000.0, 0.01, 1e-5, 1e6, 2.0, 0.1 * 0.1].map(decade);
        assert_eq!(texts, ["1000", "0.01", "1e-5", "1e6", "", "0.01"]);
    }
}
