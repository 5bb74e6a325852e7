//! The sections of a file in their order.

use std::collections::{BTreeSet, HashMap};

use crate::error::Result;
use crate::io::build::arrays::Association;
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::SampleType;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::file::text::shown;
use crate::io::formats::gmsh::cells::Cells;
use crate::io::formats::gmsh::file::File;
use crate::io::formats::gmsh::stream::{Format, Stream, pass_section, read_format};
use crate::io::formats::gmsh::tags::Tags;
use crate::io::formats::gmsh::views::Views;

/// Most names of physical groups, and of sections passed over, that are told.
const MAX_TOLD: usize = 16;

impl File {
    pub(crate) fn read(source: &Source, budget: &mut Budget) -> Result<Self> {
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
