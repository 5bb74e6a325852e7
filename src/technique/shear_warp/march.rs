//! Marches through the slabs of a base plane, in as many dispatches as the device needs.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BRICKS, BINDING_EDGES, SHEAR_WARP_EDGE, SPEC_EMPTY_SPACE, SPEC_RESUME,
};
use crate::gpu::{ComputeDesc, Descriptors, Gpu, Image, Pipeline, Recorder, Resource, SpecConstant};
use crate::interface::BasePlanePush;
use crate::resident::tables::Knots;
use crate::technique::shear_warp::bounds::ShearBounds;
use crate::technique::shear_warp::options::NAME;
use crate::technique::shear_warp::planes::DrawnPlane;

/// A bit of `BasePlanePush::order`: another dispatch follows.
const MORE: u32 = crate::gpu::shader::MARCH_CONTINUES;

/// The pipelines of a march.
#[derive(Debug)]
pub(crate) struct March {
    pub(crate) first: Arc<Pipeline>,
    /// Continues where the dispatch before stopped; only where the march is split.
    pub(crate) resume: Option<Arc<Pipeline>>,
    /// Slabs that one dispatch may walk.
    pub(crate) slabs_per_dispatch: u32,
}

impl March {
    /// Returns the number of dispatches for so many slabs; no slab takes one, which clears.
    pub(crate) fn parts(&self, slabs: u32) -> u32 {
        slabs.div_ceil(self.slabs_per_dispatch).max(1)
    }

    /// Records the dispatches of one base plane.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        name: &str,
        plane: &DrawnPlane,
        descriptors: &Arc<Descriptors>,
        groups: [u32; 3],
    ) {
        for part in 0..self.parts(plane.slabs) {
            let first = part * self.slabs_per_dispatch;
            let count = (plane.slabs - first).min(self.slabs_per_dispatch);
            let order = plane.push.order | if first + count < plane.slabs { MORE } else { 0 };
            let push = BasePlanePush { first, count, order, ..plane.push };
            let pipeline = self.resume.as_ref().filter(|_| part > 0).unwrap_or(&self.first);
            recorder.dispatch(name, pipeline, descriptors, bytemuck::bytes_of(&push), groups);
        }
    }
}

/// The march of single pixels, whose bounds differ from those of the texels around them.
#[derive(Debug)]
pub(crate) struct EdgeMarch {
    pub(crate) march: March,
    /// One for each stack.
    pub(crate) descriptors: Vec<Arc<Descriptors>>,
}

impl EdgeMarch {
    /// Builds the march. `constants` and `stacks` are those of the march of texels.
    pub(crate) fn new(
        gpu: &Gpu,
        bounds: &ShearBounds,
        image: &Arc<Image>,
        knots: &Knots,
        constants: &[SpecConstant],
        stacks: Vec<Vec<(u32, Resource)>>,
        slabs_per_dispatch: u32,
    ) -> Result<Self> {
        let pipeline = |resume: bool| {
            let constants: Vec<SpecConstant> = constants
                .iter()
                .copied()
                .chain([(SPEC_RESUME, u32::from(resume)), (SPEC_EMPTY_SPACE, 0)])
                .collect();
            let desc = ComputeDesc { shader: &SHEAR_WARP_EDGE, constants: &constants };
            gpu.compute_pipeline(&format!("{NAME}.edge"), &desc)
        };
        let (first, resume) = (pipeline(false)?, pipeline(true)?);
        let mut descriptors = Vec::new();
        for mut resources in stacks {
            resources.retain(|(binding, _)| *binding != BINDING_BRICKS);
            resources.extend([
                (BINDING_BRICKS, Resource::Buffer(Arc::clone(&knots.buffer))),
                (BINDING_EDGES, Resource::ReadOnly(Arc::clone(&bounds.edge_pixels))),
                (BINDING_ACCUMULATION, Resource::Storage(Arc::clone(image))),
            ]);
            descriptors.push(Arc::new(Descriptors::new(gpu, &first, &resources)?));
        }
        Ok(Self { march: March { first, resume: Some(resume), slabs_per_dispatch }, descriptors })
    }
}
