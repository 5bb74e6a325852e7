//! Gmsh MSH 2 and 4.1 (`.msh`), in words or binary of either byte order.
//!
//! Elements of orders 1 and 2 become cells of VTK, their nodes reordered. What VTK has no node for is left
//! out: the middles of the faces of prisms of 18 nodes and of pyramids of 14. Node and element numbers may
//! be sparse and in any order.
//!
//! Views are arrays: `$NodeData` belongs to points, `$ElementData` to cells. What has no value is NaN. The
//! first step of a view has the view's name, others have `name@step`; a second view of the same name and
//! step has `#2` behind that. Pieces of one view, told apart by their partition, are one array.
//! `$ElementNodeData` is left out. Where solid elements belong to physical groups, their numbers are the
//! cell array `gmsh:physical`, 0 for none; an element of several groups has the first.
//!
//! Sections for nothing of this (`$Periodic`, `$InterpolationScheme`, unknown ones) are passed over.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::io::{ErrorKind, Read};
use std::str::FromStr;

use glam::DVec3;

use super::arrays::{ArrayInfo, Association, Pick};
use super::dataset::{Dataset, Origin};
use super::samples::{Endian, MAX_COMPONENTS, SampleType};
use super::source::{Budget, Source};
use super::text::{self, Scanner, plain, shown};
use super::{Loaded, ReadOptions, Reader};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::{CellKind, Samples};

pub(super) struct Gmsh;

/// The array of physical groups.
const PHYSICAL: &str = "gmsh:physical";

/// Most sections of views.
const MAX_VIEWS: usize = 1 << 16;

/// Most names of physical groups, and of sections passed over, that are told.
const MAX_TOLD: usize = 16;

impl Reader for Gmsh {
    fn name(&self) -> &'static str {
        "Gmsh MSH"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["msh", "msh.gz"]
    }

    fn recognises(&self, source: &Source) -> bool {
        let head = source.head().trim_ascii_start();
        // Comments may come first.
        head.starts_with(b"$MeshFormat")
            || head.starts_with(b"$Comments") && head.windows(11).any(|bytes| bytes == b"$MeshFormat")
    }

    fn read(&self, source: &Source, options: &ReadOptions) -> Result<Loaded> {
        let mut budget = Budget::new(source, options);
        let file = File::read(source, &mut budget)?;
        let File { format, points, nodes, cells, views, left_out, names, notes, .. } = file;
        if let Some(wanted) = &options.array {
            refuse_left_out(source, wanted, &views, &left_out)?;
        }
        let Cells { mesh, elements, physical, .. } = cells;
        let solid = |cell: usize| CellKind::of_vtk(mesh.types[cell]).is_some();
        let solids = (0..mesh.types.len()).filter(|&cell| solid(cell)).count();
        let groups = (0..physical.len()).any(|cell| physical[cell] != 0 && solid(cell));
        let of_cells = views.iter().any(|view| view.association == Association::Cell);
        let elements = if of_cells { Tags::new(source, "element", elements)? } else { Tags::none() };
        let solid: Vec<bool> = if of_cells {
            budget.take("elements", length(mesh.types.len()))?;
            (0..mesh.types.len()).map(solid).collect()
        } else {
            Vec::new()
        };

        let mut arrays: Vec<ArrayInfo> = views.iter().map(|view| view.info(format.real)).collect();
        if groups {
            arrays.push(ArrayInfo {
                name: PHYSICAL.to_owned(),
                association: Association::Cell,
                kind: SampleType::I32,
                components: 1,
                active: false,
            });
        }
        let counts = (points.len(), mesh.types.len());
        // Which values are given.
        let most = if of_cells { counts.0.max(counts.1) } else { counts.0 };
        budget.take("arrays", length(most))?;
        let mut warnings = BTreeSet::new();
        let mut read = |index: usize, pick: Pick| -> Result<Samples> {
            let Some(view) = views.get(index) else {
                return Ok(Samples::F32(
                    physical.iter().map(|&group| num::f32_of(f64::from(group))).collect(),
                ));
            };
            let (tags, count) = match view.association {
                Association::Point => (&nodes, counts.0),
                Association::Cell => (&elements, counts.1),
            };
            let filled = view.read(source, format, tags, count, pick)?;
            let (what, missing, all) = match view.association {
                Association::Point => ("nodes", filled.missing(|_| true), count),
                Association::Cell => ("solid elements", filled.missing(|cell| solid[cell]), solids),
            };
            let name = &view.name;
            if missing > 0 {
                warnings.insert(format!("{name}: {missing} of {all} {what} have no value: they are NaN"));
            }
            if filled.strange > 0 {
                warnings.insert(format!("{name}: {} values belong to nothing in this file", filled.strange));
            }
            if filled.again > 0 {
                warnings.insert(format!("{name}: {} values are given again: the last counts", filled.again));
            }
            if view.scheme {
                warnings.insert(format!(
                    "{name}: has an interpolation scheme: between nodes it is shown linear all the same"
                ));
            }
            Ok(Samples::F32(filled.values))
        };
        let dataset = Dataset { points, ..mesh };
        let origin = Origin { source, format: self.name(), arrays };
        let mut loaded = dataset.build(origin, &mut budget, &mut read, options)?;
        let report = &mut loaded.report;
        report.notes.splice(0..0, notes);
        if groups {
            report.notes.extend(names.into_iter().map(|name| format!("{PHYSICAL}: {name}")));
        }
        report.warnings.extend(warnings);
        Ok(loaded)
    }
}

