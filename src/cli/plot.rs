//! Charts: curves over logarithmic axes, stacked bars. Legends stand beside what they explain, never on it.

use std::ops::Range;

use super::picture::{Anchor, Colour, Mark, Picture, text_width};

/// Colours that those who see few colours can tell apart (Okabe and Ito; the last two are darker than theirs).
const COLOURS: [[u8; 3]; 8] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [60, 60, 60],
    [136, 84, 24],
];

/// With each colour another form, for those who see none.
const MARKS: [Mark; 6] = [Mark::Disc, Mark::Square, Mark::Up, Mark::Diamond, Mark::Cross, Mark::Down];

const INK: Colour = ([34, 34, 34], 1.0);
const GREY: Colour = ([110, 110, 110], 1.0);
const GRID: Colour = ([228, 228, 228], 1.0);
const FRAME: Colour = ([150, 150, 150], 1.0);

const TITLE: f64 = 17.0;
const TEXT: f64 = 12.5;
/// Distance of lines of text.
const LINE: f64 = 19.0;

/// What a chart is about.
#[derive(Clone, Debug)]
pub(crate) struct Titles {
    pub(crate) title: String,
    /// Smaller, below.
    pub(crate) note: String,
    pub(crate) x: &'static str,
    pub(crate) y: &'static str,
}

/// A curve with its name, and points beside it.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    pub(crate) name: String,
    /// Which colour and mark: series of one style belong together, in all charts.
    pub(crate) style: usize,
    pub(crate) dashed: bool,
    /// Joined in this order, with a mark at each.
    pub(crate) line: Vec<[f64; 2]>,
    /// Small and pale.
    pub(crate) dots: Vec<[f64; 2]>,
}

/// A bar of parts.
#[derive(Clone, Debug)]
pub(crate) struct Bar {
    pub(crate) name: String,
    pub(crate) parts: Vec<(String, f64)>,
}

