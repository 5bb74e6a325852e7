//! Views: arrays at time steps, in parts.

use std::collections::{HashMap, HashSet};

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::file::budget::Budget;
use crate::io::file::decode::{MAX_COMPONENTS, Tuples, Values, magnitude};
use crate::io::file::sample_type::{Pick, SampleType};
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::{plain, shown};
use crate::io::formats::gmsh::stream::{Format, Stream, count_line};
use crate::io::formats::gmsh::tags::Tags;
use crate::num;
use crate::scene::Samples;

/// The limit on sections of views.
const MAX_VIEWS: usize = 1 << 16;

/// A view at one time step.
pub(crate) struct View {
    pub(crate) info: ArrayInfo,
    /// Whether it names an interpolation scheme.
    pub(crate) scheme: bool,
    pub(crate) parts: Vec<Part>,
}

/// A part of the tuples of a view, and its place in the file.
pub(crate) struct Part {
    partition: Option<i64>,
    count: u64,
    position: u64,
    line: u64,
}

/// The values of an array; missing ones are NaN.
pub(crate) struct Filled {
    pub(crate) values: Values,
    /// Whether each value is given.
    pub(crate) given: Vec<bool>,
    /// The number of values for unknown tags.
    pub(crate) strange: usize,
    pub(crate) again: usize,
}

impl Filled {
    pub(crate) fn missing(&self, counts: impl Fn(usize) -> bool) -> usize {
        self.given.iter().enumerate().filter(|&(i, &given)| !given && counts(i)).count()
    }
}

impl View {
    pub(crate) fn read(
        &self,
        source: &Source,
        format: Format,
        tags: &Tags,
        count: usize,
        pick: Pick,
    ) -> Result<Filled> {
        let ArrayInfo { kind, components, .. } = self.info;
        let missing = match pick {
            Pick::Whole => part_of(&vec![f64::NAN; components], kind, pick),
            _ => part_of(&[f64::NAN], kind, Pick::Component(0)),
        };
        let mut values = missing.clone();
        values.resize(count);
        (0..count).for_each(|index| values.copy(index, &missing, 0, 1));
        let mut filled = Filled { values, given: vec![false; count], strange: 0, again: 0 };
        let mut tuple = Vec::new();
        // Parts are in file order, so that a compressed file is decompressed once.
        let mut stream = Stream { scanner: Scanner::new(source), format, row: None };
        for part in &self.parts {
            stream.scanner.go_on(part.position, part.line)?;
            for _ in 0..part.count {
                stream.row("a tag and its values")?;
                let tag = stream.natural("a tag")?;
                tuple.clear();
                for _ in 0..self.info.components {
                    tuple.push(stream.real("a value")?);
                }
                stream.end_row()?;
                let Some(index) = tags.get(tag).map(num::index).filter(|&index| index < count) else {
                    filled.strange += 1;
                    continue;
                };
                filled.values.copy(index, &part_of(&tuple, kind, pick), 0, 1);
                filled.again += usize::from(std::mem::replace(&mut filled.given[index], true));
            }
            let next = stream.scanner.full_line()?.unwrap_or_default();
            if !next.starts_with("$End") {
                let rule = format!("\"{}\": {} tuples are announced", shown(&next), part.count);
                return Err(stream.scanner.line_error(rule));
            }
        }
        Ok(filled)
    }
}

/// Returns the picked part of one tuple.
fn part_of(tuple: &[f64], kind: SampleType, pick: Pick) -> Values {
    let value = match pick {
        Pick::Component(component) => tuple.get(component).copied().unwrap_or(f64::NAN),
        Pick::Magnitude => magnitude(tuple),
        Pick::Whole => {
            let mut whole = Tuples::none(kind, tuple.len());
            whole.push(kind, tuple);
            return Values::Whole(whole);
        }
    };
    Samples::F32(vec![num::f32_of(value)]).into()
}

/// The views met so far, by association (true for cells) and name.
pub(crate) struct Views<'a> {
    budget: Budget<'a>,
    sections: usize,
    names: HashSet<(bool, String)>,
    /// Views by association, name and step.
    steps: HashMap<(bool, String, i64), Steps>,
}

/// Views of the same association, name and step.
#[derive(Default)]
struct Steps {
    count: usize,
    /// The index of the last one.
    last: usize,
    partitions: HashSet<i64>,
}

/// The header of a section of data.
struct Header {
    name: String,
    scheme: bool,
    step: i64,
    components: usize,
    count: u64,
    partition: Option<i64>,
}

impl<'a> Views<'a> {
    pub(crate) fn new(budget: Budget<'a>) -> Self {
        Self { budget, sections: 0, names: HashSet::new(), steps: HashMap::new() }
    }

