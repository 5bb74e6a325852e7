//! The rank of cells: keys that the device sorts, or an order that the host finds for each view.

use std::sync::Arc;
use std::time::Instant;

use crate::error::Result;
use crate::num;
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::declare::words;
use crate::technique::mesh::order::{self, Boundary, keys};

words! {
    /// How cells are ranked.
    pub enum Rank {
        /// By a topological sort of adjacent cells. Exact wherever an order exists.
        Mpvo = "mpvo",
        /// By the power distance of circumspheres. Exact for Delaunay meshes, up to ties.
        Power = "power",
        /// By the distance of centroids, sorted on the device. Approximate until it is repaired.
        Centroid = "centroid",
    }
}

/// Finds orders on the host, and keeps the counters of the last one.
#[derive(Debug)]
pub(crate) struct Ranker {
    scene: Arc<GpuScene>,
    rank: Rank,
    back_to_front: bool,
    /// The margin that selects the cells that are drawn: see [`GpuScene::primitives`].
    margin: Option<f32>,
    counters: Vec<(&'static str, u64)>,
}

impl Ranker {
    /// Makes a ranker; pixels that are out of order are mended later if they are `repaired`.
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        rank: Rank,
        back_to_front: bool,
        margin: Option<f32>,
        repaired: bool,
    ) -> Self {
        let counters =
            if rank == Rank::Centroid { vec![("approximate", u64::from(!repaired))] } else { Vec::new() };
        Self { scene: Arc::clone(scene), rank, back_to_front, margin, counters }
    }

    /// Finds the drawn primitives by rank for a view; `None` where the device sorts.
    pub(crate) fn order(&mut self, view: &View) -> Result<Option<Vec<u32>>> {
        let mesh = self.scene.mesh()?;
        let start = Instant::now();
        let mut cells = match self.rank {
            Rank::Centroid => return Ok(None),
            Rank::Power => {
                let topology = self.scene.mesh_data().topology(mesh)?;
                let check = keys::check_power(mesh, &topology, view);
                // Only cells that share a face are checked, not cells across a gap.
                let sure = check.contrary == 0 && check.equal == 0 && topology.is_convex();
                self.counters = vec![
                    ("relations_contrary", num::wide(check.contrary)),
                    ("relations_equal", num::wide(check.equal)),
                    ("approximate", u64::from(!sure)),
                ];
                keys::ascending(&keys::power(mesh, view))
            }
            Rank::Mpvo => {
                let topology = self.scene.mesh_data().topology(mesh)?;
                let found = order::mpvo(mesh, &topology, view, Boundary::Pixels)?;
                self.counters = vec![
                    ("cycles", u64::from(found.cycles)),
                    ("cells_in_cycles", u64::from(found.cells_in_cycles)),
                    ("dropped_relations", found.dropped_relations),
                    ("approximate", u64::from(found.approximate)),
                    ("split_faces", num::wide(topology.split())),
                ];
                found.front_to_back
            }
        };
        if self.back_to_front {
            cells.reverse();
        }
        // Cells that are not drawn are left out.
        let drawn = self.scene.primitives(Primitives::Cells, self.margin)?.cells;
        if drawn.len() != cells.len() {
            let mut places = vec![u32::MAX; cells.len()];
            for (place, &cell) in (0..).zip(drawn.iter()) {
                places[num::index(cell)] = place;
            }
            cells =
                cells.into_iter().map(|cell| places[num::index(cell)]).filter(|&p| p != u32::MAX).collect();
        }
        self.counters.push(("order_us", num::u64_of(start.elapsed().as_secs_f64() * 1e6)));
        Ok(Some(cells))
    }

    /// Whether an order holds for every view from the same eye.
    pub(crate) fn serves_other_pixels(&self) -> Result<bool> {
        let mesh = self.scene.mesh()?;
        // Relations across gaps hold for the rays of one view's pixels only.
        Ok(self.rank != Rank::Mpvo || self.scene.mesh_data().topology(mesh)?.is_convex())
    }

    /// Returns the counters of the last order.
    pub(crate) fn counters(&self) -> &[(&'static str, u64)] {
        &self.counters
    }
}
