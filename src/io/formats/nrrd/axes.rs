//! The axes of the array: components, extents, and the files along them.

use crate::error::Result;
use crate::io::build::file_names::{Files, Numbered};
use crate::io::file::text;
use crate::io::formats::nrrd::header::Header;
use crate::num;

/// The limit of the format on axes.
const MAX_AXES: usize = 16;

pub(crate) struct Axes {
    pub(crate) sizes: Vec<u32>,
    /// The index of the first spatial axis: 1 after an axis of components, else 0.
    pub(crate) first: usize,
}

impl Axes {
    pub(crate) fn dims(&self) -> [u32; 3] {
        [self.sizes[self.first], self.sizes[self.first + 1], self.sizes[self.first + 2]]
    }

    pub(crate) fn components(&self) -> usize {
        if self.first == 0 { 1 } else { num::index(self.sizes[0]) }
    }
}

/// Whether an axis of this kind is, or may be, an axis in space or time.
fn is_domain(kind: &str) -> bool {
    matches!(kind.to_lowercase().as_str(), "domain" | "space" | "time" | "none" | "???")
}

/// Returns the number of components that the kind of an axis implies.
fn components_of(kind: &str) -> Option<u32> {
    Some(match kind.to_lowercase().as_str() {
        "stub" | "scalar" => 1,
        "complex" | "2-vector" => 2,
        "3-color" | "rgb-color" | "hsv-color" | "xyz-color" => 3,
        "3-vector" | "3-gradient" | "3-normal" | "2d-symmetric-matrix" => 3,
        "4-color" | "rgba-color" | "4-vector" | "quaternion" => 4,
        "2d-masked-symmetric-matrix" | "2d-matrix" => 4,
        "2d-masked-matrix" => 5,
        "3d-symmetric-matrix" => 6,
        "3d-masked-symmetric-matrix" => 7,
        "3d-matrix" => 9,
        "3d-masked-matrix" => 10,
        _ => return None,
    })
}

impl<'a> Header<'a> {
    /// Reads the extents: three in space, after an optional axis of components, and further ones of 1.
    pub(crate) fn axes(&self) -> Result<Axes> {
        let fields = &self.fields;
        let dimension = fields.required("dimension")?;
        let rank = dimension.parse().ok().filter(|rank| (3..=MAX_AXES).contains(rank));
        let Some(rank) = rank else {
            let shown = text::shown(dimension);
            let rule = format!("{shown}: a volume has 3, and at most {MAX_AXES} with components");
            return Err(fields.error("dimension", rule));
        };
        let sizes = fields.extents("sizes", "dimension", rank)?;
        let kinds: Vec<&str> = fields.get("kinds").unwrap_or_default().split_whitespace().collect();
        if !kinds.is_empty() && kinds.len() != rank {
            return Err(self
                .fields
                .error("kinds", format!("{} kinds: dimension {rank} needs {rank}", kinds.len())));
        }
        let other = |axis: usize| kinds.get(axis).filter(|kind| !is_domain(kind));
        if rank == 3 {
            return match (0..3).find_map(other) {
                Some(kind) => {
                    let rule = format!("\"{kind}\": all three axes of a volume must be spatial");
                    Err(fields.error("kinds", rule))
                }
                None => Ok(Axes { sizes, first: 0 }),
            };
        }
        let directions = self.directions(rank)?;
        let undirected =
            |axis: usize| directions.as_ref().is_some_and(|directions| directions[axis].is_none());
        let first = usize::from(other(0).is_some() || undirected(0));
        if let Some(kind) = other(0)
            && let Some(components) = components_of(kind)
            && components != sizes[0]
        {
            return Err(self
                .fields
                .error("kinds", format!("{kind}: has {components} components, not {}", sizes[0])));
        }
        for (axis, &size) in sizes.iter().enumerate().skip(first) {
            if let Some(kind) = other(axis).filter(|_| size > 1) {
                let rule = format!("\"{kind}\" on axis {}: components must lie on the first axis", axis + 1);
                return Err(fields.error("kinds", rule));
            }
            if axis >= first + 3 && size > 1 {
                let more = "; a first axis of components needs a kind such as vector, or direction none";
                let rule = format!(
                    "{size} on axis {}: a volume has three axes, further ones must be 1{}",
                    axis + 1,
                    if first == 0 { more } else { "" }
                );
                return Err(fields.error("sizes", rule));
            }
        }
        if sizes.len() < first + 3 {
            return Err(fields.error("sizes", "fewer than three axes beside the components"));
        }
        Ok(Axes { sizes, first })
    }

    /// Whether the length of the components is meaningless: times, lists, or colours with opacity or hue.
    pub(crate) fn has_no_length(&self) -> bool {
        let kinds = self.fields.get("kinds").unwrap_or_default().to_lowercase();
        let kind = kinds.split_whitespace().next().unwrap_or_default();
        matches!(kind, "list" | "time" | "rgba-color" | "4-color" | "hsv-color")
    }

    /// Returns the files of the data in order; None if the data is attached.
    pub(crate) fn files(&self, axes: &Axes) -> Result<Option<Files>> {
        let Some(name) = self.fields.get("data file") else { return Ok(None) };
        let error = |rule: String| self.fields.error("data file", rule);
        let rank = axes.sizes.len();
        // The number of axes per file; the default is all but the slowest.
        let sub = |words: &[&str]| {
            let Some(word) = words.first() else { return Ok(rank - 1) };
            let rule = || format!("\"{}\": each file must have 1 to {rank} axes", text::shown(word));
            word.parse().ok().filter(|sub| (1..=rank).contains(sub)).ok_or_else(|| error(rule()))
        };
        let words: Vec<&str> = name.split_whitespace().collect();
        let (files, sub) = match words.as_slice() {
            [] => return Err(error("empty: must name the data".to_owned())),
            ["LIST", rest @ ..] if rest.len() < 2 => (Files::Named(self.names.clone()), sub(rest)?),
            [pattern, first, last, step, rest @ ..]
                if rest.len() < 2
                    && let Some(pattern) = Numbered::parse(pattern)
                    && let (Ok(first), Ok(last), Ok(step)) = (first.parse(), last.parse(), step.parse()) =>
            {
                let wrong = |rule| error(format!("\"{}\": {rule}", text::shown(name)));
                let numbered = pattern.over(first, last, step).map_err(wrong)?;
                (Files::Numbered(numbered), sub(rest)?)
            }
            _ => return Ok(Some(Files::one(name))),
        };
        let given = files.count();
        if sub == rank {
            // Each file holds an equal share of the slowest axis.
            let last = axes.sizes.last().copied().map_or(0, u64::from);
            if given == 0 || last % given != 0 {
                return Err(error(format!(
                    "{given} files: data in several files of all axes needs a divisor of the last size, {last}"
                )));
            }
        } else {
            let needed = axes.sizes[sub..].iter().fold(1_u64, |n, &size| n.saturating_mul(u64::from(size)));
            if given != needed {
                return Err(error(format!(
                    "{given} files: data in several files of {sub} axes needs {needed}"
                )));
            }
        }
        Ok(Some(files))
    }
}
