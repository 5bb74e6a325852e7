//! Suites and their standard scenes. A further scene is a further row of a list.

use volraster::Result;
use volraster::glam::DVec3;
use volraster::io::scene_file::{PRESETS, Preset};
use volraster::scene::{
    Camera, Clip, Data, Field, Kernel, KernelSize, Kernels, Model, Projection, Scene, Shading, SplatRule,
    Surface, TransferFunction, View,
};

use super::sweeps::{DATA, PEERS, SMOKE, STANDARD, Sweep};
use crate::cli::input::Size;

use Cut::{Clipped, Opaque, Translucent, Whole};
use Shape::{Cubes, Gaussians, Points, Samples, Trained};

/// Image size of the standard scenes and of data files found in a folder.
pub(super) const SIZE: Size = Size { width: 512, height: 512 };

/// Image size of the suite `smoke`.
pub(super) const SMALL: Size = Size { width: 192, height: 192 };

/// A standard scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct StandardScene {
    pub(super) name: &'static str,
    /// Name that it shares with scenes that differ only in size.
    pub(super) family: &'static str,
    pub(super) field: &'static str,
    pub(super) shape: Shape,
    pub(super) look: Look,
    pub(super) cut: Cut,
    /// Number of views, the first of [`VIEWS`].
    pub(super) views: usize,
    /// Sides of further square images of the first view.
    pub(super) sides: &'static [u32],
}

/// The data on which the field is sampled.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// A grid: samples along each side, and their type.
    Samples(u32, &'static str),
    /// A grid of Gaussian kernels: samples along each side.
    Gaussians(u32),
    /// A mesh: cubes along each side, of five tetrahedra each.
    Cubes(u32),
    /// Points at random positions: their number and their radius.
    Points(u32, f64),
    /// Trained splats at random positions: their number, and the rule by which they are drawn.
    Trained(u32, SplatRule),
}

/// Clipping and surfaces of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// None.
    Whole,
    /// A plane and a crop box.
    Clipped,
    /// An opaque sphere on an opaque floor.
    Opaque,
    /// Two translucent spheres that overlap.
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
pub(super) const GAUSSIANS: Kernels =
    Kernels { kernel: Kernel::Gaussian, sigma: 0.7, cut: 2.5, model: Model::Density, least: Kernels::LEAST };

