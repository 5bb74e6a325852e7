//! Sweeps: techniques whose options run through all combinations of some values. A further option is a further row of
//! a list.

use volraster::scene::{Data, Model, Scene, SplatRule};
use volraster::technique::Method;
use volraster::{Result, Technique};

use crate::cli::input::{self, Wanted};

use Method::{
    Abuffer, Gaussians, Havs, ProjectedTets, Raycast, ShearWarp, Slabs, Slices2d, Slices3d, SplatEwa,
    SplatSheets,
};

/// Techniques whose options run through all combinations of some values.
#[derive(Debug)]
pub(super) struct Sweep {
    /// The name of the sweep in results.
    pub(super) name: &'static str,
    /// Techniques; those without all of the options are skipped.
    pub(super) methods: &'static [Method],
    /// Routes; those that a technique does not have are skipped.
    pub(super) routes: &'static [&'static str],
    /// Options with their values.
    pub(super) options: &'static [(&'static str, &'static [&'static str])],
}

/// All that draws a field.
const FIELDS: &[Method] =
    &[Slices2d, Slices3d, Slabs, ShearWarp, Raycast, ProjectedTets, Havs, Abuffer, SplatSheets, SplatEwa];

const GRIDS: &[Method] = &[Slices2d, Slices3d, Slabs, ShearWarp, Raycast];

const BOTH: &[&str] = &["raster", "compute"];

const COMPUTE: &[&str] = &["compute"];

const RASTER: &[&str] = &["raster"];

/// Steps from too coarse to finer than most uses need, since times are interpolated between them, never extrapolated.
const STEPS: &[&str] = &["8", "4", "2", "1", "0.5", "0.25", "0.125"];

/// The same without the slowest.
const FEWER: &[&str] = &["8", "4", "2", "1", "0.5", "0.25"];

/// Steps of a front with few points.
const SPARSE: &[&str] = &["4", "1", "0.5"];

const MIDDLE: &[&str] = &["2", "1", "0.5"];

const COARSE: &[&str] = &["2", "1"];

const ONE: &[&str] = &["1"];

const MESHES: &[Method] = &[Havs, Abuffer, ProjectedTets];

const RASTERS: &[&str] = &["raster", "interlock", "implementation-ordered"];

const PAIRS: &[&str] = &["1", "2", "4", "7", "15"];

const INTEGRALS: &[&str] = &["integral", "full", "exact"];

/// Steps of splatting with slabs, whose frames are slow.
const SLABS: &[&str] = &["4", "2", "1", "0.5"];

/// Resolutions of the intermediate image, in ascending order.
const TEXELS: &[&str] = &["0.33", "0.5", "voxel", "pixel"];

const FEW_TEXELS: &[&str] = &["0.5", "auto"];

const WARPS: &[&str] = &["bilinear", "mip", "bicubic"];

const EACH: &[&str] = &["1", "2", "4"];

pub(super) const SPLATS: &[Method] = &[SplatSheets, SplatEwa];

const TRAINED: &[Method] = &[Gaussians];

