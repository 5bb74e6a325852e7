//! The elements of a file as cells.

use crate::error::Result;
use crate::io::build::dataset::Dataset;
use crate::io::formats::gmsh::elements::Kind;
use crate::io::formats::gmsh::stream::Stream;
use crate::num;

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
