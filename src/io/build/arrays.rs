//! The arrays of a data set: their description, and the choice of the one to show.

use std::collections::HashSet;
use std::fmt;
use std::ops::Range;

use crate::error::Result;
use crate::io::file::sample_type::{Pick, SampleType};
use crate::io::file::source::Source;
use crate::io::options::{Request, Wanted};

/// Names an array and the part that is read, in the syntax of [`ReadOptions::array`](crate::io::ReadOptions::array).
pub(crate) fn describe(array: &ArrayInfo, pick: Pick) -> String {
    let name = format!("{}:{}", array.association.name(), array.name);
    match pick {
        Pick::Whole => name,
        Pick::Component(_) if array.components == 1 => name,
        Pick::Component(component) => format!("{name}:{component}"),
        Pick::Magnitude => format!("{name}:magnitude"),
    }
}

/// Returns a warning if 32-bit floats are coarse for values in this range.
pub(crate) fn coarse([lo, hi]: [f64; 2], array: &ArrayInfo) -> Option<String> {
    /// The least number of distinct values that the range should have.
    const STEPS: f64 = 4096.0;
    /// The largest magnitude up to which f32 represents every whole number.
    const WHOLE: f64 = 16_777_216.0;
    if array.kind.bytes() < 4 || array.kind == SampleType::F32 || lo >= hi {
        return None;
    }
    let magnitude = lo.abs().max(hi.abs());
    let step = magnitude * f64::from(f32::EPSILON);
    let whole = !matches!(array.kind, SampleType::F64);
    let coarse = if whole { magnitude > WHOLE } else { (hi - lo) / step < STEPS };
    let (name, range) = (array.kind.name(), hi - lo);
    coarse.then(|| format!("{name} values are kept as f32: steps of {step:.1e} in a range of {range:.1e}"))
}

/// The elements that the tuples of an array belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Association {
    /// Samples, vertices or particles.
    Point,
    /// Cells.
    Cell,
}

impl Association {
    /// Returns the prefix in selections, `point` or `cell`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Cell => "cell",
        }
    }
}

/// An array as the file declares it.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayInfo {
    /// Its name; may be empty.
    pub name: String,
    /// Whether its tuples belong to points or to cells.
    pub association: Association,
    /// The type of a component.
    pub kind: SampleType,
    /// The number of components of a tuple.
    pub components: usize,
    /// Whether the file marks it as the array to show.
    pub active: bool,
}

impl ArrayInfo {
    /// Whether it is VTK's ghost array of points or cells.
    pub(crate) fn is_ghosts(&self, association: Association) -> bool {
        (self.association, self.components, self.kind) == (association, 1, SampleType::U8)
            && self.name == "vtkGhostType"
    }

    /// Whether it holds identifiers or flags, which are shown only on request.
    fn is_bookkeeping(&self) -> bool {
        let whole = !matches!(self.kind, SampleType::F32 | SampleType::F64);
        let lower = self.name.to_lowercase();
        let number = ["id", "ids", "gid", "index", "tag"].contains(&lower.as_str())
            || ["Id", "Ids", "ID", "IDs", "_id", "_ids"].iter().any(|end| self.name.ends_with(end));
        let named = ["vtkvalidpointmask", "gmsh:physical"].contains(&lower.as_str());
        whole && (number || named || lower.starts_with("vtkghost"))
    }
}

impl fmt::Display for ArrayInfo {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{} ({}", self.association.name(), self.name, self.kind.name())?;
        if self.components != 1 {
            write!(f, " x {}", self.components)?;
        }
        f.write_str(")")
    }
}

/// A chosen array, and the part of its tuples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Choice {
    /// Its place in the list.
    pub(crate) index: usize,
    pub(crate) pick: Pick,
}

/// Chooses the array to show, as [`ReadOptions::array`](crate::io::ReadOptions::array) describes. Returns None if
/// none is selected and there is none.
pub(crate) fn choose(source: &Source, arrays: &[ArrayInfo], wanted: Option<&str>) -> Result<Option<Choice>> {
    match wanted {
        Some(wanted) => find(source, arrays, wanted).map(Some),
        None => Ok(choose_among(arrays, |_, _| true)),
    }
}

/// Chooses the array to show by default, among those that `may` accepts.
pub(crate) fn choose_among(arrays: &[ArrayInfo], may: impl Fn(usize, &ArrayInfo) -> bool) -> Option<Choice> {
    let any = || arrays.iter().enumerate().filter(|&(i, array)| array.components > 0 && may(i, array));
    let all = || any().filter(|(_, array)| !array.is_bookkeeping());
    let of = |association| move |(_, array): &(usize, &ArrayInfo)| array.association == association;
    let first = |association| all().filter(of(association)).find(|(_, array)| array.components == 1);
    let found = all()
        .find(|(_, array)| array.active)
        .or_else(|| first(Association::Point))
        .or_else(|| first(Association::Cell))
        .or_else(|| all().find(of(Association::Point)))
        .or_else(|| all().next())
        .or_else(|| any().next());
    found.map(|(index, array)| Choice { index, pick: usual(array) })
}