/// The complete sweep: the settings of the fronts, then each further option alone at step 1.
#[rustfmt::skip]
pub(super) const STANDARD: &[Sweep] = &[
    Sweep { name: "slices", methods: &[Slices2d], routes: BOTH, options: &[("step", &["slices"])] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: COMPUTE, options: &[("step", STEPS)] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: RASTER, options: &[("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", &["integral"]), ("step", STEPS)] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", TEXELS)] },
    Sweep { name: "every", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", FEW_TEXELS), ("every", EACH)] },
    Sweep { name: "warp", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", FEW_TEXELS), ("warp", WARPS)] },
    Sweep { name: "preview", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", &["voxel", "0.4"]), ("every", EACH), ("stop", &["1e-2"])] },
    Sweep { name: "step", methods: &[ShearWarp], routes: COMPUTE, options: &[("warp", &["bicubic"]), ("step", FEWER)] },
    Sweep { name: "step", methods: &[ShearWarp], routes: RASTER, options: &[("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", COARSE)] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", &["exact"]), ("intermediate", &["2"]), ("warp", &["bicubic"]), ("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", FEWER)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: RASTER, options: &[("integrator", INTEGRALS), ("step", MIDDLE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["midpoint"]), ("step", STEPS)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["exact"]), ("step", FEWER)] },
    Sweep { name: "filter", methods: GRIDS, routes: BOTH, options: &[("step", ONE), ("filter", &["hardware", "exact"])] },
    Sweep { name: "target", methods: &[Slices3d], routes: RASTER, options: &[("step", ONE), ("target", &["rgba8", "rgba16", "rgba16f"]), ("order", &["front-to-back"])] },
    Sweep { name: "dither", methods: &[Slices3d], routes: RASTER, options: &[("step", ONE), ("target", &["rgba8"]), ("dither", &["none", "alpha", "blue"])] },
    Sweep { name: "empty-space", methods: FIELDS, routes: COMPUTE, options: &[("step", ONE), ("empty-space", &["skip", "march"])] },
    Sweep { name: "prefilter", methods: FIELDS, routes: COMPUTE, options: &[("step", ONE), ("prefilter", &["none", "mip"])] },
    Sweep { name: "stop", methods: FIELDS, routes: COMPUTE, options: &[("step", ONE), ("stop", &["0", "1e-2"])] },
    Sweep { name: "integrator", methods: MESHES, routes: COMPUTE, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "integrator", methods: &[Havs, ProjectedTets], routes: RASTERS, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "rank", methods: &[ProjectedTets], routes: COMPUTE, options: &[("rank", &["centroid", "power"])] },
    Sweep { name: "fan", methods: &[ProjectedTets], routes: RASTER, options: &[("plane", &["image", "space"]), ("shade", &["fragment", "vertex"])] },
    Sweep { name: "k", methods: &[Havs], routes: COMPUTE, options: &[("k", PAIRS)] },
    Sweep { name: "repair", methods: &[Havs], routes: COMPUTE, options: &[("k", PAIRS), ("repair", &["none"])] },
    Sweep { name: "chunk", methods: &[Havs], routes: COMPUTE, options: &[("chunk", &["64"])] },
    Sweep { name: "order", methods: MESHES, routes: COMPUTE, options: &[("order", &["front-to-back", "back-to-front"])] },
    Sweep { name: "stop", methods: MESHES, routes: COMPUTE, options: &[("stop", &["0", "1e-2"])] },
    Sweep { name: "empty-space", methods: MESHES, routes: COMPUTE, options: &[("empty-space", &["skip", "march"])] },
    Sweep { name: "footprint", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["center"]), ("footprint", &["ewa", "exact"])] },
    Sweep { name: "pixel", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["pixel"]), ("footprint", &["ewa", "exact"])] },
    Sweep { name: "cut", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["center"]), ("footprint", &["ewa", "exact"]), ("cut", &["1.5", "2"])] },
    Sweep { name: "step", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["slabs"]), ("step", SLABS)] },
    Sweep { name: "step", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["image"]), ("step", SLABS)] },
    Sweep { name: "sheets", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["axis"]), ("step", COARSE)] },
    Sweep { name: "rule", methods: TRAINED, routes: COMPUTE, options: &[] },
    Sweep { name: "order", methods: TRAINED, routes: COMPUTE, options: &[("order", &["depth", "distance", "pixel"])] },
    Sweep { name: "step", methods: TRAINED, routes: COMPUTE, options: &[("step", &["0.16", "0.08", "0.04", "0.02"])] },
    Sweep { name: "stop", methods: TRAINED, routes: COMPUTE, options: &[("stop", &["0", "1e-2"])] },
    Sweep { name: "resolution", methods: TRAINED, routes: COMPUTE, options: &[("resolution", &["half"])] },
];

