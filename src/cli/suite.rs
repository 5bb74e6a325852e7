//! What `bench` measures: scenes, and sweeps of techniques' options. All of it is data: another scene,
//! technique or option is another line.

use volraster::glam::DVec3;
use volraster::io::scene_file::PRESETS;
use volraster::scene::{
    Camera, Clip, Data, Field, Kernel, KernelSize, Kernels, Model, Projection, Scene, Shading, Surface,
    TransferFunction, View,
};
use volraster::technique::Method;
use volraster::{Error, Result, Technique};

use super::input::{self, Size};
use Cut::{Clipped, Opaque, Translucent, Whole};
use Shape::{Cubes, Gaussians, Points, Samples};

/// Image size of the standard scenes and of data found in a folder.
pub(crate) const SIZE: Size = Size { width: 512, height: 512 };

/// That of the suite `smoke`.
pub(crate) const SMALL: Size = Size { width: 192, height: 192 };

/// A list of scenes with what is measured on each.
#[derive(Debug)]
pub(crate) struct Suite {
    pub(crate) name: &'static str,
    /// Lists of scenes, one after the other.
    scenes: &'static [&'static [StandardScene]],
    pub(crate) sweeps: &'static [Sweep],
    pub(crate) size: Size,
    /// Frames of each case that are timed.
    pub(crate) frames: usize,
}

/// The suites.
pub(crate) const SUITES: &[Suite] = &[
    Suite { name: "smoke", scenes: &[SMOKE_SCENES], sweeps: SMOKE, size: SMALL, frames: 5 },
    Suite { name: "standard", scenes: &[SCENES], sweeps: STANDARD, size: SIZE, frames: 9 },
    Suite { name: "full", scenes: &[SCENES, MORE_SCENES], sweeps: STANDARD, size: SIZE, frames: 15 },
];

impl Suite {
    /// The scenes that a technique draws.
    pub(crate) fn scenes(&self) -> impl Iterator<Item = &'static StandardScene> {
        self.scenes.iter().flat_map(|list| list.iter()).filter(|scene| scene.is_drawn())
    }
}

/// A scene that the project's figures are quoted on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StandardScene {
    pub(crate) name: &'static str,
    /// What it has in common with scenes that differ in size alone.
    pub(crate) family: &'static str,
    field: &'static str,
    shape: Shape,
    look: Look,
    cut: Cut,
    /// From how many of [`VIEWS`] it is seen.
    views: usize,
    /// Sides of further images, of the first view, with [`SIZES`] alone.
    sides: &'static [u32],
}

/// What the field is given on.
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// A grid: samples along each side, their type, and the transfer function's \[0, 1\] in their own units.
    Samples(u32, &'static str, [f64; 2]),
    /// A grid: samples along each side, whose Gaussians add up.
    Gaussians(u32),
    /// A mesh: cubes along each side, of five tetrahedra each.
    Cubes(u32),
    /// Points at random places: their number, and their radius.
    Points(u32, f64),
}

/// What cuts the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cut {
    /// Nothing.
    Whole,
    /// A plane and a crop box.
    Clipped,
    /// An opaque ball on an opaque floor.
    Opaque,
    /// Two translucent balls, one in the other in part.
    Translucent,
}

impl Cut {
    fn clip(self) -> Result<Clip> {
        if self != Clipped {
            return Ok(Clip::none());
        }
        let plane = Clip::none().with_plane(DVec3::new(0.0, 0.0, 0.3), DVec3::new(-0.6, 0.1, -1.0))?;
        plane.with_crop(DVec3::splat(-0.9), DVec3::splat(0.9))
    }

    fn surfaces(self) -> Result<Vec<Surface>> {
        let ball = |centre, radius, colour| {
            Ok(Surface::sphere(DVec3::from_array(centre), radius, colour, 4)?
                .with_shading(Shading::Headlight))
        };
        match self {
            Whole | Clipped => Ok(Vec::new()),
            Opaque => Ok(vec![
                ball([0.3, 0.2, 0.2], 0.6, [0.9, 0.4, 0.3, 1.0])?,
                Surface::cuboid(
                    DVec3::new(-1.1, -1.15, -1.1),
                    DVec3::new(1.1, -0.9, 1.1),
                    [0.5, 0.6, 0.5, 1.0],
                )?,
            ]),
            Translucent => Ok(vec![
                ball([0.3, 0.2, 0.2], 0.6, [0.9, 0.4, 0.3, 0.5])?,
                ball([-0.3, 0.0, 0.2], 0.5, [0.3, 0.4, 0.9, 0.5])?,
            ]),
        }
    }
}

