//! What to show of the data.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use volraster::io::Data;
use volraster::io::scene_file::{PRESETS, Preset};
use volraster::scene::auto::Side;
use volraster::scene::{ColourMap, Lighting, Mode, Opacity, Scene, TransferFunction, auto};
use volraster::{Error, Result};

use super::args::{finite, positive};
use super::scene::Input;

/// What to show of the data, in place of what a scene file says.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct LookArgs {
    /// Show the data in a ready-made way. Overrides the transfer function and the mode.
    #[arg(long, value_name = "NAME", value_parser = presets(), conflicts_with = "isosurface")]
    preset: Option<Preset>,
    /// Show the surface where the data has this scalar, lit on a grid. Overrides the transfer function.
    #[arg(long, value_name = "SCALAR", allow_negative_numbers = true, conflicts_with_all = ["range", "opacity", "colormap", "scale"])]
    isosurface: Option<f64>,
    /// Stretch the transfer function from one scalar to another.
    #[arg(long, value_name = "LO..HI", allow_hyphen_values = true, value_parser = range)]
    range: Option<[f64; 2]>,
    /// Have the extinction grow with the scalar in this way: over the range, or about or from a scalar.
    #[arg(long, value_name = "constant|linear|square|log|both|peak@S[,WIDTH]|above@S", value_parser = |text: &str| message(Opacity::parse(text)))]
    opacity: Option<Opacity>,
    /// Colour the scalars by this map, from one end of the range to the other.
    #[arg(long, value_name = "NAME", value_parser = colour_maps())]
    colormap: Option<ColourMap>,
    /// Multiply the extinction.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true, value_parser = positive)]
    scale: Option<f64>,
    /// Show emission and absorption (emission), the same with light on it (lit), or the maximum intensity projection
    /// (maximum). The last two are for grids.
    #[arg(long, value_name = "emission|lit|maximum", value_parser = |name: &str| message(Mode::from_name(name)))]
    mode: Option<Mode>,
    /// Put light on the data: `--mode lit`.
    #[arg(long, conflicts_with = "mode")]
    shade: bool,
    /// Look from this side: the patient's where the file tells, that of the axes of Gaussian splats, else the front is -y
    /// and up +z; or from so many degrees to the right of the front and upwards. Overrides the camera.
    #[arg(long, value_name = "front|back|left|right|top|bottom|iso|AZ,EL", allow_hyphen_values = true, value_parser = side)]
    view: Option<Side>,
    /// Show things this many times as large.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true, value_parser = positive)]
    zoom: Option<f64>,
    /// Lay a picture over this colour of CSS: a name, `transparent`, or `#rrggbb`. Without it PNG files are black, and EXR files keep their opacity.
    #[arg(long, value_name = "COLOUR", value_parser = colour)]
    background: Option<[f64; 4]>,
}

/// Returns the parser of presets, which lists them with their purposes.
fn presets() -> impl TypedValueParser<Value = Preset> {
    let values = PRESETS.map(|preset| PossibleValue::new(preset.name).help(preset.purpose));
    PossibleValuesParser::new(values).try_map(|name| Preset::named(&name))
}

/// Returns the parser of colour maps, which lists them.
fn colour_maps() -> impl TypedValueParser<Value = ColourMap> {
    PossibleValuesParser::new(ColourMap::NAMED.map(|(name, _)| name))
        .try_map(|name| ColourMap::from_name(&name))
}

/// Returns the result with the text of its error.
fn message<T>(result: Result<T>) -> std::result::Result<T, String> {
    result.map_err(|error| match error {
        Error::Invalid { why, .. } => why,
        other => other.to_string(),
    })
}

/// Parses `LO..HI`.
fn range(text: &str) -> std::result::Result<[f64; 2], String> {
    let ends = text
        .split_once("..")
        .and_then(|(low, high)| Some([finite(low.trim()).ok()?, finite(high.trim()).ok()?]));
    ends.filter(|[low, high]| low < high && (high - low).is_finite())
        .ok_or_else(|| "must be two numbers LO..HI, the first below the second".to_string())
}

