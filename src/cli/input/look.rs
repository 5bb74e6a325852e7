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
        let scene = match (mode, scene.mode) {
            (None, _) | (Some(Mode::Lit(_)), Mode::Lit(_)) => scene,
            (Some(mode), _) => scene.with_mode(mode)?,
        };
        Ok(Input { scene, settings })
    }
}