/// The kernels of [`Gaussians`].
const GAUSSIANS: Kernels =
    Kernels { kernel: Kernel::Gaussian, sigma: 0.7, cut: 2.5, model: Model::Density, least: Kernels::LEAST };

/// A transfer function over \[0, 1\].
#[derive(Clone, Copy, Debug)]
enum Look {
    /// One that scene files may name.
    Preset(&'static str),
    /// Rows of a scalar, a colour and an extinction.
    Rows(&'static [[f64; 5]]),
}

/// An opaque surface a fiftieth of the range thick: samples miss it, integrals do not.
const THIN: Look =
    Look::Rows(&[[0.49, 1.0, 0.8, 0.3, 0.0], [0.5, 1.0, 0.8, 0.3, 240.0], [0.51, 1.0, 0.8, 0.3, 0.0]]);
const SHELLS: Look = Look::Preset("shells");
const FOG: Look = Look::Preset("fog");

/// A place to look from.
#[derive(Clone, Copy, Debug)]
struct Viewpoint {
    name: &'static str,
    eye: [f64; 3],
    projection: Projection,
}

const EYE: [f64; 3] = [2.0, 1.5, 3.8];
const PERSPECTIVE: Projection = Projection::Perspective { fov_y_deg: 42.0 };

/// The first two are the standard ones; the others are from inside and from afar.
#[rustfmt::skip]
const VIEWS: [Viewpoint; 4] = [
    Viewpoint { name: "perspective", eye: EYE, projection: PERSPECTIVE },
    Viewpoint { name: "orthographic", eye: EYE, projection: Projection::Orthographic { half_height: 1.6 } },
    Viewpoint { name: "inside", eye: [0.31, 0.22, 0.47], projection: PERSPECTIVE },
    Viewpoint { name: "far", eye: [8.0, 6.0, 15.2], projection: PERSPECTIVE },
];

const UNIT: [f64; 2] = [0.0, 1.0];
const BYTE: [f64; 2] = [0.0, 255.0];
const SIDES: &[u32] = &[256, 1024];
/// Three pixels of [`SIZE`] from the standard eye, in the middle of the data: a standard deviation is one.
const RADIUS: f64 = 0.0205;
/// The same of [`SMALL`].
const RADIUS_SMALL: f64 = 0.0546;

/// The standard scenes.
#[rustfmt::skip]
pub(crate) const SCENES: &[StandardScene] = &[
    StandardScene { name: "marschner-lobb-64", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(64, "f32", UNIT), look: SHELLS, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "marschner-lobb-128", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(128, "f32", UNIT), look: SHELLS, cut: Whole, views: 2, sides: SIDES },
    StandardScene { name: "marschner-lobb-256", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(256, "f32", UNIT), look: SHELLS, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-128", family: "blobs", field: "blobs", shape: Samples(128, "f32", UNIT), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "thin-128", family: "thin", field: "marschner-lobb", shape: Samples(128, "f32", UNIT), look: THIN, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "marschner-lobb-128-u8", family: "marschner-lobb-u8", field: "marschner-lobb", shape: Samples(128, "u8", BYTE), look: SHELLS, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-tets-12", family: "blobs-tets", field: "blobs", shape: Cubes(12), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-tets-34", family: "blobs-tets", field: "blobs", shape: Cubes(34), look: FOG, cut: Whole, views: 2, sides: SIDES },
    StandardScene { name: "blobs-tets-58", family: "blobs-tets", field: "blobs", shape: Cubes(58), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-gaussians-128", family: "blobs-gaussians", field: "blobs", shape: Gaussians(128), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-points-100k", family: "blobs-points", field: "blobs", shape: Points(100_000, RADIUS), look: FOG, cut: Whole, views: 2, sides: SIDES },
    StandardScene { name: "blobs-points-1m", family: "blobs-points", field: "blobs", shape: Points(1_000_000, RADIUS), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "marschner-lobb-256-u8", family: "marschner-lobb-u8", field: "marschner-lobb", shape: Samples(256, "u8", BYTE), look: SHELLS, cut: Whole, views: 2, sides: &[] },
];

/// Those that the suite `full` has beside them: other sizes and looks, from inside and from afar, cut by planes and surfaces.
#[rustfmt::skip]
pub(crate) const MORE_SCENES: &[StandardScene] = &[
    StandardScene { name: "blobs-64", family: "blobs", field: "blobs", shape: Samples(64, "f32", UNIT), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-256", family: "blobs", field: "blobs", shape: Samples(256, "f32", UNIT), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-thin-128", family: "blobs-thin", field: "blobs", shape: Samples(128, "f32", UNIT), look: THIN, cut: Whole, views: 4, sides: SIDES },
    StandardScene { name: "marschner-lobb-fog-128", family: "marschner-lobb-fog", field: "marschner-lobb", shape: Samples(128, "f32", UNIT), look: FOG, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "ramp-fog-128", family: "ramp-fog", field: "ramp", shape: Samples(128, "f32", UNIT), look: FOG, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "blobs-tets-23", family: "blobs-tets", field: "blobs", shape: Cubes(23), look: FOG, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "marschner-lobb-tets-34", family: "marschner-lobb-tets", field: "marschner-lobb", shape: Cubes(34), look: SHELLS, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "blobs-128-clipped", family: "blobs-clipped", field: "blobs", shape: Samples(128, "f32", UNIT), look: FOG, cut: Clipped, views: 1, sides: &[] },
    StandardScene { name: "blobs-128-opaque", family: "blobs-opaque", field: "blobs", shape: Samples(128, "f32", UNIT), look: FOG, cut: Opaque, views: 1, sides: &[] },
    StandardScene { name: "blobs-128-translucent", family: "blobs-translucent", field: "blobs", shape: Samples(128, "f32", UNIT), look: FOG, cut: Translucent, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-34-clipped", family: "blobs-tets-clipped", field: "blobs", shape: Cubes(34), look: FOG, cut: Clipped, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-34-opaque", family: "blobs-tets-opaque", field: "blobs", shape: Cubes(34), look: FOG, cut: Opaque, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-34-translucent", family: "blobs-tets-translucent", field: "blobs", shape: Cubes(34), look: FOG, cut: Translucent, views: 1, sides: &[] },
];

/// Small ones, for a look at everything.
#[rustfmt::skip]
pub(crate) const SMOKE_SCENES: &[StandardScene] = &[
    StandardScene { name: "marschner-lobb-64", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(64, "f32", UNIT), look: SHELLS, cut: Whole, views: 1, sides: &[96] },
    StandardScene { name: "blobs-64", family: "blobs", field: "blobs", shape: Samples(64, "f32", UNIT), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-12", family: "blobs-tets", field: "blobs", shape: Cubes(12), look: FOG, cut: Whole, views: 1, sides: &[96] },
    StandardScene { name: "blobs-gaussians-32", family: "blobs-gaussians", field: "blobs", shape: Gaussians(32), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-points-10k", family: "blobs-points", field: "blobs", shape: Points(10_000, RADIUS_SMALL), look: FOG, cut: Whole, views: 1, sides: &[96] },
];

impl StandardScene {
    /// The views with their names.
    ///
    /// # Errors
    ///
    /// As [`View::new`].
    pub(crate) fn views(&self, Size { width, height }: Size) -> Result<Vec<(&'static str, View)>> {
        let view = |&Viewpoint { name, eye, projection }: &Viewpoint| {
            let camera = Camera { eye: DVec3::from(eye), target: DVec3::ZERO, up: DVec3::Y, projection };
            Ok((name, View::new(camera, width, height)?.with_clip(self.cut.clip()?)))
        };
        VIEWS.iter().take(self.views).map(view).collect()
    }

    /// The first view at further sizes.
    pub(crate) fn sizes(&self) -> impl Iterator<Item = Size> {
        self.sides.iter().map(|&side| Size { width: side, height: side })
    }

    /// Whether a technique draws it.
    pub(crate) fn is_drawn(&self) -> bool {
        // Of its kind the smallest.
        let small = match self.shape {
            Samples(_, kind, range) => Samples(2, kind, range),
            Gaussians(_) => Gaussians(2),
            Cubes(_) => Cubes(1),
            Points(_, radius) => Points(1, radius),
        };
        Self { shape: small, ..*self }.load().is_ok_and(|scene| input::drawn(&scene).is_ok())
    }

    fn data(&self) -> Result<Data> {
        let field = Field::from_name(self.field)?;
        match self.shape {
            Samples(side, kind, _) => field.sample([side; 3], kind).map(Data::from),
            Gaussians(side) => field.sample([side; 3], "f32").map(Data::from),
            Cubes(cubes) => field.tets(cubes).map(Data::from),
            Points(count, radius) => {
                field.points(count)?.with_size(KernelSize::Radius(radius)).map(Data::from)
            }
        }
    }

    /// Data, transfer function and kernels.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when the list names what does not exist.
    pub(crate) fn load(&self) -> Result<Scene> {
        let range @ [lo, hi] = self.range();
        let transfer = match self.look {
            Look::Preset(name) => {
                let Some(preset) = PRESETS.iter().find(|known| known.name == name) else {
                    let why = format!("\"{name}\": is no preset");
                    return Err(Error::Invalid { what: "transfer function".to_string(), why });
                };
                preset.transfer(range, 1.0)?
            }
            Look::Rows(rows) => {
                let stretched = rows.iter().map(|&[s, r, g, b, tau]| [lo + (hi - lo) * s, r, g, b, tau]);
                TransferFunction::from_rows(&stretched.collect::<Vec<_>>())?
            }
        };
        let scene = Scene::new(self.data()?, transfer).with_surfaces(self.cut.surfaces()?);
        if matches!(self.shape, Gaussians(_)) { scene.with_kernels(GAUSSIANS) } else { Ok(scene) }
    }

    /// The transfer function's \[0, 1\] in the data's own units.
    fn range(&self) -> [f64; 2] {
        match self.shape {
            Samples(_, _, range) => range,
            Gaussians(_) | Cubes(_) | Points(..) => UNIT,
        }
    }
}

/// Techniques whose options run through every combination of some values.
#[derive(Debug)]
pub(crate) struct Sweep {
    /// Its name in results.
    name: &'static str,
    /// Those that have every option named; others are passed over.
    methods: &'static [Method],
    /// Those that the technique has; others are passed over.
    routes: &'static [&'static str],
    /// Options with their values.
    options: &'static [(&'static str, &'static [&'static str])],
}

const ALL: &[Method] = &Method::ALL;
const GRIDS: &[Method] = &[Slices2d, Slices3d, Slabs, ShearWarp, Raycast];
const BOTH: &[&str] = &["raster", "compute"];
const COMPUTE: &[&str] = &["compute"];
const RASTER: &[&str] = &["raster"];

/// From far too coarse to far too fine for most uses: times are read between, never beyond.
const STEPS: &[&str] = &["8", "4", "2", "1", "0.5", "0.25", "0.125"];
/// The same without what takes longest.
const FEWER: &[&str] = &["8", "4", "2", "1", "0.5", "0.25"];
/// A front of few points.
const SPARSE: &[&str] = &["4", "1", "0.5"];
const MIDDLE: &[&str] = &["2", "1", "0.5"];
const COARSE: &[&str] = &["2", "1"];
const ONE: &[&str] = &["1"];
const MESHES: &[Method] = &[Havs, Abuffer, ProjectedTets];
const EVERY: &[&str] = &["compute", "raster", "interlock", "implementation-ordered"];
const RASTERS: &[&str] = &["raster", "interlock", "implementation-ordered"];
const PAIRS: &[&str] = &["1", "2", "4", "7", "15"];
const INTEGRALS: &[&str] = &["integral", "full", "exact"];

/// Of slabs of splats, whose frames take long.
const SLABS: &[&str] = &["4", "2", "1", "0.5"];
/// Texels of the intermediate image, from few to many.
const TEXELS: &[&str] = &["0.33", "0.5", "voxel", "pixel"];
const FEW_TEXELS: &[&str] = &["0.5", "auto"];
const WARPS: &[&str] = &["bilinear", "mip", "bicubic"];
const EACH: &[&str] = &["1", "2", "4"];
const SPLATS: &[Method] = &[SplatSheets, SplatEwa];

use Method::{
    Abuffer, Havs, ProjectedTets, Raycast, ShearWarp, Slabs, Slices2d, Slices3d, SplatEwa, SplatSheets,
};

/// The whole sweep: what a front is made of, then each further option alone, at step 1.
#[rustfmt::skip]
pub(crate) const STANDARD: &[Sweep] = &[
    Sweep { name: "slices", methods: &[Slices2d], routes: BOTH, options: &[("step", &["slices"])] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: COMPUTE, options: &[("step", STEPS)] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: RASTER, options: &[("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", &["integral"]), ("step", STEPS)] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", TEXELS)] },
    Sweep { name: "every", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", FEW_TEXELS), ("every", EACH)] },
    Sweep { name: "warp", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", FEW_TEXELS), ("warp", WARPS)] },
    Sweep { name: "preview", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", &["voxel", "0.4"]), ("every", EACH), ("stop", &["1e-2"])] },
    Sweep { name: "step", methods: &[ShearWarp], routes: COMPUTE, options: &[("warp", &["bicubic"]), ("step", FEWER)] },
    Sweep { name: "step", methods: &[ShearWarp], routes: RASTER, options: &[("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", COARSE)] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", &["exact"]), ("intermediate", &["2"]), ("warp", &["bicubic"]), ("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", FEWER)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: RASTER, options: &[("integrator", INTEGRALS), ("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["midpoint"]), ("step", STEPS)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["exact"]), ("step", FEWER)] },
    Sweep { name: "filter", methods: GRIDS, routes: BOTH, options: &[("step", ONE), ("filter", &["hardware", "exact"])] },
    Sweep { name: "target", methods: &[Slices3d], routes: RASTER, options: &[("step", ONE), ("target", &["rgba8", "rgba16", "rgba16f"]), ("order", &["front-to-back"])] },
    Sweep { name: "dither", methods: &[Slices3d], routes: RASTER, options: &[("step", ONE), ("target", &["rgba8"]), ("dither", &["none", "alpha", "blue"])] },
    Sweep { name: "empty-space", methods: ALL, routes: COMPUTE, options: &[("step", ONE), ("empty-space", &["skip", "march"])] },
    Sweep { name: "prefilter", methods: ALL, routes: COMPUTE, options: &[("step", ONE), ("prefilter", &["none", "mip"])] },
    Sweep { name: "stop", methods: ALL, routes: COMPUTE, options: &[("step", ONE), ("stop", &["0", "1e-2"])] },
    Sweep { name: "integrator", methods: MESHES, routes: COMPUTE, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "integrator", methods: &[Havs, ProjectedTets], routes: RASTERS, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "rank", methods: &[ProjectedTets], routes: COMPUTE, options: &[("rank", &["centroid", "power"])] },
    Sweep { name: "fan", methods: &[ProjectedTets], routes: RASTER, options: &[("plane", &["image", "space"]), ("shade", &["fragment", "vertex"])] },
    Sweep { name: "k", methods: &[Havs], routes: COMPUTE, options: &[("k", PAIRS)] },
    Sweep { name: "repair", methods: &[Havs], routes: COMPUTE, options: &[("k", PAIRS), ("repair", &["none"])] },
    Sweep { name: "chunk", methods: &[Havs], routes: COMPUTE, options: &[("chunk", &["64"])] },
    Sweep { name: "order", methods: MESHES, routes: COMPUTE, options: &[("order", &["front-to-back", "back-to-front"])] },
    Sweep { name: "stop", methods: MESHES, routes: COMPUTE, options: &[("stop", &["0", "1e-2"])] },
    Sweep { name: "empty-space", methods: MESHES, routes: COMPUTE, options: &[("empty-space", &["skip", "march"])] },
    Sweep { name: "footprint", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["center"]), ("footprint", &["ewa", "exact"])] },
    Sweep { name: "window", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["window"]), ("footprint", &["ewa", "exact"])] },
    Sweep { name: "cut", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["center"]), ("footprint", &["ewa", "exact"]), ("cut", &["1.5", "2"])] },
    Sweep { name: "step", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["slabs"]), ("step", SLABS)] },
    Sweep { name: "step", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["image"]), ("step", SLABS)] },
    Sweep { name: "sheets", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["axis"]), ("step", COARSE)] },
];

