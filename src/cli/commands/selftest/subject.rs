//! Test scenes and views.

use volraster::Result;
use volraster::glam::DVec3;
use volraster::scene::{
    Camera, Field, Kernel, KernelSize, Kernels, Model, Points, Projection, Scene, TransferFunction, View,
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
}

/// Transfer function of all subjects, over the range of the field.
const FOG: [[f64; 5]; 5] = [
    [0.0, 0.1, 0.2, 0.7, 0.0],
    [0.06, 0.1, 0.2, 0.7, 0.0],
    [0.3, 0.2, 0.6, 0.9, 1.0],
    [0.6, 0.9, 0.85, 0.3, 3.0],
    [1.0, 1.0, 0.25, 0.1, 8.0],
];

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
            _ => Self::Grid("f32"),
        }
    }

    /// Makes the scene.
    pub(crate) fn scene(self) -> Result<Scene> {
        match self {
            Self::Grid(kind) => {
                let grid = Field::Blobs.sample([12, 11, 10], kind)?;
                Ok(Scene::new(grid, self.transfer(&FOG)?))
            }
            Self::Gaussians => {
                let grid = Field::Blobs.sample([9, 8, 7], "f32")?;
                Scene::new(grid, self.transfer(&FOG)?).with_kernels(GAUSSIANS)
            }
            Self::Mesh => Ok(Scene::new(Field::Blobs.tets(3)?, self.transfer(&FOG)?)),
            Self::Points => {
                let points =
                    Points::of_vertices(&Field::Blobs.tets(4)?)?.with_size(KernelSize::Radius(0.5))?;
                Ok(Scene::new(points, self.transfer(&FOG)?))
            }
        }
    }

    /// Returns another transfer function for the subject.
    pub(crate) fn other_transfer(self) -> Result<TransferFunction> {
        self.transfer(&SMOKE)
    }

    fn transfer(self, rows: &[[f64; 5]]) -> Result<TransferFunction> {
        // Scale of the stored integers of a field.
        let scale = match self {
            Self::Grid("u8") => 255.0,
            Self::Grid("u16") => 65535.0,
            Self::Grid("i16") => 32767.0,
            _ => 1.0,
        };
        let row = |&[scalar, r, g, b, tau]: &[f64; 5]| [scale * scalar, r, g, b, tau];
        TransferFunction::from_rows(&rows.iter().map(row).collect::<Vec<_>>())
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