/// The sweep of `smoke`: every technique by every route, each feature off and on.
#[rustfmt::skip]
pub(super) const SMOKE: &[Sweep] = &[
    Sweep { name: "slices", methods: &[Slices2d], routes: BOTH, options: &[("step", &["slices"])] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: COMPUTE, options: &[("step", SPARSE)] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: RASTER, options: &[("step", COARSE)] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: BOTH, options: &[("intermediate", &["auto"])] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", TEXELS)] },
    Sweep { name: "every", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", &["0.5"]), ("every", EACH)] },
    Sweep { name: "warp", methods: &[ShearWarp], routes: COMPUTE, options: &[("warp", WARPS)] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", &["exact"]), ("step", ONE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", &["integral"]), ("step", SPARSE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", ONE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: RASTER, options: &[("integrator", &["integral"]), ("step", ONE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["midpoint"]), ("step", SPARSE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["exact"]), ("step", ONE)] },
    Sweep { name: "filter", methods: GRIDS, routes: COMPUTE, options: &[("step", ONE), ("filter", &["hardware", "exact"])] },
    Sweep { name: "dither", methods: &[Slices3d], routes: RASTER, options: &[("step", ONE), ("target", &["rgba8"]), ("dither", &["none", "blue"])] },
    Sweep { name: "empty-space", methods: FIELDS, routes: COMPUTE, options: &[("step", ONE), ("empty-space", &["skip", "march"])] },
    Sweep { name: "prefilter", methods: FIELDS, routes: COMPUTE, options: &[("step", ONE), ("prefilter", &["none", "mip"])] },
    Sweep { name: "stop", methods: FIELDS, routes: COMPUTE, options: &[("step", ONE), ("stop", &["0", "1e-2"])] },
    Sweep { name: "integrator", methods: MESHES, routes: COMPUTE, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "integrator", methods: &[Havs, ProjectedTets], routes: RASTERS, options: &[("integrator", &["exact"])] },
    Sweep { name: "rank", methods: &[ProjectedTets], routes: COMPUTE, options: &[("rank", &["centroid", "power"])] },
    Sweep { name: "fan", methods: &[ProjectedTets], routes: RASTER, options: &[("plane", &["image", "space"]), ("shade", &["fragment", "vertex"])] },
    Sweep { name: "repair", methods: &[Havs], routes: COMPUTE, options: &[("repair", &["exact", "none"])] },
    Sweep { name: "stop", methods: MESHES, routes: COMPUTE, options: &[("stop", &["0", "1e-2"])] },
    Sweep { name: "empty-space", methods: MESHES, routes: COMPUTE, options: &[("empty-space", &["skip", "march"])] },
    Sweep { name: "footprint", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["center"]), ("footprint", &["ewa", "exact"])] },
    Sweep { name: "pixel", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["pixel"])] },
    Sweep { name: "step", methods: &[SplatEwa], routes: COMPUTE, options: &[("order", &["slabs"]), ("step", COARSE)] },
    Sweep { name: "step", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["image"]), ("step", COARSE)] },
    Sweep { name: "sheets", methods: &[SplatSheets], routes: COMPUTE, options: &[("sheets", &["axis"])] },
    Sweep { name: "rule", methods: TRAINED, routes: COMPUTE, options: &[] },
    Sweep { name: "order", methods: TRAINED, routes: COMPUTE, options: &[("order", &["depth", "distance"])] },
];

