//! What to show of the data.

use volraster::Result;
use volraster::scene::auto::Side;
use volraster::scene::{Lighting, Mode, auto};

use super::args::{finite, positive};
use super::scene::Input;

/// What to show of the data, in place of what a scene file says.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct LookArgs {
    /// Show the surface where the data has this scalar, lit on a grid. Overrides the transfer function.
    #[arg(long, value_name = "SCALAR", allow_negative_numbers = true)]
    isosurface: Option<f64>,
    /// Show emission and absorption (emission), the same with light on it (lit), or the maximum intensity projection
    /// (maximum). The last two are for grids.
    #[arg(long, value_name = "emission|lit|maximum", value_parser = |name: &str| Mode::from_name(name).map_err(|error| error.to_string()))]
    mode: Option<Mode>,
    /// Look from this side: the patient's where the file tells, else the front is -y and up +z; or from so many
    /// degrees to the right of the front and upwards. Overrides the camera.
    #[arg(long, value_name = "front|back|left|right|top|bottom|iso|AZ,EL", allow_hyphen_values = true, value_parser = side)]
    view: Option<Side>,
    /// Show things this many times as large.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true, value_parser = positive)]
    zoom: Option<f64>,
}

/// Parses a side by its name, or two angles.
fn side(text: &str) -> std::result::Result<Side, String> {
    if let Some((_, side)) = Side::NAMED.iter().find(|(name, _)| *name == text) {
        return Ok(*side);
    }
    let angle = |text: &str| finite(text.trim()).ok();
    let angles = text.split_once(',').map(|(azimuth, elevation)| [angle(azimuth), angle(elevation)]);
    match angles {
        Some([Some(azimuth), Some(elevation)]) if elevation.abs() <= 90.0 => {
            Ok(Side::From(azimuth, elevation))
        }
        _ => {
            let names = Side::NAMED.map(|(name, _)| name).join(", ");
            Err(format!("must be {names}, or two angles in degrees, the second from -90 to 90"))
        }
    }
}

impl LookArgs {
    /// Returns the scene with this look. The technique that a scene file names is for its own look.
    pub(crate) fn apply(&self, input: Input) -> Result<Input> {
        let Input { mut scene, mut settings } = input;
        let mut mode = self.mode;
        if let Some(s) = self.isosurface {
            scene.transfer = auto::isosurface(&scene.data, s, auto::ISOSURFACE_COLOUR)?;
            settings.transfer_is_automatic = false;
            let can_be_lit = scene.grid().is_some() && scene.kernels.is_none();
            mode = mode.or(can_be_lit.then(|| Mode::Lit(Lighting::default())));
        } else if let (Some(mode), true) = (mode, settings.transfer_is_automatic) {
            scene.transfer = match mode {
                Mode::Maximum => auto::maximum(&scene.data)?,
                _ => auto::transfer_of(&scene.data, scene.kernels.as_ref())?,
            };
        }
        if self.isosurface.is_some() || mode.is_some() {
            settings.choice = None;
        }
        settings.camera_is_automatic &= self.view.is_none() && self.zoom.is_none();
        let [width, height] = settings.view.extent();
        if let Some(side) = self.view {
            settings.view = settings.view.with_camera(auto::camera_of(&scene.data, side, width, height)?)?;
        }
        if let Some(factor) = self.zoom {
            settings.view = settings.view.with_camera(settings.view.camera().zoomed(factor)?)?;
        }
        let scene = match (mode, scene.mode) {
            (None, _) | (Some(Mode::Lit(_)), Mode::Lit(_)) => scene,
            (Some(mode), _) => scene.with_mode(mode)?,
        };
        Ok(Input { scene, settings })
    }
}