/// Returns the ways to read a selection without its part: as a name, and as a name after the prefix of an association.
pub(crate) fn readings(wanted: &str) -> impl Iterator<Item = (Option<Association>, &str)> + Clone {
    let prefixed = [Association::Point, Association::Cell]
        .into_iter()
        .find_map(|a| Some((Some(a), wanted.strip_prefix(a.name())?.strip_prefix(':')?)));
    [Some((None, wanted)), prefixed].into_iter().flatten()
}

/// Finds an array by `NAME`, `NAME:PART`, `point:NAME` or `cell:NAME:PART`.
pub(crate) fn find(source: &Source, arrays: &[ArrayInfo], wanted: &str) -> Result<Choice> {
    let Choice { index, pick } = find_whole(source, arrays, wanted)?;
    Ok(Choice { index, pick: if pick == Pick::Whole { usual(&arrays[index]) } else { pick } })
}

/// Finds an array as [`find`] does; without a part it is the whole one.
fn find_whole(source: &Source, arrays: &[ArrayInfo], wanted: &str) -> Result<Choice> {
    let by_name = |association: Option<Association>, name: &str| {
        arrays
            .iter()
            .position(|array| array.name == name && association.is_none_or(|a| array.association == a))
    };
    // Names may contain colons: the interpretation with the longest name wins.
    if let Some(index) = readings(wanted).find_map(|(association, name)| by_name(association, name)) {
        return Ok(Choice { index, pick: Pick::Whole });
    }
    let parted = readings(wanted).find_map(|(association, name)| {
        let (name, part) = name.rsplit_once(':')?;
        Some((by_name(association, name)?, part))
    });
    if let Some((index, part)) = parted {
        return Ok(Choice { index, pick: part_of(source, &arrays[index], part)? });
    }
    Err(source
        .error(format!("array \"{wanted}\""), format!("no such array: there are {}", list(arrays.iter()))))
}

/// Selects the arrays that are kept as they are: the one that the request names, otherwise all. Arrays in `spare` are
/// left out: others contain them.
pub(crate) fn select(
    source: &Source,
    arrays: &[ArrayInfo],
    spare: &Range<usize>,
    request: &Request,
) -> Result<Vec<Choice>> {
    if let Some(wanted) = &request.array {
        return Ok(vec![find_whole(source, arrays, wanted)?]);
    }
    let one = request.wanted == Wanted::OneArray;
    let is_left = |i: usize| spare.contains(&i) || one && arrays[i].is_ghosts(arrays[i].association);
    let mut names = HashSet::new();
    let own: Vec<usize> = (0..arrays.len())
        .filter(|&i| !is_left(i))
        .filter(|&i| names.insert((arrays[i].association.name(), &arrays[i].name)))
        .collect();
    if one && own.len() != 1 {
        let rule = format!(
            "the output holds one array: choose it by --only NAME; there are {}",
            list(own.iter().map(|&i| &arrays[i]))
        );
        return Err(source.error("arrays", rule));
    }
    Ok(own.into_iter().map(|index| Choice { index, pick: Pick::Whole }).collect())
}

