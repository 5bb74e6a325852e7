//! Elements and properties of PLY files of Gaussian splats, by name.

use crate::error::{Error, Result};
use crate::io::build::gaussians::{About, about_licence, missing, mode_of};
use crate::io::file::scanner::Scanner;
use crate::io::file::text::shown;
use crate::io::formats::ply::header::{Element, Header};
use crate::num;
use crate::scene::Axes;

/// Returns the index of an element.
pub(super) fn find(header: &Header, name: &str) -> Option<usize> {
    header.elements.iter().position(|element| element.name == name)
}

/// Returns the index of a property that is a number.
pub(super) fn place_of(element: &Element, name: &str) -> Option<usize> {
    element.properties.iter().position(|property| property.name == name && property.list.is_none())
}

/// Returns the indices of properties that must exist.
pub(super) fn places(scanner: &Scanner, element: &Element, names: &[&str]) -> Result<Vec<usize>> {
    let place = |name: &&str| place_of(element, name).ok_or_else(|| error(scanner, element, missing(name)));
    names.iter().map(place).collect()
}

pub(super) fn error(scanner: &Scanner, element: &Element, rule: impl Into<String>) -> Error {
    scanner.source().error(format!("element {}", shown(&element.name)), rule)
}

/// Returns the indices of `f_rest_0`, `f_rest_1`, ..., and the degree that their number tells.
pub(super) fn rest(scanner: &Scanner, element: &Element) -> Result<(Vec<usize>, u32)> {
    let is_rest = |name: &str| name.strip_prefix("f_rest_").is_some_and(|i| i.parse::<u32>().is_ok());
    let count = element.properties.iter().filter(|property| is_rest(&property.name)).count();
    let Some(degree) = (0_u32..=3).find(|l| num::index(3 * l * (l + 2)) == count) else {
        let rule = format!("{count} properties f_rest_*: must be 0, 9, 24 or 45, for degrees 0 to 3");
        return Err(error(scanner, element, rule));
    };
    let names: Vec<String> = (0..count).map(|i| format!("f_rest_{i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    Ok((places(scanner, element, &names)?, degree))
}

/// Returns what the comments say, and notes on elements that are left out.
pub(super) fn about(header: &Header, format: &'static str, used: &[&str]) -> About {
    let left_out =
        header.elements.iter().filter(|element| element.count > 0 && !used.contains(&element.name.as_str()));
    let notes =
        left_out.map(|Element { name, count, .. }| format!("{count} elements \"{}\" left out", shown(name)));
    About {
        format,
        axes: Axes::Rdf.into(),
        axes_from: "the convention of PLY files",
        mode: header.comments.iter().find_map(|text| mode_of(text)).unwrap_or_default(),
        texts: about_licence(&header.comments),
        notes: notes.collect(),
    }
}