/// A little of everything: every technique by every route, and each feature off and on.
#[rustfmt::skip]
pub(crate) const SMOKE: &[Sweep] = &[
    Sweep { name: "slices", methods: &[Slices2d], routes: BOTH, options: &[("step", &["slices"])] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: COMPUTE, options: &[("step", SPARSE)] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: RASTER, options: &[("step", COARSE)] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: BOTH, options: &[("intermediate", &["auto"])] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", TEXELS)] },
    Sweep { name: "every", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", &["0.5"]), ("every", EACH)] },
    Sweep { name: "warp", methods: &[ShearWarp], routes: COMPUTE, options: &[("warp", WARPS)] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", &["exact"]), ("step", ONE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", &["integral"]), ("step", SPARSE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", ONE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: RASTER, options: &[("integrator", &["integral"]), ("step", ONE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["midpoint"]), ("step", SPARSE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["exact"]), ("step", ONE)] },
    Sweep { name: "filter", methods: GRIDS, routes: COMPUTE, options: &[("step", ONE), ("filter", &["hardware", "exact"])] },
    Sweep { name: "dither", methods: &[Slices3d], routes: RASTER, options: &[("step", ONE), ("target", &["rgba8"]), ("dither", &["none", "blue"])] },
    Sweep { name: "empty-space", methods: ALL, routes: COMPUTE, options: &[("step", ONE), ("empty-space", &["skip", "march"])] },
    Sweep { name: "prefilter", methods: ALL, routes: COMPUTE, options: &[("step", ONE), ("prefilter", &["none", "mip"])] },
    Sweep { name: "stop", methods: ALL, routes: COMPUTE, options: &[("step", ONE), ("stop", &["0", "1e-2"])] },
    Sweep { name: "integrator", methods: MESHES, routes: COMPUTE, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "integrator", methods: &[Havs, ProjectedTets], routes: RASTERS, options: &[("integrator", &["exact"])] },
    Sweep { name: "rank", methods: &[ProjectedTets], routes: COMPUTE, options: &[("rank", &["centroid", "power"])] },
    Sweep { name: "fan", methods: &[ProjectedTets], routes: RASTER, options: &[("plane", &["image", "space"]), ("shade", &["fragment", "vertex"])] },
    Sweep { name: "repair", methods: &[Havs], routes: COMPUTE, options: &[("repair", &["exact", "none"])] },
    Sweep { name: "stop", methods: MESHES, routes: COMPUTE, options: &[("stop", &["0", "1e-2"])] },
    Sweep { name: "empty-space", methods: MESHES, routes: COMPUTE, options: &[("empty-space", &["skip", "march"])] },
    Sweep { name: "footprint", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["center"]), ("footprint", &["ewa", "exact"])] },
    Sweep { name: "window", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["window"])] },
    Sweep { name: "step", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["slabs"]), ("step", COARSE)] },
    Sweep { name: "step", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["image"]), ("step", COARSE)] },
    Sweep { name: "sheets", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["axis"])] },
];

