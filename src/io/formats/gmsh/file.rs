//! Everything that is read of a file in one pass: all but the values of views.

use std::collections::{BTreeSet, HashMap};

use glam::DVec3;

use crate::io::formats::gmsh::cells::Cells;
use crate::io::formats::gmsh::stream::Format;
use crate::io::formats::gmsh::tags::Tags;
use crate::io::formats::gmsh::views::View;

/// The name of the array of physical groups.
pub(crate) const PHYSICAL: &str = "gmsh:physical";

/// The contents of a file, without the values of views.
pub(crate) struct File {
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
}
