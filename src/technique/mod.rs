//! Techniques: the registry, and the two steps that draw, [`Renderer::prepare`] and [`Plan::record`].
//!
//! [`Renderer::render`] does both and waits. An engine does them itself:
//!
//! ```no_run
//! # use volraster::ash::vk;
//! # use volraster::gpu::{CommandBuffer, Gpu, TargetImage};
//! # use volraster::scene::View;
//! # use volraster::{GpuScene, Renderer, Result, TargetDesc, TargetMode, Technique};
//! # use std::sync::Arc;
//! # fn frame(
//! #     gpu: &Gpu, scene: &Arc<GpuScene>, view: &View, commands: vk::CommandBuffer, image: vk::Image,
//! #     image_view: vk::ImageView, extent: [u32; 2],
//! # ) -> Result<()> {
//! // Once: may allocate, compile, upload, submit and wait.
//! let renderer = Renderer::new(scene, Technique::parse("slices-3d:step=0.5")?);
//! let format = vk::Format::B8G8R8A8_SRGB;
//! let mut plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
//!
//! // Each frame: only records, into the engine's own command buffer and image.
//! if !plan.set_view(view)? {
//!     plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
//! }
//! // SAFETY: the command buffer is recording, on this thread, for this device's queue family.
//! let mut commands = unsafe { CommandBuffer::from_raw(gpu, commands) };
//! // SAFETY: the image is in the layout COLOR_ATTACHMENT_OPTIMAL and outlives the submission.
//! let target = unsafe { TargetImage::from_raw(gpu, image, image_view, format, extent) };
//! let recorded = plan.record(&mut commands, Some(&target), None)?;
//!
//! // The engine submits, and later sees the submission end.
//! let status = recorded.completed()?;
//! for pass in status.passes {
//!     println!("{}: {:.3} ms", pass.name, pass.ms);
//! }
//! # Ok(())
//! # }
//! ```

pub mod abuffer;
mod base_planes;
mod bins;
mod blue_noise;
mod bricks;
mod composite;
mod factorisation;
mod footprint;
mod gpu_scene;
mod grid_frame;
pub mod grid_options;
mod grid_rays;
pub mod havs;
mod havs_raster;
mod line_bounds;
mod mesh_data;
mod mesh_frame;
pub mod mesh_options;
mod mesh_overlaps;
mod mesh_view;
mod mips;
mod offscreen;
mod options;

pub(crate) mod order;
mod passes;
pub mod projected_tets;

mod radix_sort;
mod ranks;
pub mod raycast;

mod scan;
mod shear_bounds;
mod shear_faces;
mod shear_frame;
mod shear_march;
pub mod shear_warp;
pub mod slabs;
pub mod slices_2d;
pub mod slices_3d;
mod splat_data;
pub mod splat_ewa;
mod splat_frame;
pub mod splat_options;
pub mod splat_sheets;
mod splat_template;
mod surfaces;
mod tets_raster;

pub(crate) mod topology;

use std::sync::Arc;
use std::time::Instant;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::Image as Picture;
use crate::gpu::shader::{
    BINDING_LINE_BOUNDS, FLAG_REPAIRED, FLAG_UNSORTED, SPEC_BOUNDED, SPEC_LAYERS, TILE, TILE_PIXELS,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Buffer, BufferUse, CommandBuffer, Commands, DepthImage, Gpu, Image, Keep, PassTime, Recorder, Resource,
    SpecConstant, TargetImage, Timers,
};
use crate::num;
use crate::scene::{Data, Kernel, Scene, Surface, View};

use composite::Composite;
pub use footprint::GridBytes;
pub use gpu_scene::{GpuScene, UploadTimes};
use grid_frame::GridFrame;
use line_bounds::{DepthMeasure, LineBounds};
pub use offscreen::Offscreen;
pub use options::OptionInfo;
use surfaces::{Layers, SurfaceData, SurfaceFrame, SurfaceLists};

/// A technique.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// Stacks of 2D-textured slices.
    Slices2d,
    /// View-aligned slices of a 3D texture.
    Slices3d,
    /// Pre-integrated slabs between view-aligned slices.
    Slabs,
    /// Slices composited in a base plane, and warped to the image.
    ShearWarp,
    /// Image-order ray casting.
    Raycast,
    /// Hardware-assisted visibility sorting of a mesh's faces.
    Havs,
    /// Exact lists of a mesh's cells, sorted pixel by pixel.
    Abuffer,
    /// Projected tetrahedra.
    ProjectedTets,
    /// Sheet buffers of splats.
    SplatSheets,
    /// Gaussian splats: elliptical weighted averages, or exact along each line.
    SplatEwa,
}

impl Method {
    /// Every technique.
    pub const ALL: [Self; 10] = [
        Self::Slices2d,
        Self::Slices3d,
        Self::Slabs,
        Self::ShearWarp,
        Self::Raycast,
        Self::ProjectedTets,
        Self::Havs,
        Self::Abuffer,
        Self::SplatSheets,
        Self::SplatEwa,
    ];