/// How time grows with the image: every technique by every route.
#[rustfmt::skip]
pub(crate) const SIZES: &[Sweep] = &[
    Sweep { name: "size", methods: &[Slices2d, ShearWarp], routes: BOTH, options: &[("step", &["slices"])] },
    Sweep { name: "size", methods: &[Slices3d, Slabs, Raycast], routes: BOTH, options: &[("step", ONE)] },
    Sweep { name: "size", methods: MESHES, routes: EVERY, options: &[] },
    Sweep { name: "size", methods: SPLATS, routes: COMPUTE, options: &[] },
];

/// Data found in a folder: little of each, for there may be much of it.
#[rustfmt::skip]
pub(crate) const DATA: &[Sweep] = &[
    Sweep { name: "slices", methods: &[Slices2d], routes: COMPUTE, options: &[("step", &["slices"])] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", FEW_TEXELS)] },
    Sweep { name: "every", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", &["0.5"]), ("every", &["4"])] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", &["exact"]), ("warp", &["bicubic"]), ("step", ONE)] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: COMPUTE, options: &[("step", COARSE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", COARSE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["midpoint", "exact"]), ("step", COARSE)] },
    Sweep { name: "integrator", methods: MESHES, routes: COMPUTE, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "splats", methods: SPLATS, routes: COMPUTE, options: &[] },
];

/// A technique with the options of one combination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setting {
    /// The sweep that it belongs to.
    pub(crate) sweep: &'static str,
    pub(crate) technique: Technique,
    /// The route that is asked for; the plan has the last word.
    pub(crate) route: &'static str,
}

impl Setting {
    /// Whether it draws a scene as the reference does, in a time that others do not make look foolish.
    pub(crate) fn is_for(&self, scene: &Scene) -> bool {
        let method = self.technique.method();
        let (adds_up, has_kernels) = match (&scene.data, &scene.kernels) {
            (_, Some(kernels)) => (kernels.model == Model::Density, true),
            (Data::Points(_), None) => (true, true),
            _ => (false, false),
        };
        // Splats as a whole have a colour of their own only where they add up.
        let ordered = |(key, value): &(&str, String)| *key == "order" && value != "slabs";
        let fits = adds_up || method != SplatEwa || !self.technique.option_pairs().iter().any(ordered);
        method.fits(scene) && fits && (has_kernels || input::too_many_splats(method, &scene.data).is_none())
    }
}

/// Every setting of some sweeps, each once.
///
/// # Errors
///
/// As [`Technique::new`]: a list names a value that an option does not take.
pub(crate) fn settings(sweeps: &[Sweep]) -> Result<Vec<Setting>> {
    let mut settings: Vec<Setting> = Vec::new();
    for sweep in sweeps {
        for &method in sweep.methods {
            let has = |key: &str| method.options().iter().any(|info| info.key == key);
            if !sweep.options.iter().all(|(key, _)| has(key)) {
                continue;
            }
            for &route in sweep.routes.iter().filter(|route| method.routes().contains(route)) {
                for options in combinations(sweep.options) {
                    let technique = input::by_route(method, route, &[], &options)?;
                    if !settings.iter().any(|known| (known.technique, known.route) == (technique, route)) {
                        settings.push(Setting { sweep: sweep.name, technique, route });
                    }
                }
            }
        }
    }
    Ok(settings)
}

/// Every combination of one value for each option; the last option runs fastest.
fn combinations(
    options: &[(&'static str, &'static [&'static str])],
) -> Vec<Vec<(&'static str, &'static str)>> {
    let extend = |rows: Vec<Vec<(&'static str, &'static str)>>,
                  &(key, values): &(&'static str, &'static [&'static str])| {
        let longer = rows.iter().flat_map(|row| {
            values.iter().map(move |&value| row.iter().copied().chain([(key, value)]).collect())
        });
        longer.collect()
    };
    options.iter().fold(vec![Vec::new()], extend)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(sweeps: &[Sweep]) -> Vec<String> {
        let text = |setting: &Setting| {
            let options = input::options_text(&setting.technique);
            format!("{} {} {} {options}", setting.sweep, setting.technique.method().name(), setting.route)
        };
        settings(sweeps).unwrap().iter().map(text).collect()
    }

    #[test]
    fn a_sweep_is_every_combination_once() {
        let sweep = |routes, options| Sweep { name: "s", methods: &[Slabs, Raycast], routes, options };
        let product = sweep(BOTH, &[("integrator", &["integral", "full"]), ("step", &["1", "2"])]);
        let one = |method: &str, route: &str, options: [&str; 4]| {
            options.map(|options| format!("s {method} {route} {options}")).to_vec()
        };
        // Defaults are not told: slabs' integrator is integral, and every step 1.
        let slabs = ["", "step=2", "integrator=full", "step=2,integrator=full"];
        let rays = [
            "integrator=integral",
            "step=2,integrator=integral",
            "integrator=full",
            "step=2,integrator=full",
        ];
        let expected =
            [one("slabs", "raster", slabs), one("slabs", "compute", slabs), one("raycast", "compute", rays)];
        assert_eq!(texts(&[product]), expected.concat());
        // The same again under another guise adds nothing, and what a technique lacks is not tried.
        let steps = || sweep(COMPUTE, &[("step", &["1", "1.0"])]);
        assert_eq!(texts(&[steps(), steps()]), ["s slabs compute ", "s raycast compute "]);
        assert_eq!(texts(&[sweep(RASTER, &[("order", &["front-to-back"])])]).len(), 1);
    }

    #[test]
    fn the_lists_hold_and_cover_every_technique_and_route() {
        for sweeps in [STANDARD, SMOKE, SIZES, DATA] {
            let settings = settings(sweeps).unwrap();
            for method in Method::ALL {
                assert!(settings.iter().any(|setting| setting.technique.method() == method), "{method:?}");
            }
        }
        for (sweeps, least) in [(STANDARD, MIDDLE.len()), (SMOKE, 1), (SIZES, 1)] {
            let settings = settings(sweeps).unwrap();
            for (method, route) in super::super::compare::by_route() {
                let drawn =
                    |setting: &&Setting| setting.technique.method() == method && setting.route == route;
                assert!(settings.iter().filter(drawn).count() >= least, "{method:?} {route}");
            }
        }
    }

    /// A standard deviation of points is a pixel, as seen from the standard eye in the middle of the data.
    #[test]
    fn points_are_of_the_size_of_pixels() {
        for (scene, size, radius) in
            [(SCENES[10], SIZE, RADIUS), (SCENES[11], SIZE, RADIUS), (SMOKE_SCENES[4], SMALL, RADIUS_SMALL)]
        {
            let (_, view) = scene.views(size).unwrap()[0];
            let right = view.forward().cross(DVec3::Y).normalize();
            let across = |at: DVec3| view.project(at).unwrap().0.x;
            let pixels = across(right * radius) - across(DVec3::ZERO);
            assert!(matches!(scene.shape, Points(_, r) if r == radius), "{}", scene.name);
            assert!((pixels - 3.0).abs() < 0.01, "{}: {pixels}", scene.name);
        }
    }

    #[test]
    fn splats_are_tried_where_they_may_win() {
        let settings = settings(STANDARD).unwrap();
        let of = |shape: Shape| {
            let scene = StandardScene { shape, ..SCENES[3] }.load().unwrap();
            let own = settings.iter().filter(|setting| setting.is_for(&scene));
            own.map(|setting| (setting.technique.method(), input::options_text(&setting.technique)))
                .filter(|(method, _)| SPLATS.contains(method))
                .collect::<Vec<_>>()
        };
        let small = of(Samples(8, "f32", UNIT));
        assert!(small.len() > 3 && small.iter().all(|(method, _)| *method == SplatSheets), "{small:?}");
        assert_eq!(of(Samples(65, "f32", UNIT)), []);
        for shape in [Gaussians(65), Points(9, 0.1)] {
            let all = of(shape);
            assert!(all.contains(&(SplatEwa, "order=center,footprint=ewa".into())), "{all:?}");
            assert!(all.contains(&(SplatSheets, "sheets=axis".into())), "{all:?}");
        }
    }

    #[test]
    fn the_standard_scenes_hold() {
        for suite in SUITES {
            let mut names: Vec<&str> = suite.scenes().map(|scene| scene.name).collect();
            let count = names.len();
            assert!(count >= 3, "{}", suite.name);
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), count, "{}", suite.name);
        }
        for scene in [SCENES, MORE_SCENES, SMOKE_SCENES].concat() {
            assert_eq!(scene.views(SIZE).unwrap().len(), scene.views);
            let small = match scene.shape {
                Samples(_, kind, range) => Samples(4, kind, range),
                Gaussians(_) => Gaussians(4),
                Cubes(_) => Cubes(2),
                Points(_, radius) => Points(20, radius),
            };
            let loaded = StandardScene { shape: small, ..scene }.load().unwrap();
            match (scene.shape, &loaded.data) {
                (Samples(_, kind, _), Data::Grid(grid)) => assert_eq!(grid.samples().type_name(), kind),
                (Cubes(_), Data::Mesh(mesh)) => assert_eq!(mesh.cells().len(), 40),
                (Gaussians(_), Data::Grid(_)) => assert_eq!(loaded.kernels, Some(GAUSSIANS)),
                (Points(_, radius), Data::Points(points)) => {
                    assert_eq!(points.size(), &KernelSize::Radius(radius));
                    assert_eq!(points.centres().len(), 20);
                }
                _ => panic!("{}: another kind of data", scene.name),
            }
            assert!(scene.is_drawn(), "{}", scene.name);
            // Something of each list is for it.
            for sweeps in [STANDARD, SMOKE, SIZES, DATA] {
                let settings = settings(sweeps).unwrap();
                let own: Vec<&Setting> = settings.iter().filter(|setting| setting.is_for(&loaded)).collect();
                assert!(own.len() >= 2, "{}", scene.name);
                let splats =
                    own.iter().filter(|setting| SPLATS.contains(&setting.technique.method())).count();
                let has_kernels = matches!(scene.shape, Gaussians(_) | Points(..));
                assert_eq!(splats == own.len(), has_kernels, "{}", scene.name);
            }
            let [lo, hi] = loaded.transfer.domain();
            let range = scene.range();
            assert!(lo >= range[0] && hi <= range[1] && hi > lo, "{}", scene.name);
        }
    }
}