/// Lists the arrays in one line.
pub(crate) fn list<'a>(arrays: impl ExactSizeIterator<Item = &'a ArrayInfo>) -> String {
    /// The limit on names in one message.
    const MOST: usize = 20;
    let more = arrays.len().saturating_sub(MOST);
    let mut names: Vec<String> = arrays.take(MOST).map(ToString::to_string).collect();
    if more > 0 {
        names.push(format!("and {more} more"));
    }
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn usual(array: &ArrayInfo) -> Pick {
    if array.components == 1 { Pick::Component(0) } else { Pick::Magnitude }
}

fn part_of(source: &Source, array: &ArrayInfo, part: &str) -> Result<Pick> {
    let letter = |letters: &str| letters.find(part).filter(|_| part.len() == 1);
    let component = match part {
        "magnitude" => return Ok(Pick::Magnitude),
        _ => part.parse().ok().or_else(|| letter("xyzw")).or_else(|| letter("rgba")),
    };
    component.filter(|&component| component < array.components).map(Pick::Component).ok_or_else(|| {
        let most = array.components;
        let rule = format!("must be a component below {most}, a letter of xyzw or rgba, or magnitude");
        source.error(format!("array {array}"), format!("\"{part}\": {rule}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::options::ReadOptions;

    #[test]
    fn coarse_values_are_told() {
        let of =
            |kind, range| coarse(range, &ArrayInfo { kind, ..array("a", Association::Point, 1) }).is_some();
        assert!(of(SampleType::F64, [100_000.0, 100_001.0]) && !of(SampleType::F64, [0.0, 1.0]));
        assert!(of(SampleType::I64, [0.0, 1e9]) && !of(SampleType::I32, [-16_777_216.0, 1e6]));
        assert!(!of(SampleType::F32, [100_000.0, 100_001.0]));
    }

    fn array(name: &str, association: Association, components: usize) -> ArrayInfo {
        ArrayInfo { name: name.into(), association, kind: SampleType::F32, components, active: false }
    }

    fn arrays() -> Vec<ArrayInfo> {
        use Association::{Cell, Point};
        vec![
            array("velocity", Point, 3),
            array("p", Cell, 1),
            array("p", Point, 1),
            array("a:x", Point, 2),
            array("a", Point, 2),
        ]
    }

    #[test]
    fn names_prefixes_and_parts() {
        let source = Source::in_memory(&[("a.vtu", b"")]).unwrap();
        let find = |wanted: &str| find(&source, &arrays(), wanted).map(|c| (c.index, c.pick));
        assert_eq!(find("p").unwrap(), (1, Pick::Component(0)));
        assert_eq!(find("point:p").unwrap(), (2, Pick::Component(0)));
        assert_eq!(find("velocity").unwrap(), (0, Pick::Magnitude));
        assert_eq!(find("velocity:z").unwrap(), (0, Pick::Component(2)));
        assert_eq!(find("point:velocity:1").unwrap(), (0, Pick::Component(1)));
        assert_eq!(find("velocity:b").unwrap(), (0, Pick::Component(2)));
        assert_eq!(find("a:x").unwrap(), (3, Pick::Magnitude), "a whole name wins");
        assert_eq!(find("a:y").unwrap(), (4, Pick::Component(1)));
        for (wanted, why) in [
            ("velocity:w", "below 3"),
            ("velocity:", "below 3"),
            ("velocity:xy", "below 3"),
            ("q", "no such array: there are point:velocity (f32 x 3), cell:p (f32)"),
            ("cell:velocity", "no such array"),
        ] {
            let text = find(wanted).unwrap_err().to_string();
            assert!(text.contains(why), "{wanted}: {text}");
        }
    }

    #[test]
    fn what_is_shown_unasked() {
        let source = Source::in_memory(&[("a.vtu", b"")]).unwrap();
        let choose = |arrays: &[ArrayInfo]| choose(&source, arrays, None).unwrap().map(|c| c.index);
        let mut arrays = arrays();
        assert_eq!(choose(&arrays), Some(2), "point data with one component");
        arrays[4].active = true;
        assert_eq!(choose(&arrays), Some(4));
        assert_eq!(choose(&arrays[..2]), Some(1), "then cell data");
        assert_eq!(choose(&arrays[..1]), Some(0), "then what there is");
        assert_eq!(choose(&[]), None);
    }

    #[test]
    fn what_is_kept() {
        let source = Source::in_memory(&[("a.vtu", b"")]).unwrap();
        let ghosts = ArrayInfo { name: "vtkGhostType".into(), kind: SampleType::U8, ..arrays()[2].clone() };
        let all = [arrays(), vec![arrays()[0].clone(), ghosts]].concat();
        let kept = |all: &[ArrayInfo], wanted, array: Option<&str>| {
            let options = ReadOptions { array: array.map(str::to_owned), ..ReadOptions::default() };
            let chosen = select(&source, all, &(4..5), &Request { options: &options, wanted })?;
            Ok::<_, crate::Error>(chosen.into_iter().map(|c| (c.index, c.pick)).collect::<Vec<_>>())
        };
        let whole = |places: &[usize]| places.iter().map(|&i| (i, Pick::Whole)).collect::<Vec<_>>();
        assert_eq!(
            kept(&all, Wanted::Arrays, None).unwrap(),
            whole(&[0, 1, 2, 3, 6]),
            "spare, and twice the same"
        );
        assert_eq!(kept(&all, Wanted::OneArray, Some("velocity")).unwrap(), whole(&[0]));
        assert_eq!(kept(&all, Wanted::Arrays, Some("a:y")).unwrap(), [(4, Pick::Component(1))]);
        assert_eq!(
            kept(&all[5..], Wanted::OneArray, None).unwrap(),
            whole(&[0]),
            "flags of ghosts do not count"
        );
        let text = kept(&all, Wanted::OneArray, None).unwrap_err().to_string();
        assert!(
            text.contains("--only NAME; there are point:velocity (f32 x 3), cell:p (f32), point:p"),
            "{text}"
        );
        assert!(kept(&[], Wanted::OneArray, None).unwrap_err().to_string().contains("there are none"));
    }
}