    /// The technique of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the names that there are.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|method| method.name()).collect();
            Error::invalid("technique", format!("\"{name}\": must be one of {}", names.join(", ")))
        })
    }

    /// The name in scene files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Slices2d => "slices-2d",
            Self::Slices3d => "slices-3d",
            Self::Slabs => "slabs",
            Self::ShearWarp => "shear-warp",
            Self::Raycast => "raycast",
            Self::Havs => "havs",
            Self::Abuffer => "abuffer",
            Self::ProjectedTets => "projected-tets",
            Self::SplatSheets => "splat-sheets",
            Self::SplatEwa => "splat-ewa",
        }
    }

    /// One line on what it does.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Slices2d => "stacks of 2D-textured slices parallel to the base plane, post-classified",
            Self::Slices3d => "view-aligned slices of a 3D texture, post-classified (Cabral 1994)",
            Self::Slabs => "view-aligned slabs, the transfer function integrated across each (Engel 2001)",
            Self::ShearWarp => "slices composited in a base plane, and warped to the image (Lacroute 1994)",
            Self::Raycast => "image-order ray casting, what the others are compared with (Levoy 1988)",
            Self::Havs => "faces of a mesh nearly sorted, put in order by a k-buffer a pixel (Callahan 2005)",
            Self::Abuffer => "cells of a mesh in a list a pixel, sorted: exact (Carpenter 1984)",
            Self::ProjectedTets => {
                "cells of a mesh sorted, projected and integrated one by one (Shirley 1990)"
            }
            Self::SplatSheets => {
                "kernels added up in sheets, the sheets composited (Westover 1990, Mueller 1998)"
            }
            Self::SplatEwa => {
                "Gaussian splats, elliptical weighted averages or exact along lines (Zwicker 2001)"
            }
        }
    }

    /// Its options.
    #[must_use]
    pub fn options(self) -> &'static [OptionInfo] {
        match self {
            Self::Slices2d => slices_2d::OPTIONS,
            Self::Slices3d => slices_3d::OPTIONS,
            Self::Slabs => slabs::OPTIONS,
            Self::ShearWarp => shear_warp::OPTIONS,
            Self::Raycast => raycast::OPTIONS,
            Self::Havs => havs::OPTIONS,
            Self::Abuffer => abuffer::OPTIONS,
            Self::ProjectedTets => projected_tets::OPTIONS,
            Self::SplatSheets => splat_sheets::OPTIONS,
            Self::SplatEwa => splat_ewa::OPTIONS,
        }
    }

    /// Whether it draws data of this kind; [`Method::draws_scene`] asks for kernels, too.
    #[must_use]
    pub fn draws(self, data: &Data) -> bool {
        match self {
            Self::Slices2d | Self::Slices3d | Self::Slabs | Self::ShearWarp | Self::Raycast => {
                matches!(data, Data::Grid(_))
            }
            Self::ProjectedTets | Self::Havs | Self::Abuffer => matches!(data, Data::Mesh(_)),
            Self::SplatSheets => matches!(data, Data::Grid(_) | Data::Points(_)),
            Self::SplatEwa => true,
        }
    }

    /// Whether it draws a scene: data of this kind, kernels where the scene has such, and translucent surfaces. A scene without kernels
    /// is drawn also by what has kernels of its own, blurred by them.
    #[must_use]
    pub fn draws_scene(self, scene: &Scene) -> bool {
        self.draws(&scene.data)
            && (self.draws_translucent_surfaces() || !scene.surfaces.iter().any(Surface::is_translucent))
            && match (self, &scene.kernels) {
                (_, None) | (Self::SplatSheets, Some(_)) => true,
                (Self::SplatEwa, Some(kernels)) => kernels.kernel == Kernel::Gaussian,
                _ => false,
            }
    }

    /// Whether the field that it draws of a scene is the one that the reference draws: what has kernels of its own draws
    /// another of a scene without.
    #[must_use]
    pub fn fits(self, scene: &Scene) -> bool {
        let has_kernels = scene.kernels.is_some() || scene.points().is_some();
        self.draws_scene(scene) && (has_kernels || self != Self::SplatEwa)
    }

    /// Whether lines are cut at translucent surfaces: others blend whole splats or cells, or lines that several pixels share.
    #[must_use]
    pub fn draws_translucent_surfaces(self) -> bool {
        match self {
            Self::Slices2d | Self::Slices3d | Self::Slabs | Self::Raycast | Self::Havs | Self::Abuffer => {
                true
            }
            Self::ShearWarp | Self::ProjectedTets | Self::SplatSheets | Self::SplatEwa => false,
        }
    }

    /// Whether it draws a scene with such surfaces.
    fn check_surfaces(self, surfaces: &SurfaceData, data: &Data) -> Result<()> {
        if !surfaces.translucent || self.draws_translucent_surfaces() {
            return Ok(());
        }
        let others =
            Self::ALL.into_iter().filter(|method| method.draws_translucent_surfaces() && method.draws(data));
        let names: Vec<&str> = others.map(Self::name).collect();
        let instead = if names.is_empty() {
            format!("no technique for {} does", data.kind())
        } else {
            format!("{} do", names.join(", "))
        };
        let why = format!("{} draws no translucent surfaces: {instead}", self.name());
        Err(Error::invalid("technique", why))
    }

    /// The technique that draws a scene where none is asked for; `None` where none does.
    #[must_use]
    pub fn default_for(scene: &Scene) -> Option<Self> {
        // Before what draws the scene's data without its kernels.
        let first = match (&scene.data, &scene.kernels) {
            (Data::Points(_), _) | (_, Some(_)) => Self::SplatEwa,
            (Data::Mesh(_), None) => Self::Havs,
            (Data::Grid(_), None) => Self::Slices3d,
        };
        std::iter::once(first).chain(Self::ALL).find(|method| method.draws_scene(scene))
    }

    /// The routes that a device may offer, by name.
    #[must_use]
    pub fn routes(self) -> &'static [&'static str] {
        match self {
            Self::Slices2d | Self::Slices3d | Self::Slabs | Self::ShearWarp | Self::ProjectedTets => {
                &["raster", "compute"]
            }
            Self::Havs => &["compute", "interlock", "implementation-ordered"],
            Self::Raycast | Self::Abuffer | Self::SplatSheets | Self::SplatEwa => &["compute"],
        }
    }
}

