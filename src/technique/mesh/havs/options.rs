//! Options of `havs`.

use crate::error::{Error, Result};
use crate::technique::mesh::options::{EMPTY_SPACE, INTEGRATOR, MeshOptions, ORDER, Repair, SMOKE, STOP};
use crate::technique::options::{self, Choice, OptionInfo, TABLE};

pub(crate) const NAME: &str = "havs";

/// Largest `k` of the raster routes: seven pairs, and the one that left last, fill a texel of four images.
const MOST_K: u32 = 7;

/// The options, each with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "k",
        values: "1 to 15",
        default: "7",
        effect: "pairs of the k-buffer: a face may come k places too early; the work for each fragment grows with k; at most 7 with a raster route",
    },
    OptionInfo {
        key: "route",
        values: "auto|compute|interlock|implementation-ordered",
        default: "auto",
        effect: "auto: compute. interlock rasterises the faces, and a Vulkan extension orders the fragments; implementation-ordered needs no extension but a driver that is known to keep their order, which Vulkan does not promise",
    },
    OptionInfo {
        key: "repair",
        values: "exact|none",
        default: "exact",
        effect: "pixels whose faces left the k-buffer out of order: exact draws them again from sorted lists; none leaves them wrong, but counts them",
    },
    OptionInfo {
        key: "chunk",
        values: "1 to 1000000",
        default: "all",
        effect: "with route=compute: faces of a pixel that one dispatch takes; storage images keep the k-buffer between two. The image is the same",
    },
    INTEGRATOR,
    TABLE,
    SMOKE,
    ORDER,
    STOP,
    EMPTY_SPACE,
];

/// How faces reach the pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KBufferRoute {
    /// Chooses [`KBufferRoute::Compute`].
    Auto,
    /// Lists the faces of each pixel, and keeps the k-buffer in registers.
    Compute,
    /// Rasterises faces; the k-buffer is in storage images, and `VK_EXT_fragment_shader_interlock` orders fragments.
    Interlock,
    /// Rasterises without the extension, on drivers that are known to order the stores of fragments. Vulkan does not
    /// promise that order.
    ImplementationOrdered,
}

impl Choice for KBufferRoute {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("auto", Self::Auto),
        ("compute", Self::Compute),
        ("interlock", Self::Interlock),
        ("implementation-ordered", Self::ImplementationOrdered),
    ];
}

impl KBufferRoute {
    pub(crate) fn rasterises(self) -> bool {
        matches!(self, Self::Interlock | Self::ImplementationOrdered)
    }
}

/// Options of `havs`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The options that techniques for meshes share.
    pub mesh: MeshOptions,
    /// Pairs of the k-buffer, 1 to 15.
    pub k: u32,
    /// How faces reach the pixels.
    pub route: KBufferRoute,
    /// Treatment of pixels whose faces were not sorted.
    pub repair: Repair,
    /// Faces of a pixel that one dispatch takes; `None`: all.
    pub chunk: Option<u32>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            mesh: MeshOptions::default(),
            k: 7,
            route: KBufferRoute::Auto,
            repair: Repair::Exact,
            chunk: None,
        }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            match key.as_str() {
                "k" => options.k = options::whole(NAME, key, text, 1..=15)?,
                "route" => options.route = options::choice(NAME, key, text)?,
                "repair" => options.repair = options::choice(NAME, key, text)?,
                "chunk" if text == "all" => options.chunk = None,
                "chunk" => options.chunk = Some(options::whole(NAME, key, text, 1..=1_000_000)?),
                _ if options.mesh.read(NAME, key, text)? => {}
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        options.check()?;
        Ok(options)
    }

    /// Refuses values and combinations that are not allowed.
    pub(crate) fn check(&self) -> Result<()> {
        options::whole(NAME, "k", &self.k.to_string(), 1..=15)?;
        if self.route.rasterises() {
            let refuse = |key: &str, why: String| Err(Error::invalid(format!("{NAME} option {key}"), why));
            let route = self.route.word();
            if self.k > MOST_K {
                return refuse("k", format!("{}: must be 1 to {MOST_K} with route={route}", self.k));
            }
            if self.chunk.is_some() {
                return refuse("chunk", format!("route={route} has no dispatches to cut: leave it out"));
            }
        }
        self.mesh.check(NAME)
    }

    /// Returns the options as text that [`Options::parse`] reads back; options that are unset are left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = vec![
            ("k", self.k.to_string()),
            ("route", self.route.word().to_string()),
            ("repair", self.repair.word().to_string()),
        ];
        pairs.extend(self.chunk.map(|chunk| ("chunk", chunk.to_string())));
        pairs.extend(self.mesh.pairs());
        pairs
    }
}