/// Parses a colour of CSS, and returns it in linear light, with its opacity.
fn colour(text: &str) -> std::result::Result<[f64; 4], String> {
    let colour = text
        .parse::<colorgrad::Color>()
        .map_err(|_| "must be a colour such as white, #204060 or transparent")?;
    Ok(colour.to_linear_rgba().map(f64::from))
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
    /// Returns the scene with this look. The technique that a scene file names is for its own mode.
    pub(crate) fn apply(&self, input: Input) -> Result<Input> {
        let Input { mut scene, mut settings } = input;
        let was = scene.mode;
        if let Some(mode) = self.mode(&scene) {
            // Light that a scene file sets up stays.
            let keeps = matches!((mode, was), (Mode::Lit(_), Mode::Lit(_)));
            scene = if keeps { scene } else { scene.with_mode(mode)? };
        }
        if settings.transfer_is_automatic && scene.mode != was {
            scene.transfer = auto::transfer_in(&scene.data, scene.kernels.as_ref(), scene.mode)?;
        }
        let own = self.transfer(&scene, settings.transfer_is_automatic)?;
        let shows_other_parts = own.is_some() || scene.mode != was;
        if let Some(transfer) = own {
            scene.transfer = transfer;
            settings.transfer_is_automatic = false;
        }
        if self.isosurface.is_some() || self.preset.is_some() || scene.mode != was {
            settings.choice = None;
        }
        let reframed = settings.camera_is_automatic && shows_other_parts;
        let framed = self.view.or(reframed.then_some(Side::CHOSEN));
        settings.camera_is_automatic &= self.view.is_none() && self.zoom.is_none();
        let [width, height] = settings.view.extent();
        if let Some(side) = framed {
            settings.view = settings.view.with_camera(auto::camera_of(&scene, side, width, height)?)?;
        }
        if let Some(factor) = self.zoom {
            settings.view = settings.view.with_camera(settings.view.camera().zoomed(factor)?)?;
        }
        settings.background = self.background.unwrap_or(settings.background);
        Ok(Input { scene, settings })
    }

    /// Returns the mode: as asked for, or that which suits a preset or an isosurface.
    fn mode(&self, scene: &Scene) -> Option<Mode> {
        let (data, kernels) = (&scene.data, scene.kernels.as_ref());
        let asked = self.mode.or(self.shade.then(|| Mode::Lit(Lighting::default())));
        asked
            .or_else(|| self.preset.map(|preset| preset.mode(data, kernels)))
            .or_else(|| self.isosurface.map(|_| auto::lit(data, kernels)))
    }

    /// Returns the transfer function if it differs from the scene's: a base, stretched, with another extinction, other colours, and scaled.
    fn transfer(&self, scene: &Scene, is_automatic: bool) -> Result<Option<TransferFunction>> {
        let (data, kernels) = (&scene.data, scene.kernels.as_ref());
        if let Data::Gaussians(_) = data {
            let given = [
                ("isosurface", self.isosurface.is_some()),
                ("preset", self.preset.is_some()),
                ("range", self.range.is_some()),
                ("opacity", self.opacity.is_some()),
                ("colormap", self.colormap.is_some()),
                ("scale", self.scale.is_some()),
            ];
            return match given.into_iter().find(|(_, given)| *given) {
                None => Ok(None),
                Some((name, _)) => {
                    let why = "gaussians have colours of their own, and no transfer function".to_string();
                    Err(Error::Invalid { what: format!("--{name}"), why })
                }
            };
        }
        let fitted = |transfer: &TransferFunction| auto::fitted(data, kernels, transfer, auto::DEPTH);
        let mut changed = None;
        if let Some(s) = self.isosurface {
            changed = Some(auto::isosurface(data, s, auto::ISOSURFACE_COLOUR)?);
        } else if let Some(preset) = self.preset {
            changed = Some(preset.transfer(data, kernels, self.range, None)?);
        } else if let Some(range) = self.range {
            let stretched = scene.transfer.stretched(range)?;
            // A scene file's extinction is its own, and that of a projection does not depend on the range.
            let derived = is_automatic && scene.mode != Mode::Maximum;
            changed = Some(if derived { fitted(&stretched)? } else { stretched });
        }
        if let Some(opacity) = self.opacity {
            changed = Some(fitted(&opacity.over(changed.as_ref().unwrap_or(&scene.transfer))?)?);
        }
        if let Some(map) = self.colormap {
            changed = Some(changed.as_ref().unwrap_or(&scene.transfer).coloured(map));
        }
        if let Some(factor) = self.scale {
            changed = Some(changed.as_ref().unwrap_or(&scene.transfer).thickened(factor)?);
        }
        Ok(changed)
    }
}