/// A technique with its options.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Technique {
    /// Stacks of 2D-textured slices.
    Slices2d(slices_2d::Options),
    /// View-aligned slices of a 3D texture.
    Slices3d(slices_3d::Options),
    /// Pre-integrated slabs between view-aligned slices.
    Slabs(slabs::Options),
    /// Slices composited in a base plane, and warped to the image.
    ShearWarp(shear_warp::Options),
    /// Image-order ray casting.
    Raycast(raycast::Options),
    /// Hardware-assisted visibility sorting.
    Havs(havs::Options),
    /// Exact lists of cells.
    Abuffer(abuffer::Options),
    /// Projected tetrahedra.
    ProjectedTets(projected_tets::Options),
    /// Sheet buffers of splats.
    SplatSheets(splat_sheets::Options),
    /// Gaussian splats.
    SplatEwa(splat_ewa::Options),
}

impl Technique {
    /// A technique with the given options; the others have their defaults.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming option, value and range.
    pub fn new(method: Method, options: &[(String, String)]) -> Result<Self> {
        Ok(match method {
            Method::Slices2d => Self::Slices2d(slices_2d::Options::parse(options)?),
            Method::Slices3d => Self::Slices3d(slices_3d::Options::parse(options)?),
            Method::Slabs => Self::Slabs(slabs::Options::parse(options)?),
            Method::ShearWarp => Self::ShearWarp(shear_warp::Options::parse(options)?),
            Method::Raycast => Self::Raycast(raycast::Options::parse(options)?),
            Method::Havs => Self::Havs(havs::Options::parse(options)?),
            Method::Abuffer => Self::Abuffer(abuffer::Options::parse(options)?),
            Method::ProjectedTets => Self::ProjectedTets(projected_tets::Options::parse(options)?),
            Method::SplatSheets => Self::SplatSheets(splat_sheets::Options::parse(options)?),
            Method::SplatEwa => Self::SplatEwa(splat_ewa::Options::parse(options)?),
        })
    }

    /// Reads `NAME[:key=value,...]`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming what is wrong.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        let method = Method::from_name(name)?;
        let pair = |pair: &str| {
            let (key, value) = pair.split_once('=').ok_or_else(|| {
                Error::invalid(format!("{name} option"), format!("\"{pair}\": must be key=value"))
            })?;
            Ok((key.trim().to_string(), value.trim().to_string()))
        };
        let pairs: Result<Vec<_>> = rest.split(',').filter(|p| !p.trim().is_empty()).map(pair).collect();
        Self::new(method, &pairs?)
    }

    /// Which technique it is.
    #[must_use]
    pub fn method(&self) -> Method {
        match self {
            Self::Slices2d(_) => Method::Slices2d,
            Self::Slices3d(_) => Method::Slices3d,
            Self::Slabs(_) => Method::Slabs,
            Self::ShearWarp(_) => Method::ShearWarp,
            Self::Raycast(_) => Method::Raycast,
            Self::Havs(_) => Method::Havs,
            Self::Abuffer(_) => Method::Abuffer,
            Self::ProjectedTets(_) => Method::ProjectedTets,
            Self::SplatSheets(_) => Method::SplatSheets,
            Self::SplatEwa(_) => Method::SplatEwa,
        }
    }

    /// Every option in force.
    #[must_use]
    pub fn option_pairs(&self) -> Vec<(&'static str, String)> {
        match self {
            Self::Slices2d(options) => options.pairs(),
            Self::Slices3d(options) => options.pairs(),
            Self::Slabs(options) => options.pairs(),
            Self::ShearWarp(options) => options.pairs(),
            Self::Raycast(options) => options.pairs(),
            Self::Havs(options) => options.pairs(),
            Self::Abuffer(options) => options.pairs(),
            Self::ProjectedTets(options) => options.pairs(),
            Self::SplatSheets(options) => options.pairs(),
            Self::SplatEwa(options) => options.pairs(),
        }
    }

    /// Fixes what a frame needs.
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        let splats = matches!(self, Self::SplatSheets(_) | Self::SplatEwa(_));
        if splats && !self.method().draws(&scene.scene().data) {
            let (name, kind) = (self.method().name(), scene.scene().data.kind());
            let why = format!("{name} draws grids and points: the scene holds a {kind}");
            return Err(Error::invalid("technique", why));
        }
        if scene.scene().kernels.is_some() && !splats {
            let linear = if scene.scene().mesh().is_some() { "linear cells" } else { "trilinear grids" };
            let why = format!("{} draws {linear}: the scene has kernels", self.method().name());
            return Err(Error::invalid("technique", why));
        }
        let grid = |technique: Box<dyn grid_frame::GridTechnique>| -> Result<Box<dyn Prepared>> {
            Ok(Box::new(GridFrame::new(scene, view, target, technique)?))
        };
        match *self {
            Self::Slices2d(options) => grid(Box::new(options)),
            Self::Slices3d(options) => grid(Box::new(options)),
            Self::Slabs(options) => grid(Box::new(options)),
            Self::ShearWarp(options) => options.prepare(scene, view, target),
            Self::Raycast(options) => grid(Box::new(options)),
            Self::Havs(options) => options.prepare(scene, view, target),
            Self::Abuffer(options) => options.prepare(scene, view, target),
            Self::ProjectedTets(options) => options.prepare(scene, view, target),
            Self::SplatSheets(options) => options.prepare(scene, view, target),
            Self::SplatEwa(options) => options.prepare(scene, view, target),
        }
    }
}

