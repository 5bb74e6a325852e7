//! Groups columns of numbers into arrays: table formats store vectors and tensors as several named columns.
//!
//! Each column is an array by itself. Columns whose names differ only in their last part also form one array, named
//! by the part before. The last part follows `_`, `:` or `.`, or a single letter:
//!
//! | parts | an array of |
//! |---|---|
//! | `x y z` | 3 |
//! | `0 1 2 ...`, without a gap | as many |
//! | `xx xy xz yy yz zz`, or with `yx zx zy` for those | 6 |
//! | all nine | 9, row by row |
//! | `nx ny nz` | 3, named `normal` |
//! | `red green blue`, and `alpha` | 3 or 4, named `colour` |
//!
//! Parts are case-insensitive, and a unit in brackets at the end of a name is ignored. Columns form no group if its
//! name is that of a column.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::file::decode::{MAX_COMPONENTS, Tuples, Values, magnitude};
use crate::io::file::sample_type::{Pick, SampleType};
use crate::num;
use crate::scene::Samples;

/// A column of numbers.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) kind: SampleType,
}

/// An array, and the indices of its columns.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub(crate) info: ArrayInfo,
    pub(crate) columns: Vec<usize>,
}

impl Group {
    /// Returns the columns needed to read this part of each tuple.
    pub(crate) fn needed(&self, pick: Pick) -> &[usize] {
        match pick {
            Pick::Component(component) => self.columns.get(component..=component).unwrap_or(&[]),
            Pick::Magnitude | Pick::Whole => &self.columns,
        }
    }
}

/// Collects the picked part of each of `count` tuples. `each` passes on the numbers of the needed columns.
pub(crate) fn collect(
    info: &ArrayInfo,
    pick: Pick,
    count: usize,
    each: impl FnOnce(&mut dyn FnMut(&[f64])) -> Result<()>,
) -> Result<Values> {
    if pick == Pick::Whole {
        let mut tuples = Tuples::none(info.kind, info.components);
        tuples.bytes.reserve_exact(count.saturating_mul(tuples.size));
        each(&mut |numbers| tuples.push(info.kind, numbers))?;
        return Ok(Values::Whole(tuples));
    }
    let mut values = Vec::with_capacity(count);
    each(&mut |numbers| values.push(num::f32_of(value(numbers, pick))))?;
    Ok(Samples::F32(values).into())
}

/// Returns the single columns that are also part of a group.
pub(crate) fn spare(groups: &[Group]) -> Range<usize> {
    let single = groups.iter().take_while(|group| group.columns.len() == 1).count();
    let is_part = |column: usize| groups[single..].iter().any(|group| group.columns.contains(&column));
    let first = groups[..single].iter().position(|group| is_part(group.columns[0]));
    first.unwrap_or(single)..single
}

/// Computes the part of a tuple from the numbers of the needed columns.
fn value(numbers: &[f64], pick: Pick) -> f64 {
    match pick {
        Pick::Component(_) => numbers.first().copied().unwrap_or(f64::NAN),
        Pick::Magnitude | Pick::Whole => magnitude(numbers),
    }
}

/// The kind of the last part of a column's name, which is a number of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Part {
    Axis,
    Number,
    /// Three times the row, plus the column.
    Pair,
}

/// Strips a unit in brackets from the end of a name.
pub(crate) fn bare(name: &str) -> &str {
    let name = name.trim();
    let open = match name.chars().last() {
        Some(')') => name.rfind('('),
        Some(']') => name.rfind('['),
        _ => None,
    };
    // A name that consists of the bracket alone stays.
    open.map(|open| name[..open].trim_end()).filter(|rest| !rest.is_empty()).unwrap_or(name)
}

fn axis(letter: u8) -> Option<usize> {
    b"xyz".iter().position(|&axis| axis == letter.to_ascii_lowercase())
}

fn letters(part: &str) -> Option<(Part, usize)> {
    match *part.as_bytes() {
        [a] => Some((Part::Axis, axis(a)?)),
        [a, b] => Some((Part::Pair, 3 * axis(a)? + axis(b)?)),
        _ => None,
    }
}

/// Splits the name of a column into the name of its group and its part.
fn split(name: &str) -> Option<(&str, (Part, usize))> {
    let name = bare(name);
    let colours = ["red", "green", "blue", "alpha"];
    if let Some(place) = colours.iter().position(|colour| *colour == name) {
        return Some(("colour", (Part::Number, place)));
    }
    let normals = ["nx", "ny", "nz"];
    if let Some(place) = normals.iter().position(|normal| *normal == name) {
        return Some(("normal", (Part::Axis, place)));
    }
    if let Some((stem, part)) = name.rsplit_once(['_', ':', '.']).filter(|(stem, _)| !stem.is_empty()) {
        let plain = part == "0" || part.starts_with(|c: char| c.is_ascii_digit() && c != '0');
        let number = part.parse().ok().filter(|_| plain).map(|number| (Part::Number, number));
        return Some((stem, number.or_else(|| letters(part))?));
    }
    let (stem, part) = name.split_at_checked(1)?;
    let letter = stem.as_bytes().first().is_some_and(u8::is_ascii_alphabetic);
    Some((stem, letters(part).filter(|_| letter)?))
}

