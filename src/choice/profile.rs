//! Time and error of settings on scenes of the profile's own.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::probes::Probes;
use super::table;
use super::trial::drawn;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, user_cache_folder};
use crate::resident::GpuScene;
use crate::scene::presets::Preset;
use crate::scene::{
    Camera, Data, Field, Kernel, KernelSize, Kernels, Model, Projection, Scene, SplatRule, View,
};

/// The source of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Measured on another machine; part of the library.
    BuiltIn,
    /// Measured on this device.
    Measured,
}

/// Root mean square error and milliseconds of each setting, as geometric means over the profile's scenes.
///
/// Only the ratios between settings matter: trials find the scale of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    pub(super) source: Source,
    pub(super) costs: BTreeMap<String, (f64, f64)>,
}

/// A profile in a file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    schema: u32,
    /// The library's version: other versions may have other costs.
    version: String,
    device: String,
    driver: String,
    costs: Vec<StoredCost>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredCost {
    technique: String,
    rmse: f64,
    ms: f64,
}

const SCHEMA: u32 = 1;

/// Larger files are rejected.
const MOST_BYTES: u64 = 1 << 20;

/// Measured with `volraster calibrate` on lavapipe 25.0, 2 cores.
const BUILT_IN: &str = include_str!("built-in.json");

/// Scenes for measurements: field, sampling, transfer function, and pixels along a side of the image. The
/// images are large enough for the fixed cost of a frame to be small.
const SCENES: &[(&str, Sides, &str, u32)] = &[
    ("marschner-lobb", Sides::Samples(48, "f32"), "shells", 128),
    ("blobs", Sides::Samples(64, "f32"), "fog", 128),
    ("marschner-lobb", Sides::Samples(64, "u8"), "fog", 128),
    ("blobs", Sides::Cubes(24), "fog", 256),
    ("marschner-lobb", Sides::Cubes(12), "shells", 192),
    ("blobs", Sides::Points(4000, 0.09), "fog", 128),
    ("blobs", Sides::Kernels(24, Kernel::Gaussian, Model::Density), "fog", 96),
    ("blobs", Sides::Kernels(24, Kernel::Gaussian, Model::Interpolate), "fog", 96),
    ("blobs", Sides::Kernels(16, Kernel::BSpline, Model::Interpolate), "fog", 96),
    ("blobs", Sides::Trained(6000, SplatRule::Khr), "fog", 128),
    ("blobs", Sides::Trained(6000, SplatRule::Ray), "fog", 128),
    ("blobs", Sides::Trained(3000, SplatRule::Overlap), "fog", 96),
];

#[derive(Clone, Copy, Debug)]
enum Sides {
    Samples(u32, &'static str),
    Cubes(u32),
    /// Number and radius.
    Points(u32, f64),
    /// Samples reconstructed by kernels.
    Kernels(u32, Kernel, Model),
    /// Trained splats by a rule.
    Trained(u32, SplatRule),
}

impl Profile {
    /// Returns the profile that is part of the library.
    #[must_use]
    pub fn built_in() -> Self {
        let stored: Option<Stored> = serde_json::from_str(BUILT_IN).ok();
        Self { source: Source::BuiltIn, costs: stored.map(costs_of).unwrap_or_default() }
    }

    /// Returns the profile stored for a device, or the built-in one.
    ///
    /// A stored profile is used only if it is from the same version of library and driver.
    #[must_use]
    pub fn load(gpu: &Gpu) -> Self {
        Self::path(gpu).and_then(|path| read(&path, gpu)).unwrap_or_else(Self::built_in)
    }

    /// Returns the file of a device's profile in the user's cache folder, or `None` if there is no such
    /// folder.
    #[must_use]
    pub fn path(gpu: &Gpu) -> Option<PathBuf> {
        let name = gpu.report().name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' });
        Some(user_cache_folder()?.join(format!("profile-{}.json", name.collect::<String>())))
    }

