//! Arguments that several commands share.

use std::sync::Arc;

use volraster::choice::Goal;
use volraster::gpu::{GpuOptions, Validation, ValidationLog};
use volraster::io::ReadOptions;
use volraster::scene::{Axes, StoredAxes, View};
use volraster::{Error, Gpu, Result};

use super::technique::Request;

/// The technique, or the goal of its choice.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct ChoiceArgs {
    /// Technique and options, see `volraster techniques` [default: that of the scene, else the default for its data].
    #[arg(long, value_name = "NAME[:key=value,...]")]
    technique: Option<String>,
    /// Choose the fastest technique and options whose root mean square error is at most this (premultiplied linear
    /// colour). The search draws trial images and compares them with the float64 reference.
    #[arg(long, value_name = "RMSE", conflicts_with = "technique", allow_negative_numbers = true,
        value_parser = positive)]
    max_error: Option<f64>,
    /// Choose the most accurate technique and options that draw a frame within this many milliseconds.
    #[arg(long, value_name = "MS", conflicts_with_all = ["technique", "max_error"], allow_negative_numbers = true,
        value_parser = positive)]
    budget: Option<f64>,
}

impl ChoiceArgs {
    /// Returns the technique that is given.
    pub(crate) fn request(&self) -> Result<Option<Request>> {
        self.technique.as_deref().map(Request::parse).transpose()
    }

    /// Returns the goal of an automatic choice.
    pub(crate) fn goal(&self) -> Option<Goal> {
        self.max_error.map(Goal::MaxError).or_else(|| self.budget.map(Goal::Budget))
    }
}

/// The device to draw with.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct DeviceArgs {
    /// Select the device by part of its name, ignoring case. Overrides the environment variable `VOLRASTER_DEVICE`.
    #[arg(long, value_name = "NAME")]
    pub(crate) device: Option<String>,
    /// Make the device behave like a tighter one: a list of as-hardware, coarse-weights, permute, loop=N, buffer=BYTES,
    /// allocation=BYTES, memory=BYTES, pages=BYTES, subgroup=N, no-FEATURE and no-features. For tests; see docs/VALIDATION.md.
    #[arg(long, value_name = "LIST", value_parser = emulated, default_value = "", hide_default_value = true)]
    emulate: Emulated,
}

/// A list of [`GpuOptions::emulating`], and the options that it sets.
#[derive(Clone, Debug, Default)]
struct Emulated {
    list: String,
    options: GpuOptions,
}

/// Parses a list of emulated properties. An error is the text of the rule; clap adds option and value.
fn emulated(list: &str) -> std::result::Result<Emulated, String> {
    let rule = |error| match error {
        Error::Invalid { why, .. } => why,
        other => other.to_string(),
    };
    let options = GpuOptions::default().emulating(list).map_err(rule)?;
    Ok(Emulated { list: list.to_string(), options })
}

impl DeviceArgs {
    /// Returns options of the device.
    pub(crate) fn options(&self) -> GpuOptions {
        GpuOptions { device: self.device.clone(), ..self.emulate.options.clone() }
    }

    /// Returns the arguments for another process that shall use the same device.
    pub(crate) fn arguments(&self) -> Vec<String> {
        let device = self.device.iter().map(|name| format!("--device={name}"));
        device.chain([format!("--emulate={}", self.emulate.list)]).collect()
    }

    /// Opens the device, and returns it with its validation log, which outlives it.
    pub(crate) fn open(&self, validate: bool) -> Result<(Gpu, Arc<ValidationLog>)> {
        self.open_with(validate, |_| ())
    }

    /// Does as [`DeviceArgs::open`], with options that `ask` changes.
    pub(crate) fn open_with(
        &self,
        validate: bool,
        ask: impl FnOnce(&mut GpuOptions),
    ) -> Result<(Gpu, Arc<ValidationLog>)> {
        let mut options = self.options();
        options.validation = if validate { Validation::On } else { Validation::Off };
        ask(&mut options);
        let gpu = Gpu::new(&options)?;
        let log = gpu.validation_log();
        Ok((gpu, log))
    }
}

/// An image size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Pixels per row.
    pub(crate) width: u32,
    /// Rows.
    pub(crate) height: u32,
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl Size {
    /// Reads `WxH`. An error is the text of the rule; clap adds option and value.
    pub(crate) fn parse(text: &str) -> std::result::Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=View::MAX_SIDE).contains(side));
        text.split_once('x')
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| format!("must be WIDTHxHEIGHT, each 1 to {}", View::MAX_SIDE))
    }
}

/// Parses a finite number.
pub(crate) fn finite(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|n: &f64| n.is_finite()).ok_or_else(|| "must be a finite number".to_string())
}