/// Draws curves over logarithmic axes. `None` when there is no point; series without a line are left out, and
/// points that logarithms cannot show.
pub(crate) fn curves(titles: &Titles, series: &[Series]) -> Option<Picture> {
    let shown = |point: &&[f64; 2]| point.iter().all(|v| *v > 0.0 && v.is_finite());
    let series: Vec<Series> = series
        .iter()
        .map(|one| Series {
            line: one.line.iter().filter(shown).copied().collect(),
            dots: one.dots.iter().filter(shown).copied().collect(),
            ..one.clone()
        })
        .filter(|one| !one.line.is_empty())
        .collect();
    let points = || series.iter().flat_map(|one| one.line.iter().chain(&one.dots));
    let [across, up] = [0, 1].map(|axis| bounds(points().map(move |point| point[axis])));
    let (across, up) = (across?, up?);

    let legend = series.iter().map(|one| text_width(&one.name, TEXT)).fold(0.0, f64::max) + 44.0;
    let (left, top, bottom) = (78.0, 66.0, 470.0);
    let right = left + 600.0;
    let mut picture = Picture::new(whole(right + 22.0 + legend), 524);
    heading(&mut picture, titles);
    let x = |v: f64| left + (right - left) * share(&across, v);
    let y = |v: f64| bottom - (bottom - top) * share(&up, v);
    for (range, is_x) in [(&across, true), (&up, false)] {
        let length = if is_x { right - left } else { bottom - top };
        for (value, label) in ticks(range, length, is_x) {
            let ends = if is_x {
                [[x(value), top], [x(value), bottom]]
            } else {
                [[left, y(value)], [right, y(value)]]
            };
            let width = if label.is_empty() { 0.5 } else { 1.0 };
            picture.line(ends.to_vec(), width, GRID, false);
            if is_x {
                picture.text(&label, [x(value), bottom + 18.0], TEXT, Anchor::Middle, INK);
            } else {
                picture.text(&label, [left - 8.0, y(value) + 4.5], TEXT, Anchor::End, INK);
            }
        }
    }
    let frame = vec![[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
    picture.line(frame, 1.0, FRAME, false);
    picture.text(titles.x, [0.5 * (left + right), bottom + 42.0], TEXT, Anchor::Middle, INK);
    picture.upwards(titles.y, [20.0, 0.5 * (top + bottom)], TEXT, INK);

    let place = |point: &[f64; 2]| [x(point[0]), y(point[1])];
    // What is pale lies below.
    for one in &series {
        for dot in &one.dots {
            picture.mark(Mark::Disc, place(dot), 2.2, (colour(one.style), 0.35));
        }
    }
    for one in &series {
        let solid = (colour(one.style), 1.0);
        if one.line.len() > 1 {
            picture.line(one.line.iter().map(place).collect(), 2.0, solid, one.dashed);
        }
        for point in &one.line {
            picture.mark(mark(one.style), place(point), 4.0, solid);
        }
    }
    for (i, one) in (0_u32..).zip(&series) {
        let (at, y) = (right + 18.0, top + 10.0 + LINE * f64::from(i));
        let solid = (colour(one.style), 1.0);
        picture.line(vec![[at, y], [at + 26.0, y]], 2.0, solid, one.dashed);
        picture.mark(mark(one.style), [at + 13.0, y], 4.0, solid);
        picture.text(&one.name, [at + 34.0, y + 4.5], TEXT, Anchor::Start, INK);
    }
    Some(picture)
}

/// Draws bars of parts, one below the other, with their sums. `None` when there is nothing to see.
pub(crate) fn bars(titles: &Titles, bars: &[Bar]) -> Option<Picture> {
    let sum = |bar: &Bar| bar.parts.iter().map(|(_, v)| v).sum::<f64>();
    let most = bars.iter().map(sum).fold(0.0, f64::max);
    if !(most > 0.0 && most.is_finite()) {
        return None;
    }
    let bars = &few_parts(bars, most);
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in bars.iter().flat_map(|bar| &bar.parts) {
        if !names.contains(&name.as_str()) && name != OTHER {
            names.push(name);
        }
    }
    let has_others = bars.iter().flat_map(|bar| &bar.parts).any(|(name, _)| name == OTHER);
    let colours =
        |name: &str| part_colour(names.iter().position(|known| *known == name).unwrap_or(usize::MAX));
    let legends: Vec<&str> = names.iter().copied().chain(has_others.then_some(OTHER)).collect();
    let names_width = bars.iter().map(|bar| text_width(&bar.name, TEXT)).fold(0.0, f64::max);
    let legend = legends.iter().map(|name| text_width(name, TEXT)).fold(0.0, f64::max) + 44.0;
    let (left, top, row) = (names_width + 28.0, 66.0, 26.0);
    let right = left + 520.0;
    let count = f64::from(u32::try_from(bars.len()).unwrap_or(u32::MAX));
    let bottom = top + row * count + 6.0;
    let legend_end = top + LINE * legends.len() as f64;
    let mut picture =
        Picture::new(whole(right + 70.0 + legend), whole((bottom + 54.0).max(legend_end + 16.0)));
    heading(&mut picture, titles);
    let step = nice_step(most / 6.0);
    let end = (most / step).ceil() * step;
    let x = |v: f64| left + (right - left) * v / end;
    let mut i = 0_u32;
    while f64::from(i) * step <= end * (1.0 + 1e-9) {
        let value = f64::from(i) * step;
        picture.line(vec![[x(value), top], [x(value), bottom]], 1.0, GRID, false);
        picture.text(&number(value), [x(value), bottom + 18.0], TEXT, Anchor::Middle, INK);
        i += 1;
    }
    picture.text(titles.x, [0.5 * (left + right), bottom + 42.0], TEXT, Anchor::Middle, INK);
    for (i, bar) in (0_u32..).zip(bars) {
        let y = top + 6.0 + row * f64::from(i);
        picture.text(&bar.name, [left - 8.0, y + 13.5], TEXT, Anchor::End, INK);
        let mut from = 0.0;
        for (name, value) in &bar.parts {
            picture.fill([x(from), y], [x(from + value), y + row - 8.0], colours(name));
            from += value;
        }
        picture.text(&three_digits(sum(bar)), [x(from) + 6.0, y + 13.5], TEXT, Anchor::Start, GREY);
    }
    picture.line(vec![[left, top], [left, bottom]], 1.0, FRAME, false);
    for (i, name) in legends.iter().enumerate() {
        let (at, y) = (right + 62.0, top + 10.0 + LINE * i as f64);
        picture.fill([at, y - 6.0], [at + 14.0, y + 6.0], colours(name));
        picture.text(name, [at + 22.0, y + 4.5], TEXT, Anchor::Start, INK);
    }
    Some(picture)
}

fn heading(picture: &mut Picture, titles: &Titles) {
    picture.text(&titles.title, [16.0, 28.0], TITLE, Anchor::Start, INK);
    picture.text(&titles.note, [16.0, 48.0], TEXT, Anchor::Start, GREY);
}

fn colour(style: usize) -> [u8; 3] {
    COLOURS[style % COLOURS.len()]
}

fn mark(style: usize) -> Mark {
    MARKS[style % MARKS.len()]
}

/// What is not one of a few parts is grey.
fn part_colour(style: usize) -> Colour {
    COLOURS.get(style).map_or(([175, 175, 175], 1.0), |colour| (*colour, 1.0))
}

/// Small parts, and those beyond the number of colours, are one.
fn few_parts(bars: &[Bar], most: f64) -> Vec<Bar> {
    let mut largest: Vec<(&str, f64)> = Vec::new();
    for (name, value) in bars.iter().flat_map(|bar| &bar.parts) {
        match largest.iter_mut().find(|(known, _)| known == name) {
            Some((_, known)) => *known = known.max(*value),
            None => largest.push((name, *value)),
        }
    }
    largest.retain(|(_, value)| *value >= 0.02 * most);
    largest.sort_by(|a, b| b.1.total_cmp(&a.1));
    largest.truncate(COLOURS.len());
    let is_own = |name: &str| largest.iter().any(|(known, _)| *known == name);
    let merged = |bar: &Bar| {
        let (mut parts, others): (Vec<_>, Vec<_>) =
            bar.parts.iter().cloned().partition(|(name, _)| is_own(name));
        let rest: f64 = others.iter().map(|(_, value)| value).sum();
        if rest > 0.0 {
            parts.push((OTHER.to_string(), rest));
        }
        Bar { name: bar.name.clone(), parts }
    };
    bars.iter().map(merged).collect()
}

const OTHER: &str = "other";

/// Where a value lies between the ends of a range, in logarithms.
fn share(range: &Range<f64>, value: f64) -> f64 {
    (value / range.start).ln() / (range.end / range.start).ln()
}

/// 1, 2 or 5 times a power of ten on either side of some numbers, so that nothing lies on the frame.
fn bounds(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (lo, hi) = values.fold((f64::INFINITY, 0.0_f64), |(lo, hi), value| (lo.min(value), hi.max(value)));
    if lo > hi {
        return None;
    }
    let round = |value: f64, is_up: bool| {
        let power = 10.0_f64.powf(value.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
        let found = if is_up {
            steps.into_iter().find(|step| *step >= value)
        } else {
            steps.into_iter().rev().find(|step| *step <= value)
        };
        found.unwrap_or(value)
    };
    // Pushed out a little, since rounding alone may leave a point on the frame.
    let (start, end) = (round(lo / 1.1, false), round(hi * 1.1, true));
    Some(start..end)
}

/// Places of lines along an axis of a length, with labels for so many of them as there is room for.
fn ticks(range: &Range<f64>, length: f64, is_x: bool) -> Vec<(f64, String)> {
    let decades = || -300..=300;
    let inside = |value: f64| value >= range.start * (1.0 - 1e-9) && value <= range.end * (1.0 + 1e-9);
    let of = |digits: &[f64], every: i32| -> Vec<f64> {
        decades()
            .filter(|exponent| exponent % every == 0)
            .flat_map(|exponent| digits.iter().map(move |digit| digit * 10.0_f64.powi(exponent)))
            .filter(|value| inside(*value))
            .collect()
    };
    let all = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    let choices =
        [of(&all, 1), of(&[1.0, 2.0, 5.0], 1), of(&[1.0], 1), of(&[1.0], 2), of(&[1.0], 3), of(&[1.0], 5)];
    // Labels stand side by side along x, one above the other along y.
    let room = |value: f64| if is_x { text_width(&number(value), TEXT) + 12.0 } else { 2.0 * LINE };
    let fits = |values: &&Vec<f64>| {
        let gap = |pair: &[f64]| length * (share(range, pair[1]) - share(range, pair[0]));
        values.windows(2).all(|pair| gap(pair) >= 0.5 * (room(pair[0]) + room(pair[1])))
    };
    let labelled = choices.iter().find(fits).cloned().unwrap_or_default();
    // Lines without a label only where they are not a grey field.
    let lines = if choices[2].len() <= 8 { of(&all, 1) } else { choices[2].clone() };
    let is_labelled = |value: f64| labelled.iter().any(|known| (known / value - 1.0).abs() < 1e-9);
    lines
        .into_iter()
        .map(|value| (value, if is_labelled(value) { number(value) } else { String::new() }))
        .collect()
}

/// A round step of at least some size.
fn nice_step(least: f64) -> f64 {
    let power = 10.0_f64.powf(least.log10().floor());
    [1.0, 2.0, 2.5, 5.0]
        .map(|step| step * power)
        .into_iter()
        .find(|step| *step >= least)
        .unwrap_or(10.0 * power)
}

/// A round number, short.
pub(crate) fn number(value: f64) -> String {
    let short = |value: f64| {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    };
    match value {
        0.0 => "0".to_string(),
        v if v < 1e-3 * (1.0 - 1e-9) => {
            let exponent = (v.log10() + 1e-9).floor();
            let digit = short(v / 10.0_f64.powf(exponent));
            format!("{digit}e{exponent}")
        }
        v if v >= 1e9 => format!("{}G", short(v / 1e9)),
        v if v >= 1e6 => format!("{}M", short(v / 1e6)),
        v if v >= 1e4 => format!("{}k", short(v / 1e3)),
        v => short(v),
    }
}

/// Three digits of a large number, short.
pub(crate) fn count(value: f64) -> String {
    if !(value > 0.0 && value.is_finite()) {
        return "0".to_string();
    }
    let power = 10.0_f64.powf(value.log10().floor() - 2.0);
    number((value / power).round() * power)
}

/// A measured number with three digits.
pub(crate) fn three_digits(value: f64) -> String {
    let places = match value {
        v if v >= 99.95 => 0,
        v if v >= 9.995 => 1,
        v if v >= 0.9995 => 2,
        _ => 3,
    };
    format!("{value:.places$}")
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(length: f64) -> u32 {
    length.ceil() as u32
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
            dashed: true,
            line: points.to_vec(),
            dots: points.to_vec(),
        }
    }

    #[test]
    fn axes_end_beyond_what_they_show() {
        assert_eq!(bounds([3.0, 150.0].into_iter()), Some(2.0..200.0));
        assert_eq!(bounds([0.01].into_iter()), Some(0.005..0.02));
        assert_eq!(bounds(std::iter::empty()), None);
    }

    #[test]
    fn labels_are_few_and_lines_are_where_numbers_are_round() {
        let labels = |range: Range<f64>, is_x: bool| -> Vec<String> {
            let length = if is_x { 600.0 } else { 404.0 };
            ticks(&range, length, is_x)
                .into_iter()
                .map(|(_, label)| label)
                .filter(|l| !l.is_empty())
                .collect()
        };
        assert_eq!(labels(2.0..20.0, true), ["2", "3", "4", "5", "6", "7", "8", "9", "10", "20"]);
        // 90k and 100k would touch.
        assert_eq!(labels(1e4..1e5, true), ["10k", "20k", "50k", "100k"]);
        assert_eq!(labels(2.0..200.0, false), ["2", "5", "10", "20", "50", "100", "200"]);
        assert_eq!(labels(1e-5..1.0, false), ["1e-5", "1e-4", "0.001", "0.01", "0.1", "1"]);
        assert_eq!(labels(1e-12..1.0, false).len(), 7);
        assert_eq!([0.0, 262_144.0, 975_560.0, 1e6].map(count), ["0", "262k", "976k", "1M"]);
        assert_eq!([0.0, 2e-4, 0.5, 20_000.0, 1.5e6].map(number), ["0", "2e-4", "0.5", "20k", "1.5M"]);
        assert_eq!(
            [0.1234, 1.234, 12.34, 123.4, 9.999].map(three_digits),
            ["0.123", "1.23", "12.3", "123", "10.0"]
        );
    }

    #[test]
    fn curves_show_lines_dots_and_names() {
        let points = [[1.0, 0.1], [10.0, 0.01], [100.0, 0.0]];
        let svg = curves(&titles(), &[series("raster & more", &points), series("empty", &[])]).unwrap().svg();
        for part in
            ["a &lt;scene&gt;", "raster &amp; more", "RMSE", "stroke-dasharray", "fill-opacity=\"0.35\""]
        {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        assert!(!svg.contains("empty") && !svg.contains("NaN") && !svg.contains("inf"));
        assert!(curves(&titles(), &[series("none", &[[1.0, 0.0], [f64::NAN, 1.0]])]).is_none());
    }

    #[test]
    fn bars_are_as_long_as_their_parts() {
        let bar = |name: &str, parts: &[(&str, f64)]| Bar {
            name: name.to_string(),
            parts: parts.iter().map(|(name, v)| ((*name).to_string(), *v)).collect(),
        };
        let two = [bar("one", &[("sort", 2.0), ("draw", 6.0)]), bar("two", &[("draw", 3.0)])];
        let svg = bars(&titles(), &two).unwrap().svg();
        let widths: Vec<f64> = svg
            .lines()
            .filter(|line| line.starts_with("<polygon"))
            .map(|line| {
                let xs: Vec<f64> = line
                    .split('"')
                    .nth(1)
                    .unwrap()
                    .split(' ')
                    .map(|p| p.split(',').next().unwrap().parse().unwrap())
                    .collect();
                xs[1] - xs[0]
            })
            .collect();
        // Three parts, then two signs of the legend.
        assert_eq!(widths.len(), 5);
        assert!(
            (widths[1] / widths[0] - 3.0).abs() < 0.01 && (widths[2] / widths[0] - 1.5).abs() < 0.01,
            "{widths:?}"
        );
        // What is small in all bars is one part, and takes its place in the sum.
        let small = bars(&titles(), &[bar("one", &[("a", 100.0), ("b", 0.6), ("c", 0.4)])]).unwrap().svg();
        assert!(small.contains(">other<") && small.contains(">101<") && !small.contains(">b<"), "{small}");
        assert!(svg.contains(">8.00<") && svg.contains(">sort<") && svg.contains(">two<"));
        assert!(bars(&titles(), &[bar("none", &[])]).is_none());
    }
}
