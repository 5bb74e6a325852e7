//! Gmsh MSH 2 and 4.1 (`.msh`), as text or binary in either byte order.
//!
//! Elements of orders 1 and 2 become VTK cells, with their nodes reordered. Nodes that VTK lacks are left out: the face
//! centres of prisms with 18 nodes and of pyramids with 14. Node and element numbers may be sparse and in any order.
//!
//! Views are arrays: `$NodeData` belongs to points, `$ElementData` to cells. Missing values are NaN. The first step of a
//! view has the name of the view, further ones `name@step`; a second view of the same name and step has the suffix `#2`.
//! Parts of a view that differ in partition form one array. `$ElementNodeData` is left out. If solid elements belong to
//! physical groups, the cell array `gmsh:physical` holds their numbers, 0 for none; an element of several groups has the
//! first.
//!
//! Other sections (`$Periodic`, `$InterpolationScheme`, unknown ones) are skipped.

mod elements;
mod file;
mod mesh_sections;
mod sections;
mod stream;
mod tags;
mod views;

use std::collections::BTreeSet;

use crate::error::Result;
use crate::io::build::arrays::{ArrayInfo, Association, readings};
use crate::io::build::dataset::Dataset;
use crate::io::build::origin::Origin;
use crate::io::file::budget::Budget;
use crate::io::file::decode::{Tuples, Values};
use crate::io::file::sample_type::{Pick, SampleType};
use crate::io::file::source::Source;
use crate::io::formats::gmsh::file::{Cells, File, PHYSICAL};
use crate::io::formats::gmsh::tags::Tags;
use crate::io::formats::gmsh::views::View;
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{CellKind, Samples};

pub(crate) struct Gmsh;

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

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        let mut budget = Budget::new(source, request);
        let file = File::read(source, &budget)?;
        let File { format, points, nodes, cells, views, left_out, names, notes, .. } = file;
        if let Some(wanted) = &request.array {
            refuse_left_out(source, wanted, &views, &left_out)?;
        }
        let Cells { mesh, elements, physical, .. } = cells;
        let solid = |cell: usize| CellKind::of_vtk(mesh.types[cell]).is_some();
        let solids = (0..mesh.types.len()).filter(|&cell| solid(cell)).count();
        let groups = (0..physical.len()).any(|cell| physical[cell] != 0 && solid(cell));
        let of_cells = views.iter().any(|view| view.info.association == Association::Cell);
        let taken = num::wide(elements.len()).saturating_mul(Tags::BYTES);
        let elements = if of_cells { Tags::new(source, "element", elements)? } else { Tags::none() };
        budget.put_back(taken.saturating_sub(elements.bytes()));
        let solid: Vec<bool> = if of_cells {
            budget.take("elements", num::wide(mesh.types.len()))?;
            (0..mesh.types.len()).map(solid).collect()
        } else {
            Vec::new()
        };

        let mut arrays: Vec<ArrayInfo> = views.iter().map(|view| view.info.clone()).collect();
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
        // One byte per value records whether it is given.
        let most = if of_cells { counts.0.max(counts.1) } else { counts.0 };
        budget.take("arrays", num::wide(most))?;
        let mut warnings = BTreeSet::new();
        let mut read = |index: usize, pick: Pick| -> Result<Values> {
            let Some(view) = views.get(index) else {
                if pick == Pick::Whole {
                    let bytes = physical.iter().flat_map(|group| group.to_le_bytes()).collect();
                    return Ok(Values::Whole(Tuples { size: 4, bytes }));
                }
                let groups = physical.iter().map(|&group| num::f32_of(f64::from(group))).collect();
                return Ok(Samples::F32(groups).into());
            };
            let (tags, count) = match view.info.association {
                Association::Point => (&nodes, counts.0),
                Association::Cell => (&elements, counts.1),
            };
            let filled = view.read(source, format, tags, count, pick)?;
            let (what, missing, all) = match view.info.association {
                Association::Point => ("nodes", filled.missing(|_| true), count),
                Association::Cell => ("solid elements", filled.missing(|cell| solid[cell]), solids),
            };
            let name = &view.info.name;
            if missing > 0 {
                warnings.insert(format!("{name}: {missing} of {all} {what} have no value: they are NaN"));
            }
            for (count, what) in [
                (filled.strange, "values belong to no node or element in this file"),
                (filled.again, "values are given more than once: the last one is used"),
            ] {
                if count > 0 {
                    warnings.insert(format!("{name}: {count} {what}"));
                }
            }
            if view.scheme {
                let rule = "has an interpolation scheme: between nodes it is interpolated linearly anyway";
                warnings.insert(format!("{name}: {rule}"));
            }
            Ok(filled.values)
        };
        let dataset = Dataset { points, ..mesh };
        let (budget, read) = (&mut budget, &mut read);
        let origin = Origin { source, format: self.name(), arrays, spare: 0..0, request, budget, read };
        let mut loaded = dataset.build(origin)?;
        let report = &mut loaded.report;
        report.notes.splice(0..0, notes);
        if groups {
            report.notes.extend(names.into_iter().map(|name| format!("{PHYSICAL}: {name}")));
        }
        report.warnings.extend(warnings);
        Ok(loaded)
    }
}

/// Refuses a selected array that is element-node data.
fn refuse_left_out(source: &Source, wanted: &str, views: &[View], left_out: &BTreeSet<String>) -> Result<()> {
    let names =
        readings(wanted).flat_map(|(_, name)| [Some(name), name.rsplit_once(':').map(|(name, _)| name)]);
    for name in names.flatten() {
        if views.iter().any(|view| view.info.name == name) || name == PHYSICAL {
            return Ok(());
        }
        if left_out.contains(name) {
            let rule = "is $ElementNodeData: values of nodes that differ between elements are not supported";
            return Err(source.error(format!("array \"{name}\""), rule));
        }
    }
    Ok(())
}
