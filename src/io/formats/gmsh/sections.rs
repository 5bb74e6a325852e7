//! The sections of a file in their order.

use std::collections::{BTreeSet, HashMap};

use crate::error::Result;
use crate::io::build::arrays::Association;
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::SampleType;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::shown;
use crate::io::formats::gmsh::file::{Cells, File};
use crate::io::formats::gmsh::stream::{Format, Stream, pass_section, read_format};
use crate::io::formats::gmsh::tags::Tags;
use crate::io::formats::gmsh::views::Views;

/// The limit on names of physical groups, and of skipped sections, in notes.
const MAX_NAMED: usize = 16;

impl<'a> File<'a> {
    pub(crate) fn read(source: &'a Source, budget: &Budget<'a>) -> Result<Self> {
        let format = Format { version: 0, binary: None, wide: SampleType::U64, real: SampleType::F64 };
        let mut stream = Stream { scanner: Scanner::new(source), format, row: None };
        let mut file = Self {
            budget: budget.clone(),
            format,
            points: Vec::new(),
            nodes: Tags::none(),
            cells: Cells::default(),
            views: Vec::new(),
            left_out: BTreeSet::new(),
            names: Vec::new(),
            notes: Vec::new(),
            groups: HashMap::new(),
            seen: BTreeSet::new(),
            passed: BTreeSet::new(),
            met: Views::new(budget.clone()),
        };
        while let Some(line) = stream.scanner.full_line()? {
            let name = line.strip_prefix('$').filter(|name| !name.starts_with("End"));
            let Some(name) = name else {
                let rule = format!("\"{}\": must begin a section, such as $Nodes", shown(&line));
                return Err(stream.scanner.line_error(rule));
            };
            file.check_order(&stream, name)?;
            if file.section(&mut stream, name)? {
                continue;
            }
            let end = stream.scanner.full_line()?.unwrap_or_default();
            if end.strip_prefix("$End") != Some(name) {
                let rule = format!("\"{}\": must be $End{name}", shown(&end));
                return Err(stream.scanner.line_error(rule));
            }
        }
        if !file.seen.contains("Nodes") {
            return Err(source.error("$Nodes", "missing: there is no mesh in this file"));
        }
        file.note();
        Ok(file)
    }

    /// Checks that a section may come here: some occur once, all known ones follow `$MeshFormat`.
    fn check_order(&mut self, stream: &Stream, name: &str) -> Result<()> {
        let once = ["MeshFormat", "Nodes", "ParametricNodes", "Elements", "Entities", "PartitionedEntities"]
            .contains(&name);
        let wrong = |why: &str| Err(stream.scanner.line_error(format!("${name}: {why}")));
        // Both give the nodes.
        let key = if name == "ParametricNodes" { "Nodes" } else { name };
        if once && !self.seen.insert(key.to_owned()) {
            return wrong("a second one");
        }
        let known = once || ["NodeData", "ElementData", "ElementNodeData"].contains(&name);
        if known && !self.seen.contains("MeshFormat") {
            return wrong("$MeshFormat must come first");
        }
        if name == "Elements" && !self.seen.contains("Nodes") {
            return wrong("$Nodes must come before");
        }
        Ok(())
    }

    /// Reads one section. True if that included its end line.
    fn section(&mut self, stream: &mut Stream, name: &str) -> Result<bool> {
        match name {
            "NOD" => {
                let rule = "$NOD: is of version 1: 2.0 to 2.2 and 4.1 are supported";
                return Err(stream.scanner.line_error(rule));
            }
            "MeshFormat" => self.format = read_format(stream)?,
            "Nodes" | "ParametricNodes" => self.read_nodes(stream, name == "ParametricNodes")?,
            "Elements" => self.read_elements(stream)?,
            "Entities" | "PartitionedEntities" if self.format.version == 4 => {
                self.read_entities(stream, name == "PartitionedEntities")?;
            }
            "NodeData" | "ElementData" => {
                let association = if name == "NodeData" { Association::Point } else { Association::Cell };
                self.met.read(stream, association, &mut self.views)?;
                pass_section(stream, name)?;
                return Ok(true);
            }
            "ElementNodeData" => {
                self.left_out.insert(self.met.pass(stream)?);
                pass_section(stream, name)?;
                return Ok(true);
            }
            "PhysicalNames" => {
                self.names = read_names(stream)?;
                return Ok(true);
            }
            _ => {
                let quiet = ["Comments", "Periodic", "InterpolationScheme"].contains(&name);
                if !quiet && self.passed.len() < MAX_NAMED {
                    self.passed.insert(name.to_owned());
                }
                pass_section(stream, name)?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Notes what was left out.
    fn note(&mut self) {
        let Cells { repeated, reduced, .. } = self.cells;
        if repeated > 0 {
            self.notes.push(format!("{repeated} elements that repeat for further physical groups left out"));
        }
        if reduced > 0 {
            self.notes
                .push(format!("{reduced} prisms or pyramids: the nodes in the middle of faces left out"));
        }
        for name in self.left_out.iter().take(MAX_NAMED) {
            self.notes.push(format!("{name}: is $ElementNodeData, left out"));
        }
        if let Some(more @ 1..) = self.left_out.len().checked_sub(MAX_NAMED) {
            self.notes.push(format!("and {more} more arrays of $ElementNodeData left out"));
        }
        for name in &self.passed {
            self.notes.push(format!("section ${} left out", shown(name)));
        }
    }
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
        if names.len() == MAX_NAMED {
            more += 1;
        } else {
            names.push(format!("{} is {}", shown(number), shown(name.trim())));
        }
    }
    Err(stream.scanner.error("$PhysicalNames: there is no $EndPhysicalNames"))
}
