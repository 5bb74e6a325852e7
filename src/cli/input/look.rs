//! What to show of the data.

use volraster::Result;
use volraster::scene::{Lighting, Mode, auto};

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
}

impl LookArgs {
    /// Returns the scene with this look. The technique that a scene file names is for its own look.
    pub(crate) fn apply(&self, input: Input) -> Result<Input> {
        let Input { mut scene, mut settings } = input;
        let mut mode = self.mode;
        if let Some(s) = self.isosurface {
            scene.transfer = auto::isosurface(&scene.data, s, auto::ISOSURFACE_COLOUR)?;
            let lit = scene.grid().is_some() && scene.kernels.is_none() && scene.mode == Mode::Emission;
            mode = mode.or(lit.then(|| Mode::Lit(Lighting::default())));
        }
        if let (Some(Mode::Maximum), true) =
            (mode, settings.transfer_is_automatic && self.isosurface.is_none())
        {
            scene.transfer = auto::maximum(&scene.data)?;
        }
        if self.isosurface.is_some() || mode.is_some() {
            settings.choice = None;
        }
        let scene = match (mode, scene.mode) {
            (None, _) | (Some(Mode::Lit(_)), Mode::Lit(_)) => scene,
            (Some(mode), _) => scene.with_mode(mode)?,
        };
        Ok(Input { scene, settings })
    }
}
