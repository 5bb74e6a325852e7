//! How techniques for meshes shade segments: the constants, push constants and resources that their passes share.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::lists::{Geometry, Lists, Stage, listing_constants};
use crate::gpu::shader::{
    BINDING_FLAGS, BINDING_KNOTS, BINDING_KNOTS_UNIFORM, BINDING_TABLE, BINDING_TABLE_HEAD, MESH_LISTS_LISTS,
    SPEC_FILL, SPEC_FLAGGED, Shader,
};
use crate::gpu::{Buffer, Resource, SpecConstant};
use crate::interface::MeshPush;
use crate::num::{self, f32_of};
use crate::primitives::dispatch::pass;
use crate::resident::GpuScene;
use crate::resident::mesh::{MeshData, Primitives};
use crate::resident::tables::{Integrator, Knots, SegmentOptions, Table};
use crate::scene::TetScalars;

/// How a technique for meshes draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshDesc {
    pub(crate) name: &'static str,
    pub(crate) primitives: Primitives,
    pub(crate) segments: SegmentOptions,
    /// Extinction per scalar of the smoke model.
    pub(crate) smoke: f64,
    pub(crate) back_to_front: bool,
    /// Resolves lists.
    pub(crate) resolve: &'static Shader,
    /// Entries of the k-buffer.
    pub(crate) k: u32,
    /// Entries of a pixel that one dispatch takes; `None`: all.
    pub(crate) chunk: Option<u32>,
    /// Draws pixels whose sequence was not sorted again, sorted.
    pub(crate) repair: Option<&'static Shader>,
    /// What those pixels are counted as.
    pub(crate) unsorted: &'static str,
    /// Transmittance at which a line ends.
    pub(crate) stop: f64,
    /// Whether cells in which nothing is visible are left out.
    pub(crate) skip: bool,
}

/// Scalars that one may stand for the other, of the transfer function's domain: in the one segment behind two faces
/// that cannot be told apart, an error no greater than this.
const ALIKE: f64 = 1e-4;

/// Most entries of the k-buffer that a repair sorts with.
pub(crate) const REPAIR_K: u32 = 15;

/// Refuses a frame in which the device has ended loops before they were through.
///
/// # Errors
///
/// [`Error::Unsupported`] with the number of pixels.
pub(crate) fn check_loops(pixels: u32) -> Result<()> {
    if pixels == 0 {
        return Ok(());
    }
    Err(Error::unsupported(
        "this view of the mesh",
        format!(
            "{pixels} pixels need more turns of a loop than it makes; havs with chunk=5000 makes fewer in one"
        ),
    ))
}

/// Specialisation constants that every pass of a technique shares.
pub(crate) fn constants(scene: &GpuScene, desc: &MeshDesc) -> Result<Vec<SpecConstant>> {
    let cell_scalars = matches!(scene.mesh()?.scalars(), TetScalars::Cell(_));
    Ok(listing_constants(desc.primitives, cell_scalars, desc.back_to_front))
}

/// What push constants tell of the scene and the technique.
///
/// # Errors
///
/// [`Error::Unsupported`] where knots are more than a line can be cut at on this device.
pub(crate) fn shading_push(scene: &GpuScene, desc: &MeshDesc, knots: &Knots) -> Result<MeshPush> {
    /// Every device manages this many iterations; the probe runs only where the answer counts.
    const ALWAYS: u32 = 32_768;
    // A segment may span every knot, and a line has several that do.
    let turns = knots.count.saturating_mul(8).saturating_add(1024);
    if desc.segments.integrator == Integrator::Exact && turns > ALWAYS {
        let limit = scene.gpu().loop_limit()?;
        if turns > limit {
            return Err(Error::unsupported(
                format!("{} integrator=exact", desc.name),
                format!(
                    "{turns} loop iterations for this transfer function, the limit is {limit}; integral works"
                ),
            ));
        }
    }
    let transfer = &scene.scene().transfer;
    let [low, high] = transfer.domain();
    Ok(MeshPush {
        knots: knots.count,
        opaque: f32_of(desc.stop / scene.max_colour()),
        smoke: f32_of(desc.smoke),
        alike: f32_of((high - low) * ALIKE),
        last_round: 0,
        ..MeshPush::default()
    })
}

/// What a segment's colour comes from.
pub(crate) fn shading(
    scene: &GpuScene,
    knots: &Knots,
    table: Option<&Arc<Table>>,
) -> Result<Vec<(u32, Resource)>> {
    let knots = || Resource::Buffer(Arc::clone(&knots.buffer));
    let head = table.map_or_else(knots, |table| Resource::Buffer(Arc::clone(&table.buffer)));
    let texels = table.map_or_else(|| scene.no_table(), |table| Ok(Arc::clone(&table.image)))?;
    Ok(vec![
        (BINDING_KNOTS, knots()),
        (BINDING_KNOTS_UNIFORM, knots()),
        (BINDING_TABLE_HEAD, head),
        (BINDING_TABLE, Resource::Sampled(texels, vk::Filter::NEAREST)),
    ])
}

/// Lists of flagged pixels instead of all.
pub(crate) fn only_flagged(
    lists: &mut Lists,
    scene: &GpuScene,
    desc: &MeshDesc,
    flags: &Arc<Buffer>,
) -> Result<()> {
    // Lists of cells are there where a frame before has flagged something.
    if desc.primitives == Primitives::Faces {
        lists.bins.only_where_flagged(scene.gpu())?;
    }
    let constants = constants(scene, desc)?;
    let passes =
        [(&mut lists.list_count, &MESH_LISTS_LISTS, 0), (&mut lists.list_fill, &MESH_LISTS_LISTS, 1)];
    for (old, shader, fill) in passes {
        let resource = |&(binding, _): &(u32, _)| {
            let found = match binding {
                BINDING_FLAGS => Some(Resource::ReadOnly(Arc::clone(flags))),
                _ => old.descriptors.resource(binding),
            };
            found.map(|found| (binding, found))
        };
        let resources: Vec<_> = shader.bindings.iter().filter_map(resource).collect();
        let constants: Vec<_> =
            constants.iter().copied().chain([(SPEC_FILL, fill), (SPEC_FLAGGED, 1)]).collect();
        *old = pass(scene.gpu(), &old.name, shader, &constants, &resources)?;
    }
    Ok(())
}

/// Ranks the primitives of a mesh that a technique draws.
pub(crate) fn stage(
    scene: &GpuScene,
    data: &MeshData,
    desc: &MeshDesc,
    order_given: Option<&[u32]>,
) -> Result<Stage> {
    let gpu = scene.gpu();
    let mesh = scene.mesh()?;
    let margin = desc.skip.then(|| scene.margin(Some(&desc.segments)));
    let drawn = scene.primitives(desc.primitives, margin)?;
    let scalars = match drawn.scalars {
        Some(scalars) => scalars,
        None => data.scalars(gpu, mesh, scene.scene().transfer.domain())?,
    };
    let geometry = Geometry {
        kind: desc.primitives,
        points: data.points(gpu, mesh)?,
        point_count: num::count(mesh.points().len()),
        scalars,
        cell_scalars: matches!(mesh.scalars(), TetScalars::Cell(_)),
        primitives: drawn.buffer,
        count: drawn.count,
    };
    Stage::of(gpu, desc.name, geometry, desc.back_to_front, order_given)
}