/// An array of element-node data that is asked for is refused by its name.
fn refuse_left_out(source: &Source, wanted: &str, views: &[View], left_out: &BTreeSet<String>) -> Result<()> {
    let bare = wanted.strip_prefix("point:").or_else(|| wanted.strip_prefix("cell:")).unwrap_or(wanted);
    let names = [Some(wanted), Some(bare), bare.rsplit_once(':').map(|(name, _)| name)];
    for name in names.into_iter().flatten() {
        if views.iter().any(|view| view.name == name) || name == PHYSICAL {
            return Ok(());
        }
        if left_out.contains(name) {
            return Err(source.error(
                format!("array \"{name}\""),
                "is $ElementNodeData: values of nodes that differ between elements are not supported",
            ));
        }
    }
    Ok(())
}

fn length(count: usize) -> u64 {
    u64::try_from(count).unwrap_or(u64::MAX)
}

/// An element type.
struct Kind {
    nodes: usize,
    /// Its number in VTK.
    vtk: u8,
    /// For each node in VTK, its place here.
    order: &'static [usize],
}

const LINEAR: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 7, 8];
/// The last two edges are exchanged.
const TETRAHEDRON: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];
/// Edges by their first corner here, round the bottom, round the top and upright in VTK; then faces.
const HEXAHEDRON: [usize; 27] =
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26];
const PRISM: [usize; 15] = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11];
const PYRAMID: [usize; 13] = [0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12];

/// The element type of a number.
fn kind_of(number: i64) -> Option<Kind> {
    let (nodes, vtk, order): (usize, u8, &'static [usize]) = match number {
        1 => (2, 3, &LINEAR[..2]),
        2 => (3, 5, &LINEAR[..3]),
        3 => (4, 9, &LINEAR[..4]),
        4 => (4, 10, &LINEAR[..4]),
        5 => (8, 12, &LINEAR[..8]),
        6 => (6, 13, &LINEAR[..6]),
        7 => (5, 14, &LINEAR[..5]),
        8 => (3, 21, &LINEAR[..3]),
        9 => (6, 22, &LINEAR[..6]),
        10 => (9, 28, &LINEAR[..9]),
        11 => (10, 24, &TETRAHEDRON),
        12 => (27, 29, &HEXAHEDRON),
        13 => (18, 26, &PRISM),
        14 => (14, 27, &PYRAMID),
        15 => (1, 1, &LINEAR[..1]),
        16 => (8, 23, &LINEAR[..8]),
        17 => (20, 25, &HEXAHEDRON[..20]),
        18 => (15, 26, &PRISM),
        19 => (13, 27, &PYRAMID),
        _ => return None,
    };
    Some(Kind { nodes, vtk, order })
}

/// What elements of other numbers are.
fn family(number: i64) -> &'static str {
    match number {
        20..=25 | 42..=46 | 52..=56 => "triangles of a higher order",
        26..=28 | 62..=66 => "lines of a higher order",
        29..=33 | 71..=75 | 79..=83 | 137 => "tetrahedra of a higher order",
        34 => "polygons",
        35 => "polyhedra",
        36..=41 | 47..=51 | 57..=61 => "quadrilaterals of a higher order",
        90 | 91 | 106..=117 => "prisms of a higher order",
        92..=105 => "hexahedra of a higher order",
        118..=131 => "pyramids of a higher order",
        _ => "unknown",
    }
}

/// How a file has its numbers.
#[derive(Clone, Copy)]
struct Format {
    /// 2 or 4.
    version: u8,
    /// The byte order of a binary file; None: numbers are words.
    binary: Option<Endian>,
    /// Of counts and tags in version 4.
    wide: SampleType,
    real: SampleType,
}

/// Numbers, of lines in a file of words.
struct Stream<'a> {
    scanner: Scanner<'a>,
    format: Format,
    /// The line that words come from, and how much of it is behind. None: from any line.
    row: Option<(String, usize)>,
}