impl Default for Technique {
    fn default() -> Self {
        Self::Slices3d(slices_3d::Options::default())
    }
}

/// What a technique has fixed for frames of one size.
pub(crate) trait Prepared: std::fmt::Debug + Send + Sync {
    /// Turns to another view of the same image size. `false`, and nothing is changed, when there is no room
    /// for it in `most_passes` passes.
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool>;
    /// How it measures depth.
    fn measure(&self) -> DepthMeasure;
    /// The image that the technique draws into, when that is not the caller's.
    fn image(&self) -> Option<&Arc<Image>>;
    /// A word for each pixel, tile by tile, that a frame leaves 0 where the list of the pixel was sorted as it came;
    /// `None` where nothing is sorted.
    fn overflow(&self) -> Option<&Arc<Buffer>> {
        None
    }
    /// How a frame leaves image and words.
    fn last_use(&self) -> Use;
    /// How it draws.
    fn route(&self) -> &'static str;
    /// Passes of one frame.
    fn passes(&self) -> u32;
    /// Work of a frame that is known before it is drawn.
    fn counters(&self) -> Vec<(&'static str, u64)>;
    /// Records a frame into the own image, or into `target` where there is none. `clear` begins with
    /// transparent black.
    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool);
    /// Where a frame's status can be read when it has ended.
    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        None
    }
}

/// What a frame tells of itself when it has ended.
pub(crate) trait Outcome: std::fmt::Debug + Send + Sync {
    /// Whether everything was drawn, and work counted on the device.
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)>;
}

/// What becomes of what the caller's image holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetMode {
    /// Replaced: transparent black where the volume is not.
    Clear,
    /// Covered: the volume is composited over it.
    Over,
}

/// Where a plan draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TargetDesc {
    caller: Option<(vk::Format, TargetMode)>,
    depth: bool,
}

impl TargetDesc {
    /// Into an image of the plan's own, to be read back.
    #[must_use]
    pub fn own() -> Self {
        Self { caller: None, depth: false }
    }

    /// Into a colour image of the caller, of the view's extent. Values are premultiplied linear RGBA; an
    /// sRGB format encodes them.
    #[must_use]
    pub fn caller(format: vk::Format, mode: TargetMode) -> Self {
        Self { caller: Some((format, mode)), depth: false }
    }

    /// The same with a depth image in each recording: nothing behind what it shows is drawn, and what passes through it is cut
    /// there, along each pixel's line.
    #[must_use]
    pub fn with_depth(self) -> Self {
        Self { depth: true, ..self }
    }

    fn format(&self) -> Option<vk::Format> {
        self.caller.map(|(format, _)| format)
    }

    fn mode(&self) -> TargetMode {
        self.caller.map_or(TargetMode::Clear, |(_, mode)| mode)
    }
}

/// What a technique is to draw into, and between which depths of each pixel's line.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    target: TargetDesc,
    /// Two depths a pixel, where anything bounds lines.
    bounds: Option<Arc<Buffer>>,
    /// Translucent surfaces.
    layers: Option<Layers>,
    /// Whether what is drawn is put before opaque surfaces, in an image of its own.
    behind: bool,
}

impl Canvas {
    fn format(&self) -> Option<vk::Format> {
        self.target.format()
    }

    fn mode(&self) -> TargetMode {
        self.target.mode()
    }

    /// The bounds of lines as a shader binds them; what is there anyway, for variants that do not read any.
    fn bounds(&self, unread: &Arc<Buffer>) -> [(u32, Resource); 1] {
        [(BINDING_LINE_BOUNDS, Resource::ReadOnly(Arc::clone(self.bounds.as_ref().unwrap_or(unread))))]
    }

    /// The translucent surfaces of pixels as a shader binds them, with the same stand-in.
    fn layers(&self, unread: &Arc<Buffer>) -> [(u32, Resource); 4] {
        Layers::bound(self.layers.as_ref(), unread)
    }

    /// Whether there are any.
    fn layered(&self) -> SpecConstant {
        (SPEC_LAYERS, u32::from(self.layers.is_some()))
    }