    fn header(&mut self, stream: &mut Stream) -> Result<Header> {
        /// The limit on the length of a name, in bytes.
        const MAX_NAME: usize = 256;
        /// The memory of a section in lists and maps, which grow by doubling, in bytes.
        const BYTES: usize =
            2 * (size_of::<View>() + size_of::<Part>() + 2 * size_of::<(bool, String, i64, Steps)>() + 64);
        self.sections += 1;
        if self.sections > MAX_VIEWS {
            return Err(stream.scanner.line_error(format!("more than {MAX_VIEWS} sections of data")));
        }
        self.budget.take("views", num::wide(BYTES))?;
        let strings = count_line(stream, "the number of string tags")?;
        let mut name = String::new();
        let mut scheme = false;
        for i in 0..strings {
            let Some(line) = stream.scanner.next_line()? else {
                return Err(stream.error("ends before a string tag"));
            };
            let line = line.trim();
            let bare = line.strip_prefix('"').and_then(|line| line.strip_suffix('"')).unwrap_or(line);
            match i {
                0 if bare.len() > MAX_NAME => {
                    let rule = format!("a name longer than {MAX_NAME} bytes");
                    return Err(stream.scanner.line_error(rule));
                }
                0 => name = plain(bare),
                1 => scheme = !bare.is_empty(),
                _ => {}
            }
        }
        let reals: u64 = stream.scanner.number("the number of real tags")?;
        for _ in 0..reals {
            stream.scanner.number::<f64>("a real tag")?;
        }
        let whole: u64 = stream.scanner.number("the number of integer tags")?;
        let mut tags = [None; 4];
        for i in 0..whole {
            let tag: i64 = stream.scanner.number("an integer tag")?;
            if let Some(place) = usize::try_from(i).ok().and_then(|i| tags.get_mut(i)) {
                *place = Some(tag);
            }
        }
        let [Some(step), Some(components), Some(count), partition] = tags else {
            let rule = format!("{whole} integer tags: step, components and number of tuples are needed");
            return Err(stream.scanner.error(rule));
        };
        let size = usize::try_from(components).ok().filter(|size| (1..=MAX_COMPONENTS).contains(size));
        let Some(size) = size else {
            let rule = format!("{components} components: must be from 1 to {MAX_COMPONENTS}");
            return Err(stream.scanner.error(rule));
        };
        let Ok(count) = u64::try_from(count) else {
            return Err(stream.scanner.error(format!("{count} tuples: must not be negative")));
        };
        stream.scanner.end_line()?;
        // The name is stored four times: in the view, in its array, and in two maps.
        self.budget.take("views", num::wide(name.len()).saturating_mul(4))?;
        Ok(Header { name, scheme, step, components: size, count, partition })
    }

    /// Records where the tuples of a view are, and skips them if they are binary.
    pub(crate) fn read(
        &mut self,
        stream: &mut Stream,
        association: Association,
        views: &mut Vec<View>,
    ) -> Result<()> {
        let Header { name, scheme, step, components, count, partition } = self.header(stream)?;
        let Format { binary, real, .. } = stream.format;
        let numbers = num::wide(components);
        // A number takes a digit and a blank; the last needs no blank.
        let least = match binary {
            None => numbers.saturating_mul(2).saturating_add(2),
            Some(_) => numbers.saturating_mul(real.bytes()).saturating_add(4),
        };
        stream.holds(count, least, "tuples")?;
        let part =
            Part { partition, count, position: stream.scanner.position(), line: stream.scanner.lines() };
        if binary.is_some() {
            stream.scanner.skip(count.saturating_mul(least))?;
        }
        let cell = association == Association::Cell;
        let next = views.len();
        let first = self.names.insert((cell, name.clone()));
        let steps = self.steps.entry((cell, name.clone(), step)).or_default();
        if let Some(partition) = part.partition
            && let Some(view) = views.get_mut(steps.last)
            && view.info.components == components
            && !steps.partitions.is_empty()
            && steps.partitions.insert(partition)
        {
            view.parts.push(part);
            return Ok(());
        }
        steps.count += 1;
        steps.last = next;
        steps.partitions = part.partition.into_iter().collect();
        let name = match (first, steps.count) {
            (true, _) => name,
            (false, 1) => format!("{name}@{step}"),
            (false, several) => format!("{name}@{step}#{several}"),
        };
        let info = ArrayInfo { name, association, kind: real, components, active: false };
        views.push(View { info, scheme, parts: vec![part] });
        Ok(())
    }

    /// Skips element-node data if they are binary, and returns their name.
    pub(crate) fn pass(&mut self, stream: &mut Stream) -> Result<String> {
        let Header { name, components, count, .. } = self.header(stream)?;
        if stream.format.binary.is_some() {
            let tuple = num::wide(components).saturating_mul(stream.format.real.bytes());
            for _ in 0..count {
                stream.natural("an element's number")?;
                let nodes = stream.natural("a number of nodes")?;
                stream.scanner.skip(nodes.saturating_mul(tuple))?;
            }
        }
        Ok(name)
    }
}