impl Stream<'_> {
    fn error(&self, rule: impl Into<String>) -> Error {
        if self.format.binary.is_some() {
            self.scanner.source().error(format!("byte {}", self.scanner.position()), rule)
        } else if self.row.is_some() {
            self.scanner.line_error(rule)
        } else {
            self.scanner.error(rule)
        }
    }

    /// Begins a line, in a file of words.
    fn row(&mut self, what: &str) -> Result<()> {
        if self.format.binary.is_none() {
            let Some(line) = self.scanner.full_line()? else {
                return Err(self.error(format!("ends before {what}")));
            };
            self.row = Some((line, 0));
        }
        Ok(())
    }

    /// Ends it.
    fn end_row(&mut self) -> Result<()> {
        if let Some((line, at)) = &self.row {
            let rest = line[*at..].trim();
            if !rest.is_empty() {
                return Err(self.error(format!("\"{}\": must not follow here", shown(rest))));
            }
        }
        self.row = None;
        Ok(())
    }

    fn word<T: FromStr>(&mut self, what: &str) -> Result<T> {
        let Some((line, at)) = &mut self.row else { return self.scanner.number(what) };
        let rest = line[*at..].trim_start();
        let word = rest.split_ascii_whitespace().next().unwrap_or("");
        *at = line.len() - rest.len() + word.len();
        let rule = match word.parse() {
            Ok(number) => return Ok(number),
            Err(_) if word.is_empty() => format!("ends before {what}"),
            Err(_) => format!("\"{}\": must be {what}", shown(word)),
        };
        Err(self.error(rule))
    }

    fn bytes<const N: usize>(&mut self, what: &str) -> Result<([u8; N], bool)> {
        let mut bytes = [0; N];
        match self.scanner.read_exact(&mut bytes) {
            Ok(()) => Ok((bytes, self.format.binary == Some(Endian::Little))),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Err(self.error(format!("ends before {what}")))
            }
            Err(error) => Err(text::stream_error(self.scanner.source(), error)),
        }
    }

    /// An `int`.
    fn int(&mut self, what: &str) -> Result<i64> {
        if self.format.binary.is_none() {
            return self.word(what);
        }
        let (bytes, little) = self.bytes(what)?;
        Ok(if little { i32::from_le_bytes(bytes) } else { i32::from_be_bytes(bytes) }.into())
    }

    /// An `int` that is a number of something.
    fn natural(&mut self, what: &str) -> Result<u64> {
        if self.format.binary.is_none() {
            return self.word(what);
        }
        let number = self.int(what)?;
        u64::try_from(number).map_err(|_| self.error(format!("{number}: must be {what}, not negative")))
    }

    /// A `size_t`.
    fn wide(&mut self, what: &str) -> Result<u64> {
        if self.format.binary.is_none() {
            return self.word(what);
        }
        if self.format.wide == SampleType::U32 {
            let (bytes, little) = self.bytes(what)?;
            return Ok(if little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) }.into());
        }
        let (bytes, little) = self.bytes(what)?;
        Ok(if little { u64::from_le_bytes(bytes) } else { u64::from_be_bytes(bytes) })
    }

    fn real(&mut self, what: &str) -> Result<f64> {
        if self.format.binary.is_none() {
            return self.word(what);
        }
        if self.format.real == SampleType::F32 {
            let (bytes, little) = self.bytes(what)?;
            return Ok(if little { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }.into());
        }
        let (bytes, little) = self.bytes(what)?;
        Ok(if little { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) })
    }

    /// Whether so many things of at least so many bytes can follow, before memory is taken for them.
    fn holds(&self, count: u64, least: u64, what: &str) -> Result<()> {
        let available = self.scanner.available();
        if count.checked_mul(least).is_some_and(|bytes| bytes <= available) {
            return Ok(());
        }
        Err(self.error(format!("{count} {what}: the {available} bytes that follow cannot hold them")))
    }
}

/// From tags to indices.
#[derive(Debug)]
enum Tags {
    /// So many, one after the other from the first.
    Consecutive { first: u64, count: u64 },
    /// The index of each from the first; `u32::MAX` where there is none.
    Dense { first: u64, indices: Vec<u32> },
    /// By tag.
    Sorted(Vec<(u64, u32)>),
}

impl Tags {
    /// Bytes that one takes at most while it is made, with its pair.
    const BYTES: u64 = 24;

    fn none() -> Self {
        Self::Consecutive { first: 0, count: 0 }
    }

    fn new(source: &Source, what: &str, mut pairs: Vec<(u64, u32)>) -> Result<Self> {
        let Some(&(first, _)) = pairs.first() else { return Ok(Self::none()) };
        if pairs.iter().all(|&(tag, index)| tag.checked_sub(first) == Some(index.into())) {
            return Ok(Self::Consecutive { first, count: length(pairs.len()) });
        }
        let (first, last) =
            pairs.iter().fold((first, first), |(lo, hi), &(tag, _)| (lo.min(tag), hi.max(tag)));
        let twice = |tag: u64| source.error(format!("{what} {tag}"), "there are two of this number");
        let span = usize::try_from(last - first).unwrap_or(usize::MAX);
        // No more memory than the pairs take.
        if span < pairs.len().saturating_mul(2) {
            let mut indices = vec![u32::MAX; span + 1];
            for &(tag, index) in &pairs {
                let place = &mut indices[usize::try_from(tag - first).unwrap_or(span)];
                if *place != u32::MAX {
                    return Err(twice(tag));
                }
                *place = index;
            }
            return Ok(Self::Dense { first, indices });
        }
        pairs.sort_unstable();
        if let Some(pair) = pairs.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(twice(pair[0].0));
        }
        Ok(Self::Sorted(pairs))
    }

    fn get(&self, tag: u64) -> Option<u32> {
        match self {
            Self::Consecutive { first, count } => {
                let index = tag.checked_sub(*first).filter(|index| index < count)?;
                u32::try_from(index).ok()
            }
            Self::Dense { first, indices } => {
                let index = usize::try_from(tag.checked_sub(*first)?).ok()?;
                indices.get(index).copied().filter(|&index| index != u32::MAX)
            }
            Self::Sorted(pairs) => {
                let place = pairs.binary_search_by_key(&tag, |&(tag, _)| tag).ok()?;
                Some(pairs[place].1)
            }
        }
    }
}