/// A transfer function over \[0, 1\].
#[derive(Clone, Copy, Debug)]
pub(super) enum Look {
    /// A preset that scene files can name.
    Preset(&'static Preset),
    /// Knots: scalar, colour, extinction.
    Rows(&'static [[f64; 5]]),
}

/// A thin opaque layer, 2 % of the range: samples miss it, integrals do not.
const THIN: Look =
    Look::Rows(&[[0.49, 1.0, 0.8, 0.3, 0.0], [0.5, 1.0, 0.8, 0.3, 240.0], [0.51, 1.0, 0.8, 0.3, 0.0]]);

const SHELLS: Look = Look::Preset(&PRESETS[2]);

const FOG: Look = Look::Preset(&PRESETS[1]);

const EYE: [f64; 3] = [2.0, 1.5, 3.8];

const PERSPECTIVE: Projection = Projection::Perspective { fov_y_deg: 42.0 };

/// Views with their names. The first two are the standard views; the others are from inside the data and from afar.
const VIEWS: [(&str, [f64; 3], Projection); 4] = [
    ("perspective", EYE, PERSPECTIVE),
    ("orthographic", EYE, Projection::Orthographic { half_height: 1.6 }),
    ("inside", [0.31, 0.22, 0.47], PERSPECTIVE),
    ("far", [8.0, 6.0, 15.2], PERSPECTIVE),
];

const SIDES: &[u32] = &[256, 1024];

/// Radius of points: three pixels of [`SIZE`] at the centre of the data, so that a standard deviation is one pixel.
const RADIUS: f64 = 0.0205;

/// The same for [`SMALL`].
const RADIUS_SMALL: f64 = 0.0546;

/// The scenes of the suite `standard`.
#[rustfmt::skip]
pub(super) const SCENES: &[StandardScene] = &[
    StandardScene { name: "marschner-lobb-64", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(64, "f32"), look: SHELLS, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "marschner-lobb-128", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(128, "f32"), look: SHELLS, cut: Whole, views: 2, sides: SIDES },
    StandardScene { name: "marschner-lobb-256", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(256, "f32"), look: SHELLS, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-128", family: "blobs", field: "blobs", shape: Samples(128, "f32"), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "thin-128", family: "thin", field: "marschner-lobb", shape: Samples(128, "f32"), look: THIN, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "marschner-lobb-128-u8", family: "marschner-lobb-u8", field: "marschner-lobb", shape: Samples(128, "u8"), look: SHELLS, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-tets-12", family: "blobs-tets", field: "blobs", shape: Cubes(12), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-tets-34", family: "blobs-tets", field: "blobs", shape: Cubes(34), look: FOG, cut: Whole, views: 2, sides: SIDES },
    StandardScene { name: "blobs-tets-58", family: "blobs-tets", field: "blobs", shape: Cubes(58), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-gaussians-128", family: "blobs-gaussians", field: "blobs", shape: Gaussians(128), look: FOG, cut: Whole, views: 2, sides: &[] },
    StandardScene { name: "blobs-points-100k", family: "blobs-points", field: "blobs", shape: Points(100_000, RADIUS), look: FOG, cut: Whole, views: 2, sides: SIDES },
    StandardScene { name: "blobs-points-1m", family: "blobs-points", field: "blobs", shape: Points(1_000_000, RADIUS), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "marschner-lobb-256-u8", family: "marschner-lobb-u8", field: "marschner-lobb", shape: Samples(256, "u8"), look: SHELLS, cut: Whole, views: 2, sides: &[] },
];

/// Further scenes of the suite `full`: other sizes and transfer functions, views from inside and from afar, clip
/// planes and surfaces.
#[rustfmt::skip]
pub(super) const MORE_SCENES: &[StandardScene] = &[
    StandardScene { name: "blobs-64", family: "blobs", field: "blobs", shape: Samples(64, "f32"), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-256", family: "blobs", field: "blobs", shape: Samples(256, "f32"), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-thin-128", family: "blobs-thin", field: "blobs", shape: Samples(128, "f32"), look: THIN, cut: Whole, views: 4, sides: SIDES },
    StandardScene { name: "marschner-lobb-fog-128", family: "marschner-lobb-fog", field: "marschner-lobb", shape: Samples(128, "f32"), look: FOG, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "ramp-fog-128", family: "ramp-fog", field: "ramp", shape: Samples(128, "f32"), look: FOG, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "blobs-tets-23", family: "blobs-tets", field: "blobs", shape: Cubes(23), look: FOG, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "marschner-lobb-tets-34", family: "marschner-lobb-tets", field: "marschner-lobb", shape: Cubes(34), look: SHELLS, cut: Whole, views: 4, sides: &[] },
    StandardScene { name: "blobs-128-clipped", family: "blobs-clipped", field: "blobs", shape: Samples(128, "f32"), look: FOG, cut: Clipped, views: 1, sides: &[] },
    StandardScene { name: "blobs-128-opaque", family: "blobs-opaque", field: "blobs", shape: Samples(128, "f32"), look: FOG, cut: Opaque, views: 1, sides: &[] },
    StandardScene { name: "blobs-128-translucent", family: "blobs-translucent", field: "blobs", shape: Samples(128, "f32"), look: FOG, cut: Translucent, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-34-clipped", family: "blobs-tets-clipped", field: "blobs", shape: Cubes(34), look: FOG, cut: Clipped, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-34-opaque", family: "blobs-tets-opaque", field: "blobs", shape: Cubes(34), look: FOG, cut: Opaque, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-34-translucent", family: "blobs-tets-translucent", field: "blobs", shape: Cubes(34), look: FOG, cut: Translucent, views: 1, sides: &[] },
];

/// The small scenes of the suite `smoke`.
#[rustfmt::skip]
pub(super) const SMOKE_SCENES: &[StandardScene] = &[
    StandardScene { name: "marschner-lobb-64", family: "marschner-lobb", field: "marschner-lobb", shape: Samples(64, "f32"), look: SHELLS, cut: Whole, views: 1, sides: &[96] },
    StandardScene { name: "blobs-64", family: "blobs", field: "blobs", shape: Samples(64, "f32"), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-tets-12", family: "blobs-tets", field: "blobs", shape: Cubes(12), look: FOG, cut: Whole, views: 1, sides: &[96] },
    StandardScene { name: "blobs-gaussians-32", family: "blobs-gaussians", field: "blobs", shape: Gaussians(32), look: FOG, cut: Whole, views: 1, sides: &[] },
    StandardScene { name: "blobs-points-10k", family: "blobs-points", field: "blobs", shape: Points(10_000, RADIUS_SMALL), look: FOG, cut: Whole, views: 1, sides: &[96] },
    StandardScene { name: "trained-10k-khr", family: "trained-khr", field: "blobs", shape: Trained(10_000, SplatRule::Khr), look: FOG, cut: Whole, views: 1, sides: &[96] },
];

/// The scenes of the suite `gaussians`: trained splats by every rule, and more of them by two.
#[rustfmt::skip]
const TRAINED_SCENES: &[StandardScene] = &[
    trained("trained-100k-khr", "trained-khr", Trained(100_000, SplatRule::Khr), 2),
    trained("trained-100k-inria", "trained-inria", Trained(100_000, SplatRule::Inria), 1),
    trained("trained-100k-antialiased", "trained-antialiased", Trained(100_000, SplatRule::Antialiased), 1),
    trained("trained-100k-ray", "trained-ray", Trained(100_000, SplatRule::Ray), 2),
    trained("trained-100k-overlap", "trained-overlap", Trained(100_000, SplatRule::Overlap), 1),
    trained("trained-100k-integral", "trained-integral", Trained(100_000, SplatRule::Integral), 1),
    trained("trained-1m-khr", "trained-khr", Trained(1_000_000, SplatRule::Khr), 1),
    trained("trained-1m-ray", "trained-ray", Trained(1_000_000, SplatRule::Ray), 1),
];

const fn trained(name: &'static str, family: &'static str, shape: Shape, views: usize) -> StandardScene {
    let sides = if views > 1 { SIDES } else { &[] };
    StandardScene { name, family, field: "blobs", shape, look: FOG, cut: Whole, views, sides }
}

/// The scenes of the suite `peers`, on which other renderers were timed.
#[rustfmt::skip]
const PEER_SCENES: &[StandardScene] = &[
    StandardScene { views: 1, sides: &[], ..SCENES[1] },
    StandardScene { views: 1, sides: &[], ..SCENES[2] },
    StandardScene { views: 1, ..SCENES[3] },
    SCENES[5],
    SCENES[12],
    StandardScene { views: 1, sides: &[], ..SCENES[7] },
    StandardScene { views: 1, ..SCENES[8] },
];

/// A list of scenes with the sweeps that are measured on each.
#[derive(Debug)]
pub(super) struct Suite {
    pub(super) name: &'static str,
    /// Lists of scenes, measured in this order.
    scenes: &'static [&'static [StandardScene]],
    pub(super) sweeps: &'static [Sweep],
    /// The sweeps that are measured on files of a folder.
    pub(super) data: &'static [Sweep],
    pub(super) size: Size,
    /// Least and most timed frames per case.
    pub(super) frames: [usize; 2],
    /// Minutes within which it ends.
    pub(super) minutes: u64,
}

/// All suites.
#[rustfmt::skip]
pub(super) const SUITES: &[Suite] = &[
    Suite { name: "smoke", scenes: &[SMOKE_SCENES], sweeps: SMOKE, data: DATA, size: SMALL, frames: [5, 5], minutes: 1 },
    Suite { name: "standard", scenes: &[SCENES], sweeps: STANDARD, data: DATA, size: SIZE, frames: [12, 45], minutes: 60 },
    Suite { name: "gaussians", scenes: &[TRAINED_SCENES], sweeps: STANDARD, data: DATA, size: SIZE, frames: [12, 45], minutes: 30 },
    Suite { name: "peers", scenes: &[PEER_SCENES], sweeps: PEERS, data: PEERS, size: SIZE, frames: [12, 45], minutes: 15 },
    Suite { name: "full", scenes: &[SCENES, MORE_SCENES], sweeps: STANDARD, data: DATA, size: SIZE, frames: [15, 100], minutes: 240 },
];

impl Suite {
    /// Returns the scenes.
    pub(super) fn scenes(&self) -> impl Iterator<Item = &'static StandardScene> {
        self.scenes.iter().copied().flatten()
    }
}

impl StandardScene {
    /// Returns the views with their names.
    pub(super) fn views(&self, Size { width, height }: Size) -> Result<Vec<(&'static str, View)>> {
        let view = |&(name, eye, projection): &(&'static str, [f64; 3], Projection)| {
            let camera = Camera { eye: DVec3::from(eye), target: DVec3::ZERO, up: DVec3::Y, projection };
            Ok((name, View::new(camera, width, height)?.with_clip(self.cut.clip()?)))
        };
        VIEWS.iter().take(self.views).map(view).collect()
    }

    fn data(&self) -> Result<Data> {
        let field = Field::from_name(self.field)?;
        match self.shape {
            Samples(side, kind) => field.sample([side; 3], kind).map(Data::from),
            Gaussians(side) => field.sample([side; 3], "f32").map(Data::from),
            Cubes(cubes) => field.tets(cubes).map(Data::from),
            Points(count, radius) => {
                field.points(count)?.with_size(KernelSize::Radius(radius)).map(Data::from)
            }
            Trained(count, _) => field.splats(count).map(Data::from),
        }
    }

    /// Makes the scene: data, transfer function, kernels and surfaces.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`](volraster::Error::Invalid) when the scene names an unknown field.
    pub(super) fn load(&self) -> Result<Scene> {
        let (data, range @ [lo, hi]) = (self.data()?, self.range());
        let transfer = match self.look {
            Look::Preset(preset) => preset.transfer(&data, None, Some(range), Some(1.0))?,
            Look::Rows(rows) => {
                let stretched = rows.iter().map(|&[s, r, g, b, tau]| [lo + (hi - lo) * s, r, g, b, tau]);
                TransferFunction::from_rows(&stretched.collect::<Vec<_>>())?
            }
        };
        let scene = Scene::new(data, transfer).with_surfaces(self.cut.surfaces()?);
        match self.shape {
            Gaussians(_) => scene.with_kernels(GAUSSIANS),
            Trained(_, rule) => Ok(scene.with_rule(rule)),
            _ => Ok(scene),
        }
    }

    /// Returns the scalars that the transfer function's \[0, 1\] stands for.
    fn range(&self) -> [f64; 2] {
        if let Samples(_, "u8") = self.shape { [0.0, 255.0] } else { [0.0, 1.0] }
    }
}

#[cfg(test)]
mod tests {
    use volraster::technique::Method::{SplatEwa, SplatSheets};

    use super::super::sweeps::{DATA, SIZES, SPLATS, Setting, settings};
    use super::*;
    use crate::cli::input;

    /// The standard deviation of a point is one pixel at the centre of the data.
    #[test]
    fn points_have_the_size_of_pixels() {
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
    fn splats_are_tried_where_they_are_reasonable() {
        let settings = settings(STANDARD).unwrap();
        let of = |shape: Shape| {
            let scene = StandardScene { shape, ..SCENES[3] }.load().unwrap();
            let own = settings.iter().filter(|setting| setting.is_for(&scene));
            own.map(|setting| (setting.technique.method(), input::options_text(&setting.technique)))
                .filter(|(method, _)| SPLATS.contains(method))
                .collect::<Vec<_>>()
        };
        let small = of(Samples(8, "f32"));
        assert!(small.len() > 3 && small.iter().all(|(method, _)| *method == SplatSheets), "{small:?}");
        assert_eq!(of(Samples(65, "f32")), []);
        for shape in [Gaussians(65), Points(9, 0.1)] {
            let all = of(shape);
            assert!(all.contains(&(SplatEwa, "order=center,footprint=ewa".into())), "{all:?}");
            assert!(all.contains(&(SplatSheets, "sheets=axis".into())), "{all:?}");
        }
    }

    #[test]
    fn the_standard_scenes_are_valid() {
        let name = |look| if let Look::Preset(preset) = look { preset.name } else { "" };
        assert_eq!([SHELLS, FOG].map(name), ["shells", "fog"]);
        for suite in SUITES {
            let mut names: Vec<&str> = suite.scenes().map(|scene| scene.name).collect();
            let count = names.len();
            assert!(count >= 3, "{}", suite.name);
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), count, "{}", suite.name);
        }
        for scene in [SCENES, MORE_SCENES, SMOKE_SCENES, TRAINED_SCENES].concat() {
            assert_eq!(scene.views(SIZE).unwrap().len(), scene.views);
            let small = match scene.shape {
                Samples(_, kind) => Samples(4, kind),
                Gaussians(_) => Gaussians(4),
                Cubes(_) => Cubes(2),
                Points(_, radius) => Points(20, radius),
                Trained(_, rule) => Trained(20, rule),
            };
            let loaded = StandardScene { shape: small, ..scene }.load().unwrap();
            match (scene.shape, &loaded.data) {
                (Samples(_, kind), Data::Grid(grid)) => assert_eq!(grid.samples().type_name(), kind),
                (Cubes(_), Data::Mesh(mesh)) => assert_eq!(mesh.cells().len(), 40),
                (Gaussians(_), Data::Grid(_)) => assert_eq!(loaded.kernels, Some(GAUSSIANS)),
                (Points(_, radius), Data::Points(points)) => {
                    assert_eq!(points.size(), &KernelSize::Radius(radius));
                    assert_eq!(points.centres().len(), 20);
                }
                (Trained(_, rule), Data::Gaussians(splats)) => {
                    assert_eq!((splats.len(), loaded.splat_rule()), (20, Some(rule)));
                }
                _ => panic!("{}: another kind of data", scene.name),
            }
            assert!(input::drawn(&loaded).is_ok(), "{}", scene.name);
            // Every sweep list has settings for every scene.
            for sweeps in [STANDARD, SMOKE, SIZES, DATA] {
                let settings = settings(sweeps).unwrap();
                let own: Vec<&Setting> = settings.iter().filter(|setting| setting.is_for(&loaded)).collect();
                let least = if matches!(scene.shape, Trained(..)) { 1 } else { 2 };
                assert!(own.len() >= least, "{}", scene.name);
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
