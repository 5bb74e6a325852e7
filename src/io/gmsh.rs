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

mod elements;
mod stream;
mod tags;
mod views;

use std::collections::{BTreeSet, HashMap};

use glam::DVec3;

use super::arrays::{ArrayInfo, Association, Pick};
use super::dataset::{Dataset, Origin};
use super::samples::SampleType;
use super::source::{Budget, Source};
use super::text::{self, Scanner, shown};
use super::{Loaded, ReadOptions, Reader};
use crate::error::Result;
use crate::num;
use crate::scene::{CellKind, Samples};

use elements::{Kind, family, kind_of};
use stream::{Format, Stream, count_line, pass_section, read_format};
use tags::Tags;
use views::{View, Views};

pub(super) struct Gmsh;

/// The array of physical groups.
const PHYSICAL: &str = "gmsh:physical";

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
        let taken = num::wide(elements.len()).saturating_mul(Tags::BYTES);
        let elements = if of_cells { Tags::new(source, "element", elements)? } else { Tags::none() };
        budget.put_back(taken.saturating_sub(elements.bytes()));
        let solid: Vec<bool> = if of_cells {
            budget.take("elements", num::wide(mesh.types.len()))?;
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
        budget.take("arrays", num::wide(most))?;
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
                    views.read(&mut stream, Association::Point, &mut file.views, budget)?;
                    continue;
                }
                "ElementData" => {
                    views.read(&mut stream, Association::Cell, &mut file.views, budget)?;
                    continue;
                }
                "ElementNodeData" => {
                    views.pass(&mut stream, &mut file.left_out, budget)?;
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
        for name in self.left_out.iter().take(MAX_TOLD) {
            self.notes.push(format!("{name}: is $ElementNodeData, left out"));
        }
        if let Some(more @ 1..) = self.left_out.len().checked_sub(MAX_TOLD) {
            self.notes.push(format!("and {more} more arrays of $ElementNodeData left out"));
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
            if many > num::wide(count - pairs.len()) {
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
        budget.put_back(all.saturating_mul(Tags::BYTES).saturating_sub(self.nodes.bytes()));
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
        let nodes = num::wide(kind.nodes);
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

/// Room for more numbers. Growing takes both the old list and the new one.
fn make_room(stream: &Stream, list: &mut Vec<u32>, more: usize, budget: &mut Budget) -> Result<()> {
    let needed = list.len().saturating_add(more);
    if needed <= list.capacity() {
        return Ok(());
    }
    let capacity = needed.max(list.capacity().saturating_add(list.capacity() / 2)).max(64);
    budget.take("elements", num::wide(capacity).saturating_mul(4))?;
    let old = num::wide(list.capacity());
    let full = |_| stream.scanner.source().error("elements", "memory is full");
    list.try_reserve_exact(capacity - list.len()).map_err(full)?;
    budget.put_back(old.saturating_mul(4));
    Ok(())
}

/// Reads the names of the physical groups of volumes, to the section's end.
fn read_names(stream: &mut Stream) -> Result<Vec<String>> {
    let mut names = Vec::new();
    let mut more = 0_u64;
    while let Some(line) = stream.scanner.full_line()? {
        if line == "$EndPhysicalNames" {
            if more > 0 {
                names.push(format!("and {more} more names"));
            }
            return Ok(names);
        }
        let name = line.strip_prefix("3 ").and_then(|name| name.trim_start().split_once(' '));
        let Some((number, name)) = name else { continue };
        if names.len() == MAX_TOLD {
            more += 1;
        } else {
            names.push(format!("{} is {}", shown(number), shown(name.trim())));
        }
    }
    Err(stream.scanner.error("$PhysicalNames: there is no $EndPhysicalNames"))
}
