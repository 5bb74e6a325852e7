//! Options of `havs`.

use crate::error::Result;
use crate::technique::declare::draw::{Facts, Of, TechniqueOptions};
use crate::technique::declare::{Value, option_set, refused, words};
use crate::technique::mesh::options::{MeshOptions, Repair};

/// Largest `k` of the raster routes: seven pairs, and the one that left last, fill a texel of four images.
const MOST_K: u32 = 7;

words! {
    /// How faces reach the pixels.
    pub enum KBufferRoute {
        /// Chooses [`KBufferRoute::Compute`].
        Auto = "auto",
        /// Has each pixel walk through the faces of its tile, and keeps the k-buffer in registers.
        Compute = "compute",
        /// Rasterises faces; the k-buffer is in storage images, and `VK_EXT_fragment_shader_interlock` orders fragments.
        Interlock = "interlock",
        /// Rasterises without the extension, on drivers that are known to order the stores of fragments. Vulkan does not
        /// promise that order.
        ImplementationOrdered = "implementation-ordered",
    }
}

impl KBufferRoute {
    pub(crate) fn rasterises(self) -> bool {
        matches!(self, Self::Interlock | Self::ImplementationOrdered)
    }
}

option_set! {
    /// Options of `havs`.
    pub struct Options {
        /// Sets the pairs of the k-buffer: a face may come k places too early. The work for each fragment grows with k. Raster routes
        /// take at most 7. auto is 7, and 15 once many pixels of a mesh had to be drawn again with 7, or where a mesh is drawn in parts
        /// and memory allows it.
        pub k: Option<u32> = None => Rule::whole(1, 15).or("auto", None),
        /// Selects how faces reach the pixels; auto is compute. interlock rasterises the faces, and a Vulkan extension orders the
        /// fragments. implementation-ordered needs no extension but a driver that is known to keep their order, which Vulkan does not
        /// promise.
        pub route: KBufferRoute = KBufferRoute::Auto,
        /// Selects the treatment of pixels whose faces left the k-buffer out of order. exact draws them again from sorted lists; none
        /// leaves them wrong, but counts them.
        pub repair: Repair = Repair::Exact,
        /// Sets the faces of a tile that one dispatch takes, with route=compute. Storage images keep the k-buffer between two. The
        /// image is the same.
        pub chunk: Option<u32> = None => Rule::whole(1, 1_000_000).or("all", None).quiet(),
        /// Sets the parts of the mesh that are drawn one after the other, with route=compute, so that the device needs room for one at a time.
        /// auto takes one where there is room for all, else as many as it takes. With repair=exact the image is the same.
        pub parts: Option<u32> = None => Rule::whole(1, 4096).or("auto", None).quiet(),
        /// The options that techniques for meshes share.
        pub mesh: MeshOptions = MeshOptions::default() => GROUP,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "havs",
        summary: "faces of a mesh sorted approximately, then exactly by a k-buffer per pixel",
        source: "Callahan, Ikits, Comba and Silva 2005",
        data: &["mesh"],
        kernels: &[],
        routes: &["compute", "interlock", "implementation-ordered"],
        splits_rays: true,
        modes: &[],
        samples: &[
            ("mesh", "route=compute", [1e-6, 4e-6]),
            ("mesh", "route=compute,k=2,chunk=9", [1e-6, 4e-6]),
            ("mesh", "parts=5,k=3", [1e-6, 4e-6]),
            ("mesh", "resolution=half", [2e-2, 0.2]),
            ("mesh", "route=compute,k=3,integrator=integral,order=back-to-front", [2e-2, 0.2]),
            ("mesh", "route=interlock", [1e-6, 4e-6]),
            ("mesh", "route=implementation-ordered", [1e-6, 4e-6]),
        ],
        families: &[
            (Of::Meshes, "resolution=", &["quarter", "half"]),
            (Of::Meshes, "", &[""]),
            (Of::Meshes, "integrator=integral", &[""]),
        ],
    };

    fn check(&self) -> Result<()> {
        if self.route.rasterises() {
            let route = self.route.word();
            if let Some(k) = self.k.filter(|&k| k > MOST_K) {
                let why = format!("{k}: must be 1 to {MOST_K} with route={route}");
                return Err(refused(Self::NAME, "k", why));
            }
            if self.parts.is_some_and(|parts| parts > 1) {
                let why = format!("route={route} draws a mesh at once: leave it out");
                return Err(refused(Self::NAME, "parts", why));
            }
            if self.chunk.is_some() {
                let why = format!("route={route} has no dispatches to cut: leave it out");
                return Err(refused(Self::NAME, "chunk", why));
            }
        }
        self.mesh.check(Self::NAME)
    }
}
