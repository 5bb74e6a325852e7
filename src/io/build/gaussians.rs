//! From columns of numbers to Gaussian splats: what the readers of all their formats share.

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::file::text::{plain, shown};
use crate::io::options::Request;
use crate::io::report::{Found, GaussiansReport, Loaded};
use crate::num;
use crate::scene::{GaussianParts, Gaussians, StoredAxes, TrainedMode, harmonics};

/// Number of texts about the licence that are kept.
const TEXTS: usize = 16;
/// Number of characters of such a text that are kept.
const TEXT: usize = 300;

/// The numbers of splats, all zero at first. Readers fill them in in any order.
pub(crate) struct Columns {
    pub(crate) parts: GaussianParts,
}

impl Columns {
    /// Makes columns of `count` splats, once the memory for them is granted. The reader has compared the count with the
    /// size of the file.
    pub(crate) fn new(source: &Source, budget: &mut Budget, count: u64, degree: u32) -> Result<Self> {
        let count = crate::io::file::text::index(source, "splats", count)?;
        let numbers = 3 * harmonics::count(degree);
        budget.take("splats", num::wide(count).saturating_mul(num::wide(4 * (3 + 4 + 3 + 1 + numbers))))?;
        Ok(Self {
            parts: GaussianParts {
                centres: zeros(source, count)?,
                rotations: zeros(source, count)?,
                log_scales: zeros(source, count)?,
                opacities: zeros(source, count)?,
                degree,
                harmonics: zeros(source, count.saturating_mul(numbers))?,
                ..GaussianParts::default()
            },
        })
    }

    /// Returns the coefficients of a splat, with three numbers for each function.
    pub(crate) fn harmonics(&mut self, i: usize) -> &mut [f32] {
        let numbers = 3 * harmonics::count(self.parts.degree);
        &mut self.parts.harmonics[numbers * i..numbers * (i + 1)]
    }

    /// Sets the constant part of the colour, from a display-referred colour of 0 to 1.
    pub(crate) fn set_colour(&mut self, i: usize, colour: [f64; 3]) {
        for (k, c) in self.harmonics(i).iter_mut().zip(colour) {
            *k = num::f32_of((c - 0.5) / harmonics::C0);
        }
    }

    /// Sets a coefficient of a function but the constant one from its place in files that have all coefficients of a
    /// channel together.
    pub(crate) fn set_rest(&mut self, i: usize, place: usize, value: f32) {
        let rest = harmonics::count(self.parts.degree) - 1;
        let (channel, function) = (place / rest.max(1), place % rest.max(1));
        self.harmonics(i)[3 * (function + 1) + channel] = value;
    }

    /// Makes splats in the axes that the file or the options say, turned as the options say.
    pub(crate) fn finish(
        self,
        source: &Source,
        budget: &mut Budget,
        about: About,
        request: &Request,
    ) -> Result<Found> {
        let About { format, axes, axes_from, mode, texts, mut notes } = about;
        if let Some((name, array)) = request.selected() {
            return Err(source.error(format!("{name} \"{array}\""), "gaussians have no arrays with names"));
        }
        let (stored, axes_from) = match request.axes {
            Some(axes) => (axes, "given"),
            None => (axes, axes_from),
        };
        let parts = GaussianParts { axes: stored.axes, mode, ..self.parts };
        let bytes = num::wide(size_of_val(&*parts.harmonics) + 4 * 7 * parts.centres.len());
        let (mut splats, dropped) = Gaussians::new(parts).map_err(|error| error.in_file(source.path()))?;
        if stored.mirrored {
            budget.take("splats, mirrored", bytes)?;
            splats = splats.mirrored();
            notes.push(format!("left-handed axes: x is negated, which makes them {}", stored.axes.name()));
        }
        if let Some(axes) = request.turn_to.filter(|axes| *axes != splats.axes()) {
            budget.take("splats, turned", bytes)?;
            notes.push(format!("turned from {} to {}", splats.axes().name(), axes.name()));
            splats = splats.turned(axes);
        }
        let mut warnings = Vec::new();
        if dropped.total() > 0 {
            warnings.push(format!("{} splats left out: {dropped}", dropped.total()));
        }
        if dropped.clamped > 0 {
            let most = Gaussians::MOST_LOG_SCALE;
            warnings.push(format!(
                "{} splats with logarithms of lengths beyond ±{most}, which are clamped",
                dropped.clamped
            ));
        }
        let mut loaded = Loaded::new(format, splats);
        loaded.report.notes = notes;
        loaded.report.warnings = warnings;
        loaded.report.gaussians = Some(GaussiansReport { axes_from, texts, dropped });
        Ok(loaded.into())
    }
}