/// Elements.
#[derive(Default)]
struct Cells {
    /// Without points.
    mesh: Dataset,
    /// Each element's number and its cell.
    elements: Vec<(u64, u32)>,
    /// Each cell's physical group; 0 for none.
    physical: Vec<i32>,
    /// Elements that are listed once more for each further physical group.
    repeated: usize,
    /// Prisms and pyramids with more nodes than VTK has.
    reduced: usize,
}

impl Cells {
    fn add(&mut self, stream: &Stream, kind: &Kind, element: u64, own: &[u32], physical: i32) -> Result<()> {
        let Dataset { types, ends, nodes, .. } = &mut self.mesh;
        let begin = nodes.len();
        nodes.extend(kind.order.iter().map(|&place| own[place]));
        let previous = begin.saturating_sub(kind.order.len());
        if types.last() == Some(&kind.vtk) && nodes[previous..begin] == nodes[begin..] {
            nodes.truncate(begin);
            self.repeated += 1;
        } else {
            let end = u32::try_from(nodes.len()).ok();
            ends.push(end.ok_or_else(|| stream.error("more nodes of elements than 32 bits can count"))?);
            types.push(kind.vtk);
            self.physical.push(physical);
            self.reduced += usize::from(kind.nodes > kind.order.len());
        }
        self.elements.push((element, num::count(types.len() - 1)));
        Ok(())
    }
}

/// One view at one step.
struct View {
    name: String,
    association: Association,
    components: usize,
    /// Whether it names an interpolation scheme.
    scheme: bool,
    parts: Vec<Part>,
}

/// Where the tuples of a view lie.
struct Part {
    partition: Option<i64>,
    count: u64,
    position: u64,
    line: u64,
}

/// Values of an array, NaN where there is none.
struct Filled {
    values: Vec<f32>,
    /// Which of them were given.
    given: Vec<bool>,
    /// Given for tags that nothing has.
    strange: usize,
    again: usize,
}

impl Filled {
    fn missing(&self, counts: impl Fn(usize) -> bool) -> usize {
        self.given.iter().enumerate().filter(|&(i, &given)| !given && counts(i)).count()
    }
}

impl View {
    fn info(&self, kind: SampleType) -> ArrayInfo {
        ArrayInfo {
            name: self.name.clone(),
            association: self.association,
            kind,
            components: self.components,
            active: false,
        }
    }

