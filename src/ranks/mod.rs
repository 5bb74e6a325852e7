//! Several processes that draw one image: each draws what its box of space owns, and the images are composited in visibility order.
//!
//! 1. [`KdTree`] cuts space into a box per rank, of about the same visible work each. Every rank builds the same one from the scene.
//! 2. A rank draws the view that [`View::with_owned`] gives its box. Of a grid whose samples are read on demand it reads the pages that the box
//!    meets and no others; so a rank may also hold a part of the data alone, behind a source of its own
//!    ([`SampleSource`](crate::scene::SampleSource)).
//! 3. [`composite`] exchanges pieces of the images, of active pixels only, in rounds of ranks that are neighbours in visibility order (radix-k), and
//!    gathers the whole on rank 0.
//!
//! The image is that of one process to float32's rounding, since boxes share out the same pieces of rays. Processes speak through a
//! [`Communicator`]: `mpi::Mpi` (feature `mpi`), [`Threads`] for ranks that are threads of one process, or the caller's.
//!
//! Source: Peterka et al., A Configurable Algorithm for Parallel Image-Compositing Applications, SC 2009 (radix-k).

mod communicator;
mod composite;
mod tree;

pub use communicator::{Communicator, Threads, agree};
pub use composite::composite;
pub use tree::KdTree;

use std::sync::Arc;

use crate::error::Result;
use crate::image::Image;
use crate::resident::GpuScene;
use crate::scene::View;
use crate::technique::{Renderer, Technique};

/// Draws a view with all ranks of a communicator, each of which has the same arguments but for the contents of sources of samples. Returns the
/// image on rank 0.
///
/// # Errors
///
/// Those of [`View::with_owned`] and [`Renderer::render`] of any rank, on all of them, and those of the communicator.
pub fn render(
    scene: &Arc<GpuScene>,
    technique: Technique,
    view: &View,
    tree: &KdTree,
    ranks: &dyn Communicator,
) -> Result<Option<Image>> {
    let [low, high] = tree.boxes()[crate::num::index(ranks.rank())];
    let drawn = view.with_owned(low, high).and_then(|view| Renderer::new(scene, technique).render(&view));
    let image = agree(ranks, drawn)?;
    composite(&image, &tree.order(view), ranks)
}
