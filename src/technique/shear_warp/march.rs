//! Marches through the slabs of a base plane, in as many dispatches as the device needs.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::shader::MARCH_CONTINUES;
use crate::gpu::{Bound, Descriptors, Gpu, Pipeline, Recorder};
use crate::interface::BasePlanePush;
use crate::primitives::dispatch::tiles_of;
use crate::technique::grid::paging::Paging;
use crate::technique::shear_warp::options::NAME;
use crate::technique::shear_warp::planes::DrawnPlane;

/// A bit of `BasePlanePush::order`: another dispatch follows.
const MORE: u32 = MARCH_CONTINUES;

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

impl March {
    /// Records the march of a base plane through a grid in pages: each ray goes on from where it is, and `resumes` from the last recording.
    pub(crate) fn record_paged(
        &self,
        recorder: &mut Recorder<'_>,
        name: &str,
        plane: &DrawnPlane,
        descriptors: &Arc<Descriptors>,
        resumes: bool,
    ) {
        for part in 0..self.parts(plane.slabs) {
            let order = plane.push.order | Paging::march_order(resumes, part);
            let push = BasePlanePush { first: 0, count: self.slabs_per_dispatch, order, ..plane.push };
            let groups = tiles_of(plane.push.size);
            recorder.dispatch(name, &self.first, descriptors, bytemuck::bytes_of(&push), groups);
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
    /// Builds the march; `shaders` binds its shader for each stack, with the argument whether it continues a march.
    pub(crate) fn new(
        gpu: &Gpu,
        shaders: &[impl Fn(bool) -> Bound],
        slabs_per_dispatch: u32,
    ) -> Result<Self> {
        let Some(shader) = shaders.first() else { return Err(Error::invalid(NAME, "no stack")) };
        let name = format!("{NAME}.edge");
        let first = gpu.compute_pipeline(&name, &shader(false))?;
        let resume = Some(gpu.compute_pipeline(&name, &shader(true))?);
        let sets = shaders.iter().map(|shader| Descriptors::new(gpu, &first, &shader(false)).map(Arc::new));
        let descriptors = sets.collect::<Result<_>>()?;
        let march = March { first, resume, slabs_per_dispatch };
        Ok(Self { march, descriptors })
    }
}
