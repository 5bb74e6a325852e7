//! How a technique for meshes draws, and the primitives that it ranks.

use crate::error::Result;
use crate::frame::lists::{Geometry, Ranking};
use crate::num;
use crate::resident::GpuScene;
use crate::resident::mesh::{MeshData, Primitives};
use crate::resident::mesh_parts::PartSlot;
use crate::scene::TetScalars;
use crate::technique::mesh::list_inputs::{ListShader, TileShader};
use crate::technique::mesh::options::MeshOptions;

/// How a technique for meshes draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshDesc {
    pub(crate) name: &'static str,
    pub(crate) primitives: Primitives,
    pub(crate) options: MeshOptions,
    /// Shader that draws the primitives of each tile.
    pub(crate) draw: TileShader,
    /// Entries of the k-buffer.
    pub(crate) k: u32,
    /// Whether later frames get a larger k-buffer if the lists of unsorted pixels do not fit.
    pub(crate) deepens: bool,
    /// Primitives of a tile that one dispatch takes; `None`: all.
    pub(crate) chunk: Option<u32>,
    /// Shader that sorts the lists of pixels that were drawn out of order, and draws them again.
    pub(crate) repair: Option<ListShader>,
    /// Name of the counter of those pixels.
    pub(crate) unsorted: &'static str,
}

impl MeshDesc {
    /// Whether pixels in which cells overlap are drawn again.
    pub(crate) fn repairs_overlaps(&self) -> bool {
        self.repair.is_some() && self.primitives == Primitives::Faces
    }

    /// Returns the distance, in scalars, by which extinction is smeared, where only visible cells are drawn.
    pub(crate) fn margin(&self, scene: &GpuScene) -> Option<f32> {
        self.options.skips().then(|| scene.margin(Some(&self.options.segments)))
    }

    /// Returns how the pixels in which cells overlap are drawn again.
    pub(crate) fn of_overlaps(&self) -> Self {
        Self { name: "havs.overlaps", primitives: Primitives::Cells, chunk: None, deepens: false, ..*self }
    }

    /// Ranks the faces or cells of a part of the mesh.
    pub(crate) fn rank_part(&self, scene: &GpuScene, slot: &PartSlot) -> Result<Ranking> {
        let cell_scalars = matches!(scene.mesh()?.scalars(), TetScalars::Cell(_));
        let [points, scalars, primitives] = slot.buffers().map(std::sync::Arc::clone);
        let [point_count, count] = slot.room(self.primitives.words(cell_scalars));
        let geometry =
            Geometry { kind: self.primitives, points, point_count, scalars, cell_scalars, primitives, count };
        Ranking::new(scene.gpu(), self.name, geometry, self.options.back_to_front(), None)
    }

    /// Ranks the faces or cells of the mesh that are drawn: by `order_given`, else on the device.
    pub(crate) fn rank_primitives(
        &self,
        scene: &GpuScene,
        data: &MeshData,
        order_given: Option<&[u32]>,
    ) -> Result<Ranking> {
        let gpu = scene.gpu();
        let mesh = scene.mesh()?;
        let drawn = scene.primitives(self.primitives, self.margin(scene))?;
        let scalars = match drawn.scalars {
            Some(scalars) => scalars,
            None => data.scalars(gpu, mesh, scene.scene().transfer.domain())?,
        };
        let geometry = Geometry {
            kind: self.primitives,
            points: data.points(gpu, mesh)?,
            point_count: num::count(mesh.points().len()),
            scalars,
            cell_scalars: matches!(mesh.scalars(), TetScalars::Cell(_)),
            primitives: drawn.buffer,
            count: drawn.count,
        };
        Ranking::new(gpu, self.name, geometry, self.options.back_to_front(), order_given)
    }
}
