//! Stacked horizontal bars.

use super::axis::nice_step;
use super::picture::{COLOURS, Colour, FRAME, GREY, GRID, INK, LINE, Picture, Titles, style, text_width};
use crate::cli::numbers::{three_digits, tick_label};

/// A stacked bar: a name, and named parts with their values.
#[derive(Debug)]
pub(crate) struct Bar {
    pub(crate) name: String,
    pub(crate) parts: Vec<(String, f64)>,
}

/// Draws stacked bars below one another, each with its sum, and a legend at the right. `None` if no bar has a length.
pub(crate) fn bars(titles: &Titles, mut bars: Vec<Bar>) -> Option<Picture> {
    let sum = |bar: &Bar| bar.parts.iter().map(|(_, v)| v).sum::<f64>();
    let most = bars.iter().map(sum).fold(0.0, f64::max);
    if !(most > 0.0 && most.is_finite()) {
        return None;
    }
    merge_parts(&mut bars, most);
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in bars.iter().flat_map(|bar| &bar.parts) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names.sort_by_key(|name| *name == OTHER);
    let colour = |name: &str| -> Colour {
        let place = names.iter().position(|known| *known == name).filter(|_| name != OTHER);
        (place.map_or([175; 3], |place| style(place).0), 1.0)
    };
    let names_width = bars.iter().map(|bar| text_width(&bar.name)).fold(0.0, f64::max);
    let legend = names.iter().map(|name| text_width(name)).fold(0.0, f64::max) + 44.0;
    let (left, top, row) = (names_width + 28.0, 66.0, 26.0);
    let right = left + 520.0;
    let count = f64::from(u32::try_from(bars.len()).unwrap_or(u32::MAX));
    let bottom = top + row * count + 6.0;
    let legend_end = top + LINE * names.len() as f64;
    let height = (bottom + 54.0).max(legend_end + 16.0);
    let mut picture = Picture::new([right + 70.0 + legend, height], titles);
    let step = nice_step(most / 6.0);
    let end = (most / step).ceil() * step;
    let x = |v: f64| left + (right - left) * v / end;
    let ticks = (0_u32..).map(|i| f64::from(i) * step);
    for value in ticks.take_while(|value| *value <= end * (1.0 + 1e-9)) {
        picture.line(&[[x(value), top], [x(value), bottom]], 1.0, GRID, false);
        picture.text(&tick_label(value), [x(value), bottom + 18.0], "middle", INK);
    }
    picture.text(titles.x, [0.5 * (left + right), bottom + 42.0], "middle", INK);
    for (i, bar) in (0_u32..).zip(&bars) {
        let y = top + 6.0 + row * f64::from(i);
        picture.text(&bar.name, [left - 8.0, y + 13.5], "end", INK);
        let mut from = 0.0;
        for (name, value) in &bar.parts {
            picture.fill([x(from), y], [x(from + value), y + row - 8.0], colour(name));
            from += value;
        }
        picture.text(&three_digits(sum(bar)), [x(from) + 6.0, y + 13.5], "start", GREY);
    }
    picture.line(&[[left, top], [left, bottom]], 1.0, FRAME, false);
    for (i, name) in names.iter().enumerate() {
        let (at, y) = (right + 62.0, top + 10.0 + LINE * i as f64);
        picture.fill([at, y - 6.0], [at + 14.0, y + 6.0], colour(name));
        picture.text(name, [at + 22.0, y + 4.5], "start", INK);
    }
    Some(picture)
}

/// Merges small parts, and parts beyond the number of colours, into one.
fn merge_parts(bars: &mut [Bar], most: f64) {
    let mut largest: Vec<(String, f64)> = Vec::new();
    for (name, value) in bars.iter().flat_map(|bar| &bar.parts) {
        match largest.iter_mut().find(|(known, _)| known == name) {
            Some((_, known)) => *known = known.max(*value),
            None => largest.push((name.clone(), *value)),
        }
    }
    largest.retain(|(_, value)| *value >= 0.02 * most);
    largest.sort_by(|a, b| b.1.total_cmp(&a.1));
    largest.truncate(COLOURS.len());
    let is_own = |(name, _): &(String, f64)| largest.iter().any(|(known, _)| known == name);
    for Bar { parts, .. } in bars {
        let rest: f64 = parts.iter().filter(|part| !is_own(part)).map(|(_, value)| value).sum();
        parts.retain(is_own);
        parts.extend((rest > 0.0).then(|| (OTHER.to_string(), rest)));
    }
}

const OTHER: &str = "other";

#[cfg(test)]
mod tests {
    use super::*;

    fn titles() -> Titles {
        Titles { title: "a <scene>".to_string(), note: "device".to_string(), x: "ms", y: "RMSE" }
    }

    #[test]
    fn bars_are_as_long_as_their_parts() {
        let bar = |name: &str, parts: &[(&str, f64)]| Bar {
            name: name.to_string(),
            parts: parts.iter().map(|(name, v)| ((*name).to_string(), *v)).collect(),
        };
        let two = vec![bar("one", &[("sort", 2.0), ("draw", 6.0)]), bar("two", &[("draw", 3.0)])];
        let svg = bars(&titles(), two).unwrap().svg();
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
        // Three parts, then two swatches of the legend.
        assert_eq!(widths.len(), 5);
        assert!(
            (widths[1] / widths[0] - 3.0).abs() < 0.01 && (widths[2] / widths[0] - 1.5).abs() < 0.01,
            "{widths:?}"
        );
        // Parts that are small in all bars are merged; their sum stays in the bar.
        let small = bars(&titles(), vec![bar("one", &[("a", 100.0), ("b", 0.6), ("c", 0.4)])]).unwrap().svg();
        assert!(small.contains(">other<") && small.contains(">101<") && !small.contains(">b<"), "{small}");
        assert!(svg.contains(">8.00<") && svg.contains(">sort<") && svg.contains(">two<"));
        assert!(bars(&titles(), vec![bar("none", &[])]).is_none());
    }
}
