//! Everything that is read of a file in one pass: all but the values of views.

use std::collections::{BTreeSet, HashMap};

use glam::DVec3;

use crate::error::Result;
use crate::io::build::dataset::Dataset;
use crate::io::file::budget::Budget;
use crate::io::formats::gmsh::elements::Kind;
use crate::io::formats::gmsh::stream::{Format, Stream};
use crate::io::formats::gmsh::tags::Tags;
use crate::io::formats::gmsh::views::{View, Views};
use crate::num;

/// The name of the array of physical groups.
pub(crate) const PHYSICAL: &str = "gmsh:physical";

/// The contents of a file, without the values of views.
pub(crate) struct File<'a> {
    pub(crate) budget: Budget<'a>,
    pub(crate) format: Format,
    pub(crate) points: Vec<DVec3>,
    pub(crate) nodes: Tags,
    pub(crate) cells: Cells,
    pub(crate) views: Vec<View>,
    /// Names of views of element-node data.
    pub(crate) left_out: BTreeSet<String>,
    /// Physical groups of volumes: number and name.
    pub(crate) names: Vec<String>,
    pub(crate) notes: Vec<String>,
    /// The first physical group of each entity that has one, by dimension and tag.
    pub(crate) groups: HashMap<(i64, i64), i32>,
    /// Sections that may occur once.
    pub(crate) seen: BTreeSet<String>,
    /// Unknown sections, for a note.
    pub(crate) passed: BTreeSet<String>,
    /// What tells views apart.
    pub(crate) met: Views<'a>,
}

/// The elements of a file.
#[derive(Default)]
pub(crate) struct Cells {
    /// The cells; points are added later.
    pub(crate) mesh: Dataset,
    /// The number of each element, and its cell.
    pub(crate) elements: Vec<(u64, u32)>,
    /// Each cell's physical group; 0 for none.
    pub(crate) physical: Vec<i32>,
    /// Elements that are repeated for further physical groups.
    pub(crate) repeated: usize,
    /// Prisms and pyramids whose additional nodes VTK lacks.
    pub(crate) reduced: usize,
}

impl Cells {
    pub(crate) fn add(
        &mut self,
        stream: &Stream,
        kind: &Kind,
        element: u64,
        own: &[u32],
        physical: i32,
    ) -> Result<()> {
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