    /// Refuses a way to draw that cannot cut lines at translucent surfaces.
    fn refuse_layers(&self, what: &str, instead: &str) -> Result<()> {
        if self.layers.is_none() {
            return Ok(());
        }
        Err(Error::invalid("technique", format!("{what} draws no translucent surfaces: {instead} does")))
    }

    /// Whether lines are bounded.
    fn bounded(&self) -> SpecConstant {
        (SPEC_BOUNDED, u32::from(self.bounds.is_some()))
    }
}

/// A scene on a device, drawn by one technique. `Send` and `Sync`; several threads may prepare plans of one.
#[derive(Clone, Debug)]
pub struct Renderer {
    scene: Arc<GpuScene>,
    technique: Technique,
}

impl Renderer {
    /// Takes scene and technique. Nothing is uploaded or built yet.
    #[must_use]
    pub fn new(scene: &Arc<GpuScene>, technique: Technique) -> Self {
        Self { scene: Arc::clone(scene), technique }
    }

    /// The technique.
    #[must_use]
    pub fn technique(&self) -> &Technique {
        &self.technique
    }

    /// Fixes everything that a frame of this view needs. May allocate, compile, upload, submit and wait.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for options that do not fit the scene, [`Error::Unsupported`] and
    /// [`Error::Memory`] for what the device lacks, [`Error::Vulkan`] when a call fails.
    pub fn prepare(&self, view: &View, target: &TargetDesc) -> Result<Plan> {
        let gpu = self.scene.gpu();
        gpu.alive()?;
        if let Some(format) = target.format() {
            let needed = if target.mode() == TargetMode::Over {
                vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND
            } else {
                vk::FormatFeatureFlags::COLOR_ATTACHMENT
            };
            let name = format!("{format:?}");
            let integer = name.ends_with("_UINT") || name.ends_with("_SINT");
            if integer || !gpu.image_features(format).contains(needed) {
                return Err(Error::unsupported(
                    format!("target of format {format:?}"),
                    format!("{needed:?}"),
                ));
            }
        }
        let lists = match self.scene.surfaces()? {
            Some(data) => {
                self.technique.method().check_surfaces(&data, &self.scene.scene().data)?;
                Some(SurfaceLists::new(gpu, &data, view)?)
            }
            None => None,
        };
        let bounds = match target.depth || lists.is_some() || !view.clip().is_none() {
            true => Some(line_bounds::bounds_buffer(gpu, view)?),
            false => None,
        };
        let layers = lists.as_ref().and_then(SurfaceLists::layers);
        let canvas = Canvas { target: *target, bounds, layers, behind: lists.is_some() };
        let prepared = self.technique.prepare(&self.scene, view, &canvas)?;
        let measure = prepared.measure();
        let surfaces = match (lists, &canvas.bounds, prepared.image()) {
            (Some(lists), Some(bounds), Some(image)) => {
                let mut frame = SurfaceFrame::new(gpu, lists, view, bounds, target.depth, &measure)?;
                frame.put_behind(gpu, image, &canvas)?;
                Some(frame)
            }
            _ => None,
        };
        let bounds = match &canvas.bounds {
            Some(bounds) => Some(LineBounds::new(gpu, bounds, target.depth, measure, view)?),
            None => None,
        };
        let image = surfaces.as_ref().map_or(prepared.image(), SurfaceFrame::image);
        let composite = match (image, target.caller) {
            (Some(image), Some((format, mode))) => Some(Composite::new(gpu, image, format, mode)?),
            _ => None,
        };
        let others = u32::from(composite.is_some())
            + bounds.as_ref().map_or(0, |_| LineBounds::passes())
            + surfaces.as_ref().map_or(0, SurfaceFrame::passes);
        let passes = prepared.passes() + others;
        Ok(Plan {
            gpu: gpu.clone(),
            bounds,
            surfaces,
            timers: Timers::new(gpu, passes)?,
            technique_passes: passes - others,
            prepared,
            composite,
            target: *target,
            extent: view.extent(),
            in_flight: Arc::new(()),
        })
    }

    /// Draws one frame and waits for it: prepare, record, submit, wait, read back.
    ///
    /// # Errors
    ///
    /// As [`Renderer::prepare`] and [`Plan::record`].
    pub fn render(&self, view: &View) -> Result<Picture> {
        let mut frames = self.frames(view)?;
        frames.draw(view)?;
        frames.read_back()
    }

    /// Draws frame after frame with one plan. Compiles and allocates here, and in [`Frames::draw`] only when a
    /// view needs more room than the plan has.
    ///
    /// # Errors
    ///
    /// As [`Renderer::prepare`].
    pub fn frames(&self, view: &View) -> Result<Frames> {
        let plan = self.prepare(view, &TargetDesc::own())?;
        Ok(Frames { commands: Commands::new(self.scene.gpu())?, renderer: self.clone(), plan, drawn: false })
    }
}

/// Everything that one frame needs, fixed. Belongs to one frame in flight.
///
/// `Send` and `Sync`: it may be prepared, recorded and completed on different threads, and plans of one scene or device be
/// recorded at the same time, each into a command buffer of its own pool.
#[derive(Debug)]
pub struct Plan {
    gpu: Gpu,
    prepared: Box<dyn Prepared>,
    composite: Option<Composite>,
    bounds: Option<LineBounds>,
    surfaces: Option<SurfaceFrame>,
    timers: Option<Arc<Timers>>,
    /// Passes of the technique that are timed.
    technique_passes: u32,
    target: TargetDesc,
    extent: [u32; 2],
    /// Shared with the recording that is in flight.
    in_flight: Arc<()>,
}