    /// Measures every setting on this device, which takes some seconds.
    ///
    /// `progress` receives the number of finished settings and of all settings.
    ///
    /// # Errors
    ///
    /// As [`super::choose`].
    pub fn measure(gpu: &Gpu, progress: &mut dyn FnMut(usize, usize)) -> Result<Self> {
        let mut sums: BTreeMap<String, [f64; 3]> = BTreeMap::new();
        let scenes = SCENES.iter().map(scene_of).collect::<Result<Vec<_>>>()?;
        let all: usize = scenes.iter().map(|(scene, _)| table::candidates(scene).len()).sum();
        let mut done = 0;
        for (scene, side) in scenes {
            let projection = Projection::Perspective { fov_y_deg: 42.0 };
            let camera =
                Camera { eye: DVec3::new(2.0, 1.5, 3.8), target: DVec3::ZERO, up: DVec3::Y, projection };
            let view = View::new(camera, side, side)?;
            let probes = Probes::new(&scene, &view, Probes::MOST)?;
            let candidates = table::candidates(&scene);
            let on_gpu = GpuScene::new(gpu, scene);
            for candidate in candidates {
                match drawn(&on_gpu, &view, &candidate, 0.0, 5) {
                    Ok((image, times)) => {
                        // Other work on the machine delays some frames, and hastens none.
                        let ms = times.into_iter().fold(f64::INFINITY, f64::min);
                        let (rmse, ms) = (probes.error(&image).rmse.max(1e-9), ms.max(1e-6));
                        let sum = sums.entry(candidate.spec).or_default();
                        *sum = [sum[0] + rmse.ln(), sum[1] + ms.ln(), sum[2] + 1.0];
                    }
                    Err(Error::Unsupported { .. }) => {}
                    Err(error) => return Err(error),
                }
                done += 1;
                progress(done, all);
            }
        }
        let mean = |[rmse, ms, n]: [f64; 3]| ((rmse / n).exp(), (ms / n).exp());
        let costs = sums.into_iter().map(|(spec, sum)| (spec, mean(sum))).collect();
        Ok(Self { source: Source::Measured, costs })
    }

    /// Checks that [`Profile::store`] can write the profile of a device, for those who measure it first, and makes its folder.
    ///
    /// # Errors
    ///
    /// Those of [`Profile::store`].
    pub fn check_store(gpu: &Gpu) -> Result<()> {
        crate::replace::check_writable(&Self::place(gpu)?)
    }

    /// Returns the path of a device's profile, in a folder that exists.
    fn place(gpu: &Gpu) -> Result<PathBuf> {
        let Some(path) = Self::path(gpu) else {
            return Err(Error::unsupported("a profile", "neither XDG_CACHE_HOME nor HOME is set"));
        };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, "write", source))?;
        }
        Ok(path)
    }

    /// Writes the profile to the file that [`Profile::load`] reads for this device.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] naming the file; [`Error::Unsupported`] if the user has no cache folder.
    pub fn store(&self, gpu: &Gpu) -> Result<PathBuf> {
        let path = Self::place(gpu)?;
        let report = gpu.report();
        let cost = |(spec, &(rmse, ms)): (&String, _)| StoredCost { technique: spec.clone(), rmse, ms };
        let stored = Stored {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION").to_string(),
            device: report.name.clone(),
            driver: report.driver.clone(),
            costs: self.costs.iter().map(cost).collect(),
        };
        let text = serde_json::to_string_pretty(&stored);
        let text = text.map_err(|error| Error::invalid("profile", error.to_string()))? + "\n";
        crate::replace::replace(&path, |writer| writer.write_all(text.as_bytes()))?;
        Ok(path)
    }

    /// Returns the source of the profile.
    #[must_use]
    pub fn source(&self) -> Source {
        self.source
    }

    /// Returns the settings with their root mean square error and milliseconds.
    pub fn costs(&self) -> impl Iterator<Item = (&str, (f64, f64))> {
        self.costs.iter().map(|(spec, cost)| (spec.as_str(), *cost))
    }
}

