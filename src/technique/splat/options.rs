//! Options that the techniques for splats share.

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::scene::{Data, Kernel, Kernels, Model, Scene};
use crate::technique::declare::{Resolution, Value, option_set, words};

words! {
    /// How the pixels of a tile are divided among invocations.
    #[derive(Default)]
    pub enum TileSplit {
        /// Chooses columns on software devices, else pixels.
        #[default]
        Auto = "auto",
        /// Each invocation draws a column of eight pixels.
        Columns = "columns",
        /// Each invocation draws one pixel.
        Pixels = "pixels",
    }
}

impl Value for Kernel {
    const WORDS: &'static [(&'static str, Self)] = &Self::ALL;
}

impl Value for Model {
    const WORDS: &'static [(&'static str, Self)] = &Self::ALL;
}

option_set! {
    /// The properties of kernels that options set; the scene decides the rest.
    pub struct KernelOptions {
        /// Selects the shape of each sample's kernel. On grids gaussian blurs, tent interpolates trilinearly, bspline and sinc
        /// interpolate smoothly. Points have gaussian or bspline.
        pub kernel: Option<Kernel> = None => Rule::words().unset("the scene's"),
        /// Sets the standard deviation of a grid's Gaussians, in voxels. Their sum ripples by 4.4e-2 at 0.5, 3.8e-4 at 0.7, 2e-8 at 1; a
        /// larger one blurs more.
        pub sigma: Option<f64> = None => Rule::between(Kernels::SIGMA).unset("the scene's, or 0.7"),
        /// Sets the distance at which Gaussians end, in standard deviations. The cost grows with its cube, the loss falls exponentially.
        pub cut: Option<f64> = None => Rule::between(Kernels::CUT).unset("the scene's, or 3"),
        /// Selects whether samples are classified, and their extinctions add up (density), or scalars are interpolated, then classified
        /// (interpolate).
        pub model: Option<Model> = None
            => Rule::words().unset("the scene's, or density for points and interpolate for grids and meshes"),
        /// Sets the least sum of weights that is visible, with model=interpolate.
        pub least: Option<f64> = None => Rule::between(Kernels::LEASTS).unset("the scene's, or 0.05"),
    }
}

option_set! {
    /// Options of the tiles that splats are binned to.
    pub struct TileOptions {
        /// Sets the largest colour that a ray may miss when it ends early: an absolute error.
        pub stop: f64 = 2.4e-7 => Rule::below_one(),
        /// Selects the pixels that are drawn: half and quarter draw one for each square of 2 x 2 or 4 x 4 and upsample the image. They blur
        /// edges; where the image is smooth their error is of third order. They refuse surfaces and depth images.
        pub resolution: Resolution = Resolution::Full => Rule::words().quiet(),
        /// Sets the most entries of bins at a time. An image with more is drawn in several bands of tiles.
        pub pairs: Option<u32> = None => Rule::whole(64, u32::MAX).unset("as many as a buffer holds"),
        /// Selects the pixels that an invocation draws. columns: a column of eight, which share what is read of a splat; pixels: one,
        /// which fills the subgroups of a GPU; auto: columns on software devices, else pixels. The image is the same but for rounding.
        pub spread: TileSplit = TileSplit::Auto => Rule::words().quiet(),
    }
}

option_set! {
    /// Options that the techniques for kernels share.
    pub struct SplatOptions {
        /// Sets the thickness of slabs: for grids in units of the smallest voxel spacing, for points in median standard deviations. The
        /// error is of second order, at jumps of the transfer function of first.
        pub step: f64 = 1.0 => Rule::positive(),
        /// Sets the parts of the image, of whole rows of tiles, that are drawn one after the other with the kernels that reach them, so that the
        /// device needs room for these alone. auto takes one where there is room for all, else as many as it takes. The image is the same.
        pub parts: Option<u32> = None => Rule::whole(1, 4096).or("auto", None).quiet(),
        /// Properties of kernels that replace the scene's.
        pub kernels: KernelOptions = KernelOptions::default() => GROUP,
        /// Options of tiles, which all techniques for splats have.
        pub tiles: TileOptions = TileOptions::default() => GROUP,
    }
}

impl TileOptions {
    /// Returns whether the pixels of a tile are drawn in columns.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] for `spread=columns` on a device that cannot share words in a subgroup of eight.
    pub(crate) fn columns(&self, name: &str, gpu: &Gpu) -> Result<bool> {
        // A software device runs the lanes of a workgroup in step, and reads what they share once. On a GPU a column
        // would leave most lanes of a subgroup idle.
        Ok(match self.spread {
            TileSplit::Auto => gpu.emulates_groups() && gpu.eight_share_words(),
            TileSplit::Pixels => false,
            TileSplit::Columns if gpu.eight_share_words() => true,
            TileSplit::Columns => {
                return Err(Error::unsupported(
                    format!("{name} spread=columns"),
                    "subgroups of eight invocations that share words",
                ));
            }
        })
    }
}

impl KernelOptions {
    /// Returns `kernels` with the properties that options set replaced.
    fn over(&self, kernels: Kernels) -> Kernels {
        Kernels {
            kernel: self.kernel.unwrap_or(kernels.kernel),
            sigma: self.sigma.unwrap_or(kernels.sigma),
            cut: self.cut.unwrap_or(kernels.cut),
            model: self.model.unwrap_or(kernels.model),
            least: self.least.unwrap_or(kernels.least),
        }
    }

    /// Returns the kernels of a scene.
    ///
    /// Options come first, then the scene's own kernels, then `usual` for grids and meshes and [`Kernels::of_points`]
    /// for points.
    pub(crate) fn of(&self, scene: &Scene, usual: Kernels) -> Result<Kernels> {
        let usual = match scene.data {
            Data::Points(_) => Kernels::of_points(),
            Data::Mesh(_) => Kernels { kernel: Kernel::Gaussian, ..usual },
            Data::Grid(_) | Data::Gaussians(_) => usual,
        };
        let kernels = self.over(scene.kernels.unwrap_or(usual));
        kernels.check()?;
        Ok(kernels)
    }
}
