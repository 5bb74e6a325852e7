//! Test scenes and views.

use volraster::Result;
use volraster::glam::DVec3;
use volraster::io::scene_file::{PRESETS, Preset};
use volraster::scene::{
    Camera, Data, Field, Kernel, KernelSize, Kernels, Model, Points, Projection, Scene, SplatRule,
    TransferFunction, View,
};
use volraster::technique::Method;

/// A kind of data, with a small test scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Subject {
    /// A grid with a sample type.
    Grid(&'static str),
    /// A grid of Gaussian kernels.
    Gaussians,
    /// A mesh.
    Mesh,
    /// Points.
    Points,
    /// Trained splats, drawn by a rule.
    Trained(SplatRule),
}

/// Transfer function of all subjects: the preset `fog`.
const FOG: Preset = PRESETS[1];

/// Another transfer function.
const SMOKE: [[f64; 5]; 3] =
    [[0.0, 1.0, 0.9, 0.8, 0.2], [0.5, 0.3, 0.1, 0.9, 0.0], [1.0, 0.1, 0.8, 0.2, 5.0]];

/// Kernels of [`Subject::Gaussians`].
const GAUSSIANS: Kernels =
    Kernels { kernel: Kernel::Gaussian, sigma: 0.7, cut: 2.5, model: Model::Density, least: Kernels::LEAST };

impl Subject {
    /// Returns the subject that a technique draws by default.
    pub(crate) fn of(method: Method) -> Self {
        match method.data() {
            ["mesh", ..] => Self::Mesh,
            ["points", ..] => Self::Points,
            ["gaussians", ..] => Self::Trained(SplatRule::Ray),
            _ => Self::Grid("f32"),
        }
    }

    /// Returns the subject that a sample of a technique names.
    pub(crate) fn of_sample(scene: &'static str) -> Self {
        match scene {
            "gaussians" => Self::Gaussians,
            "mesh" => Self::Mesh,
            "points" => Self::Points,
            name => SplatRule::named(name).map_or(Self::Grid(name), Self::Trained),
        }
    }

    /// Makes the scene.
    pub(crate) fn scene(self) -> Result<Scene> {
        let data: Data = match self {
            Self::Trained(rule) => {
                let splats = Field::Blobs.splats(150)?;
                return Ok(Scene::new(splats, TransferFunction::from_rows(&SMOKE)?).with_rule(rule));
            }
            Self::Grid(kind) => Field::Blobs.sample([12, 11, 10], kind)?.into(),
            Self::Gaussians => Field::Blobs.sample([9, 8, 7], "f32")?.into(),
            Self::Mesh => Field::Blobs.tets(3)?.into(),
            Self::Points => {
                Points::of_vertices(&Field::Blobs.tets(4)?)?.with_size(KernelSize::Radius(0.5))?.into()
            }
        };
        let transfer = FOG.transfer(&data, None, Some(self.range()), Some(1.0))?;
        let scene = Scene::new(data, transfer);
        if matches!(self, Self::Gaussians) { scene.with_kernels(GAUSSIANS) } else { Ok(scene) }
    }

    /// Returns another transfer function for the subject.
    pub(crate) fn other_transfer(self) -> Result<TransferFunction> {
        let [_, scale] = self.range();
        TransferFunction::from_rows(&SMOKE.map(|[scalar, r, g, b, tau]| [scale * scalar, r, g, b, tau]))
    }

    /// Returns the range of the stored values of the field.
    fn range(self) -> [f64; 2] {
        match self {
            Self::Grid("u8") => [0.0, 255.0],
            Self::Grid("u16") => [0.0, 65535.0],
            Self::Grid("i16") => [0.0, 32767.0],
            _ => [0.0, 1.0],
        }
    }
}

/// The views in which images are compared: from outside, orthographic, from inside.
pub(crate) const VIEWS: [&str; 3] = ["perspective", "orthographic", "inside"];

/// Returns a view of [`VIEWS`].
pub(crate) fn view(name: &str, [width, height]: [u32; 2]) -> Result<View> {
    let (distance, projection) = match name {
        "orthographic" => (1.0, Projection::Orthographic { half_height: 1.6 }),
        "inside" => (0.1, Projection::Perspective { fov_y_deg: 60.0 }),
        _ => (1.0, Projection::Perspective { fov_y_deg: 42.0 }),
    };
    let eye = DVec3::new(2.0, 1.5, 3.8) * distance;
    View::new(Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection }, width, height)
}

/// Image size of most cases.
pub(crate) const SIZE: [u32; 2] = [40, 30];

/// A subject, the name of a view, and an image size.
pub(super) type Sight = (Subject, &'static str, [u32; 2]);