/// What a completed recording reports. `Send` and `Sync`.
#[derive(Clone, Debug)]
pub struct Status {
    /// Whether everything was drawn. `false` when a capacity was short: prepare anew and repeat.
    pub complete: bool,
    /// Passes with their times on the device; empty where the device has no timestamps.
    pub passes: Vec<PassTime>,
    /// Work of the frame that only the device knows, counted.
    pub counters: Vec<(&'static str, u64)>,
}

/// Owns what a recording names, until the caller says through [`Recorded::completed`] that its submission
/// has ended, or through [`Recorded::discarded`] that there is none. Dropped
/// without that, it frees nothing, for the device may still read it: the memory is lost. `Send` and `Sync`.
#[derive(Debug)]
#[must_use = "holds what the device reads until the submission has ended"]
pub struct Recorded {
    held: std::mem::ManuallyDrop<Held>,
}

/// What a recording holds.
#[derive(Debug)]
struct Held {
    gpu: Gpu,
    keep: Keep,
    timers: Option<Arc<Timers>>,
    passes: Vec<String>,
    outcomes: Vec<Arc<dyn Outcome>>,
    _in_flight: Arc<()>,
}

impl Recorded {
    /// The caller has seen the submission end (a fence, a timeline semaphore, an idle queue). Reads the
    /// status and frees what the recording held.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`] when the timestamps cannot be read, [`Error::DeviceLost`] when the device is known to be lost. What
    /// was held is freed all the same.
    pub fn completed(self) -> Result<Status> {
        let held = std::mem::ManuallyDrop::into_inner(self.held);
        held.gpu.alive()?;
        let times = match &held.timers {
            Some(timers) => timers.read(held.passes.len())?,
            None => Vec::new(),
        };
        let passes = held.passes.into_iter().zip(times).map(|(name, ms)| PassTime { name, ms }).collect();
        let (mut complete, mut counters) = (true, Vec::new());
        for outcome in &held.outcomes {
            let (fits, counted) = outcome.read()?;
            complete &= fits;
            counters.extend(counted);
        }
        Ok(Status { complete, passes, counters })
    }

    /// What must live until the submission has ended.
    fn keep(&self) -> Keep {
        self.held.keep.clone()
    }

    /// The caller will never submit what was recorded, or never again: its command buffer was reset, freed or forgotten
    /// (a frame that was dropped because the window changed). Frees what the recording held; the plan can be recorded again.
    pub fn discarded(self) {
        drop(std::mem::ManuallyDrop::into_inner(self.held));
    }

    fn last_pass(&self) -> &str {
        self.held.passes.last().map_or("none", String::as_str)
    }
}

impl Plan {
    /// Records the frame into the caller's command buffer: no submission, no wait, no allocation of
    /// device memory.
    ///
    /// `target` is the image that [`TargetDesc::caller`] announced, and `None` for
    /// [`TargetDesc::own`]; `depth` the one that [`TargetDesc::with_depth`] did.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when `target` or `depth` is not what the plan was made for, or when an earlier recording
    /// of this plan has not been completed; [`Error::Unsupported`] for a depth image of a format that the device
    /// cannot sample.
    pub fn record(
        &mut self,
        commands: &mut CommandBuffer,
        target: Option<&TargetImage>,
        depth: Option<&DepthImage>,
    ) -> Result<Recorded> {
        self.gpu.alive()?;
        let device = self.gpu.device().handle();
        let strange = target.is_some_and(|target| target.device != device)
            || depth.is_some_and(|depth| depth.device != device);
        if commands.device() != device || strange {
            return Err(Error::invalid(
                "command buffer, target or depth image",
                "belongs to another device than the plan",
            ));
        }
        if Arc::strong_count(&self.in_flight) > 1 {
            return Err(Error::invalid("plan", "its last recording has not been completed"));
        }
        match (self.target.format(), target) {
            (None, None) => {}
            (Some(format), Some(target)) if target.format == format && target.extent == self.extent => {}
            (wanted, given) => {
                return Err(Error::invalid(
                    "target",
                    format!(
                        "the plan is for {wanted:?} of {:?}, given is {:?}",
                        self.extent,
                        given.map(|target| (target.format, target.extent))
                    ),
                ));
            }
        }
        match &self.bounds {
            Some(bounds) => bounds.check_depth(&self.gpu, depth)?,
            None if depth.is_some() => {
                return Err(Error::invalid(
                    "depth image",
                    "the plan is for none: see TargetDesc::with_depth",
                ));
            }
            None => {}
        }
        let mut recorder = Recorder::new(&self.gpu, commands, self.timers.clone());
        if let Some(bounds) = &self.bounds {
            bounds.record(&mut recorder, depth, self.surfaces.as_ref())?;
        }
        self.prepared.record(&mut recorder, target, self.target.mode() == TargetMode::Clear);
        if let Some(surfaces) = &self.surfaces {
            surfaces.record_behind(&mut recorder);
        }
        if let (Some(composite), Some(target)) = (&self.composite, target) {
            composite.record(&mut recorder, target);
        }
        let (passes, keep) = recorder.finish();
        let held = Held {
            gpu: self.gpu.clone(),
            keep,
            timers: self.timers.clone(),
            passes,
            outcomes: self
                .prepared
                .outcome()
                .into_iter()
                .chain(self.surfaces.as_ref().map(SurfaceFrame::outcome))
                .collect(),
            _in_flight: Arc::clone(&self.in_flight),
        };
        Ok(Recorded { held: std::mem::ManuallyDrop::new(held) })
    }