    fn read(&self, source: &Source, format: Format, tags: &Tags, count: usize, pick: Pick) -> Result<Filled> {
        let mut filled =
            Filled { values: vec![f32::NAN; count], given: vec![false; count], strange: 0, again: 0 };
        let mut tuple = Vec::new();
        for part in &self.parts {
            let scanner = Scanner::resume(source, part.position, part.line)?;
            let mut stream = Stream { scanner, format, row: None };
            for _ in 0..part.count {
                stream.row("a tag and its values")?;
                let tag = stream.natural("a tag")?;
                tuple.clear();
                for _ in 0..self.components {
                    tuple.push(stream.real("a value")?);
                }
                stream.end_row()?;
                let Some(index) = tags.get(tag).map(num::index).filter(|&index| index < count) else {
                    filled.strange += 1;
                    continue;
                };
                let value = match pick {
                    Pick::Component(component) => tuple.get(component).copied().unwrap_or(f64::NAN),
                    Pick::Magnitude => tuple.iter().map(|x| x * x).sum::<f64>().sqrt(),
                };
                filled.values[index] = num::f32_of(value);
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

/// What is read of a file at once: all but the values of views.
struct File {
    format: Format,
    points: Vec<DVec3>,
    nodes: Tags,
    cells: Cells,
    views: Vec<View>,
    /// Names of views of element-node data.
    left_out: BTreeSet<String>,
    /// Physical groups of volumes: number and name.
    names: Vec<String>,
    notes: Vec<String>,
    /// First group of each entity that has one, by dimension and tag.
    groups: HashMap<(i64, i64), i32>,
}

impl File {
    fn read(source: &Source, budget: &mut Budget) -> Result<Self> {
        let format = Format { version: 0, binary: None, wide: SampleType::U64, real: SampleType::F64 };
        let mut stream = Stream { scanner: Scanner::new(source), format, row: None };
        let mut file = Self {
            format,
            points: Vec::new(),
            nodes: Tags::none(),
            cells: Cells::default(),
            views: Vec::new(),
            left_out: BTreeSet::new(),
            names: Vec::new(),
            notes: Vec::new(),
            groups: HashMap::new(),
        };
        let mut seen = BTreeSet::new();
        let mut passed = BTreeSet::new();
        let mut views = Views::default();
        while let Some(line) = stream.scanner.full_line()? {
            let name = line.strip_prefix('$').filter(|name| !name.starts_with("End"));
            let Some(name) = name else {
                let rule = format!("\"{}\": must begin a section, such as $Nodes", shown(&line));
                return Err(stream.scanner.line_error(rule));
            };
            let once =
                ["MeshFormat", "Nodes", "ParametricNodes", "Elements", "Entities", "PartitionedEntities"]
                    .contains(&name);
            // Both are the nodes.
            let key = if name == "ParametricNodes" { "Nodes" } else { name };
            if once && !seen.insert(key.to_owned()) {
                return Err(stream.scanner.line_error(format!("${name}: a second one")));
            }
            let needs = |section: &str, why: &str| match seen.contains(section) {
                true => Ok(()),
                false => Err(stream.scanner.line_error(format!("${name}: {why}"))),
            };
            let known = once || ["NodeData", "ElementData", "ElementNodeData"].contains(&name);
            if known {
                needs("MeshFormat", "$MeshFormat must come first")?;
            }
            match name {
                "NOD" => {
                    let rule = "$NOD: is of version 1: 2.0 to 2.2 and 4.1 are supported";
                    return Err(stream.scanner.line_error(rule));
                }
                "MeshFormat" => file.format = read_format(&mut stream)?,
                "Nodes" | "ParametricNodes" => {
                    file.read_nodes(&mut stream, name == "ParametricNodes", budget)?
                }
                "Elements" => {
                    needs("Nodes", "$Nodes must come before")?;
                    file.read_elements(&mut stream, budget)?;
                }
                "Entities" | "PartitionedEntities" if file.format.version == 4 => {
                    file.read_entities(&mut stream, name == "PartitionedEntities", budget)?;
                }
                // These go on to the section's end.
                "NodeData" => {
                    views.read(&mut stream, Association::Point, &mut file.views)?;
                    continue;
                }
                "ElementData" => {
                    views.read(&mut stream, Association::Cell, &mut file.views)?;
                    continue;
                }
                "ElementNodeData" => {
                    views.pass(&mut stream, &mut file.left_out)?;
                    continue;
                }
                "PhysicalNames" => {
                    file.names = read_names(&mut stream)?;
                    continue;
                }
                _ => {
                    let quiet = ["Comments", "Periodic", "InterpolationScheme"].contains(&name);
                    if !quiet && passed.len() < MAX_TOLD {
                        passed.insert(name.to_owned());
                    }
                    pass_section(&mut stream, name)?;
                    continue;
                }
            }
            let end = stream.scanner.full_line()?.unwrap_or_default();
            if end.strip_prefix("$End") != Some(name) {
                let rule = format!("\"{}\": must be $End{name}", shown(&end));
                return Err(stream.scanner.line_error(rule));
            }
        }
        if !seen.contains("Nodes") {
            return Err(source.error("$Nodes", "missing: there is no mesh in this file"));
        }
        file.note(passed);
        Ok(file)
    }

    fn note(&mut self, passed: BTreeSet<String>) {
        let Cells { repeated, reduced, .. } = self.cells;
        if repeated > 0 {
            self.notes.push(format!("{repeated} elements that repeat for further physical groups left out"));
        }
        if reduced > 0 {
            self.notes
                .push(format!("{reduced} prisms or pyramids: the nodes in the middle of faces left out"));
        }
        for name in &self.left_out {
            self.notes.push(format!("{name}: is $ElementNodeData, left out"));
        }
        for name in passed {
            self.notes.push(format!("section ${} left out", shown(&name)));
        }
    }

    fn read_nodes(&mut self, stream: &mut Stream, parametric: bool, budget: &mut Budget) -> Result<()> {
        /// "1 0 0 0" and a line end.
        const LEAST: u64 = 8;
        let old = self.format.version == 2;
        let (blocks, all) = if old {
            // A line of words in binary files too.
            (1, count_line(stream, "the number of nodes")?)
        } else {
            stream.row("the number of nodes")?;
            let blocks = stream.wide("a number of blocks")?;
            let all = stream.wide("a number of nodes")?;
            for _ in 0..2 {
                stream.wide("a node's number")?;
            }
            stream.end_row()?;
            (blocks, all)
        };
        stream.holds(all, LEAST, "nodes")?;
        let count = text::index(stream.scanner.source(), "$Nodes", all)?;
        budget.take("nodes", all.saturating_mul(24 + Tags::BYTES))?;
        let full = |_| stream.scanner.source().error("nodes", "memory is full");
        self.points.try_reserve_exact(count).map_err(full)?;
        let mut pairs: Vec<(u64, u32)> = Vec::new();
        pairs.try_reserve_exact(count).map_err(full)?;

        let coordinates = |stream: &mut Stream| -> Result<DVec3> {
            let mut point = [0.0; 3];
            for x in &mut point {
                *x = stream.real("a coordinate")?;
            }
            Ok(point.into())
        };
        for _ in 0..blocks {
            if old {
                for index in 0..num::count(count) {
                    stream.row("a node")?;
                    pairs.push((stream.natural("a node's number")?, index));
                    self.points.push(coordinates(stream)?);
                    if parametric {
                        let dimension = stream.int("a dimension")?;
                        stream.int("an entity")?;
                        for _ in 0..if (1..=2).contains(&dimension) { dimension } else { 0 } {
                            stream.real("a parameter")?;
                        }
                    }
                    stream.end_row()?;
                }
                continue;
            }
            stream.row("a block of nodes")?;
            let dimension = stream.int("a dimension")?;
            stream.int("an entity")?;
            let parametric = stream.int("0 or 1")? != 0;
            let many = stream.wide("a number of nodes")?;
            stream.end_row()?;
            if many > length(count - pairs.len()) {
                return Err(stream.error(format!("a block of {many} nodes: {count} in all are announced")));
            }
            for _ in 0..many {
                stream.row("a node's number")?;
                pairs.push((stream.wide("a node's number")?, num::count(pairs.len())));
                stream.end_row()?;
            }
            for _ in 0..many {
                stream.row("coordinates")?;
                self.points.push(coordinates(stream)?);
                for _ in 0..if parametric { dimension.clamp(0, 3) } else { 0 } {
                    stream.real("a parameter")?;
                }
                stream.end_row()?;
            }
        }
        if pairs.len() != count {
            let rule = format!("{count} are announced, the blocks hold {}", pairs.len());
            return Err(stream.scanner.source().error("$Nodes", rule));
        }
        self.nodes = Tags::new(stream.scanner.source(), "node", pairs)?;
        Ok(())
    }

    fn read_elements(&mut self, stream: &mut Stream, budget: &mut Budget) -> Result<()> {
        /// "1 1" and a line end.
        const LEAST: u64 = 4;
        let old = self.format.version == 2;
        let (blocks, all) = if old {
            (u64::MAX, count_line(stream, "the number of elements")?)
        } else {
            stream.row("the number of elements")?;
            let blocks = stream.wide("a number of blocks")?;
            let all = stream.wide("a number of elements")?;
            for _ in 0..2 {
                stream.wide("an element's number")?;
            }
            stream.end_row()?;
            (blocks, all)
        };
        stream.holds(all, LEAST, "elements")?;
        let count = text::index(stream.scanner.source(), "$Elements", all)?;
        // Types, ends, groups and numbers.
        budget.take("elements", all.saturating_mul(5 + 4 + Tags::BYTES))?;
        let full = |_| stream.scanner.source().error("elements", "memory is full");
        self.cells.mesh.types.try_reserve_exact(count).map_err(full)?;
        self.cells.mesh.ends.try_reserve_exact(count).map_err(full)?;
        self.cells.physical.try_reserve_exact(count).map_err(full)?;
        self.cells.elements.try_reserve_exact(count).map_err(full)?;

        let mut left = all;
        let mut block = 0;
        while if old { left > 0 } else { block < blocks } {
            block += 1;
            let many = self.read_block(stream, left, budget)?;
            left -= many;
        }
        if left > 0 {
            let rule = format!("{all} are announced, the blocks hold {}", all - left);
            return Err(stream.scanner.source().error("$Elements", rule));
        }
        Ok(())
    }

    /// Reads elements of one type, of which there may be so many. Returns how many they are.
    fn read_block(&mut self, stream: &mut Stream, left: u64, budget: &mut Budget) -> Result<u64> {
        let binary = self.format.binary.is_some();
        let old = self.format.version == 2;
        let mut physical = 0;
        // In words, each element of version 2 has a header of its own, behind its number.
        let mut element = None;
        stream.row("an element")?;
        let (number, many, tags) = if old {
            if !binary {
                element = Some(stream.natural("an element's number")?);
            }
            let number = stream.int("an element type")?;
            let many = if binary { stream.natural("a number of elements")? } else { 1 };
            (number, many, stream.natural("a number of tags")?)
        } else {
            let dimension = stream.int("a dimension")?;
            let entity = stream.int("an entity")?;
            physical = self.groups.get(&(dimension, entity)).copied().unwrap_or(0);
            let number = stream.int("an element type")?;
            (number, stream.wide("a number of elements")?, 0)
        };
        if !old {
            stream.end_row()?;
        }
        if many > left {
            return Err(
                stream.error(format!("a block of {many} elements: {left} are left of those announced"))
            );
        }
        let Some(kind) = kind_of(number) else {
            return Err(stream.error(format!(
                "elements of type {number} ({}): points, lines, triangles, quadrilaterals, tetrahedra, \
                 hexahedra, prisms and pyramids of orders 1 and 2 are supported",
                family(number)
            )));
        };
        let size = match (binary, old) {
            (false, _) => 2,
            (true, true) => 4,
            (true, false) => self.format.wide.bytes(),
        };
        let nodes = length(kind.nodes);
        let words = tags.saturating_add(nodes).saturating_mul(size);
        // Of the first line of words a part is behind, and the last has no blank after it.
        let slack = if binary { 0 } else { size };
        stream.holds(many, words.saturating_sub(slack), "elements of this type")?;
        let room = usize::try_from(many).unwrap_or(usize::MAX).saturating_mul(kind.order.len());
        make_room(stream, &mut self.cells.mesh.nodes, room, budget)?;

        let mut own = [0_u32; 27];
        for _ in 0..many {
            if !old {
                stream.row("an element")?;
            }
            let element = match element {
                Some(element) => element,
                None if old => stream.natural("an element's number")?,
                None => stream.wide("an element's number")?,
            };
            for i in 0..tags {
                let tag = stream.int("a tag")?;
                if i == 0 {
                    physical = group(tag);
                }
            }
            for node in &mut own[..kind.nodes] {
                let tag = if old { stream.natural("a node")? } else { stream.wide("a node")? };
                *node = self
                    .nodes
                    .get(tag)
                    .ok_or_else(|| stream.error(format!("element {element}: there is no node {tag}")))?;
            }
            stream.end_row()?;
            self.cells.add(stream, &kind, element, &own[..kind.nodes], physical)?;
        }
        Ok(many)
    }

    /// Reads which physical groups entities belong to. Lines of many numbers may be long: words count here.
    fn read_entities(&mut self, stream: &mut Stream, partitioned: bool, budget: &mut Budget) -> Result<()> {
        /// Of an entry of the map.
        const BYTES: u64 = 64;
        let first_of = |stream: &mut Stream| -> Result<i32> {
            let count = stream.wide("a number of tags")?;
            let mut first = 0;
            for _ in 0..count {
                let tag = stream.int("a tag")?;
                first = if first == 0 { group(tag) } else { first };
            }
            Ok(first)
        };
        if partitioned {
            stream.wide("a number of partitions")?;
            let ghosts = stream.wide("a number of ghost entities")?;
            for _ in 0..ghosts {
                stream.int("a ghost entity")?;
                stream.int("a partition")?;
            }
        }
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = stream.wide("a number of entities")?;
        }
        for (dimension, count) in (0..).zip(counts) {
            for _ in 0..count {
                let tag = stream.int("an entity")?;
                if partitioned {
                    stream.int("a dimension")?;
                    stream.int("an entity")?;
                    first_of(stream)?;
                }
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    stream.real("a coordinate")?;
                }
                let group = first_of(stream)?;
                if dimension > 0 {
                    first_of(stream)?;
                }
                if group != 0 && self.groups.insert((dimension, tag), group).is_none() {
                    budget.take("entities", BYTES)?;
                }
            }
        }
        if stream.format.binary.is_none() {
            stream.scanner.end_line()?;
        }
        Ok(())
    }
}

/// A physical group of a tag: negative ones are of turned elements.
fn group(tag: i64) -> i32 {
    i32::try_from(tag.unsigned_abs()).unwrap_or(i32::MAX)
}

/// A line with a count alone.
fn count_line(stream: &mut Stream, what: &str) -> Result<u64> {
    let count = stream.scanner.number(what)?;
    stream.scanner.end_line()?;
    Ok(count)
}

/// Room for more numbers. Growing takes both the old list and the new one.
fn make_room(stream: &Stream, list: &mut Vec<u32>, more: usize, budget: &mut Budget) -> Result<()> {
    let needed = list.len().saturating_add(more);
    if needed <= list.capacity() {
        return Ok(());
    }
    let capacity = needed.max(list.capacity().saturating_add(list.capacity() / 2)).max(64);
    budget.take("elements", length(capacity).saturating_mul(4))?;
    let full = |_| stream.scanner.source().error("elements", "memory is full");
    list.try_reserve_exact(capacity - list.len()).map_err(full)
}

fn read_format(stream: &mut Stream) -> Result<Format> {
    let version: String = stream.scanner.number("a version")?;
    let major = match version.as_str() {
        "2" | "2.0" | "2.1" | "2.2" => 2,
        "4.1" => 4,
        other => {
            let rule = format!("version \"{}\": 2.0 to 2.2 and 4.1 are supported", shown(other));
            return Err(stream.scanner.error(rule));
        }
    };
    let binary: u8 = stream.scanner.number("0 for words or 1 for binary")?;
    let size: u8 = stream.scanner.number("a size in bytes")?;
    let sizes = match size {
        4 => (SampleType::U32, SampleType::F32),
        8 => (SampleType::U64, SampleType::F64),
        _ => return Err(stream.scanner.error(format!("data of {size} bytes: must be 4 or 8"))),
    };
    stream.scanner.end_line()?;
    let binary = match binary {
        0 => None,
        1 => {
            let (one, _) = stream.bytes::<4>("the mark of byte order")?;
            if one == 1_i32.to_le_bytes() {
                Some(Endian::Little)
            } else if one == 1_i32.to_be_bytes() {
                Some(Endian::Big)
            } else {
                let rule = format!("mark of byte order {one:?}: must be 1 in one of both");
                return Err(stream.scanner.line_error(rule));
            }
        }
        other => {
            let rule = format!("file type {other}: must be 0 for words or 1 for binary");
            return Err(stream.scanner.line_error(rule));
        }
    };
    // The size is that of counts in version 4, that of reals before.
    stream.format = if major == 4 {
        Format { version: 4, binary, wide: sizes.0, real: SampleType::F64 }
    } else {
        Format { version: 2, binary, wide: SampleType::U64, real: sizes.1 }
    };
    Ok(stream.format)
}

/// Passes over the rest of a section, and its end.
fn pass_section(stream: &mut Stream, name: &str) -> Result<()> {
    let begin = stream.scanner.lines().max(1);
    if !stream.scanner.pass(format!("$End{name}").as_bytes())? {
        let name = shown(name);
        let rule = format!("${name}: there is no $End{name}");
        return Err(stream.scanner.source().error(format!("line {begin}"), rule));
    }
    stream.scanner.end_line()
}

/// Reads the names of the physical groups of volumes, to the section's end.
fn read_names(stream: &mut Stream) -> Result<Vec<String>> {
    let mut names = Vec::new();
    while let Some(line) = stream.scanner.full_line()? {
        if line == "$EndPhysicalNames" {
            return Ok(names);
        }
        if let Some(name) = line.strip_prefix("3 ")
            && let Some((number, name)) = name.trim_start().split_once(' ')
            && names.len() < MAX_TOLD
        {
            names.push(format!("{} is {}", shown(number), shown(name.trim())));
        }
    }
    Err(stream.scanner.error("$PhysicalNames: there is no $EndPhysicalNames"))
}

/// Which views there are, by whether they are of cells and by name.
#[derive(Default)]
struct Views {
    sections: usize,
    names: HashSet<(bool, String)>,
    /// By their step, too.
    steps: HashMap<(bool, String, i64), Steps>,
}

/// Views of the same association, name and step.
#[derive(Default)]
struct Steps {
    count: usize,
    /// The last one.
    last: usize,
    partitions: HashSet<i64>,
}

/// What a section of data tells of itself.
struct Header {
    name: String,
    scheme: bool,
    step: i64,
    components: usize,
    count: u64,
    partition: Option<i64>,
}

impl Views {
    fn header(&mut self, stream: &mut Stream) -> Result<Header> {
        /// Longest name, in bytes.
        const MAX_NAME: usize = 256;
        self.sections += 1;
        if self.sections > MAX_VIEWS {
            return Err(stream.scanner.line_error(format!("more than {MAX_VIEWS} sections of data")));
        }
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
        Ok(Header { name, scheme, step, components: size, count, partition })
    }

    /// Reads where a view's tuples are, and passes over them to the section's end.
    fn read(&mut self, stream: &mut Stream, association: Association, views: &mut Vec<View>) -> Result<()> {
        let Header { name, scheme, step, components, count, partition } = self.header(stream)?;
        let Format { binary, real, .. } = stream.format;
        let numbers = length(components);
        // A digit and a blank each; the last needs no blank.
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
        let section = if association == Association::Point { "NodeData" } else { "ElementData" };
        pass_section(stream, section)?;

        let cell = association == Association::Cell;
        let next = views.len();
        let first = self.names.insert((cell, name.clone()));
        let steps = self.steps.entry((cell, name.clone(), step)).or_default();
        if let Some(partition) = part.partition
            && let Some(view) = views.get_mut(steps.last)
            && view.components == components
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
        views.push(View { name, association, components, scheme, parts: vec![part] });
        Ok(())
    }

    /// Passes over element-node data to the section's end.
    fn pass(&mut self, stream: &mut Stream, left_out: &mut BTreeSet<String>) -> Result<()> {
        let Header { name, components, count, .. } = self.header(stream)?;
        if stream.format.binary.is_some() {
            let tuple = length(components).saturating_mul(stream.format.real.bytes());
            for _ in 0..count {
                stream.natural("an element's number")?;
                let nodes = stream.natural("a number of nodes")?;
                stream.scanner.skip(nodes.saturating_mul(tuple))?;
            }
        }
        left_out.insert(name);
        pass_section(stream, "ElementNodeData")
    }
}
