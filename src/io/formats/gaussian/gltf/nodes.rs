//! The hierarchy of nodes.

use glam::{DMat3, DQuat, DVec3};

use crate::error::Result;
use crate::io::file::source::Source;
use crate::io::formats::gaussian::gltf::document::{Document, Node};

/// A mesh in the world: `matrix · x + offset`.
pub(super) struct Instance {
    pub(super) node: usize,
    pub(super) mesh: usize,
    pub(super) matrix: DMat3,
    pub(super) offset: DVec3,
}

/// Returns the meshes that the default scene shows, in the order of its nodes.
pub(super) fn instances(
    source: &Source,
    document: &Document,
    notes: &mut Vec<String>,
) -> Result<Vec<Instance>> {
    let nodes = &document.nodes;
    let wrong = |node: usize, rule: &str| source.error(format!("node {node}"), rule);
    let roots: Vec<usize> = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None if document.scenes.is_empty() => {
            // Without scenes, the nodes without parents.
            let mut is_child = vec![false; nodes.len()];
            for child in nodes.iter().flat_map(|node| &node.children) {
                if let Some(flag) = is_child.get_mut(*child) {
                    *flag = true;
                }
            }
            (0..nodes.len()).filter(|i| !is_child[*i]).collect()
        }
        None => return Err(source.error("scene", "there is no such scene")),
    };
    if document.scenes.len() > 1 {
        notes.push(format!("{} other scenes left out", document.scenes.len() - 1));
    }
    if !document.animations.is_empty() {
        notes.push(format!("{} animations left out", document.animations.len()));
    }
    let mut is_listed = vec![false; nodes.len()];
    let mut list = |i: usize| {
        let Some(flag) = is_listed.get_mut(i) else { return Err(wrong(i, "there is no such node")) };
        if std::mem::replace(flag, true) {
            return Err(wrong(i, "must have one parent, and be no child of its own"));
        }
        Ok(i)
    };
    let (mut instances, mut stack, mut skins) = (Vec::new(), Vec::new(), 0);
    for root in roots.into_iter().rev() {
        stack.push((list(root)?, DMat3::IDENTITY, DVec3::ZERO));
    }
    while let Some((i, parent, origin)) = stack.pop() {
        let node = &nodes[i];
        let (own, translation) = local(source, i, node)?;
        let (matrix, offset) = (parent * own, parent * translation + origin);
        if !matrix.is_finite() || !offset.is_finite() {
            return Err(wrong(i, "its transform overflows"));
        }
        if let Some(mesh) = node.mesh {
            if mesh >= document.meshes.len() {
                return Err(wrong(i, "there is no such mesh"));
            }
            let is_splats =
                document.meshes[mesh].primitives.iter().any(|own| own.extensions.splats.is_some());
            if is_splats && node.extensions.instancing.is_some() {
                return Err(wrong(i, "EXT_mesh_gpu_instancing is not supported"));
            }
            skins += usize::from(is_splats && node.skin.is_some());
            instances.push(Instance { node: i, mesh, matrix, offset });
        }
        for child in node.children.iter().rev() {
            stack.push((list(*child)?, matrix, offset));
        }
    }
    if skins > 0 {
        notes.push(format!("skins of {skins} nodes left out"));
    }
    Ok(instances)
}

/// Returns the transform of a node to its parent.
fn local(source: &Source, i: usize, node: &Node) -> Result<(DMat3, DVec3)> {
    let wrong = |rule: &str| source.error(format!("node {i}"), rule);
    let Node { matrix, translation, rotation, scale, .. } = node;
    if let Some(matrix) = matrix {
        if translation.is_some() || rotation.is_some() || scale.is_some() {
            return Err(wrong("has a matrix, and translation, rotation or scale"));
        }
        // Column by column, with the translation last.
        let [a, b, c, d] = [0, 4, 8, 12].map(|k| DVec3::new(matrix[k], matrix[k + 1], matrix[k + 2]));
        if [matrix[3], matrix[7], matrix[11], matrix[15]] != [0.0, 0.0, 0.0, 1.0] {
            return Err(wrong("matrix: its last row must be 0, 0, 0, 1"));
        }
        return Ok((DMat3::from_cols(a, b, c), d));
    }
    let turn = match rotation {
        Some(rotation) => {
            let quaternion = DQuat::from_array(*rotation);
            if quaternion.length() == 0.0 || !quaternion.length().is_finite() {
                return Err(wrong("rotation: must not have length 0"));
            }
            DMat3::from_quat(quaternion.normalize())
        }
        None => DMat3::IDENTITY,
    };
    let scale = DMat3::from_diagonal(scale.map_or(DVec3::ONE, DVec3::from_array));
    Ok((turn * scale, translation.map_or(DVec3::ZERO, DVec3::from_array)))
}