/// The facts that a file tells of its splats.
pub(crate) struct About {
    pub(crate) format: &'static str,
    pub(crate) axes: StoredAxes,
    /// Where the axes come from, as a phrase.
    pub(crate) axes_from: &'static str,
    pub(crate) mode: TrainedMode,
    /// Texts about the licence.
    pub(crate) texts: Vec<String>,
    pub(crate) notes: Vec<String>,
}

/// Returns a list of zeros.
fn zeros<T: Clone + Default>(source: &Source, count: usize) -> Result<Vec<T>> {
    let mut list = Vec::new();
    list.try_reserve_exact(count).map_err(|_| source.error("splats", "memory is full"))?;
    list.resize(count, T::default());
    Ok(list)
}

/// Returns the texts that speak of a licence or of authors, shortened.
pub(crate) fn about_licence(texts: &[String]) -> Vec<String> {
    const WORDS: [&str; 12] = [
        "licen",
        "copyright",
        "©",
        "creative commons",
        "cc-by",
        "cc by",
        "cc0",
        "author",
        "creat",
        "credit",
        "attribution",
        "rights reserved",
    ];
    let speaks = |text: &&String| {
        let lower = text.to_lowercase();
        WORDS.iter().any(|word| lower.contains(word))
    };
    let short = |text: &String| plain(&text.chars().take(TEXT).collect::<String>());
    texts.iter().filter(speaks).take(TEXTS).map(short).collect()
}

/// Returns the rule of training that a text names.
pub(crate) fn mode_of(text: &str) -> Option<TrainedMode> {
    let lower = text.trim().to_ascii_lowercase();
    let value =
        |key: &str| lower.strip_prefix(key).map(|rest| rest.trim_start_matches([':', '=', ' ', '\t']).trim());
    if let Some(word) = value("splatrendermode") {
        return Some(match word {
            "mip" => TrainedMode::Antialiased,
            "2dgs" => TrainedMode::Flat,
            "khr" => TrainedMode::Khronos,
            "default" => TrainedMode::Default,
            _ => TrainedMode::Unknown,
        });
    }
    match value("antialiased")? {
        "1" | "true" => Some(TrainedMode::Antialiased),
        "0" | "false" => Some(TrainedMode::Default),
        _ => None,
    }
}

/// Returns a name for messages with its rule.
pub(crate) fn missing(name: &str) -> String {
    format!("property \"{}\" is missing: splats need it", shown(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_name_modes_and_licences() {
        for (text, mode) in [
            ("SplatRenderMode: mip", Some(TrainedMode::Antialiased)),
            ("splatrendermode=2dgs ", Some(TrainedMode::Flat)),
            ("SplatRenderMode default", Some(TrainedMode::Default)),
            ("SplatRenderMode: khr", Some(TrainedMode::Khronos)),
            ("SplatRenderMode: other", Some(TrainedMode::Unknown)),
            ("antialiased 1", Some(TrainedMode::Antialiased)),
            (" antialiased: 0", Some(TrainedMode::Default)),
            ("antialiased maybe", None),
            ("Generated by hand", None),
        ] {
            assert_eq!(mode_of(text), mode, "{text}");
        }
        let texts = [
            "Generated by hand",
            "Licensed under CC-BY 4.0",
            "(c) me",
            "Created by X\u{1b}",
            &"©".repeat(999),
        ];
        let kept = about_licence(&texts.map(str::to_owned));
        assert_eq!(kept, ["Licensed under CC-BY 4.0", "Created by X ", &"©".repeat(300)]);
    }
}