    /// Turns the plan to another view of the same image size, without allocating. `false` when the plan
    /// has no room for it: prepare anew.
    ///
    /// # Errors
    ///
    /// As [`Renderer::prepare`].
    pub fn set_view(&mut self, view: &View) -> Result<bool> {
        self.gpu.alive()?;
        if view.extent() != self.extent || (self.bounds.is_none() && !view.clip().is_none()) {
            return Ok(false);
        }
        let Some(bounds) = &mut self.bounds else {
            return self.prepared.set_view(view, self.technique_passes);
        };
        bounds.check(view)?;
        let seen = match &self.surfaces {
            Some(surfaces) => Some(surfaces.pushes(view)?),
            None => None,
        };
        // Nothing has been changed where anything is refused.
        let fits = self.prepared.set_view(view, self.technique_passes)?;
        if fits {
            bounds.set_view(view);
            if let (Some(surfaces), Some(seen)) = (&mut self.surfaces, seen) {
                surfaces.set_view(seen);
            }
        }
        Ok(fits)
    }

    /// The image that a frame leaves, and how it has used it last.
    fn image(&self) -> Option<(&Arc<Image>, Use)> {
        match &self.surfaces {
            Some(surfaces) => surfaces.image().map(|image| (image, Use::ComputeReadWrite)),
            None => self.prepared.image().map(|image| (image, self.prepared.last_use())),
        }
    }

    /// The route that the technique takes on this device.
    #[must_use]
    pub fn route(&self) -> &'static str {
        self.prepared.route()
    }

    /// Work of the frame, counted.
    #[must_use]
    pub fn counters(&self) -> Vec<(&'static str, u64)> {
        self.prepared.counters()
    }
}

/// Time of one frame.
#[derive(Clone, Debug)]
pub struct FrameTime {
    /// Milliseconds from the start of recording to the fence.
    pub wall_ms: f64,
    /// Passes on the device; their sum is the frame's time there.
    pub passes: Vec<PassTime>,
    /// Work of the frame that only the device knows, counted.
    pub counters: Vec<(&'static str, u64)>,
}

/// Frames that are drawn for one, each with the room that the one before was short of.
const MOST_TRIES: u32 = 12;

/// Draws frame after frame of one size into an image that can be read back. `Send` and `Sync`.
#[derive(Debug)]
pub struct Frames {
    renderer: Renderer,
    plan: Plan,
    commands: Commands,
    /// Whether the plan's image holds a frame.
    drawn: bool,
}

impl Frames {
    /// Draws a frame and waits for it.
    ///
    /// # Errors
    ///
    /// As [`Plan::record`] and [`Renderer::prepare`]; [`Error::Timeout`] when the device does not end.
    pub fn draw(&mut self, view: &View) -> Result<FrameTime> {
        self.drawn = false;
        // After an error the last frame may run still: it reads what a view changes.
        self.commands.settle()?;
        if !self.plan.set_view(view)? {
            self.plan = self.renderer.prepare(view, &TargetDesc::own())?;
        }
        for _ in 0..MOST_TRIES {
            let start = Instant::now();
            let recorded = self.plan.record(self.commands.begin()?, None, None)?;
            // What the frame names stays with `commands` for as long as the submission may run.
            if let Err(error) = self.commands.submit(recorded.keep(), recorded.last_pass()) {
                recorded.discarded();
                return Err(error);
            }
            let wall_ms = start.elapsed().as_secs_f64() * 1e3;
            let status = recorded.completed()?;
            if status.complete {
                self.drawn = true;
                return Ok(FrameTime { wall_ms, passes: status.passes, counters: status.counters });
            }
            self.plan = self.renderer.prepare(view, &TargetDesc::own())?;
        }
        Err(Error::unsupported(
            format!("{} of this view", self.renderer.technique.method().name()),
            format!("room for it was not found in {MOST_TRIES} frames"),
        ))
    }

    /// The plan in use.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Copies the image of the last frame to the host.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when nothing has been drawn; else as [`Frames::draw`].
    pub fn read_back(&mut self) -> Result<Picture> {
        let gpu = &self.plan.gpu;
        let Some((image, last)) = self.plan.image().filter(|_| self.drawn) else {
            return Err(Error::invalid("frames", "nothing has been drawn: there is no image to read back"));
        };
        let format = image.desc().format;
        let host = Arc::new(Buffer::new(gpu, "read back", image.desc().texel_bytes(), BufferUse::Download)?);
        let mut recorder = Recorder::new(gpu, self.commands.begin()?, None);
        recorder.assume_after(image, last);
        recorder.copy_image_to_buffer("read back", image, &host);
        recorder.leave(image, last);
        let (_, keep) = recorder.finish();
        self.commands.submit(keep, "read back")?;
        let [width, height] = self.plan.extent;
        Picture::new(width, height, pixels(&host.host_copy()?, format))
    }