/// Parses a positive number.
pub(crate) fn positive(text: &str) -> std::result::Result<f64, String> {
    finite(text).ok().filter(|n| *n > 0.0).ok_or_else(|| "must be a positive number".to_string())
}

/// The arrays of a file to read. They override those of a scene file.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct ArraysArgs {
    /// Array to show, for files with several; `info` lists them. PART is a component (0, 1, ..., or a letter of xyzw
    /// or rgba) or `magnitude`. Overrides the scene file.
    #[arg(long, value_name = "[point:|cell:]NAME[:PART]")]
    array: Option<String>,
    /// For points: array of support radii. Without any size array, one radius is estimated from the spacing.
    #[arg(long, value_name = "NAME", conflicts_with = "covariance")]
    radius: Option<String>,
    /// For points: array of covariances with 6 components (xx, xy, xz, yy, yz, zz) or 9.
    #[arg(long, value_name = "NAME")]
    covariance: Option<String>,
    /// For points: array of weights.
    #[arg(long, value_name = "NAME")]
    weight: Option<String>,
    /// Time step to read of a series, from 0: of a .pvd or .series file, or of files that a name with `*` fits, in the
    /// order of the numbers in their names.
    #[arg(long, value_name = "N")]
    step: Option<u32>,
    /// Memory to keep data in, on the device and beside it, as 2GiB: a grid that is larger is read from its file in parts, as the picture needs
    /// them. The device's free memory, and 4 GiB beside it, unless given.
    #[arg(long, value_name = "BYTES", value_parser = |text: &str| GpuOptions::bytes(text).ok_or("must be a number of bytes, as 900MiB or 2GiB"))]
    pub(crate) memory: Option<u64>,
    /// Whether grids stay in their files, whatever their size.
    #[arg(skip)]
    pub(crate) in_files: bool,
    #[command(flatten)]
    axes: AxesArgs,
}

/// The axes of Gaussian splats. They override those of a scene file.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct AxesArgs {
    /// For Gaussian splats: what x, y and z of the file point to, whatever it says: r right, l left, u up, d down, f
    /// front, b back.
    #[arg(long, value_name = "XYZ, such as rdf", value_parser = axes)]
    stored_axes: Option<StoredAxes>,
    /// For Gaussian splats: turn them to these axes, with their colours.
    #[arg(long, value_name = "XYZ, such as rub", value_parser = |text: &str| axes(text)?.right_handed().map_err(why))]
    turn_to: Option<Axes>,
}

impl AxesArgs {
    /// Returns options of readers with these axes.
    pub(crate) fn over(&self, options: ReadOptions) -> ReadOptions {
        ReadOptions { axes: self.stored_axes, turn_to: self.turn_to, ..options }
    }
}

/// Parses three letters.
fn axes(text: &str) -> std::result::Result<StoredAxes, String> {
    Axes::named(text).map_err(why)
}

fn why(error: Error) -> String {
    match error {
        Error::Invalid { why, .. } => why,
        other => other.to_string(),
    }
}

impl ArraysArgs {
    /// Limits the memory of a device.
    pub(crate) fn limit(&self, options: &mut GpuOptions) {
        options.memory_budget = self.memory.or(options.memory_budget);
    }

    /// Returns the options for readers.
    pub(crate) fn options(&self) -> ReadOptions {
        self.axes.over(ReadOptions {
            radius: self.radius.clone(),
            covariance: self.covariance.clone(),
            weight: self.weight.clone(),
            array: self.array.clone(),
            step: self.step,
            on_demand: Some(if self.in_files { 0 } else { self.memory.unwrap_or(4 << 30) }),
            ..ReadOptions::default()
        })
    }

    /// Returns the arrays and axes given, with their keys in scene files.
    pub(crate) fn given(&self) -> impl Iterator<Item = (&'static str, String)> {
        let all = [
            ("array", &self.array),
            ("radius", &self.radius),
            ("covariance", &self.covariance),
            ("weight", &self.weight),
        ];
        let axes = [
            ("axes", self.axes.stored_axes.map(StoredAxes::name)),
            ("turn_to", self.axes.turn_to.map(|axes| axes.name().to_string())),
        ];
        let arrays = all.into_iter().map(|(name, array)| (name, array.clone()));
        arrays.chain(axes).filter_map(|(name, text)| Some((name, text?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_two_sides_in_range() {
        assert_eq!(Size::parse("64x48"), Ok(Size { width: 64, height: 48 }));
        for wrong in ["64", "0x48", "64x", "64x48x2", "-1x5", "64X48", "32769x1"] {
            assert!(Size::parse(wrong).is_err(), "{wrong}");
        }
    }
}