/// The sweep of `peers`: the settings that are fastest at the errors of other renderers.
#[rustfmt::skip]
pub(super) const PEERS: &[Sweep] = &[
    Sweep { name: "step", methods: &[Slices3d, Slabs, Raycast], routes: COMPUTE, options: &[("step", &["4", "3", "2", "1.5", "1", "0.5", "0.25"]), ("stop", &["1e-3"])] },
    Sweep { name: "refine", methods: &[Slabs, Raycast], routes: COMPUTE, options: &[("step", &["3", "2", "1.5", "1"]), ("stop", &["1e-3"]), ("resolution", &["half", "quarter"]), ("refine", &["0.1", "0.3"])] },
    Sweep { name: "tolerance", methods: &[Raycast], routes: COMPUTE, options: &[("tolerance", &["1e-2", "3e-3", "1e-3"])] },
    Sweep { name: "slices", methods: &[Slices2d], routes: COMPUTE, options: &[("step", &["slices"])] },
    Sweep { name: "preview", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", &["voxel", "0.4"]), ("every", EACH), ("stop", &["1e-2"])] },
    Sweep { name: "resolution", methods: MESHES, routes: COMPUTE, options: &[("resolution", &["full", "half", "quarter"])] },
];

/// Settings for time over image size: every technique by every route.
#[rustfmt::skip]
pub(super) const SIZES: &[Sweep] = &[
    Sweep { name: "size", methods: &[Slices2d, ShearWarp], routes: BOTH, options: &[("step", &["slices"])] },
    Sweep { name: "size", methods: &[Slices3d, Slabs, Raycast], routes: BOTH, options: &[("step", ONE)] },
    Sweep { name: "size", methods: MESHES, routes: &["compute", "raster", "interlock", "implementation-ordered"], options: &[] },
    Sweep { name: "size", methods: SPLATS, routes: COMPUTE, options: &[] },
    Sweep { name: "size", methods: TRAINED, routes: COMPUTE, options: &[] },
];

/// Few settings for data found in a folder, which may be many files.
#[rustfmt::skip]
pub(super) const DATA: &[Sweep] = &[
    Sweep { name: "slices", methods: &[Slices2d], routes: COMPUTE, options: &[("step", &["slices"])] },
    Sweep { name: "slices", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", FEW_TEXELS)] },
    Sweep { name: "every", methods: &[ShearWarp], routes: COMPUTE, options: &[("intermediate", &["0.5"]), ("every", &["4"])] },
    Sweep { name: "integrator", methods: &[ShearWarp], routes: COMPUTE, options: &[("integrator", &["exact"]), ("warp", &["bicubic"]), ("step", ONE)] },
    Sweep { name: "step", methods: &[Slices2d, Slices3d], routes: COMPUTE, options: &[("step", COARSE)] },
    Sweep { name: "integrator", methods: &[Slabs], routes: COMPUTE, options: &[("integrator", INTEGRALS), ("step", COARSE)] },
    Sweep { name: "integrator", methods: &[Raycast], routes: COMPUTE, options: &[("integrator", &["midpoint", "exact"]), ("step", COARSE)] },
    Sweep { name: "integrator", methods: MESHES, routes: COMPUTE, options: &[("integrator", INTEGRALS)] },
    Sweep { name: "splats", methods: SPLATS, routes: COMPUTE, options: &[] },
    Sweep { name: "order", methods: TRAINED, routes: COMPUTE, options: &[("order", &["depth", "distance"])] },
    Sweep { name: "rule", methods: TRAINED, routes: COMPUTE, options: &[] },
];

/// A technique with one combination of options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Setting {
    /// The name of its sweep.
    pub(super) sweep: &'static str,
    pub(super) technique: Technique,
    /// The requested route; checking the case replaces it by that of the plan.
    pub(super) route: &'static str,
}

/// Returns every setting of some sweeps, without duplicates.
///
/// # Errors
///
/// As [`Technique::new`], when a list contains an invalid value.
pub(super) fn settings(sweeps: &[Sweep]) -> Result<Vec<Setting>> {
    let mut settings: Vec<Setting> = Vec::new();
    for sweep in sweeps {
        for &method in sweep.methods {
            let has = |key: &str| method.options().iter().any(|info| info.key == key);
            if !sweep.options.iter().all(|(key, _)| has(key)) {
                continue;
            }
            for &route in sweep.routes.iter().filter(|route| method.routes().contains(route)) {
                for options in combinations(sweep.options) {
                    let technique = input::by_route(method, route, &[], &options)?;
                    if !settings.iter().any(|known| (known.technique, known.route) == (technique, route)) {
                        settings.push(Setting { sweep: sweep.name, technique, route });
                    }
                }
            }
        }
    }
    Ok(settings)
}

/// Settings that the user asks for in place of those of sweeps; none by default.
#[derive(Clone, Debug, Default)]
pub(super) struct Given(Vec<Setting>);

impl Given {
    /// Reads lists of techniques; `all` is every technique by every route.
    ///
    /// # Errors
    ///
    /// As [`Wanted::parse_list`].
    pub(super) fn parse(lists: &[String]) -> Result<Self> {
        let mut settings = Vec::new();
        for list in lists {
            for wanted in Wanted::parse_list(list)? {
                match wanted {
                    Wanted::One(request) => settings.push((request.technique, "")),
                    Wanted::All => {
                        for (method, route) in input::all_routes() {
                            settings.push((input::by_route(method, route, &[], &[])?, route));
                        }
                    }
                }
            }
        }
        let setting = |(technique, route)| Setting { sweep: "given", technique, route };
        Ok(Self(settings.into_iter().map(setting).collect()))
    }

    /// Returns the settings, or those of sweeps if there are none.
    ///
    /// # Errors
    ///
    /// As [`settings`].
    pub(super) fn or(&self, sweeps: &[Sweep]) -> Result<Vec<Setting>> {
        if self.0.is_empty() { settings(sweeps) } else { Ok(self.0.clone()) }
    }

    /// Returns those of them that draw a scene.
    ///
    /// # Errors
    ///
    /// As [`settings`].
    pub(super) fn fitting(&self, sweeps: &[Sweep], scene: &Scene) -> Result<Vec<Setting>> {
        let mut settings = self.or(sweeps)?;
        settings.retain(|setting| setting.is_for(scene));
        Ok(settings)
    }
}

/// Returns every combination of one value per option; the last option varies fastest.
fn combinations(
    options: &[(&'static str, &'static [&'static str])],
) -> Vec<Vec<(&'static str, &'static str)>> {
    let mut rows = vec![Vec::new()];
    for &(key, values) in options {
        let longer = |row: &Vec<_>, value| row.iter().copied().chain([(key, value)]).collect();
        rows = rows.iter().flat_map(|row| values.iter().map(|value| longer(row, *value))).collect();
    }
    rows
}

impl Setting {
    /// Returns technique and route.
    pub(super) fn kind(&self) -> (Method, &'static str) {
        (self.technique.method(), self.route)
    }

    /// Returns whether the technique draws the scene's field as the reference does, in reasonable time.
    pub(super) fn is_for(&self, scene: &Scene) -> bool {
        let method = self.technique.method();
        let (adds_up, has_kernels) = match (&scene.data, &scene.kernels) {
            (_, Some(kernels)) => (kernels.model == Model::Density, true),
            (Data::Points(_), None) => (true, true),
            _ => (false, false),
        };
        // Splats composited one by one represent the field only if kernels add up.
        let ordered = |(key, value): &(&str, String)| *key == "order" && value != "slabs";
        let fits = adds_up || method != SplatEwa || !self.technique.option_pairs().iter().any(ordered);
        let suits = scene.splat_rule().is_none_or(|rule| suits(&self.technique, rule));
        method.fits(scene)
            && suits
            && fits
            && (has_kernels || input::too_many_splats(method, &scene.data).is_none())
    }
}

/// Returns whether a rule of trained splats has the options that a technique sets.
fn suits(technique: &Technique, rule: SplatRule) -> bool {
    let overlaps = rule.overlaps();
    technique.changed().iter().all(|(key, value)| match *key {
        "order" => !overlaps && (value != "pixel" || rule.has_depth()),
        "step" => overlaps,
        _ => true,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(sweeps: &[Sweep]) -> Vec<String> {
        let text = |setting: &Setting| {
            let options = input::options_text(&setting.technique);
            format!("{} {} {} {options}", setting.sweep, setting.technique.method().name(), setting.route)
        };
        settings(sweeps).unwrap().iter().map(text).collect()
    }

    #[test]
    fn a_sweep_is_every_combination_once() {
        let sweep = |routes, options| Sweep { name: "s", methods: &[Slabs, Raycast], routes, options };
        let product = sweep(BOTH, &[("integrator", &["integral", "full"]), ("step", &["1", "2"])]);
        let one = |method: &str, route: &str, options: [&str; 4]| {
            options.map(|options| format!("s {method} {route} {options}")).to_vec()
        };
        // Defaults are omitted: `integrator=integral` of slabs, and `step=1`.
        let slabs = ["", "step=2", "integrator=full", "step=2,integrator=full"];
        let rays = [
            "integrator=integral",
            "step=2,integrator=integral",
            "integrator=full",
            "step=2,integrator=full",
        ];
        let expected =
            [one("slabs", "raster", slabs), one("slabs", "compute", slabs), one("raycast", "compute", rays)];
        assert_eq!(texts(&[product]), expected.concat());
        // Duplicates add nothing, and techniques without the option are skipped.
        let steps = || sweep(COMPUTE, &[("step", &["1", "1.0"])]);
        assert_eq!(texts(&[steps(), steps()]), ["s slabs compute ", "s raycast compute "]);
        assert_eq!(texts(&[sweep(RASTER, &[("order", &["front-to-back"])])]).len(), 1);
    }

    #[test]
    fn the_sweeps_cover_every_technique_and_route() {
        for sweeps in [STANDARD, SMOKE, SIZES, DATA] {
            let settings = settings(sweeps).unwrap();
            for method in Method::ALL {
                assert!(settings.iter().any(|setting| setting.technique.method() == method), "{method:?}");
            }
        }
        for (sweeps, least) in [(STANDARD, MIDDLE.len()), (SMOKE, 1), (SIZES, 1)] {
            let settings = settings(sweeps).unwrap();
            for (method, route) in input::all_routes() {
                let drawn =
                    |setting: &&Setting| setting.technique.method() == method && setting.route == route;
                assert!(settings.iter().filter(drawn).count() >= least, "{method:?} {route}");
            }
        }
    }
}