    /// Which pixels of the last frame had a list that the k-buffer did not sort, repaired or not: row by row, top row
    /// first. `None` where the technique has no k-buffer.
    ///
    /// # Errors
    ///
    /// As [`Frames::read_back`].
    pub fn overflow_map(&mut self) -> Result<Option<Vec<bool>>> {
        let gpu = &self.plan.gpu;
        let Some(words) = self.plan.prepared.overflow() else { return Ok(None) };
        if !self.drawn {
            return Err(Error::invalid("frames", "nothing has been drawn: there is no map of its pixels"));
        }
        let host = Arc::new(Buffer::new(gpu, "overflow map", words.size(), BufferUse::Download)?);
        let mut recorder = Recorder::new(gpu, self.commands.begin()?, None);
        recorder.assume_buffer_after(words, self.plan.prepared.last_use());
        recorder.copy_buffer("overflow map", words, &host, host.size());
        recorder.release_to_host(&host);
        let (_, keep) = recorder.finish();
        self.commands.submit(keep, "overflow map")?;
        Ok(Some(pixels_of_tiles(&host.host_copy()?, self.plan.extent)))
    }
}

/// From words tile by tile to pixels row by row: whether what left the k-buffer was in order, repaired since or not.
fn pixels_of_tiles(words: &[u8], [width, height]: [u32; 2]) -> Vec<bool> {
    let across = width.div_ceil(TILE);
    let place = |x: u32, y: u32| (y / TILE * across + x / TILE) * TILE_PIXELS + y % TILE * TILE + x % TILE;
    let unsorted = |word: &[u8]| {
        u32::from_ne_bytes([word[0], word[1], word[2], word[3]]) & (FLAG_UNSORTED | FLAG_REPAIRED) != 0
    };
    let words: Vec<bool> = words.chunks_exact(4).map(unsorted).collect();
    let is_set = |(x, y)| words.get(num::index(place(x, y))).is_some_and(|&set| set);
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(is_set).collect()
}

/// Texels of a readable format as float32 RGBA.
fn pixels(bytes: &[u8], format: vk::Format) -> Vec<[f32; 4]> {
    match format {
        vk::Format::R8G8B8A8_UNORM => {
            bytes.chunks_exact(4).map(|t| std::array::from_fn(|c| f32::from(t[c]) / 255.0)).collect()
        }
        vk::Format::R16G16B16A16_UNORM => bytes
            .chunks_exact(8)
            .map(|t| {
                std::array::from_fn(|c| f32::from(u16::from_ne_bytes([t[2 * c], t[2 * c + 1]])) / 65535.0)
            })
            .collect(),
        vk::Format::R16G16B16A16_SFLOAT => bytes
            .chunks_exact(8)
            .map(|t| std::array::from_fn(|c| half_to_f32(u16::from_ne_bytes([t[2 * c], t[2 * c + 1]]))))
            .collect(),
        _ => bytes
            .chunks_exact(16)
            .map(|t| {
                std::array::from_fn(|c| {
                    f32::from_ne_bytes([t[4 * c], t[4 * c + 1], t[4 * c + 2], t[4 * c + 3]])
                })
            })
            .collect(),
    }
}

/// IEEE 754 binary16 to binary32, exact.
fn half_to_f32(half: u16) -> f32 {
    let sign = if half & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(half >> 10 & 31), f64::from(half & 0x3ff));
    let magnitude = match exponent {
        0 => fraction * (-24.0_f64).exp2(),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * f64::from(exponent - 25).exp2(),
    };
    num::f32_of(sign * magnitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_read_exactly() {
        for (bits, value) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x3555, 0.333_251_95),
            (0x0001, 5.960_464_5e-8),
            (0x7bff, 65504.0),
            (0x7c00, f32::INFINITY),
        ] {
            assert_eq!(half_to_f32(bits), value, "{bits:#x}");
        }
        assert!(half_to_f32(0x7e00).is_nan());
    }

    #[test]
    fn tiles_become_rows() {
        // 10 x 9 pixels in four tiles.
        let mut words = vec![0_u8; 4 * 4 * 64];
        for place in [0, 7 * 8 + 1, 64 + 1, 3 * 64] {
            words[4 * place..4 * place + 4].copy_from_slice(&FLAG_UNSORTED.to_ne_bytes());
        }
        // Outside of the image; and what says something else.
        words[4 * (64 + 2)] = 1;
        words[4 * 5..4 * 6].copy_from_slice(&crate::gpu::shader::FLAG_OVERLAPS.to_ne_bytes());
        let map = pixels_of_tiles(&words, [10, 9]);
        let set: Vec<usize> = (0..90).filter(|&i| map[i]).collect();
        assert_eq!((map.len(), set), (90, vec![0, 9, 71, 88]));
    }

    #[test]
    fn techniques_parse_by_name_and_options() {
        let technique = Technique::parse("slices-3d:step=0.5, filter=exact").unwrap();
        assert_eq!(technique.option_pairs()[0], ("step", "0.5".to_string()));
        assert!(Technique::parse("slices-4d").unwrap_err().to_string().contains("slices-3d"));
        assert!(Technique::parse("slices-3d:step").unwrap_err().to_string().contains("key=value"));
    }
}
