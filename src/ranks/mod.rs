//! Several processes that draw one image: each draws what its box of space owns, and the images are composited in visibility order.
//!
//! 1. [`KdTree`] cuts space into a box per rank, of about the same visible work each. Every rank builds the same one from the scene.
//! 2. A rank draws the view that [`View::with_owned`] gives its box. Of a mesh it needs [`KdTree::part`]. Of a grid whose samples are read on demand it reads the pages that the box
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
#[cfg(feature = "mpi")]
mod mpi;
mod tree;

pub use communicator::{Communicator, Counted, Threads, agree};
pub use composite::composite;
#[cfg(feature = "mpi")]
pub use mpi::Mpi;
pub use tree::KdTree;

use std::sync::Arc;
use std::time::Instant;

use crate::error::Result;
use crate::image::Image;
use crate::num;
use crate::resident::GpuScene;
use crate::scene::View;
use crate::technique::{FrameTime, Renderer, Technique};

/// A rank's part of drawing an image.
#[derive(Debug)]
pub struct Rendered {
    /// The whole image, on rank 0.
    pub image: Option<Image>,
    /// The frame of this rank's box, whose counters tell the bytes that it has read.
    pub frame: FrameTime,
    /// Milliseconds from the end of the frame to the end of compositing, in which a rank waits for slower ones.
    pub composite_ms: f64,
}

/// Draws a view with all ranks of a communicator, each of which has the same arguments but for the contents of sources of samples.
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
) -> Result<Rendered> {
    let draw = || {
        let [low, high] = tree.boxes()[num::index(ranks.rank())];
        let view = view.with_owned(low, high)?;
        let mut frames = Renderer::new(scene, technique).frames(&view)?;
        let frame = frames.draw(&view)?;
        Ok((frame, frames.read_back()?))
    };
    let drawn = draw();
    let begin = Instant::now();
    let (frame, image) = agree(ranks, drawn)?;
    let image = composite(&image, &tree.order(view), ranks)?;
    Ok(Rendered { image, frame, composite_ms: begin.elapsed().as_secs_f64() * 1e3 })
}
