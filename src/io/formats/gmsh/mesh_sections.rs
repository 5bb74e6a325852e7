//! The sections of the mesh: nodes, elements and entities, of versions 2 and 4.1.

use glam::DVec3;

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::text;
use crate::io::formats::gmsh::elements::{family, kind_of};
use crate::io::formats::gmsh::file::{Cells, File};
use crate::io::formats::gmsh::stream::{Stream, count_line};
use crate::io::formats::gmsh::tags::Tags;
use crate::num;

impl File<'_> {
    pub(crate) fn read_nodes(&mut self, stream: &mut Stream, parametric: bool) -> Result<()> {
        /// The length of the shortest node: "1 0 0 0" and a line end.
        const LEAST: u64 = 8;
        let (blocks, all) = read_counts(stream, "nodes", "a node's number")?;
        stream.holds(all, LEAST, "nodes")?;
        let count = text::index(stream.scanner.source(), "$Nodes", all)?;
        self.budget.take("nodes", all.saturating_mul(24 + Tags::BYTES))?;
        let full = |_| stream.scanner.source().error("nodes", "memory is full");
        self.points.try_reserve_exact(count).map_err(full)?;
        let mut pairs: Vec<(u64, u32)> = Vec::new();
        pairs.try_reserve_exact(count).map_err(full)?;

        let coordinates = |stream: &mut Stream| -> Result<DVec3> {
            let mut next = || stream.real("a coordinate");
            Ok(DVec3::new(next()?, next()?, next()?))
        };
        for index in 0..if blocks.is_none() { num::count(count) } else { 0 } {
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
        for _ in 0..blocks.unwrap_or(0) {
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
        self.budget.put_back(all.saturating_mul(Tags::BYTES).saturating_sub(self.nodes.bytes()));
        Ok(())
    }

    pub(crate) fn read_elements(&mut self, stream: &mut Stream) -> Result<()> {
        /// The length of the shortest element: "1 1" and a line end.
        const LEAST: u64 = 4;
        let (blocks, all) = read_counts(stream, "elements", "an element's number")?;
        stream.holds(all, LEAST, "elements")?;
        let count = text::index(stream.scanner.source(), "$Elements", all)?;
        // The memory of types, ends, groups and numbers.
        self.budget.take("elements", all.saturating_mul(5 + 4 + Tags::BYTES))?;
        let full = |_| stream.scanner.source().error("elements", "memory is full");
        let Cells { mesh, physical, elements, .. } = &mut self.cells;
        mesh.types.try_reserve_exact(count).map_err(full)?;
        mesh.ends.try_reserve_exact(count).map_err(full)?;
        physical.try_reserve_exact(count).map_err(full)?;
        elements.try_reserve_exact(count).map_err(full)?;

        let (mut left, mut block) = (all, 0);
        while blocks.map_or(left > 0, |blocks| block < blocks) {
            block += 1;
            left -= self.read_block(stream, left)?;
        }
        if left > 0 {
            let rule = format!("{all} are announced, the blocks hold {}", all - left);
            return Err(stream.scanner.source().error("$Elements", rule));
        }
        Ok(())
    }

    /// Reads a block of elements of one type, at most `left`, and returns their number.
    fn read_block(&mut self, stream: &mut Stream, left: u64) -> Result<u64> {
        let binary = self.format.binary.is_some();
        let old = self.format.version == 2;
        let mut physical = 0;
        // In text files of version 2, each element is a block whose header follows its number.
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
            let entity = (stream.int("a dimension")?, stream.int("an entity")?);
            physical = self.groups.get(&entity).copied().unwrap_or(0);
            let counts = (stream.int("an element type")?, stream.wide("a number of elements")?, 0);
            stream.end_row()?;
            counts
        };
        if many > left {
            let rule = format!("a block of {many} elements: {left} are left of those announced");
            return Err(stream.error(rule));
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
        // In text, part of the first line has been read, and the last word needs no blank.
        let slack = if binary { 0 } else { size };
        stream.holds(many, words.saturating_sub(slack), "elements of this type")?;
        let room = usize::try_from(many).unwrap_or(usize::MAX).saturating_mul(kind.order.len());
        make_room(stream, &mut self.cells.mesh.nodes, room, &mut self.budget)?;

        let mut own = [0_u32; 27];
        for _ in 0..many {
            if !old {
                stream.row("an element")?;
            }
            let element = element.map_or_else(|| stream.tag("an element's number"), Ok)?;
            for i in 0..tags {
                let tag = stream.int("a tag")?;
                if i == 0 {
                    physical = group(tag);
                }
            }
            for node in &mut own[..kind.nodes] {
                let tag = stream.tag("a node")?;
                let none = || stream.error(format!("element {element}: there is no node {tag}"));
                *node = self.nodes.get(tag).ok_or_else(none)?;
            }
            stream.end_row()?;
            self.cells.add(stream, &kind, element, &own[..kind.nodes], physical)?;
        }
        Ok(many)
    }

    /// Reads the physical groups of entities. Lines may be very long, so they are read word by word.
    pub(crate) fn read_entities(&mut self, stream: &mut Stream, partitioned: bool) -> Result<()> {
        /// The memory of an entry of the map, in bytes.
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
                    self.budget.take("entities", BYTES)?;
                }
            }
        }
        if stream.format.binary.is_none() {
            stream.scanner.end_line()?;
        }
        Ok(())
    }
}

/// Reads the number of nodes or elements, and that of their blocks; None in version 2.
fn read_counts(stream: &mut Stream, what: &str, number: &str) -> Result<(Option<u64>, u64)> {
    if stream.format.version == 2 {
        // The count is text in binary files too.
        return Ok((None, count_line(stream, &format!("the number of {what}"))?));
    }
    stream.row(&format!("the number of {what}"))?;
    let blocks = stream.wide("a number of blocks")?;
    let all = stream.wide(&format!("a number of {what}"))?;
    // The least and the largest number.
    stream.wide(number)?;
    stream.wide(number)?;
    stream.end_row()?;
    Ok((Some(blocks), all))
}

/// Converts a tag to a physical group; negative tags mark reversed elements.
fn group(tag: i64) -> i32 {
    i32::try_from(tag.unsigned_abs()).unwrap_or(i32::MAX)
}

/// Reserves memory for more numbers. Reallocation holds both the old list and the new one.
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
