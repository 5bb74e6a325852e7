//! A camera for data that comes without one.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::scene::auto::visible;
use crate::scene::{Anatomy, Camera, Gaussians, Grid, Projection, Scene, View};

/// Vertical angle of view, in degrees.
const FOV_Y_DEG: f64 = 30.0;
/// Share of the half image that the box fills in the tighter direction.
const FILL: f64 = 0.98;

/// A side of the data that a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// Anterior of a patient, else -y. Of Gaussian splats that which a viewer sees who looks to the front.
    Front,
    /// Posterior, else +y.
    Back,
    /// The patient's left, else -x.
    Left,
    /// The patient's right, else +x.
    Right,
    /// Superior, else +z, with the front below.
    Top,
    /// Inferior, else -z, with the front above.
    Bottom,
    /// A corner: front, the viewer's right and top alike.
    Iso,
    /// Degrees from the front to the viewer's right, and degrees upwards, from -90 to 90.
    From(f64, f64),
}

impl Side {
    /// The side that [`camera`] chooses.
    pub const CHOSEN: Self = Self::From(35.0, 20.0);

    /// The sides by name.
    pub const NAMED: [(&'static str, Self); 7] = [
        ("front", Self::Front),
        ("back", Self::Back),
        ("left", Self::Left),
        ("right", Self::Right),
        ("top", Self::Top),
        ("bottom", Self::Bottom),
        ("iso", Self::Iso),
    ];

    /// Returns degrees to the viewer's right and upwards.
    fn direction(self, anatomy: Anatomy) -> [f64; 2] {
        // Who looks at the front of a patient has the patient's left on the right.
        let left = if anatomy == Anatomy::Unknown { -90.0 } else { 90.0 };
        match self {
            Self::Front => [0.0, 0.0],
            Self::Back => [180.0, 0.0],
            Self::Left => [left, 0.0],
            Self::Right => [-left, 0.0],
            Self::Top => [0.0, 90.0],
            Self::Bottom => [0.0, -90.0],
            Self::Iso => [45.0, f64::atan(0.5_f64.sqrt()).to_degrees()],
            Self::From(azimuth, elevation) => [azimuth, elevation],
        }
    }
}

/// Returns a perspective camera that frames what the scene shows of its data ([`visible()`]) from the front, rotated to one side and
/// slightly from above.
///
/// Where a grid's [`Anatomy`] is known, up is superior and the front is anterior; the eye is rotated towards
/// the patient's left. Otherwise up is +z and the front is -y, because most scanners stack slices along z.
/// Gaussian splats are seen as their [`Axes`](crate::scene::Axes) say: up is up, and the viewer looks towards the front.
///
/// # Errors
///
/// [`crate::Error::Invalid`] if `width` or `height` is not a valid image side, or if the box is so large, so
/// small or so far from the origin that no camera sees it in float64.
pub fn camera(scene: &Scene, width: u32, height: u32) -> Result<Camera> {
    camera_of(scene, Side::CHOSEN, width, height)
}

/// Returns a perspective camera that frames what the scene shows of its data ([`visible()`]) from a side.
///
/// # Errors
///
/// Those of [`camera`]; [`crate::Error::Invalid`] for angles of [`Side::From`] that are not finite, or an elevation beyond 90 degrees.
pub fn camera_of(scene: &Scene, side: Side, width: u32, height: u32) -> Result<Camera> {
    let anatomy = scene.grid().map_or(Anatomy::Unknown, Grid::anatomy);
    let [azimuth, elevation] = side.direction(anatomy);
    if !(azimuth.is_finite() && elevation.abs() <= 90.0) {
        let why = format!("{azimuth},{elevation}: must be finite, the second from -90 to 90 degrees");
        return Err(Error::invalid("view", why));
    }
    // World directions to the viewer and to the viewer's right.
    let axes = scene.gaussians().map(Gaussians::axes);
    let (front, right, above) = match (axes, anatomy) {
        (Some(axes), _) => (axes.back(), axes.right(), axes.up()),
        (None, Anatomy::Unknown | Anatomy::Lps) => (DVec3::NEG_Y, DVec3::X, DVec3::Z),
        (None, Anatomy::Ras) => (DVec3::Y, DVec3::NEG_X, DVec3::Z),
        (None, Anatomy::Las) => (DVec3::Y, DVec3::X, DVec3::Z),
    };
    let (turn, rise) = (azimuth.to_radians(), elevation.to_radians());
    let across = front * turn.cos() + right * turn.sin();
    let towards = across * rise.cos() + above * rise.sin();
    // From above and below, the side that the eye came from stays below and above.
    let up = if elevation.abs() > 89.9 { across * -elevation.signum() } else { above };

    // Move the eye back until every corner of the box lies inside the image.
    let corners = visible(scene);
    let target = 0.5 * (corners[0] + corners[7]);
    let at = |distance: f64| Camera {
        eye: target + towards * distance,
        target,
        up,
        projection: Projection::Perspective { fov_y_deg: FOV_Y_DEG },
    };
    let radius = corners.iter().map(|corner| (*corner - target).length()).fold(0.0, f64::max);
    let view = View::new(at(radius), width, height)?;
    let half = FILL * view.pixel_size() * 0.5;
    let tangents = [half * f64::from(width), half * f64::from(height)];
    let distance = corners.into_iter().map(|corner| {
        let relative = corner - target;
        let across =
            (relative.dot(view.right()).abs() / tangents[0]).max(relative.dot(view.up()).abs() / tangents[1]);
        across - relative.dot(view.forward())
    });
    let camera = at(distance.fold(0.0, f64::max));
    View::new(camera, width, height)?;
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num;
    use crate::scene::{Axes, Data, Field, GaussianParts, Samples, TransferFunction};

    /// Shows all of the data.
    fn shown(data: impl Into<Data>) -> Scene {
        Scene::new(data, TransferFunction::from_rows(&[[0.0, 1.0, 1.0, 1.0, 1e3]]).unwrap())
    }

    #[test]
    fn every_corner_lies_in_the_image_and_superior_is_up() {
        for anatomy in [Anatomy::Unknown, Anatomy::Ras, Anatomy::Lps, Anatomy::Las] {
            for (width, height, spacing) in
                [(512, 512, [1.0; 3]), (800, 200, [0.1, 1.0, 9.0]), (100, 700, [1e6; 3])]
            {
                let grid = Grid::new([8, 9, 10], Samples::U8(vec![1; 720])).unwrap().with_anatomy(anatomy);
                let origin = DVec3::new(-3.0, 70.0, 5.0);
                let grid =
                    grid.with_placement(DVec3::from_array(spacing), origin, glam::DMat3::IDENTITY).unwrap();
                let camera = camera(&shown(grid.clone()), width, height).unwrap();
                let view = View::new(camera, width, height).unwrap();
                let mut reach = 0.0_f64;
                for corner in grid.corners() {
                    let (pixel, depth) = view.project(corner).unwrap();
                    let u = (pixel.x / f64::from(width) * 2.0 - 1.0).abs();
                    let v = (pixel.y / f64::from(height) * 2.0 - 1.0).abs();
                    assert!(depth > 0.0 && u <= 1.0 && v <= 1.0, "{anatomy:?}: {u} {v}");
                    reach = reach.max(u).max(v);
                }
                assert!((reach - FILL).abs() < 1e-6, "{anatomy:?}: {reach}");
                assert!(view.up().z > 0.9);
                let anterior =
                    if matches!(anatomy, Anatomy::Ras | Anatomy::Las) { DVec3::Y } else { DVec3::NEG_Y };
                assert!(view.forward().dot(anterior) < -0.5, "{anatomy:?}");
            }
        }
    }

    #[test]
    fn sides_are_the_patient_s_or_the_axes() {
        let grid =
            |anatomy| shown(Grid::new([8, 9, 10], Samples::U8(vec![1; 720])).unwrap().with_anatomy(anatomy));
        // Where the eye is from the target, and what is up in the image.
        let seen = |anatomy, side| {
            let view = View::new(camera_of(&grid(anatomy), side, 64, 64).unwrap(), 64, 64).unwrap();
            [-view.forward(), view.up()].map(|v| v.round())
        };
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        for (anatomy, front, left) in
            [(Anatomy::Unknown, -y, -x), (Anatomy::Ras, y, -x), (Anatomy::Lps, -y, x), (Anatomy::Las, y, x)]
        {
            for (side, eye, up) in [
                (Side::Front, front, z),
                (Side::Back, -front, z),
                (Side::Left, left, z),
                (Side::Right, -left, z),
                (Side::Top, z, -front),
                (Side::Bottom, -z, front),
                (Side::From(180.0, 0.0), -front, z),
            ] {
                assert_eq!(seen(anatomy, side), [eye, up], "{anatomy:?} {side:?}");
            }
        }
        let iso = camera_of(&grid(Anatomy::Unknown), Side::Iso, 64, 64).unwrap();
        assert!((iso.eye - iso.target).normalize().distance(DVec3::new(1.0, -1.0, 1.0).normalize()) < 1e-12);
        assert!(camera_of(&grid(Anatomy::Unknown), Side::From(0.0, 91.0), 64, 64).is_err());
    }

    /// A dense ball of radius 1 around `centre`, given to the right, up and back, in these axes, with splats far away.
    fn ball(axes: Axes, centre: DVec3, floaters: usize) -> Gaussians {
        let place = |i: usize| {
            let i = num::f64_of(i);
            let [z, angle] = [(i * 0.37).fract() * 2.0 - 1.0, i * 2.4];
            DVec3::new(angle.cos(), angle.sin(), 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        };
        let far = (0..floaters).map(|i| DVec3::new(1.0, -2.0, 0.5) * 1e4 * num::f64_of(i + 1));
        let centres: Vec<[f32; 3]> = (0..1000)
            .map(|i| centre + place(i))
            .chain(far)
            .map(|place| (Axes::Rub.rotation_to(axes) * place).to_array().map(num::f32_of))
            .collect();
        let count = centres.len();
        let parts = GaussianParts {
            centres,
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
            log_scales: vec![[-5.0; 3]; count],
            opacities: vec![0.9; count],
            harmonics: vec![0.0; 3 * count],
            axes,
            ..GaussianParts::default()
        };
        Gaussians::new(parts).unwrap().0
    }

    #[test]
    fn splats_are_seen_as_their_axes_say_and_never_mirrored() {
        let centre = DVec3::new(5.0, 6.0, 7.0);
        for axes in Axes::ALL {
            let turn = Axes::Rub.rotation_to(axes);
            for (side, eye, up) in [
                (Side::Front, DVec3::Z, DVec3::Y),
                (Side::Left, DVec3::NEG_X, DVec3::Y),
                (Side::Top, DVec3::Y, DVec3::NEG_Z),
                (Side::CHOSEN, DVec3::new(0.54, 0.34, 0.77), DVec3::new(-0.2, 0.94, -0.28)),
            ] {
                let camera = camera_of(&shown(ball(axes, centre, 0)), side, 64, 64).unwrap();
                let view = View::new(camera, 64, 64).unwrap();
                assert!((turn.transpose() * -view.forward()).distance(eye) < 0.01, "{axes:?} {side:?}");
                assert!((turn.transpose() * view.up()).distance(up) < 0.01, "{axes:?} {side:?}");
                // What is to the right of the centre is to the right in the image of the front.
                let right = view.project(turn * (centre + DVec3::X)).unwrap().0.x;
                assert!(side != Side::Front || right > 40.0, "{axes:?}: {right}");
                assert!((turn.transpose() * camera.target).distance(centre) < 0.1, "{}", camera.target);
            }
        }
    }

    #[test]
    fn a_few_splats_far_away_do_not_shrink_the_others() {
        let size = |splats: Gaussians| {
            let corners = visible(&shown(splats));
            corners[7] - corners[0]
        };
        let alone = size(ball(Axes::Rub, DVec3::ZERO, 0));
        assert!((alone - 2.0).abs().max_element() < 0.1, "{alone}");
        assert_eq!(size(ball(Axes::Rub, DVec3::ZERO, 5)), alone);
        // Those that nobody sees, and a giant one.
        let [mut faint, mut giant] = [0, 1].map(|_| ball(Axes::Rub, DVec3::ZERO, 0));
        let parts = |splats: &Gaussians| GaussianParts {
            centres: splats.centres().to_vec(),
            rotations: splats.rotations().to_vec(),
            log_scales: splats.log_scales().to_vec(),
            opacities: splats.opacities().to_vec(),
            harmonics: splats.harmonics().to_vec(),
            ..GaussianParts::default()
        };
        let mut some = parts(&faint);
        some.centres[..100].fill([1e3; 3]);
        some.opacities[..100].fill(0.01);
        faint = Gaussians::new(some).unwrap().0;
        assert!((size(faint) - alone).abs().max_element() < 0.1);
        let mut some = parts(&giant);
        some.log_scales[0] = [10.0; 3];
        giant = Gaussians::new(some).unwrap().0;
        assert!(size(giant).max_element() < 1.6 * alone.max_element());
        // One splat, and one without extent.
        let one = |log: f32| GaussianParts {
            centres: vec![[1.0, 2.0, 3.0]],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[log; 3]],
            opacities: vec![0.9],
            harmonics: vec![0.0; 3],
            ..GaussianParts::default()
        };
        let one_of = |log| Gaussians::new(one(log)).unwrap().0;
        let reach = (2.0 * (0.9_f64 / 0.05).ln()).sqrt();
        assert!((size(one_of(0.0)) - 2.0 * reach).abs().max_element() < 1e-5);
        assert_eq!(size(one_of(f32::NEG_INFINITY)), DVec3::splat(2.0));
    }

    #[test]
    fn a_mesh_is_framed_by_the_box_of_what_is_drawn() {
        let mut points = Field::Ramp.tets(2).unwrap().points().to_vec();
        // A point that no tetrahedron uses must not enlarge the box.
        points.push(DVec3::splat(1e6));
        let mesh = Field::Ramp.tets(2).unwrap();
        let scalars = vec![1.0; points.len()];
        let mesh =
            crate::scene::Tets::new(points, mesh.cells().to_vec(), crate::scene::TetScalars::Point(scalars));
        let data = Data::from(mesh.unwrap().0);
        let camera = camera(&shown(data.clone()), 300, 200).unwrap();
        assert_eq!(camera.target, DVec3::ZERO);
        let view = View::new(camera, 300, 200).unwrap();
        let heights = data.corners().map(|corner| (view.project(corner).unwrap().0.y / 100.0 - 1.0).abs());
        let reach = heights.into_iter().fold(0.0, f64::max);
        assert!((reach - FILL).abs() < 1e-6, "{reach}");
    }
}