/// Reads a profile if it is complete and belongs to this device, driver and library.
fn read(path: &Path, gpu: &Gpu) -> Option<Profile> {
    if std::fs::metadata(path).ok()?.len() > MOST_BYTES {
        return None;
    }
    let stored: Stored = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    let report = gpu.report();
    let is_ours = stored.schema == SCHEMA
        && stored.version == env!("CARGO_PKG_VERSION")
        && stored.device == report.name
        && stored.driver == report.driver;
    // Settings that it lacks keep their built-in costs.
    is_ours.then(|| {
        let mut costs = Profile::built_in().costs;
        costs.extend(costs_of(stored));
        Profile { source: Source::Measured, costs }
    })
}

/// Returns the valid entries of a file: settings of the table with possible numbers.
fn costs_of(stored: Stored) -> BTreeMap<String, (f64, f64)> {
    let known: Vec<String> = table::every().into_iter().map(|candidate| candidate.spec).collect();
    let valid = |&StoredCost { ref technique, rmse, ms }: &StoredCost| {
        known.contains(technique) && rmse.is_finite() && rmse >= 0.0 && ms.is_finite() && ms > 0.0
    };
    stored.costs.into_iter().filter(valid).map(|cost| (cost.technique, (cost.rmse, cost.ms))).collect()
}

fn scene_of(&(field, sides, look, side): &(&str, Sides, &str, u32)) -> Result<(Scene, u32)> {
    let field = Field::from_name(field)?;
    let data = match sides {
        Sides::Samples(side, kind) => Data::from(field.sample([side; 3], kind)?),
        Sides::Kernels(side, ..) => field.sample([side; 3], "f32")?.into(),
        Sides::Cubes(cubes) => field.tets(cubes)?.into(),
        Sides::Points(count, radius) => field.points(count)?.with_size(KernelSize::Radius(radius))?.into(),
        Sides::Trained(count, _) => field.splats(count)?.into(),
    };
    let top = if matches!(sides, Sides::Samples(_, "u8")) { 255.0 } else { 1.0 };
    let transfer = Preset::named(look)?.transfer(&data, None, Some([0.0, top]), Some(1.0))?;
    let mut scene = Scene::new(data, transfer);
    match sides {
        Sides::Kernels(_, kernel, model) => {
            scene = scene.with_kernels(Kernels { kernel, model, ..Kernels::of_samples() })?;
        }
        Sides::Trained(_, rule) => scene = scene.with_rule(rule),
        _ => {}
    }
    Ok((scene, side))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_built_in_is_whole_and_plausible() {
        let profile = Profile::built_in();
        for candidate in table::every() {
            let &(rmse, ms) =
                profile.costs.get(&candidate.spec).unwrap_or_else(|| panic!("{}", candidate.spec));
            assert!((1e-9..1.0).contains(&rmse) && (0.01..1e4).contains(&ms), "{candidate:?}: {rmse} {ms}");
        }
        let [coarse, fine] = ["8", "0.125"].map(|step| profile.costs[&format!("slices-3d:step={step}")]);
        assert!(coarse.0 > 10.0 * fine.0 && coarse.1 < fine.1);
    }

    #[test]
    fn what_is_damaged_is_left_out() {
        let cost = |technique: &str, rmse, ms| StoredCost { technique: technique.to_string(), rmse, ms };
        let stored = Stored {
            schema: SCHEMA,
            version: String::new(),
            device: String::new(),
            driver: String::new(),
            costs: vec![
                cost("havs", 1e-7, 3.0),
                cost("abuffer", f64::NAN, 3.0),
                cost("slices-3d:step=1", 1e-3, 0.0),
                cost("slices-3d:step=2", -1e-3, 1.0),
                cost("other", 1e-3, 1.0),
            ],
        };
        let costs = costs_of(stored);
        assert_eq!(costs.into_iter().collect::<Vec<_>>(), [("havs".to_string(), (1e-7, 3.0))]);
    }
}
