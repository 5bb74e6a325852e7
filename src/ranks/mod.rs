//! Several processes that draw one image: each draws what its box of space owns, and the images are composited in visibility order.
//!
//! 1. [`KdTree`] cuts space into a box per rank, of about the same visible work each. Every rank builds the same one from the scene.
//!    Where no boxes own what is drawn (kernels overlap, surfaces, maximum intensity projection) each rank draws a rectangle of the image in
//!    place of a box ([`Shares`]).
//! 2. A rank draws the view that [`View::with_owned`] gives its box. Of a mesh it needs the cells there alone ([`Shares::part`]). Of a
//!    grid whose samples are read on demand it reads the pages that its pieces of rays meet; so a rank may also hold a part of the data
//!    alone, behind a source of its own ([`SampleSource`](crate::scene::SampleSource)).
//! 3. [`composite()`] exchanges pieces of the images, of active pixels only, in rounds of ranks that are neighbours in visibility order
//!    (radix-k), and gathers the whole on rank 0.
//!
//! The image is that of one process to float32's rounding, since boxes share out the same pieces of rays. Processes speak through a
//! [`Communicator`]: `mpi::Mpi` (feature `mpi`), [`Threads`] for ranks that are threads of one process, or the caller's.
//!
//! Source: Peterka et al., A Configurable Algorithm for Parallel Image-Compositing Applications, SC 2009 (radix-k).

mod communicator;
mod composite;
#[cfg(feature = "mpi")]
mod mpi;
mod tiles;
mod tree;

pub use communicator::{Communicator, Counted, Threads, agree, gather};
pub use composite::composite;
#[cfg(feature = "mpi")]
pub use mpi::Mpi;
pub use tiles::Tiles;
pub use tree::KdTree;

use std::sync::Arc;
use std::time::Instant;

use crate::error::{Error, Result};
use crate::image::Image;
use crate::num;
use crate::ranks::composite::joined;
use crate::ranks::tiles::Rectangle;
use crate::resident::GpuScene;
use crate::scene::{Data, Mode, Scene, View};
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

/// How ranks share the work of a view.
#[derive(Clone, Debug)]
pub enum Shares {
    /// Each draws what a box of space owns, of this view and of others.
    Space(KdTree),
    /// Each draws a rectangle of the image of this view, where no boxes own what is drawn.
    Image(Tiles),
}

impl Shares {
    /// Cuts space, or the image, into shares of about the same work, one per rank. Equal arguments give equal shares.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for no ranks, and for so many that the image has no rows and columns to share out; of trained splats no rows and columns
    /// of 16 pixels.
    pub fn new(scene: &Scene, view: &View, ranks: u32) -> Result<Self> {
        match &scene.data {
            Data::Grid(_) | Data::Mesh(_)
                if scene.kernels.is_none() && scene.surfaces.is_empty() && scene.mode != Mode::Maximum =>
            {
                KdTree::new(scene, view, ranks).map(Self::Space)
            }
            _ => Tiles::new(scene, view, ranks).map(Self::Image),
        }
    }

    /// Returns what a rank needs of a scene: of a mesh the cells that meet its box, of points those whose kernels may reach its rectangle, else
    /// the whole.
    #[must_use]
    pub fn part(&self, scene: &Scene, view: &View, rank: u32) -> Scene {
        match (self, &scene.data) {
            (Self::Space(tree), Data::Mesh(mesh)) => {
                let part = mesh.near_box(tree.boxes()[num::index(rank)]);
                Scene { data: part.into(), ..scene.clone() }
            }
            (Self::Image(tiles), Data::Points(points)) => {
                Scene { data: tiles.part(points, view, rank).into(), ..scene.clone() }
            }
            _ => scene.clone(),
        }
    }

    /// Returns the number of shares.
    fn count(&self) -> u32 {
        match self {
            Self::Space(tree) => num::count(tree.boxes().len()),
            Self::Image(tiles) => tiles.count(),
        }
    }

    /// Returns the view that a rank draws.
    fn view(&self, view: &View, rank: u32) -> Result<View> {
        match self {
            Self::Space(tree) => {
                let [low, high] = tree.boxes()[num::index(rank)];
                view.with_owned(low, high)
            }
            Self::Image(tiles) => {
                if tiles.image != view.extent() {
                    let why = format!("of an image of {:?} pixels, not {:?}", tiles.image, view.extent());
                    return Err(Error::invalid("shares", why));
                }
                let Rectangle { corner, extent } = tiles.of(rank);
                view.part(corner.map(u32::cast_signed), extent)
            }
        }
    }
}

/// Draws a view with all ranks of a communicator, each of which has equal arguments but for what [`Shares::part`] leaves out of the scene and
/// for what sources of samples hold.
///
/// # Errors
///
/// Those of [`View::with_owned`] and [`Renderer::render`] of any rank, on all of them, and those of the communicator.
pub fn render(
    scene: &Arc<GpuScene>,
    technique: Technique,
    view: &View,
    shares: &Shares,
    ranks: &dyn Communicator,
) -> Result<Rendered> {
    let draw = || {
        if shares.count() != ranks.size() {
            let why = format!("{} for {} ranks", shares.count(), ranks.size());
            return Err(Error::invalid("shares", why));
        }
        let view = shares.view(view, ranks.rank())?;
        let renderer = Renderer::new(scene, technique);
        if let Shares::Image(_) = shares {
            renderer.check_rectangle()?;
        }
        let mut frames = renderer.frames(&view)?;
        let frame = frames.draw(&view)?;
        Ok((frame, frames.read_back()?))
    };
    let drawn = draw();
    let begin = Instant::now();
    let (frame, image) = agree(ranks, drawn)?;
    let image = match shares {
        Shares::Space(tree) => composite(image, &tree.order(view), ranks)?,
        Shares::Image(tiles) => joined(&image, tiles, view.extent(), ranks)?,
    };
    Ok(Rendered { image, frame, composite_ms: begin.elapsed().as_secs_f64() * 1e3 })
}