/// Returns the columns of a group in the order of the parts, if it is complete.
fn complete(kind: Part, parts: &BTreeMap<usize, usize>) -> Option<Vec<usize>> {
    let all = |count: usize| (0..count).map(|number| parts.get(&number).copied()).collect::<Option<Vec<_>>>();
    match kind {
        Part::Axis => all(3),
        Part::Number => all(parts.len()).filter(|all| (2..=MAX_COMPONENTS).contains(&all.len())),
        Part::Pair => all(9).or_else(|| {
            let pairs = [(0, 0), (1, 3), (2, 6), (4, 4), (5, 7), (8, 8)];
            pairs.iter().map(|(a, b)| parts.get(a).or_else(|| parts.get(b)).copied()).collect()
        }),
    }
}

/// Returns the arrays of columns: single columns, members of groups, then groups.
pub(crate) fn groups(columns: &[Column]) -> Vec<Group> {
    let names: HashSet<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    // Groups are keyed by name and by the kind of part, and ordered by their first columns.
    let mut order = Vec::new();
    let mut found: HashMap<(&str, Part), BTreeMap<usize, usize>> = HashMap::new();
    for (i, column) in columns.iter().enumerate() {
        if let Some((stem, (kind, part))) = split(&column.name).filter(|(stem, _)| !names.contains(stem)) {
            let parts = found.entry((stem, kind)).or_insert_with(|| {
                order.push((stem, kind));
                BTreeMap::new()
            });
            parts.entry(part).or_insert(i);
        }
    }
    let point = |name: &str, columns: Vec<usize>, kind: SampleType| Group {
        info: ArrayInfo {
            name: name.to_owned(),
            association: Association::Point,
            kind,
            components: columns.len(),
            active: false,
        },
        columns,
    };
    let mut taken = HashSet::new();
    let mut grouped = HashSet::new();
    let mut groups = Vec::new();
    for key in order {
        if let Some(places) = found.get(&key).and_then(|parts| complete(key.1, parts))
            && taken.insert(key.0)
        {
            grouped.extend(places.iter().copied());
            let kinds: Vec<SampleType> = places.iter().map(|&place| columns[place].kind).collect();
            let same = kinds.iter().all(|kind| *kind == kinds[0]);
            groups.push(point(key.0, places, if same { kinds[0] } else { SampleType::F64 }));
        }
    }
    let mut arrays: Vec<Group> =
        columns.iter().enumerate().map(|(i, column)| point(&column.name, vec![i], column.kind)).collect();
    // The sort is stable: columns keep their order in the file.
    arrays.sort_by_key(|array| grouped.contains(&array.columns[0]));
    arrays.extend(groups);
    arrays
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(names: &[&str]) -> Vec<String> {
        let columns: Vec<Column> =
            names.iter().map(|name| Column { name: (*name).into(), kind: SampleType::F32 }).collect();
        let name = |group: &Group| (group.info.name.clone(), group.columns.clone());
        groups(&columns).iter().map(name).map(|(name, columns)| format!("{name}{columns:?}")).collect()
    }

    #[test]
    fn columns_that_differ_in_their_last_part_are_one_array() {
        assert_eq!(shown(&["vz", "T", "vx", "vy"]), ["T[1]", "vz[0]", "vx[2]", "vy[3]", "v[2, 3, 0]"]);
        assert_eq!(shown(&["u_x", "u_Y (m/s)", "u_z"])[3..], ["u[0, 1, 2]"]);
        assert_eq!(shown(&["U:1", "U:0"])[2..], ["U[1, 0]"]);
        assert_eq!(
            shown(&["red", "green", "blue", "alpha", "nx", "ny", "nz"])[7..],
            ["colour[0, 1, 2, 3]", "normal[4, 5, 6]"]
        );
        let half = ["c_xx", "c_xy", "c_xz", "c_yy", "c_zy", "c_zz"];
        assert_eq!(shown(&half)[6..], ["c[0, 1, 2, 3, 4, 5]"]);
        let all = ["c.xx", "c.yx", "c.zx", "c.xy", "c.yy", "c.zy", "c.xz", "c.yz", "c.zz"];
        assert_eq!(shown(&all)[9..], ["c[0, 3, 6, 1, 4, 7, 2, 5, 8]"]);
        assert_eq!(shown(&["sxx", "sxy", "sxz", "syy", "syz", "szz"])[6..], ["s[0, 1, 2, 3, 4, 5]"]);
    }

    #[test]
    fn what_is_no_whole_group_stays_single() {
        for names in [
            &["u_x", "u_y"][..],
            &["U:0", "U:2"],
            &["U:0"],
            &["U:00", "U:1"],
            &["_0", "_1"],
            &["x", "y", "z"],
            &["abx", "aby", "abz"],
            &["u_x", "u_y", "u_z", "u"],
            &["\u{e9}x", "\u{e9}y", "\u{e9}z"],
            &["", "(m)", "a_"],
        ] {
            assert_eq!(shown(names).len(), names.len(), "{names:?}");
        }
        assert_eq!((bare(" X (m) "), bare("T [K]"), bare("(m)"), bare("a)")), ("X", "T", "(m)", "a)"));
    }
}
